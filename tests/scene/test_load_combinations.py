"""`romdam combinations`: a gravity dam in four combinations, its factors by hand."""

import contextlib
import csv
import html
import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from test_cli import call

import romdam
from romdam.core.errors import ConfigError, ConvergenceError
from romdam.error.statement import opening_errors
from romdam.pipelines import combinations as pipeline
from romdam.pipelines.combinations import assess_combinations
from romdam.postprocess import combinations

G, RHO, WIDTH, BASE, HEIGHT = 9.81, 2400.0, 10.0, 24.0, 30.0
MU, COHESION = 0.9, 2e5
WEIGHT = RHO * G * WIDTH * BASE * HEIGHT
USUAL, FLOOD = 24.0, 26.0
COMBINATIONS: dict[str, dict[str, Any]] = {
    "usual": {"required_factor": 2.0},
    "flood": {"changes": {"loads.hydrostatic.0.level": FLOOD, "loads.joint_water.0.level": FLOOD},
              "required_factor": 1.5},
    "earthquake": {"situation": "earthquake", "largest_slip": "50 mm", "tension": "3 MPa"},
    "after": {"situation": "after", "after": "earthquake", "required_factor": 1.3,
              "changes": {"joints.base.friction": 0.6, "joints.base.cohesion": 0,
                          "joints.base.tensile_strength": 0,
                          "loads.joint_water.0.drains": None}},
}  # fmt: skip


def push(level: float) -> float:
    """Thrust of the water [N]."""
    return 0.5 * 1000.0 * G * level**2 * WIDTH


def uplift(level: float, drained: bool) -> float:
    """Linear from the heel to the toe; with drains at 4 m, a third of the head there [N]."""
    head = 1000.0 * G * level
    if not drained:
        return 0.5 * head * BASE * WIDTH
    return 0.5 * (head + head / 3.0) * 4.0 * WIDTH + 0.5 * head / 3.0 * (BASE - 4.0) * WIDTH


