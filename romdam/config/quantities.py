"""Physical quantities in a configuration: an SI number or a string such as ``"30 GPa"``.

Units are converted here and nowhere else; everything behind the configuration is SI.
"""

from __future__ import annotations

import math
import re
from functools import cache, partial
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BeforeValidator, PlainSerializer, ValidationInfo

from romdam.core.errors import quote

if TYPE_CHECKING:
    import pint

_STANDARD = 9.80665  # [m/s2]
_LONGEST = 80  # characters of a quantity
_NUMBER_AND_UNIT = re.compile(r"^\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*$", re.ASCII)
_NAME = r"([A-Za-zµ°]+(\^?-?\d)?|%)"
_UNIT = re.compile(rf"^(1/)?{_NAME}(\s*[*/ ]\s*{_NAME})*$")
_BARE_EXPONENT = re.compile(r"(?<=[A-Za-z])(-?[1-6])\b")  # "m/s2" means m/s^2
_DEGREES = re.compile(r"(?:deg|°)([CF])\b")  # in front of them: what is asked for is a difference
TemperatureUnit = Literal["degC", "degF", "K"]
CELSIUS: dict[TemperatureUnit, tuple[float, float]] = {  # zero point and size of a degree, in degC
    "degC": (0.0, 1.0),
    "degF": (-32.0 / 1.8, 1.0 / 1.8),
    "K": (-273.15, 1.0),
}
_TYPED = str.maketrans("−⁻¹²³⁴⋅·", "--1234**")  # as word processors write signs, exponents and products
_COMMA = re.compile(r"^\s*([+-]?\d+),(\d+(?:[eE][+-]?\d+)?)(?!,)(.*)$")
_LEAST = 1e-20  # in any SI unit: nothing but round-off is as small
_MOST = {  # largest magnitude of each SI unit that anything of a dam can have; far above, but no overflow
    "m": 1e8,  # coordinates of a national grid are 1e7
    "s": 1e7,
    "Hz": 1e7,
    "1/s": 1e7,
    "Pa": 1e14,
    "kg/m^3": 1e6,
    "N": 1e15,
    "kg": 1e14,
    "m/s^2": 1e5,
    "N/m": 1e20,
    "N/m^3": 1e20,
    "N*s/m^3": 1e20,
    "N*s/m": 1e20,
    "m/s": 1e6,
    "m^2/s": 1.0,
    "m^2": 1e4,
    "": 1e6,
    "1/K": 1.0,
    "delta_degC": 1e4,
    "byte": 1e18,
    "degree": 1e4,
}
_COMMONLY = {"m/s^2": "g", "m/s": "cm/s", "m": "cm"}  # units that measures of ground motion are stated in
_SUGGESTED = {  # units that a mistyped one is compared with, of each SI unit
    "m": ("m", "cm", "mm", "km"),
    "s": ("s", "ms", "min"),
    "Hz": ("Hz", "kHz"),
    "Pa": ("GPa", "MPa", "kPa", "Pa", "N/mm2"),
    "kg/m^3": ("kg/m3", "t/m3"),
    "N": ("kN", "MN", "GN", "N"),
    "kg": ("kg", "t"),
    "m/s^2": ("g", "m/s2", "cm/s2"),
    "N/m^3": ("GPa/m", "MPa/m", "N/m3"),
    "N/m": ("GN/m", "MN/m", "kN/m", "N/m"),
    "N*s/m": ("MN*s/m", "kN*s/m", "N*s/m"),
    "m^2": ("m2", "cm2", "mm2"),
    "byte": ("GB", "MB"),
}
_SPELT = {"delta_degC": "K", "N*s/m^3": "N s/m3", "N*s/m": "N s/m"}  # else pint's way without its ^
# as pint defines them; without names that would be others than to pint: "rads" is none of "rad", "kt" of "t"
_COMMON = """
nano- = 1e-9 = n-
micro- = 1e-6 = µ- = μ- = u- = mu- = mc-
milli- = 1e-3 = m-
centi- = 1e-2 = c-
kilo- = 1e3 = k-
mega- = 1e6 = M-
giga- = 1e9 = G-
meter = [length] = m = metre
second = [time] = s = sec
gram = [mass] = g
kelvin = [temperature]; offset: 0 = K = degK = °K = degree_Kelvin = degreeK
radian = []
bit = []
pi = 3.1415926535897932384626433832795028841971693993751 = π
standard_gravity = 9.80665 m/s^2 = g_0 = g0 = g_n = gravity
degree = π / 180 * radian = deg = arcdeg = arcdegree = angular_degree
byte = 8 * bit = B = octet
percent = 0.01 = %
permille = 0.001 = ‰
minute = 60 * second = min
degree_Celsius = kelvin; offset: 273.15 = °C = celsius = degC = degreeC
hertz = 1 / second = Hz
newton = kilogram * meter / second ** 2 = N
pascal = newton / meter ** 2 = Pa
"""
# of US practice, which pint does not know
_CUSTOMARY = (
    "lbm = pound", "psf = force_pound / foot ** 2", "ksf = 1000 * psf", "pcf = pound / foot ** 3"
)  # fmt: skip
_EXAMPLES = {"": "0.05 or 5 %", "delta_degC": "-4 K", "1/K": "1e-5 1/K", "byte": "8 GB"}


