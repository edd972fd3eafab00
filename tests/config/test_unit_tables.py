"""Every table of units against factors of NIST SP 811, appendix B, written by hand; none of them left out."""

import numpy as np
import pytest

from romdam.config.quantities import _COMMON, _COMMONLY, _MOST, _SUGGESTED, CELSIUS, to_celsius, to_si
from romdam.config.sections.motions.records import unit_in_si
from romdam.core.display_units import US
from romdam.core.motion import _ACCELERATIONS, GroundMotion
from romdam.geometry.matrices.files import UNITS
from romdam.records.formats import cosmos, text

INCH, FOOT = 25.4e-3, 0.3048  # m, exact
POUND_FORCE = 4.448222  # N, to the digits of the table, as what follows
POUND = 0.4535924  # kg
SLUG = 14.59390  # kg
PSI = 6894.757  # Pa

SHOWN = {
    "m": (INCH, "in"),
    "m2": (9.290304e-2, "ft²"),
    "m s-1": (INCH, "in/s"),
    "m s-2": (FOOT, "ft/s²"),
    "kg": (POUND, "lb"),
    "kg m-3": (16.01846, "lb/ft³"),
    "N": (4448.222, "kip"),
    "N m": (1355.818, "kip ft"),
    "J": (1355818.0, "10⁶ ft lb"),
    "Pa": (PSI, "psi"),
    "N m-1": (14593.90, "kip/ft"),
    "N m-3": (PSI / INCH, "lb/in³"),
    "K": (5.0 / 9.0, "°F"),
}


def test_customary_units_of_pictures():
    assert set(US.customary) == set(SHOWN) and US.foot == (FOOT, "ft")
    for units, (size, name) in SHOWN.items():
        assert US.suited(units, 1.0) == (pytest.approx(size, rel=5e-7), name)


# force, and stiffness and mass of what is written as 1, in SI
SYSTEMS = {
    "m-kg-s": (1.0, 1.0, 1.0),
    "mm-t-s": (1.0, 1e3, 1e3),  # N, N/mm, t
    "mm-kg-ms": (1e3, 1e6, 1.0),  # kN, kN/mm, kg
    "mm-kg-s": (1e-3, 1.0, 1.0),  # mN, mN/mm, kg
    "in-lbf-s": (POUND_FORCE, POUND_FORCE / INCH, SLUG * 12.0),  # lbf s2/in is 12 slugs
    "ft-lbf-s": (POUND_FORCE, POUND_FORCE / FOOT, SLUG),
    "ft-slug-s": (POUND_FORCE, POUND_FORCE / FOOT, SLUG),
}


def test_systems_of_units_of_matrices():
    """Force is mass times length over time squared, stiffness mass over time squared."""
    assert set(SYSTEMS) == set(UNITS)
    lengths = {"m": 1.0, "mm": 1e-3, "in": INCH, "ft": FOOT}
    for name, (length, mass, time) in UNITS.items():
        assert length == lengths[name.partition("-")[0]]
        assert (mass * length / time**2, mass / time**2, mass) == pytest.approx(SYSTEMS[name], rel=5e-7)


ACCELERATIONS = {
    "g": 9.80665, "mg": 9.80665e-3, "%g": 9.80665e-2, "gal": 1e-2, "gals": 1e-2, "cm/s2": 1e-2,
    "cms-2": 1e-2, "m/s2": 1.0, "ms-2": 1.0, "mm/s2": 1e-3, "ms2": 1.0, "mps2": 1.0, "cms2": 1e-2,
    "cmps2": 1e-2, "cm/ss": 1e-2, "m/ss": 1.0, "mms2": 1e-3, "in/s2": INCH, "ft/s2": FOOT,
}  # fmt: skip


def test_accelerations_of_headers():
    found = {name: unit_in_si(unit) for name, unit in text._ACCELERATIONS.items()}
    assert found == pytest.approx(ACCELERATIONS, rel=1e-15)
    of_cosmos = {2: 9.80665, 4: 1e-2, 7: INCH, 10: 1e-2, 11: 9.80665e-3, 12: 9.80665e-6}
    assert {number: unit_in_si(unit) for number, unit in cosmos.UNITS.items()} == pytest.approx(of_cosmos)


def test_accelerations_of_arrays():
    sizes = {"m/s2": 1.0, "cm/s2": 1e-2, "mm/s2": 1e-3, "gal": 1e-2, "g": 9.80665}
    assert set(sizes) == set(_ACCELERATIONS)
    for unit, size in sizes.items():
        motion = GroundMotion.from_arrays("r", {"y": np.array([0.0, 3.0])}, 0.01, units=unit)
        assert motion.acc[1, 1] == pytest.approx(3.0 * size, rel=1e-15)


def test_temperatures():
    assert {*CELSIUS} == {"degC", "degF", "K"}
    for value, celsius in (("8 degC", 8.0), ("46.4 degF", 8.0), ("-40 °F", -40.0), ("281.15 K", 8.0)):
        assert to_celsius(value) == pytest.approx(celsius, abs=1e-12)