def job(**sections: Any) -> dict[str, Any]:
    def box(z: float, height: float, size: float) -> dict[str, Any]:
        return {"origin": [0, 0, z], "size": [WIDTH, BASE, height], "element_size": [5, size, 5]}

    return {
        "title": "A wall of concrete",
        "materials": {
            "concrete": {"E": "25 GPa", "nu": 0.2, "rho": RHO},
            "rock": {"E": "30 GPa", "nu": 0.2, "rho": 2600},
        },
        "blocks": {
            "rock": {"material": "rock", "mass": False, "box": box(-10, 10, 2)},
            "dam": {"material": "concrete", "box": box(0, HEIGHT, 2)},
        },
        "supports": [{"block": "rock", "face": "zmin"}],
        "joints": {
            "base": {
                "between": ["rock", "dam"], "normal_stiffness": "50 GPa/m", "shear_stiffness": "25 GPa/m",
                "friction": MU, "cohesion": COHESION, "tensile_strength": "0.2 MPa",
            }
        },
        "loads": {
            "gravity": [0, 0, -G],
            "hydrostatic": [{"level": USUAL, "faces": [{"block": "dam", "face": "ymin"}]}],
            "joint_water": [{"joints": ["base"], "level": USUAL, "downstream": [0, 1, 0],
                             "drains": {"at": "4 m", "rule": "usbr"}}],
        },
        "damping": {"rayleigh": {"frequencies": [3, 20], "ratio": 0.05}},
        "records": [{"file": "shake.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}],
        "model": {"modes": 6},
        "transient": {"finest_step": "2.5 ms"},
        "outputs": {"plots": False, "error_estimate": False, "mesh_error": False,
                    "stress": {"blocks": ["dam"], "faces": [{"block": "dam", "face": "ymin"}]}},
        "combinations": COMBINATIONS,
    } | sections  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("combinations")
    time = np.arange(200) * 0.01
    np.savetxt(made / "shake.txt", 2.5 * np.sin(2 * np.pi * 4.0 * time) * np.exp(-2.0 * time))
    (made / "dam.yaml").write_text(yaml.safe_dump(job(), sort_keys=False))
    return made


def test_factors_of_four_combinations_by_hand(folder: Path):
    """(mu (W - U) + c A) / H at rest; after the earthquake friction alone, and no drains; within 0.1 %."""
    assessed = assess_combinations(folder / "dam.yaml", folder / "out")
    found = {(one.combination, one.of, one.criterion): one for one in assessed.margins}
    area = WIDTH * BASE
    by_hand = {
        "usual": (MU * (WEIGHT - uplift(USUAL, True)) + COHESION * area) / push(USUAL),
        "flood": (MU * (WEIGHT - uplift(FLOOD, True)) + COHESION * area) / push(FLOOD),
        "after": 0.6 * (WEIGHT - uplift(USUAL, False)) / push(USUAL),
    }
    for name, factor in by_hand.items():
        margin = found[name, "base", "factor of safety"]
        assert margin.value == pytest.approx(factor, rel=1e-3), name
        required = COMBINATIONS[name]["required_factor"]
        assert margin.margin == pytest.approx(factor / required, rel=1e-3)
        assert margin.verdict == ("satisfied" if factor >= required else "not satisfied")
    assert [one.combination for one in assessed.margins] == sorted(
        (one.combination for one in assessed.margins), key=list(COMBINATIONS).index
    )
    shaken = romdam.open_result(folder / "out" / "earthquake" / "shake.nc").dataset
    stress = found["earthquake", "dam.ymin", "tension [MPa]"]
    assert stress.value == pytest.approx(
        1e-6 * float(shaken.face_principal_stress.sel(area_percentile=98.0)[0]), rel=1e-9
    )
    assert stress.margin == pytest.approx(3.0 / stress.value) if stress.value > 0 else stress.margin == np.inf
    slip = found["earthquake", "base", "slip left [mm]"]
    assert slip.required == 50.0 and 0.0 <= slip.value < 50.0 and slip.verdict == "satisfied"
    table = list(csv.reader((folder / "out" / "dam-combinations.csv").open()))
    assert len(table) == 1 + len(assessed.margins) and table[1][:4] == [
        "usual",
        "rest",
        "static loads",
        "base",
    ]
    page = (folder / "out" / "dam-combinations.html").read_text()
    assert all(name in page for name in COMBINATIONS) and "joints.base.friction" in page
    # what the result of the earthquake says of itself stands beside the verdicts
    said = [text for _, _, text in assessed.statements]
    assert {(one, record) for one, record, _ in assessed.statements} == {("earthquake", "shake")}
    assert not opening_errors(shaken.attrs)  # the job asks for none
    assert said[0] == "stated error of the openings in L2, at most: unknown"
    assert said[1:] == json.loads(shaken.attrs["run_warnings"])
    assert all(text in html.unescape(page) for text in said)


def test_the_error_that_a_result_states_is_told(tmp_path: Path):
    """Mesh 3 %, modes 0.5 % and steps 0.7 % are 4.2 % at most."""
    attrs = {"record": "r", "run_warnings": '["it slides on"]', "record_dt": 0.01}
    errors = {"mesh": 0.03, "modes": 0.005, "steps": 0.007}
    with pytest.MonkeyPatch.context() as patch:
        opened = SimpleNamespace(dataset=SimpleNamespace(attrs=attrs))
        patch.setattr(pipeline, "open_result", lambda _: contextlib.nullcontext(opened))
        patch.setattr(pipeline, "opening_errors", lambda _: errors)
        said = pipeline._statements("quake", tmp_path)
    assert said == [
        ("quake", "r", "stated error of the openings in L2, at most: 4.2 %"),
        ("quake", "r", "it slides on"),
    ]


@pytest.mark.slow
def test_two_moduli_rest_after_the_earthquake_by_the_sustained_one(folder: Path):
    """The factors of a state at rest do not depend on E, and its joints remember the shaking."""
    raw = job(combinations={name: COMBINATIONS[name] for name in ("usual", "earthquake", "after")})
    raw["materials"]["concrete"]["E_dynamic"] = "32 GPa"
    (folder / "two.yaml").write_text(yaml.safe_dump(raw, sort_keys=False))
    assessed = assess_combinations(folder / "two.yaml", folder / "two")
    factors = {one.combination: one.value for one in assessed.margins if one.criterion == "factor of safety"}
    usual = (MU * (WEIGHT - uplift(USUAL, True)) + COHESION * WIDTH * BASE) / push(USUAL)
    assert factors["usual"] == pytest.approx(usual, rel=1e-3)
    assert factors["after"] == pytest.approx(0.6 * (WEIGHT - uplift(USUAL, False)) / push(USUAL), rel=1e-3)


def test_an_anchor_presses_the_dam_on_its_base(folder: Path):
    """(mu (W - U + T) + c A) / H with a soft tendon of T = 40 MN, straight down into the rock."""
    head, foot = ({"block": name, "at": [5, 12, z]} for name, z in (("dam", 30), ("rock", -8)))
    raw = job(
        anchors={"T": {"head": head, "foot": foot, "stiffness": "1 MN/m", "pretension": "40 MN"}},
        combinations={"usual": {"required_factor": 2.0}},
    )
    (margin,) = assess_combinations(raw, folder / "anchored").margins
    held = MU * (WEIGHT - uplift(USUAL, True) + 40e6) + COHESION * WIDTH * BASE
    assert margin.value == pytest.approx(held / push(USUAL), rel=1e-3)


def test_what_could_not_be_judged_is_not_satisfied(folder: Path, monkeypatch):
    """Joints without shear, faces without a stress, and earthquakes without a result."""
    smooth = job(combinations={"usual": {"required_factor": 2.0}})
    for key in ("friction", "cohesion", "tensile_strength"):
        del smooth["joints"]["base"][key]
    smooth["loads"] = {"gravity": [0, 0, -G]}
    assessed = assess_combinations(smooth, folder / "smooth")
    assert [one.verdict for one in assessed.margins] == ["no joint carries shear"] and not assessed.satisfied
    asked = combinations.Requirement("quake", "earthquake", None, None, 2e6, None)
    verdicts = [asked._of_face("r", "f", value, ring).verdict for value, ring in
                ((1.9e6, 49.0), (1.9e6, 51.0), (2.1e6, 51.0))]  # fmt: skip
    assert verdicts == ["satisfied", "undecided: the ring leaves out most of the face", "not satisfied"]
    assert asked._most("r", "dam.ymin", "tension [MPa]", np.nan, 2.0).verdict == "not found"

    def fails(*_: Any, **__: Any) -> Any:
        raise ConvergenceError("a step does not converge")

    monkeypatch.setattr(pipeline, "_at_rest", lambda *_: [])
    monkeypatch.setattr(pipeline, "run", fails)
    assessed = assess_combinations(job(), folder / "failed")
    assert [(one.combination, one.record, one.verdict) for one in assessed.margins] == [
        ("earthquake", "all records", "not found"),
        ("after", "earthquake", "not found"),
    ]
    assert assessed.failures == {"earthquake, all records": "a step does not converge"}


def test_check_finds_what_is_wrong_in_a_combination(folder: Path):
    wrong = {"a": {"required_factor": 1, "changes": {"loads.hydrostatic.4.level": 3}}}
    (folder / "wrong.yaml").write_text(yaml.safe_dump(job(combinations=wrong)))
    code, _, err = call("check", folder / "wrong.yaml", "--quick")
    assert code == 2 and "combinations.a.changes.loads.hydrostatic.4.level" in err


def test_margins_in_an_earthquake_are_of_the_joints_asked_for_and_of_the_largest_slip(monkeypatch):
    """The largest of a gap, not the mean of the joint; nothing of joints that are not named."""
    joints = [
        SimpleNamespace(joint=name, factor=factor, largest_slip=most, residual_slip=0.5 * most)
        for name, factor, most in (("base", 1.2, 0.03), ("lift", 1.0, 0.09))
    ]
    monkeypatch.setattr(combinations, "sliding", lambda dataset: joints)
    dataset: Any = None
    asked = combinations.Requirement("quake", "earthquake", 1.0, 0.06, None, None)
    rows = [(one.of, one.value, one.margin, one.verdict) for one in asked.shaken(dataset, "r")]
    assert rows == [
        ("base", 1.2, 1.2, "satisfied"),
        ("base", 30.0, 2.0, "satisfied"),
        ("lift", 1.0, 1.0, "slides"),
        ("lift", 90.0, pytest.approx(60.0 / 90.0), "not satisfied"),
    ]
    of_base = replace(asked, joints=("base",)).shaken(dataset, "r")
    assert [one.of for one in of_base] == ["base", "base"]


@pytest.mark.slow
def test_the_command_ends_with_1_where_a_margin_is_not_met(folder: Path):
    (folder / "strict.yaml").write_text(
        yaml.safe_dump(job(combinations={"usual": {"required_factor": 9.0}, "low": {"required_factor": 1.0}}))
    )
    code, said = call("combinations", folder / "strict.yaml", "--out", folder / "strict")[:2]
    assert code == 1 and "not satisfied" in said and "written:" in said
    (folder / "low.yaml").write_text(yaml.safe_dump(job(combinations={"low": {"required_factor": 1.0}})))
    assert call("combinations", folder / "low.yaml", "--out", folder / "low")[0] == 0


def test_a_dam_without_equilibrium_is_a_verdict(folder: Path):
    loose = {"joints.base.friction": 0.05, "joints.base.cohesion": 0, "joints.base.tensile_strength": 0}
    raw = job(combinations={"weak": {"changes": loose, "required_factor": 1.0}})
    assessed = assess_combinations(raw, folder / "weak")
    assert [one.verdict for one in assessed.margins] == ["no equilibrium"] and not assessed.satisfied
    assert "weak, static loads" in assessed.failures


@pytest.mark.parametrize(
    ("combinations", "message"),
    [
        ({"a": {}}, r"combinations.a.*requires nothing"),
        ({"a": {"situation": "after", "required_factor": 1}}, r"combinations.a.*`after` names"),
        ({"a": {"situation": "after", "after": "b", "required_factor": 1}, "b": {"required_factor": 1}},
         r"combinations.a.after: 'b' is no combination of situation: earthquake; there is none"),
        ({"a": {"required_factor": 1}, "A": {"required_factor": 1}}, r"'A' and 'a' are one folder"),
        ({"a": {"largest_slip": 0.1}}, r"`largest_slip` is of what an earthquake leaves"),
        ({"a": {"required_factor": 1, "joints": ["bse"]}}, r"combinations.a.joints.*'bse'.*'base'"),
        ({"a": {"required_factor": 1, "changes": {"loads.hydrostatic.4.level": 3}}},
         r"combinations.a.changes.loads.hydrostatic.4.level.*leads nowhere"),
        ({"a": {"required_factor": 1, "changes": {"joints.base.frction": 0.3}}}, r"frction.*friction"),
        ({"a": {"tension": "1 MPa", "changes": {"outputs.stress": None}}},
         r"combinations.a.tension is of the faces of outputs.stress"),
        ({}, r"combinations is missing; name them"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_refused_before_anything_runs(folder: Path, combinations, message):
    out = folder / "never"
    with pytest.raises(ConfigError, match=message):
        assess_combinations(job(combinations=combinations), out)
    assert not out.exists()
