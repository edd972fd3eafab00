"""Numbers with units: read as written, or refused; never as something else of the same dimension."""

import pytest

from romdam.config.quantities import _COMMON, _EXAMPLES, _MOST, _registry, _registry_of, to_si


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("30 GPa", "Pa", 30e9),
        ("0.3 g", "m/s^2", 0.3 * 9.80665),
        ("-4 degC", "delta_degC", -4.0),
        ("-4 °C", "delta_degC", -4.0),
        ("-9 degF", "delta_degC", -5.0),
        ("1e-5 1/K", "1/K", 1e-5),
        ("1e-5 1/°C", "1/K", 1e-5),
        ("1e-5 K-1", "1/K", 1e-5),
        ("2.4 t/m3", "kg/m^3", 2400.0),
        ("8 GB", "byte", 8e9),
        ("1 rad", "degree", 57.29577951308232),
        ("5 %", "", 0.05),
    ],
)
def test_quantities(text, unit, value):
    assert to_si(text, unit) == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize("unit", _MOST)
def test_what_a_message_advises_is_read(unit):
    for example in _EXAMPLES.get(unit, f"1 {unit}").split(" or "):
        assert to_si(example, unit) != 0.0


def test_common_units_are_those_of_pint():
    """Any unit that pint knows is the same where the registry of few knows it too, with prefix and plural."""
    few, every = _registry(_COMMON), _registry()
    short = [name for name in every._units if len(name) < 4]
    names = [*every._units, *(prefix + name for prefix in every._prefixes for name in short)]
    known = 0
    for name in [*names, *(f"{one}s" for one in names)]:
        try:
            factor = few.Quantity(1.0, name).to_root_units()
        except Exception:  # half a dozen kinds, as in `_parse`
            continue
        pints = every.Quantity(1.0, name).to_root_units()
        assert (factor.magnitude, str(factor.units)) == (pints.magnitude, str(pints.units)), name
        known += 1
    assert known > 300


def test_only_uncommon_units_cost_the_registry_of_all():
    assert all(_registry_of(unit) is _registry(_COMMON) for unit in ["GPa/m", *(u for u in _MOST if u)])
    assert _registry_of("ksi") is _registry()
    assert to_si("1 ksi", "Pa") == pytest.approx(4448.2216152605 / 0.0254**2, rel=1e-12)


@pytest.mark.parametrize(
    ("value", "unit"),
    [
        ("1 rad/s", "Hz"),  # was 1 Hz
        ("60 rpm", "Hz"),  # was 6.28 Hz
        ("31 deg", ""),  # was 0.54, where its tangent was meant
        ("5 dB", ""),
        ("5 GB", ""),
        ("8 %", "byte"),
        ("90 %", "degree"),
        ("5 %%", ""),
        ("30 gpa", "Pa"),
        ("30 GPa GPa", "Pa"),
        ("1 m^0", "m"),
        ("2**999999999 m", "m"),
        ("1e999 m", "m"),
        ("nan m", "m"),
        ("9,81 m/s2", "m/s^2"),
        ("1 000 m", "m"),
        ("m" + " " * 9999 + "!", "m"),
        ("1 " + "m " * 5000, "m"),
        (float("nan"), "m"),
        (10**400, "m"),
        (1e300, "Pa"),
        (1e-300, "Pa"),
        (True, "m"),
        ([1], "m"),
        (None, "m"),
    ],
)
def test_what_is_refused(value, unit):
    with pytest.raises(ValueError) as caught:
        to_si(value, unit)
    assert len(str(caught.value)) < 400