@cache
def _registry(definitions: str = "") -> pint.UnitRegistry[Any]:
    """Build a registry of the units that are defined, or of all that pint knows."""
    import pint  # here, not above: it costs 0.1 s that `import romdam` need not pay

    registry: pint.UnitRegistry[Any] = pint.UnitRegistry(
        definitions.splitlines() or "", autoconvert_offset_to_baseunit=True
    )
    for definition in () if definitions else _CUSTOMARY:
        registry.define(definition)
    return registry


@cache
def _registry_of(unit: str) -> pint.UnitRegistry[Any]:
    """Choose the registry that knows a unit: that of all units takes 0.13 s to build, that of few 0.004 s."""
    few = _registry(_COMMON)
    try:
        few.parse_units(unit)
    except AttributeError:  # pint's UndefinedUnitError
        return _registry()
    return few


def to_si(value: float | str, unit: str) -> float:
    """Convert a number (taken as SI) or a string with a unit to a number in `unit`.

    Parameters
    ----------
    value : number in `unit`, or text such as "2.5 ms"
    unit : the SI unit wanted, in pint's spelling

    Raises
    ------
    ValueError
        for text without a number, an unknown unit, a unit of another dimension, NaN or infinity, and numbers
        beyond anything that a dam can have.
    """
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(f"expected a number{_in(unit)} or text with a unit, got {quote(value)}")
    try:
        number = _parse(value, unit) if isinstance(value, str) else float(value)
    except OverflowError:  # an integer of more than 308 digits
        number = math.inf
    if not math.isfinite(number):
        raise ValueError(f"expected a finite number{_in(unit)}, got {quote(value)}")
    most = _MOST.get(unit, math.inf)
    if abs(number) > most or 0.0 < abs(number) < _LEAST:
        limit = f"at most {most:g}" if abs(number) > most else f"0 or at least {_LEAST:g}"
        raise ValueError(
            f"{quote(value)} is beyond what a dam can have, the magnitude must be {limit}{_in(unit)}; is the "
            "unit right?"
        )
    return number


def to_si_stated(value: float | str, info: ValidationInfo, unit: str) -> float:
    """Convert text with a unit to a number in `unit`, for what is commonly stated in others than SI.

    A bare number is refused: an acceleration of 0.3 may be in g or in m/s2, a factor of ten. Where the
    context of the validation has "si", it is taken as SI: older results hold such configurations.

    Raises
    ------
    ValueError
        for a number without a unit, and as `to_si` does.
    """
    number = to_si(value, unit)
    if not (info.context or {}).get("si"):
        refuse_bare(value, unit)
    return number


