"""Every mistake in a configuration: one line with the file, the key, the value, the limit and the remedy."""

import copy
from pathlib import Path

import numpy as np
import pytest
import yaml
from scene_builders import two_boxes

from romdam.config import load_config, parse_config
from romdam.core.errors import ConfigError
from romdam.scene.build import build_scene

EXAMPLE = Path(__file__).parents[2] / "configs" / "two_cantilevers.yaml"
CONCRETE = ("materials", "concrete")
JOINT = ("joints", "contraction")
DELETE = object()

# key, wrong value, what the one line must contain
MISTAKES = [
    (("outputz",), 1, ["outputz is not a known key", "did you mean 'outputs'?"]),
    ((*CONCRETE, "nuu"), 0.2, ["materials.concrete.nuu is not a known key", "did you mean 'nu'?"]),
    ((*CONCRETE, "E"), DELETE, ["materials.concrete.E is missing", "E: 30 GPa"]),
    (("transient",), DELETE, ["transient is missing", "transient: {finest_step: 2.5 ms}"]),
    ((*CONCRETE, "E"), "30 GPA", ["materials.concrete.E", "'30 GPA'", "unknown unit", 'is "30 GPa" meant?']),
    ((*CONCRETE, "E"), "30 kg", ["materials.concrete.E", "'30 kg' is not a quantity in Pa"]),
    ((*CONCRETE, "nu"), 0.5, ["materials.concrete.nu must be less than 0.5, got 0.5", "0.18"]),
    ((*CONCRETE, "rho"), -2400, ["materials.concrete.rho must be greater than 0, got -2400", "2400 kg/m3"]),
    (
        ("transient", "integrator"),
        "conserving",
        ["transient.integrator: conserving is for scenes without damping", "adaptive is the default"],
    ),
    (
        ("transient", "integrator"),
        "euler",
        ["transient.integrator must be one of adaptive, conserving, generalized_alpha, modal, got 'euler'"],
    ),
    ((*JOINT, "normal_stiffness"), -1, ["normal_stiffness must be greater than 0, got -1"]),
    ((*JOINT, "normal_stiffness"), 0, ["normal_stiffness must be greater than 0, got 0"]),
    ((*JOINT, "normal_stiffness"), {"per_gap": 0}, ["per_gap must be greater than 0, got 0"]),
    ((*JOINT, "normal_stiffness"), "30 kg", ["normal_stiffness: '30 kg' is not a quantity in N/m^3"]),
    (
        (*JOINT, "normal_stiffness"),
        [1, 2],
        ["normal_stiffness: expected a stiffness", '"rigid"', "got [1, 2]"],
    ),
    ((*JOINT, "normal_stiffness"), {"per_gap": "3 kg"}, ["normal_stiffness.per_gap: '3 kg' is not"]),
    ((*JOINT, "friction"), 0.6, ["joints.contraction: friction 0.6 needs `shear_stiffness`", "or set"]),
    ((*JOINT, "friction"), -0.6, ["friction must be at least 0, got -0.6"]),
    ((*JOINT, "friction_static"), -0.1, ["friction_static must be at least 0, got -0.1"]),
    ((*JOINT, "cohesion"), "1 MPa", ["`cohesion` needs `shear_stiffness`", "give it"]),
    ((*JOINT, "cohesion"), "1 kg", ["joints.contraction.cohesion: '1 kg' is not a quantity in Pa"]),
    ((*JOINT, "tensile_strength"), -1, ["tensile_strength must be at least 0, got -1"]),
    ((*JOINT, "viscosity"), "3 Pa", ["joints.contraction.viscosity: '3 Pa' is not a quantity in"]),
    ((*JOINT, "shear_key"), {"depth": "3 cm"}, ["`shear_key` needs `shear_stiffness` above 0"]),
    ((*JOINT, "shear_key"), {"depth": 0}, ["shear_key.depth must be greater than 0, got 0"]),
    ((*JOINT, "shear_key"), {"depth": 0.1, "directions": ["i"]}, ["directions[0] must be 'j' or 'k'"]),
    ((*JOINT, "shear_key"), {"depth": 0.1, "directions": []}, ["directions must have at least 1 entry"]),
    ((*JOINT, "normal"), "fase", ["joints.contraction.normal must be 'face' or 'nodes', got 'fase'"]),
    (
        ("blocks", "left", "box", "element_size"),
        [1, 2, -1],
        ["element_size[2] must be greater than 0, got -1"],
    ),
    (("blocks", "left", "box", "element"), "hex9", ["blocks.left.box.element must be 'hex8'", "got 'hex9'"]),
    (("blocks", "left", "material"), "stone", ["blocks.left.material: no 'stone'", "defined are concrete"]),
    (("supports", 0, "block"), "lef", ["supports[0].block: no 'lef' is defined; defined are left, right"]),
    (("supports", 0, "fix"), ["w"], ["supports[0].fix[0] must be 'x', 'y' or 'z', got 'w'"]),
    (("model", "modes"), "al", ["model.modes", "got 'al'", '"all"']),
    (("model", "modes"), DELETE, ["model: a reduced model needs exactly one of `modes`"]),
    (("transient", "finest_step"), 0, ["transient.finest_step must be greater than 0, got 0", "1 to 5 ms"]),
    (
        ("transient", "finest_step"),
        float("nan"),
        ["transient.finest_step: expected a finite number in s, got nan"],
    ),
    (("records",), [], ["records must have at least 1 entry, got []"]),
    (("records", 0, "unit"), "kg", ["records[0].unit", "is not a quantity in m/s^2"]),
    (("records", 0, "dt"), 0, ["records[0].dt must be greater than 0, got 0"]),
    (("records", 0, "correction"), ["detren"], ["records[0].correction[0]: no such step", "'detrend'"]),
]