# every unit that the registry of common ones defines, and some that only pint's has
NAMED = {
    ("m", "meter"): 1.0, ("m", "metre"): 1.0, ("m", "km"): 1e3, ("m", "cm"): 1e-2, ("m", "mm"): 1e-3,
    ("m", "um"): 1e-6, ("m", "nm"): 1e-9, ("m", "in"): INCH, ("m", "ft"): FOOT, ("m", "yard"): 0.9144,
    ("s", "ms"): 1e-3, ("s", "min"): 60.0, ("s", "minute"): 60.0, ("s", "hour"): 3600.0, ("s", "sec"): 1.0,
    ("Hz", "kHz"): 1e3, ("Hz", "1/s"): 1.0, ("1/s", "Hz"): 1.0, ("Hz", "MHz"): 1e6,
    ("Pa", "kPa"): 1e3, ("Pa", "MPa"): 1e6, ("Pa", "GPa"): 1e9, ("Pa", "N/mm2"): 1e6, ("Pa", "psi"): PSI,
    ("Pa", "ksi"): 1e3 * PSI, ("Pa", "psf"): 47.88026, ("Pa", "ksf"): 47880.26, ("Pa", "bar"): 1e5,
    ("kg/m^3", "g/cm3"): 1e3, ("kg/m^3", "t/m3"): 1e3, ("kg/m^3", "pcf"): 16.01846,
    ("kg/m^3", "lb/ft3"): 16.01846,
    ("N", "kN"): 1e3, ("N", "MN"): 1e6, ("N", "GN"): 1e9, ("N", "lbf"): POUND_FORCE, ("N", "kip"): 4448.222,
    ("kg", "t"): 1e3, ("kg", "g"): 1e-3, ("kg", "lb"): POUND, ("kg", "lbm"): POUND, ("kg", "slug"): SLUG,
    ("m/s^2", "g"): 9.80665, ("m/s^2", "cm/s2"): 1e-2, ("m/s^2", "gravity"): 9.80665,
    ("N/m", "MN/m"): 1e6, ("N/m", "GN/m"): 1e9, ("N/m", "kN/m"): 1e3,
    ("N/m", "kip/in"): 4448.222 / INCH, ("N/m^3", "GPa/m"): 1e9, ("N/m^3", "MPa/m"): 1e6,
    ("N/m^3", "lbf/in3"): PSI / INCH, ("N/m^3", "MPa/mm"): 1e9, ("N*s/m^3", "MPa s/m"): 1e6,
    ("N*s/m", "MN s/m"): 1e6, ("N*s/m", "MN*s/m"): 1e6, ("N*s/m", "kN*s/m"): 1e3, ("N*s/m", "N*s/m"): 1.0,
    ("m/s", "cm/s"): 1e-2, ("m/s", "km/s"): 1e3, ("m/s", "ft/s"): FOOT, ("m^2/s", "mm2/s"): 1e-6,
    ("m^2", "m2"): 1.0, ("m^2", "cm2"): 1e-4, ("m^2", "mm2"): 1e-6, ("m^2", "in2"): INCH**2,
    ("", "%"): 1e-2, ("", "percent"): 1e-2, ("", "permille"): 1e-3,
    ("1/K", "1/degC"): 1.0, ("1/K", "1/degF"): 1.8, ("delta_degC", "K"): 1.0, ("delta_degC", "degF"): 1 / 1.8,
    ("byte", "kB"): 1e3, ("byte", "MB"): 1e6, ("byte", "GB"): 1e9, ("byte", "bit"): 0.125,
    ("degree", "deg"): 1.0, ("degree", "rad"): 57.295779513,
}  # fmt: skip


@pytest.mark.parametrize(("unit", "name"), NAMED, ids=lambda text: text.replace("/", "|") or "1")
def test_quantities_of_a_configuration(unit, name):
    """Digits of NIST's table; metric ones are exact to one rounding."""
    exact = float(f"{NAMED[unit, name]:.1g}") == NAMED[unit, name]
    assert to_si(f"0.25 {name}", unit) == pytest.approx(
        0.25 * NAMED[unit, name], rel=1e-14 if exact else 5e-7
    )


def test_every_suggested_and_every_si_unit_is_in_the_table():
    named = {unit for unit, _ in NAMED}
    assert named == set(_MOST)
    for unit, names in _SUGGESTED.items():
        for name in names:
            assert (unit, name) in NAMED or to_si(f"1 {name}", unit) == 1.0
    assert all((unit, name) in NAMED for unit, name in _COMMONLY.items())
    defined = [line.split(" = ")[0] for line in _COMMON.strip().splitlines()]
    assert [name for name in defined if name.endswith("-")] == [
        "nano-", "micro-", "milli-", "centi-", "kilo-", "mega-", "giga-",
    ]  # fmt: skip
