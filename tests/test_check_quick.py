"""`romdam check --quick`, loads at rest against hand calculations, and faults that are told together."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from gravity_dams import gravity_dam
from pytest import approx
from suite_jobs import BASE, write_job
from test_cli import call

import romdam
from romdam.pipelines import check as pipeline

KOYNA = Path(__file__).parents[1] / "configs" / "koyna.yaml"
NEED = ("blocks", "joints", "ties", "loads", "warnings", "bodies", "supports")


def test_a_gravity_dam_is_checked_without_a_reduction(monkeypatch):
    for name in ("build_model", "reduced_model", "run_costs", "initial_state"):
        monkeypatch.setattr(pipeline, name, lambda *a, **k: pytest.fail("something was reduced"))
    checked = romdam.check(KOYNA, quick=True)
    assert checked.quick and np.isnan(checked.seconds) and checked.unknowns == 17643
    # 103 m high, 70 m wide at the base, 19.25 m at 66.5 m and 14.8 m at the crest; five monoliths 15.24 m
    # wide that end at 20, 0, 0, 0 and 10 m; the base's width where it is raised is that of the section there
    weight, thrust = 0.0, 0.0
    for foot in (20.0, 0.0, 0.0, 0.0, 10.0):
        at_foot = np.interp(foot, [0.0, 66.5], [70.0, 19.25])
        area = 0.5 * (at_foot + 19.25) * (66.5 - foot) + 0.5 * (19.25 + 14.8) * 36.5
        weight += 2643.0 * 9.81 * 15.24 * area
        thrust += 0.5 * 1000.0 * 9.81 * 15.24 * (91.7 - foot) ** 2
    loads = checked.loads
    assert loads["weight"] == {"x": 0.0, "y": 0.0, "z": approx(-weight, rel=1e-9)}
    assert loads["water"] == {"x": 0.0, "y": approx(thrust, rel=1e-9), "z": 0.0}


def test_quick_and_whole_checks_say_the_same(tmp_path):
    config = write_job(tmp_path, 2, pipeline="run", loads={"gravity": [0, 0, -9.81]})
    quick, whole = romdam.check(config, quick=True), romdam.check(config)
    for name in NEED:
        one, other = getattr(quick, name), getattr(whole, name)
        if name == "blocks":
            other = {block: {key: numbers[key] for key in one[block]} for block, numbers in other.items()}
        assert one == other, name
    assert not whole.quick and whole.seconds > 0.0
    code, out, _ = call("check", config, "--quick")
    assert code == 0 and "unknowns of the mesh, not reduced" in out and "is valid" in out


@pytest.mark.parametrize("kind", ["run", "suite"])
def test_faults_that_need_not_each_other_are_told_together(tmp_path, kind):
    """Of supports, joints, nodes, loads and records: each with its key, in one go."""
    outputs = {**BASE["outputs"], "nodes": {"top": {"block": "right", "at": [0, 0, 200]}}}
    loads = {"pressure": [{"block": "left", "face": "nowhere", "value": "1 kPa"}]}
    config = write_job(tmp_path, 1, pipeline=kind, outputs=outputs, loads=loads)
    raw = yaml.safe_load(config.read_text())
    raw["supports"].append({"block": "left", "face": "elsewhere"})
    raw["joints"]["far"] = {"between": ["left", "third"], "normal_stiffness": "1 GPa/m"}
    raw["blocks"]["third"] = {"material": "concrete", "box": {
        "origin": [50, 0, 0], "size": [5, 5, 5], "element_size": "5 m"}}  # fmt: skip
    raw["records"][0]["components"] = {"y": 7}
    config.write_text(yaml.safe_dump(raw))
    with pytest.raises(romdam.RomdamError) as refused:
        romdam.check(config, quick=True)
    text = str(refused.value)
    for key in ("supports[2].face", "joints.far", "outputs.nodes.top.at", "loads.pressure[0].face", "r0"):
        assert key in text, text
    assert len(text.split("\n")) == 5, text


def test_all_parameters_that_cannot_be_varied_are_told(tmp_path):
    suite = {"parameters": {
        "one": {"path": "joints.gop.friction", "values": [0.1]},
        "two": {"path": "blocks.left", "values": [0.1]},
        "three": {"path": "joints.gap.friction", "values": [-1.0]}}}  # fmt: skip
    with pytest.raises(romdam.ConfigError) as refused:
        romdam.load_config(write_job(tmp_path, 1, suite))
    assert [f"parameters.{name}" in str(refused.value) for name in suite["parameters"]] == [True] * 3


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"stiffness": "50 Pa/m"}, ["normal_stiffness = 50 N/m3", "is a unit missing, such as `16 GPa/m`?"]),
        ({"gravity": [0, 0, 9.81]}, ["loads.gravity", "does not point down", "[0, 0, -9.81] makes weight"]),
    ],
)
@pytest.mark.parametrize("command", [romdam.check, pytest.param(romdam.run, marks=pytest.mark.slow)])
def test_a_dam_that_does_not_rest_names_the_values_that_it_hardly_means(tmp_path, command, changes, says):
    """A joint of 50 Pa/m and a weight upwards: the remedy is not friction."""
    write_job(tmp_path, 1)
    dam = gravity_dam()
    for joint in dam["gravity_dam"]["joints"].values():
        joint["normal_stiffness"] = changes.get("stiffness", joint["normal_stiffness"])
    loads = {"gravity": changes.get("gravity", [0, 0, -9.81])}
    short = {"finest_step": "5 ms", "duration": "0.1 s"}
    keys = {"records": BASE["records"], "model": {"modes": 3}, "transient": short, "loads": loads}
    with pytest.raises(romdam.ConvergenceError) as refused:
        command(romdam.load_config({**dam, **keys}, tmp_path))
    text = str(refused.value)
    assert text.startswith("initial state: no") and all(part in text for part in says)
    assert text.count("normal_stiffness =") <= 1, "joints alike are told once"


def test_names_of_joints_may_be_patterns_as_those_of_blocks():
    raw = yaml.safe_load(KOYNA.read_text())
    named = romdam.load_config(raw, KOYNA.parent).config
    raw["loads"]["joint_water"][0]["joints"] = ["base_?"]
    wet = [{"block": "monolith_*", "face": "upstream"}]
    raw["loads"]["hydrostatic"][0]["faces"] = raw["water"]["faces"] = wet
    assert romdam.load_config(raw, KOYNA.parent).config == named
    stage = {
        "name": "all",
        "pour": ["monolith_*"],
        "grout": [{"joints": ["contraction_*", "contraction_1_2"]}],
    }
    after = {"changes": {"loads.joint_water.0.drains": None}, "required_factor": 1.1, "joints": ["base_*"]}
    config = romdam.load_config(
        raw | {"construction": [stage], "post_earthquake": after}, KOYNA.parent
    ).config
    assert config.construction[0].grout[0].joints == (
        "contraction_1_2", "contraction_2_3", "contraction_3_4", "contraction_4_5"
    )  # fmt: skip
    assert config.post_earthquake.joints == named.loads.joint_water[0].joints
    raw["loads"]["joint_water"][0]["joints"] = ["bose_*"]
    with pytest.raises(romdam.ConfigError, match=r"\[0\]: no joint is like .bose_\*.; joints are base_1"):
        romdam.load_config(raw, KOYNA.parent)


def test_the_statement_of_the_mesh_before_a_suite_costs_what_its_runs_on_both_meshes_do(tmp_path):
    suite = {"scales": [0.5, 1.0, 2.0]}
    outputs = {**BASE["outputs"], "mesh_error": "finer"}
    stated = romdam.check(write_job(tmp_path, 1, suite, outputs=outputs))
    without = romdam.check(write_job(tmp_path, 1, suite, outputs={**outputs, "mesh_error": False}))
    assert without.costs["mesh"] == 0.0 < stated.costs["mesh"] < 60.0 * stated.costs["integration"]