FURTHER_LAWS = [  # several keys of a joint that do not fit together
    ({"friction": 0.6, "friction_static": 0.5}, "friction_static (0.5, 0.5) must be at least friction"),
    (
        {"friction": 0.6, "tensile_strength": "2 MPa", "cohesion": "1 MPa"},
        "cohesion 1e+06 Pa must be at least",
    ),
    ({"normal_stiffness": "rigid", "viscosity": "1 MPa*s/m"}, "viscosity needs a finite `normal_stiffness`"),
]


def example() -> dict:
    return yaml.safe_load(EXAMPLE.read_text())


def with_mistake(key: tuple, value: object) -> dict:
    raw = copy.deepcopy(example())
    place = raw
    for part in key[:-1]:
        place = place[part]
    if value is DELETE:
        del place[key[-1]]
    else:
        place[key[-1]] = value
    return raw


@pytest.mark.parametrize(
    ("key", "value", "parts"),
    MISTAKES,
    ids=lambda v: ".".join(map(str, v))[:60] if isinstance(v, tuple) else "",
)
def test_mistake_is_one_line_naming_file_key_value_and_limit(key, value, parts):
    with pytest.raises(ConfigError) as caught:
        parse_config(with_mistake(key, value), "dam.yaml")
    message = str(caught.value)
    assert message.startswith("dam.yaml: ")
    assert "\n" not in message, "one mistake, one line"
    for part in parts:
        assert part in message


@pytest.mark.parametrize(("keys", "part"), FURTHER_LAWS)
def test_joint_laws_that_contradict_each_other_are_refused(keys, part):
    raw = example()
    raw["joints"]["contraction"] |= {"shear_stiffness": "8 GPa/m", **keys}
    with pytest.raises(ConfigError) as caught:
        parse_config(raw, "dam.yaml")
    assert str(caught.value).startswith("dam.yaml: joints.contraction: ")
    assert part in str(caught.value)


def test_further_joint_laws_are_read_and_reach_every_gap():
    """Strengths per area times the gap's area; a friction number counts for both directions."""
    keys = {"friction": 0.6, "friction_static": [0.7, 0.8], "tensile_strength": "2 MPa", "cohesion": "3 MPa"}
    keys |= {
        "shear_stiffness": "8 GPa/m",
        "viscosity": 1e6,
        "shear_key": {"depth": "3 cm", "directions": ["k"]},
    }
    raw = example()
    raw["joints"]["contraction"] |= keys
    scene = build_scene(parse_config(raw, "dam.yaml"), EXAMPLE.parent, "dam.yaml")
    joint = scene.joints["contraction"]
    area = joint.area
    laws = {rows.law.name: rows.values for rows in joint.laws}
    assert laws["Bond"] == pytest.approx(np.column_stack([2e6 * area, 3e6 * area]))
    assert joint.viscosity == pytest.approx(1e6 * area)
    assert (laws["StaticFriction"] == [0.7, 0.8, 0.6, 0.6]).all()
    assert (laws["ShearKey"] == [0.03, 0.0, 1.0]).all()


def test_several_mistakes_have_a_line_each():
    raw = with_mistake((*CONCRETE, "nu"), 0.7)
    raw["transient"]["finest_step"] = -1
    with pytest.raises(ConfigError) as caught:
        parse_config(raw, "dam.yaml")
    assert len(str(caught.value).splitlines()) == 2


def test_key_given_twice_is_refused(tmp_path):
    path = tmp_path / "twice.yaml"
    path.write_text("materials:\n  c: {E: 1, nu: 0.1, nu: 0.2, rho: 1}\n")
    with pytest.raises(ConfigError, match=r"twice\.yaml.*'nu' is given twice"):
        load_config(path)