def to_celsius(value: float | str) -> float:
    """Convert text such as "8 degC", "46 degF" or "281 K" to a temperature in degC.

    Raises
    ------
    ValueError
        for a number without a unit, an unknown unit, and what is below absolute zero.
    """
    text = str(value).translate(_TYPED).replace("°", "deg")
    match = _NUMBER_AND_UNIT.match(text) if len(text) <= _LONGEST else None
    unit = match[2].replace(" ", "") if match else ""
    if isinstance(value, bool) or match is None or unit not in CELSIUS:
        raise ValueError(f'{quote(value)} is no temperature; write a number with its unit, such as "8 degC", '
                         '"46 degF" or "281 K"')  # fmt: skip
    zero, degree = CELSIUS[unit]
    celsius = zero + degree * float(match[1])
    if not CELSIUS["K"][0] <= celsius <= _MOST["delta_degC"]:
        raise ValueError(
            f"{quote(value)} is {celsius:g} degC, limits -273.15 and 10000 degC; is the unit right?"
        )
    return celsius


def refuse_bare(value: float | str, unit: str) -> None:
    """Raise a ValueError for a number without a unit, but 0, where others than SI are common."""
    match = _NUMBER_AND_UNIT.match(str(value))
    if unit in _COMMONLY and match is not None and not match[2] and float(match[1]) != 0.0:
        common = _COMMONLY[unit]
        raise ValueError(f"{match[1]} has no unit; write {match[1]} {common} or {match[1]} {spelt(unit)}")


def with_unit(number: float, unit: str) -> str:
    """Write a number in SI so that `to_si_stated` reads it again, to the last bit."""
    return f"{number!r} {spelt(unit)}"


def _in(unit: str) -> str:
    return f" in {unit}" if unit else ""


def _parse(text: str, unit: str) -> float:
    example = _EXAMPLES.get(unit, f"1 {unit}")
    remedy = f'write an SI number or text with a unit, for example "{example}"'
    match = _NUMBER_AND_UNIT.match(text.translate(_TYPED)) if len(text) <= _LONGEST else None
    if match is None or (match[2] and _UNIT.match(match[2]) is None):
        if len(text) <= _LONGEST and (comma := _COMMA.match(text)):
            whole, decimals, rest = comma.groups()
            remedy = f'the decimal sign is a point: is "{whole}.{decimals}{rest}" meant?'
            if len(decimals) == 3:  # a comma of thousands, perhaps
                remedy = f'{remedy[:-1]}, or "{whole}{decimals}{rest}"?'
        raise ValueError(f"cannot read {quote(text)} as a quantity{_in(unit)}; {remedy}")
    if not match[2]:
        return float(match[1])
    if meant := _meant(match[2], unit):
        remedy = f'is "{match[1]} {meant}" meant?'
    unit_text = _DEGREES.sub(r"delta_deg\1", _BARE_EXPONENT.sub(r"^\1", match[2]))
    if unit == "m/s^2" and unit_text == "g":
        unit_text = "standard_gravity"  # an acceleration in "g" is never grams
    try:
        registry = _registry_of(unit_text)
        roots = _roots(registry, unit_text)
    except Exception as error:  # what pint raises for units that it does not know: half a dozen kinds
        raise ValueError(f"unknown unit in {quote(text)} (units are case-sensitive); {remedy}") from error
    if roots != _roots(registry, unit):
        what = f"a quantity in {unit}" if unit else "a number or a part of one"
        if "radian" in roots:  # in place of a frequency in Hz or a ratio
            remedy += "; an angle, or what turns in a second, is to be converted by hand"
        if not unit and roots == "radian" and (said := tangent(_parse(text, "degree"))):
            remedy = said
        if unit == "kg/m^3" and roots == _roots(registry, "N/m^3"):  # as codes of practice tabulate it
            mass = float(registry.Quantity(float(match[1]), unit_text).to("N/m^3").magnitude) / _STANDARD
            remedy = f"that is a weight; write its mass, {mass:.0f} kg/m3 (by 9.80665 m/s2)"
        raise ValueError(f"{quote(text)} is not {what}; {remedy}")
    return float(registry.Quantity(float(match[1]), unit_text).to(unit).magnitude)


