"""Numbers with units: read as written, or refused; never as something else of the same dimension."""

import pytest
from pydantic import ValidationError

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
        ("150 pcf", "kg/m^3", 150 * 0.45359237 / 0.3048**3),  # NIST SP 811, appendix B
        ("1 lbm", "kg", 0.45359237),
        ("4 ksf", "Pa", 4e3 * 4.4482216152605 / 0.3048**2),
        ("4000 psf", "Pa", 4e3 * 4.4482216152605 / 0.3048**2),
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


def _of_every_kind():
    from romdam.config.sections.motions.records import RecordConfig, ScaleConfig
    from romdam.config.sections.motions.target import Asce7Spectrum, Eurocode8Spectrum, SpectrumConfig
    from romdam.config.sections.suite import IntensityConfig

    return [
        (ScaleConfig, lambda a: {"pga": a}, "pga"),
        (ScaleConfig, lambda a: {"sa": a, "period": 1.0}, "sa"),
        (Asce7Spectrum, lambda a: {"SDS": a, "SD1": "0.6 g", "TL": 8.0}, "SDS"),
        (Asce7Spectrum, lambda a: {"SDS": "1 g", "SD1": a, "TL": 8.0}, "SD1"),
        (Eurocode8Spectrum, lambda a: {"ag": a, "type": 1, "ground": "A"}, "ag"),
        (SpectrumConfig, lambda a: {"points": [[0.1, "1 g"], [1.0, a]]}, "points"),
        (IntensityConfig, lambda a: {"measure": "pga", "values": ["0.1 g", a]}, "values"),
        (RecordConfig, lambda a: {"file": "x", "keep": {"pga": {"min": a}}}, "keep"),
    ]


@pytest.mark.parametrize(("text", "mass"), [("24 kN/m3", 2447), ("150 lbf/ft3", 2403)])
def test_a_weight_of_a_material_is_refused_with_its_mass(text, mass):
    with pytest.raises(ValueError, match=rf"a weight; write its mass, {mass} kg/m3"):
        to_si(text, "kg/m^3")


@pytest.mark.parametrize("number", [0.3, "0.3", 1, " 1e-1 "])
@pytest.mark.parametrize("kind", range(8))
def test_a_bare_acceleration_of_records_and_codes_is_refused(kind, number):
    """A code's 0.3 is in g: taken as m/s2 it is 9.81 times too weak."""
    model, keys, name = _of_every_kind()[kind]
    bare = str(number).strip() if model.__name__ != "RecordConfig" or number != 1 else "1.0"
    with pytest.raises(
        ValidationError, match=rf"{name}[\s\S]*{bare} has no unit; write {bare} g or {bare} m/s2"
    ):
        model.model_validate(keys(number))


@pytest.mark.parametrize("kind", range(8))
def test_what_is_written_out_is_read_again_to_the_last_bit(kind):
    """Also where a result of before holds the number alone, which is in SI."""
    model, keys, _ = _of_every_kind()[kind]
    made = model.model_validate(keys("0.1234567 g"))
    for mode in ("python", "json"):
        assert model.model_validate(made.model_dump(mode=mode, exclude_unset=True)) == made
    assert model.model_validate(keys(1.21069521555), context={"si": True})


def test_no_key_of_an_acceleration_takes_a_bare_number_but_gravity():
    """By the schema, so that a key of tomorrow is held to it."""
    from romdam.config.schema import schema

    def bare(node, path):
        if isinstance(node, dict):
            if node.get("unit") == "m/s2" and node["pattern"].endswith(")?$"):
                yield path
            for key, inner in node.items():
                yield from bare(inner, f"{path}.{key}")
        elif isinstance(node, list):
            for inner in node:
                yield from bare(inner, path)

    assert {path.partition(".properties.")[2].split(".")[0] for path in bare(schema(), "")} == {"gravity"}


@pytest.mark.parametrize(("name", "common"), [("pgv", "cm/s"), ("pgd", "cm"), ("cav", "cm/s")])
def test_limits_of_measures_in_other_units_than_si_need_theirs(name, common):
    from romdam.config.sections.motions.records import RecordConfig

    with pytest.raises(ValidationError, match=f"{name}: max: 20.0 has no unit; write 20.0 {common} or"):
        RecordConfig.model_validate({"file": "x", "keep": {name: {"max": 20}}})
    kept = RecordConfig.model_validate({"file": "x", "keep": {name: {"min": 0, "max": f"20 {common}"}}})
    assert kept.keep[name].max == f"20 {common}"
