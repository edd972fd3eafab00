"""Units in which numbers are shown: SI with prefixes, or the customary units of the United States.

Everything inside is SI; pictures and reports convert when they are drawn.

References
----------
NIST Special Publication 811 (2008), appendix B: the inch, the pound and its force are exact.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from romdam.core.round_off import NOTHING

_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))
_PREFIXED = {"m", "N", "N m", "Pa", "J", "N m-3", "N m-1"}  # units that take a prefix which suits the numbers
_NAMES = {"N m-3": "Pa/m"}
SUPERSCRIPTS = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
_INCH, _FOOT, _POUND = 0.0254, 0.3048, 0.45359237  # m, m, kg
_POUND_FORCE = _POUND * 9.80665  # N


def unit_text(units: str) -> str:
    """A unit as in print: `m s-2` becomes m/s², `1` becomes nothing."""
    above: list[str] = []
    below: list[str] = []
    for word in units.split():
        name = word.rstrip("-0123456789")
        power = int(word[len(name) :] or 1)
        if name:
            (above if power > 0 else below).append(
                name + (str(abs(power)).translate(SUPERSCRIPTS) if abs(power) > 1 else "")
            )
    text = " ".join(above) or ("1" if below else "")
    return f"{text}/{' '.join(below)}" if below else text


def number(value: float, digits: int = 3) -> str:
    """A number with so many significant digits, as plain text; a dash where there is none."""
    if np.isnan(value):
        return "–"
    if np.isinf(value):
        return "∞" if value > 0 else "−∞"
    if value != 0.0 and not 1e-4 <= abs(value) < 1e6:
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        return f"{mantissa}·10{str(int(exponent)).translate(SUPERSCRIPTS)}".replace("-", "−")
    rounded = float(f"{value:.{digits - 1}e}")
    return np.format_float_positional(rounded, trim="-").replace("-", "−")


@dataclass(frozen=True)
class DisplayUnits:
    """Units that numbers are shown in.

    Attributes
    ----------
    name : "SI" or "US customary"
    foot : length that positions are shown in [m], and its name
    customary : SI unit -> size of the unit in its place [SI], and its name; other units stay as they are
    """

    name: str
    foot: tuple[float, str]
    customary: Mapping[str, tuple[float, str]] = field(default_factory=dict)

    def converts(self, units: str) -> bool:
        """Tell whether numbers in a unit are shown in another one."""
        return units in self.customary or units in _PREFIXED

    def suited(self, units: str, largest: float) -> tuple[float, str]:
        """The size [SI] and the name of the unit that suits numbers up to `largest` [units].

        Parameters
        ----------
        units : as files state them, for example "m s-2"
        """
        if units in self.customary:
            return self.customary[units]
        name = _NAMES.get(units, unit_text(units))
        if units not in _PREFIXED or largest < NOTHING:
            return 1.0, name
        return next(((size, prefix + name) for size, prefix in _PREFIXES if largest >= size), (1.0, name))


SI = DisplayUnits("SI", (1.0, "m"))
US = DisplayUnits(
    "US customary",
    (_FOOT, "ft"),
    {
        "m": (_INCH, "in"),
        "m2": (_FOOT**2, "ft²"),
        "m s-1": (_INCH, "in/s"),
        "m s-2": (_FOOT, "ft/s²"),
        "kg": (_POUND, "lb"),
        "kg m-3": (_POUND / _FOOT**3, "lb/ft³"),
        "N": (1e3 * _POUND_FORCE, "kip"),
        "N m": (1e3 * _POUND_FORCE * _FOOT, "kip ft"),
        "J": (1e6 * _POUND_FORCE * _FOOT, "10⁶ ft lb"),
        "Pa": (_POUND_FORCE / _INCH**2, "psi"),
        "N m-1": (1e3 * _POUND_FORCE / _FOOT, "kip/ft"),
        "N m-3": (_POUND_FORCE / _INCH**3, "lb/in³"),
        "K": (5.0 / 9.0, "°F"),
    },
)
