"""Paths of a suite's parameter: patterns, lists, and what a dam makes its joints of."""

import pytest
from gravity_dams import gravity_dam
from suite_jobs import write_job

import romdam
from romdam.config import parse_config
from romdam.config.parameters import find_varied_key, vary
from romdam.core.errors import ConfigError

REST = {
    "records": [{"file": "r.txt", "unit": "g", "dt": 0.01, "components": {"y": 1}}],
    "model": {"modes": 3},
    "transient": {"finest_step": "2 ms"},
    "damping": {"rayleigh": {"frequencies": [3, 20], "ratio": 0.05}},
}
BASES = ("base_1", "base_2", "step_2_1", "step_2_3", "base_3")  # the middle monolith stands deeper
SIDES = ("contraction_1_2", "contraction_2_3")
BASE, CONTRACTION = "gravity_dam.joints.base.friction", "gravity_dam.joints.contraction.friction"


@pytest.fixture(scope="module")
def config():
    return parse_config(gravity_dam() | REST, "dam.yaml")


@pytest.mark.parametrize(
    ("path", "joints"),
    [
        ("joints.base_2.friction", {"base_2"}),
        ("joints.base_*.friction", {"base_1", "base_2", "base_3"}),
        ("joints.step_?_3.friction", {"step_2_3"}),
        ("joints.*.friction", {*BASES, *SIDES}),
        (BASE, {*BASES}),
        ("gravity_dam.joints.*.friction", {*BASES, *SIDES}),
        (["joints.base_1.friction", CONTRACTION], {"base_1", *SIDES}),
    ],
)
def test_all_that_match_have_the_value_and_no_other_joint(config, path, joints):
    key = find_varied_key(config, path, "mu", "dam.yaml")
    assert {*key.joints} == joints and len(key.joints) == len(joints)
    varied = vary(config, {"mu": key}, {"mu": 0.4}, "dam.yaml")
    assert {
        name for name, joint in varied.config.every_joint.items() if joint.friction == (0.4, 0.4)
    } == joints
    assert {joint.friction for name, joint in varied.config.every_joint.items() if name not in joints} <= {
        (0.6, 0.6)
    }


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("joints.bse_*.friction", ["no joint is like 'bse_*'", "did you mean", "'joints.base_1'"]),
        ("joints.contraction_1_3.friction", ["'joints.contraction_1_2'"]),
        (
            "gravity_dam.joints.bases.friction",
            ["'gravity_dam.joints.bases'", "did you mean 'gravity_dam.joints.base'"],
        ),
        ("gravity_dam.joints.lift.friction", ["no joints are made of 'gravity_dam.joints.lift'"]),
        ("joints.base_1.fricton", ["cannot be varied", "did you mean 'friction'?"]),
        ([BASE, "joints.base_1.gap"], ["one key, got friction, gap"]),
        ("gravity_dam.material", ["not of the joints or the damping"]),
    ],
)
def test_what_matches_nothing_is_refused_with_what_is_near(config, path, words):
    with pytest.raises(ConfigError) as caught:
        find_varied_key(config, path, "mu", "dam.yaml")
    assert str(caught.value).startswith("dam.yaml: suite.parameters.mu.path: ")
    assert [word for word in words if word not in str(caught.value)] == []


def test_two_parameters_of_one_path_are_refused():
    both = {"a": {"path": [BASE, CONTRACTION], "values": [0.5]}, "b": {"path": CONTRACTION, "values": [0.6]}}
    with pytest.raises(ConfigError, match=r"suite\.parameters\.b\.path: .* is varied twice"):
        parse_config(gravity_dam() | REST | {"pipeline": "suite", "suite": {"parameters": both}}, "dam.yaml")


@pytest.mark.parametrize("pipeline", ["run", "suite"])
@pytest.mark.parametrize(
    ("parameter", "words"),
    [
        ({"path": "ground.input", "values": [1]}, "'ground.input' is not of the joints or the damping"),
        ({"path": "joints.gap.mu", "values": [0.3]}, "'joints.gap.mu' cannot be varied"),
        ({"path": "joints.gap.friction", "values": [0.3, "3 m"]}, "got '3 m'"),
        ({"path": "joints.gap.friction", "low": -1, "high": 0.3, "count": 2}, "got -1"),
    ],
)
def test_a_suite_that_varies_something_else_is_refused_when_it_is_read(tmp_path, pipeline, parameter, words):
    """Also where its pipeline makes nothing of it: check, run and every other command say the same."""
    path = write_job(tmp_path, records=1, suite={"parameters": {"a": parameter}}, pipeline=pipeline)
    run = romdam.run_suite if pipeline == "suite" else romdam.run
    for command, where in ((romdam.load_config, ()), (romdam.check, ()), (run, (tmp_path / "out",))):
        with pytest.raises(ConfigError) as told:
            command(path, *where)
        assert words in str(told.value)
        assert f"{path}:" in str(told.value) and "suite.parameters.a" in str(told.value)