def test_missing_file_and_bad_yaml_are_named(tmp_path):
    with pytest.raises(ConfigError, match=r"nowhere\.yaml: no such file"):
        load_config(tmp_path / "nowhere.yaml")
    (tmp_path / "bad.yaml").write_text("a: [1, 2")
    with pytest.raises(ConfigError, match=r"bad\.yaml:\d+: not valid YAML"):
        load_config(tmp_path / "bad.yaml")


def test_yaml_cannot_make_objects(tmp_path):
    path = tmp_path / "evil.yaml"
    path.write_text("title: !!python/object/apply:os.getcwd []\n")
    with pytest.raises(ConfigError, match="not valid YAML"):
        load_config(path)


def test_example_survives_a_round_trip_through_json():
    config = load_config(EXAMPLE).config
    assert parse_config(config.model_dump(mode="json"), "again") == config


def test_digest_ignores_spelling_and_sees_values(tmp_path):
    same, other = tmp_path / "same.yaml", tmp_path / "other.yaml"
    text = EXAMPLE.read_text()
    same.write_text("# a comment\n" + text.replace("30 GPa", "3.0e4 MPa"))
    other.write_text(text.replace("30 GPa", "31 GPa"))
    digest = load_config(EXAMPLE).digest
    assert load_config(same).digest == digest
    assert load_config(other).digest != digest


@pytest.mark.parametrize(
    ("value", "expected"),
    [("16 GPa/m", 1.6e10), (2e10, 2e10), ("rigid", "rigid"), ({"per_gap": "1 GN/m"}, 1e9)],
)
def test_normal_stiffness_is_read_in_each_of_its_forms(value, expected):
    joint = parse_config(with_mistake((*JOINT, "normal_stiffness"), value), "x").joints["contraction"]
    got = joint.normal_stiffness
    assert getattr(got, "per_gap", got) == (pytest.approx(expected) if expected != "rigid" else "rigid")


def test_a_message_names_the_line_of_the_file(tmp_path):
    """That of the key, of a value within a flow, of a sequence's entry, and of what lacks a key."""
    wrong = example()
    wrong["materials"]["concrete"]["rho"] = -1
    del wrong["joints"]["contraction"]["between"]
    wrong["supports"][1]["face"] = 3
    path = tmp_path / "dam.yaml"
    path.write_text(yaml.safe_dump(wrong, sort_keys=False))
    rows = path.read_text().splitlines()
    with pytest.raises(ConfigError) as caught:
        load_config(path)
    for message, key in (
        ("rho must be", "rho"),
        ("between is missing", "contraction:"),
        ("supports[1]", "face: 3"),
    ):
        line = 1 + next(k for k, row in enumerate(rows) if key in row)
        assert any(
            told.startswith(f"{path}:{line}: ") and message in told for told in str(caught.value).splitlines()
        )


def test_the_model_of_the_water_is_not_that_of_the_job():
    raw = example() | {"water": {"level": 10.0, "faces": [{"block": "left", "face": "ymin"}]}}
    with pytest.raises(ConfigError) as caught:
        parse_config(raw, "s.yaml")
    assert "water.model is missing and has no default; add it, for example `model: incompressible`" in str(
        caught.value
    )


@pytest.mark.parametrize(
    ("design", "messages"),
    [
        ({"sobol_indices": 100}, ["`sobol_indices` is a power of 2"]),
        ({"latin_hypercube": 8, "sead": 2}, ["suite.design.sead is not a known key; did you mean 'seed'?"]),
        ({"monte_carlo": 0}, ["suite.design.monte_carlo must be at least 1, got 0"]),
        ({"table": 3}, ["suite.design.table must be the path of a file, got 3"]),
        ({"sobol_indices": 64, "latin_hypercube": 3}, ['suite.design: expected one of "grid", {latin_hyp']),
        ({"sobol": 64}, ['suite.design: expected one of "grid", {latin_hypercube: 100']),
        ("gird", ['suite.design: expected one of "grid", {latin_hypercube: 100']),
    ],
)
def test_a_design_is_answered_by_its_own_keys_alone(design, messages):
    parameters = {"mu": {"path": "joints.contact.friction", "low": 0.1, "high": 0.2}}
    raw = two_boxes() | {"suite": {"parameters": parameters, "design": design}}
    with pytest.raises(ConfigError) as refused:
        parse_config(raw, "s.yaml")
    lines = [line for line in str(refused.value).splitlines() if "suite" in line]
    assert len(lines) == len(messages)
    for line, message in zip(lines, messages, strict=True):
        assert message in line
