"""Physical quantities in a configuration: an SI number or a string such as ``"30 GPa"``.

Units are converted here and nowhere else; everything behind the configuration is SI.
"""

from __future__ import annotations

import math
import re
from functools import cache
from typing import TYPE_CHECKING, Annotated

from pydantic import BeforeValidator

if TYPE_CHECKING:
    import pint

_NUMBER_AND_UNIT = re.compile(r"^\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*$")
_UNIT = re.compile(r"^[A-Za-zµ°%]+(\^?-?\d)?(\s*[*/ ]\s*[A-Za-zµ°%]+(\^?-?\d)?)*$")
_BARE_EXPONENT = re.compile(r"(?<=[A-Za-z])(-?[2-6])\b")  # "m/s2" means m/s^2


@cache
def _registry() -> pint.UnitRegistry:
    import pint  # here, not above: it costs 0.2 s that `import romdam` need not pay

    return pint.UnitRegistry(autoconvert_offset_to_baseunit=True)


def to_si(value: float | str, unit: str) -> float:
    """Convert a number (taken as SI) or a string with a unit to a number in `unit`.

    Parameters
    ----------
    value : number in `unit`, or text such as "2.5 ms"
    unit : the SI unit wanted, in pint's spelling

    Raises
    ------
    ValueError
        for text without a number, an unknown unit, a unit of another dimension, or NaN/infinity.
    """
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(f"expected a number in {unit} or text with a unit, got {value!r}")
    number = _parse(value, unit) if isinstance(value, str) else float(value)
    if not math.isfinite(number):
        raise ValueError(f"expected a finite number in {unit}, got {value!r}")
    return number


def _parse(text: str, unit: str) -> float:
    import pint

    remedy = f'write an SI number or text with a unit, for example "1 {unit}"'
    match = _NUMBER_AND_UNIT.match(text)
    if match is None:
        raise ValueError(f"cannot read {text!r} as a quantity in {unit}; {remedy}")
    number, unit_text = float(match[1]), _BARE_EXPONENT.sub(r"^\1", match[2])
    if not match[2]:
        return number
    if _UNIT.match(match[2]) is None:
        raise ValueError(f"cannot read {text!r} as a quantity in {unit}; {remedy}")
    if unit == "m/s^2" and unit_text == "g":
        unit_text = "standard_gravity"  # an acceleration in "g" is never grams
    try:
        return float(_registry().Quantity(number, unit_text).to(unit).magnitude)
    except pint.DimensionalityError as error:
        raise ValueError(f"{text!r} is not a quantity in {unit}; {remedy}") from error
    except (pint.UndefinedUnitError, pint.DefinitionSyntaxError, ValueError, TypeError) as error:
        raise ValueError(f"unknown unit in {text!r} (units are case-sensitive); {remedy}") from error


def _si(unit: str) -> BeforeValidator:
    return BeforeValidator(lambda value: to_si(value, unit))


Length = Annotated[float, _si("m")]
Time = Annotated[float, _si("s")]
Frequency = Annotated[float, _si("Hz")]
AngularFrequency = Annotated[float, _si("1/s")]
Pressure = Annotated[float, _si("Pa")]
Density = Annotated[float, _si("kg/m^3")]
Force = Annotated[float, _si("N")]
Acceleration = Annotated[float, _si("m/s^2")]
Stiffness = Annotated[float, _si("N/m")]
StiffnessPerArea = Annotated[float, _si("N/m^3")]
ViscosityPerArea = Annotated[float, _si("N*s/m^3")]
Dimensionless = Annotated[float, _si("")]
Expansion = Annotated[float, _si("1/K")]
TemperatureChange = Annotated[float, _si("delta_degC")]
Memory = Annotated[float, _si("byte")]