def _meant(typed: str, unit: str) -> str:
    """A unit that mistyped text most likely stands for; empty where none is near.

    Text may have letters of the wrong case (Gpa), a prefix without its unit (G), or no length below (GPa for
    GPa/m).
    """
    for suggested in _SUGGESTED.get(unit, ()):
        plain = typed.replace("^", "").replace(" ", "")
        if plain != suggested and (
            plain.lower() == suggested.lower()
            or plain == suggested.removesuffix("/m")
            or (plain in "GMk" and suggested.startswith(plain))
        ):
            return suggested
    return ""


def tangent(angle: float) -> str:
    """What a coefficient of friction is where an angle in degrees was written; empty where that is none."""
    if not 0.0 < angle < 90.0:
        return ""
    number = math.tan(math.radians(angle))
    return f"write {number:.2f} if an angle of friction is meant: tan({angle:g} deg) = {number:.2f}"


def _roots(registry: pint.UnitRegistry[Any], unit: str) -> str:
    """Root units of a unit: radians and bits are units among them, though of no dimension.

    Raises
    ------
    ValueError
        for decibels and the like, which do not add up.
    """
    none = registry.Quantity(0.0, unit).to_root_units()
    if none.magnitude != 0.0:
        raise ValueError(f"{unit} has no zero")
    return str(none.units)


def _si(unit: str) -> BeforeValidator:
    return BeforeValidator(partial(to_si, unit=unit))


def unit_of(validator: object) -> str | None:
    """The unit that a validator of this module converts to, in pint's spelling; None for any other."""
    if validator is to_celsius:
        return "degC"
    if isinstance(validator, partial) and validator.func in (to_si, to_si_stated):
        return str(validator.keywords["unit"])
    return None


def needs_unit(validator: object) -> bool:
    """Whether a validator of this module refuses a bare number."""
    return validator is to_celsius or (isinstance(validator, partial) and validator.func is to_si_stated)


def spelt(unit: str) -> str:
    """A unit as messages and tables spell it."""
    return _SPELT.get(unit, unit.replace("^", ""))


def in_unit(unit: str) -> Any:
    """A number whose text is converted to this unit, in pint's spelling."""
    return Annotated[float, _si(unit)]


def _no_bool(value: object) -> object:
    if isinstance(value, bool):
        raise ValueError(f"expected a number, got {value}")
    return value


NoBool = BeforeValidator(_no_bool)  # to pydantic, True is 1
Whole = Annotated[int, NoBool]
NumberOrText = Annotated[float | str, NoBool]

Length = Annotated[float, _si("m")]
Time = Annotated[float, _si("s")]
Frequency = Annotated[float, _si("Hz")]
AngularFrequency = Annotated[float, _si("1/s")]
Pressure = Annotated[float, _si("Pa")]
Density = Annotated[float, _si("kg/m^3")]
Mass = Annotated[float, _si("kg")]
Force = Annotated[float, _si("N")]
SpringStiffness = Annotated[float, _si("N/m")]
ForcePerLength = Annotated[float, _si("N/m")]
DashpotDamping = Annotated[float, _si("N*s/m")]
Area = Annotated[float, _si("m^2")]
Acceleration = Annotated[float, _si("m/s^2")]
GroundAcceleration = Annotated[  # of records, spectra and codes: commonly in g, so written with its unit
    float,
    BeforeValidator(partial(to_si_stated, unit="m/s^2")),
    PlainSerializer(partial(with_unit, unit="m/s^2"), return_type=str),
]
Velocity = Annotated[float, _si("m/s")]
Dimensionless = Annotated[float, _si("")]
Expansion = Annotated[float, _si("1/K")]
TemperatureChange = Annotated[float, _si("delta_degC")]
Temperature = Annotated[  # in degC; written with its unit, as a bare number is not read
    float, BeforeValidator(to_celsius), PlainSerializer(partial(with_unit, unit="degC"), return_type=str)
]
Diffusivity = Annotated[float, _si("m^2/s")]
Memory = Annotated[float, _si("byte")]
Degrees = Annotated[float, _si("degree")]
