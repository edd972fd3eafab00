"""`romdam stability`: the dam at rest after an earthquake, against equilibrium by hand."""

import itertools

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation
from test_cli import call
from test_initial_state import BOND, G, after, job, motion, pulses, run

import romdam
from romdam.core.errors import ConfigError
from romdam.pipelines.stability import assess_stability
from romdam.postprocess.stability import NO_EQUILIBRIUM, NOT_STABLE, STABLE, _toe_pressure

WEIGHT, PUSH = 2400 * G * 8, 40e3  # [N]
PUSHED = {"force": [{"block": "block", "at": [x, 1, 2], "force": [0, 0.5 * PUSH, 0]} for x in (0, 2)]}
WATER = {"joint_water": [{"joints": ["foot"], "level": "1 m", "downstream": [0, 1, 0], "crack": "redrawn"}]}
UPLIFT = 9810 * 1.0 * 4  # [N], full head over the whole base
RECORD = {"file": "none.txt", "dt": 0.002, "unit": "m/s2", "components": {"y": 1}}


def judged(joint=BOND, changes=(), required=1.3, joints=None, **loads):
    after = {"changes": dict(changes), "required_factor": required}
    section = after | ({"joints": joints} if joints else {})
    return job(joint, **loads) | {"post_earthquake": section, "records": [RECORD]}


@pytest.fixture(scope="module")
def shaken(tmp_path_factory):
    """A block whose bond a pulse breaks as a whole."""
    result = run(judged(**PUSHED), tmp_path_factory.mktemp("shaken"), motion("a", pulses(9.0, 2, 1.2))).paths[
        0
    ]
    with romdam.open_result(result) as opened:
        assert float(opened.dataset.bonded_area[-1, 0]) == 0.0
        assert float(opened.dataset.bonded_area[0, 0]) == pytest.approx(4.0)
    return result


def only(configuration, result):
    assessed = assess_stability(configuration, [result])
    (joint,) = assessed.joints
    return assessed, joint


def test_what_is_left_holds_by_friction_alone(shaken):
    """FS = mu W / H, the resultant where W and H put it: at 1 + H h / W of 2 m."""
    assessed, joint = only(judged(**PUSHED), shaken)
    assert joint.factor == pytest.approx(0.3 * WEIGHT / PUSH, rel=1e-6)
    assert joint.compression == pytest.approx(WEIGHT, rel=1e-6) and joint.shear == pytest.approx(
        PUSH, rel=1e-6
    )
    assert joint.resultant == pytest.approx((1.0 + PUSH * 2.0 / WEIGHT) / 2.0, rel=1e-5)
    assert joint.bonded_share == 0.0 and joint.water == 0.0 and joint.cracked_length == 0.0
    # N acts at 1 - H h / W of 2 m from the toe, in the third of a triangle of pressure
    assert joint.toe_pressure == pytest.approx(
        2.0 * WEIGHT / (3.0 * (1.0 - PUSH * 2.0 / WEIGHT) * 2.0), rel=1e-4
    )
    assert joint.location == "in the middle half, towards the toe"
    assert joint.verdict == STABLE and assessed.is_stable
    with romdam.open_result(shaken) as opened:
        left = opened.dataset.slip.values[-1]
    assert joint.slip == pytest.approx(np.linalg.norm(left.mean(axis=0)), rel=0.2)


def test_residual_friction_decides(shaken):
    """With 0.25 the factor is 1.18: less than 1.3. With 0.2 nothing holds."""
    assessed, joint = only(judged(changes={"joints.foot.friction": 0.25}, **PUSHED), shaken)
    assert joint.factor == pytest.approx(0.25 * WEIGHT / PUSH, rel=1e-6) and joint.factor < 1.3
    assert joint.verdict == NOT_STABLE and not assessed.is_stable
    gone = assess_stability(judged(changes={"joints.foot.friction": 0.2}, **PUSHED), [shaken])
    assert 0.2 * WEIGHT < PUSH and not gone.joints and not gone.is_stable
    assert gone.rows[0][:3] == ("a", "all", NO_EQUILIBRIUM)
    assert "equilibrium" in gone.failures["a"]


def test_water_in_the_damaged_joint(tmp_path):
    """Uplift under the open part: W less what the joint's own pressure says, and the moments of all of it."""
    loads = PUSHED | WATER
    result = run(judged(**loads), tmp_path, motion("a", pulses(9.0, 2, 1.2))).paths[0]
    _, joint = only(judged(changes={"loads.joint_water.0.earthquake": "full"}, **loads), result)
    assert joint.water > 0.0
    assert joint.compression == pytest.approx(WEIGHT - joint.water, rel=1e-6)
    assert joint.factor == pytest.approx(0.3 * (WEIGHT - joint.water) / PUSH, rel=1e-6)
    # without a crack the head falls linearly to nothing at the toe: half of the full uplift
    assert joint.water >= UPLIFT / 2 * (1 - 1e-9)
    if joint.open_share == 0.0:
        assert joint.water == pytest.approx(UPLIFT / 2, rel=1e-9)
        moment = WEIGHT * 1.0 + PUSH * 2.0 - joint.water * 2.0 / 3.0
        assert joint.resultant == pytest.approx(moment / joint.compression / 2.0, rel=1e-3)


def test_a_model_at_full_order_or_with_automatic_modes_judges_the_same(shaken):
    few = only(judged(**PUSHED), shaken)[1]
    automatic = judged(**PUSHED) | {"model": {"modes": "auto"}, "transient": {"accuracy": "1 %"}}
    full = judged(order="full", **PUSHED)
    for configuration in (automatic, full):
        joint = only(configuration, shaken)[1]
        assert joint.factor == pytest.approx(few.factor, rel=1e-9)
        assert joint.resultant == pytest.approx(few.resultant, rel=1e-6)


def columns(folder, turn, **loads):
    """A block of 2 by 1 by 2 m on a base of 2 by 2 by 2 m, turned with weight and push."""
    lines, first = ["*NODE"], {}
    for name, size, lowest in (("BASE", (2, 2, 2), (0, 0, -2)), ("BLOCK", (2, 1, 2), (0, 1, 0))):
        corners = list(
            itertools.product(*(range(low, low + n + 1) for low, n in zip(lowest, size, strict=True)))
        )
        number = {corner: len(lines) + i for i, corner in enumerate(corners)}
        lines += [
            f"{number[c]}, " + ", ".join(f"{x:.17g}" for x in turn @ np.array(c, float)) for c in corners
        ]
        first[name] = (
            number,
            list(itertools.product(*(range(a, a + n) for a, n in zip(lowest, size, strict=True)))),
        )
    element = itertools.count(1)
    for name, (number, cubes) in first.items():
        lines.append(f"*ELEMENT, TYPE=C3D8, ELSET={name}")
        for x, y, z in cubes:
            nodes = [
                number[x + a, y + b, z + up] for up in (0, 1) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))
            ]
            lines.append(", ".join(map(str, [next(element), *nodes])))
    foot = [number for corner, number in first["BASE"][0].items() if corner[2] == -2]
    lines += ["*NSET, NSET=FOOT", ", ".join(map(str, foot))]
    (folder / "columns.inp").write_text("\n".join(lines) + "\n")
    mesh = {"file": str(folder / "columns.inp"), "unit": "m"}
    push = [
        {
            "block": "block",
            "at": (turn @ [x, 1.0, 2.0]).tolist(),
            "force": (turn @ [0, 0.25 * PUSH, 0]).tolist(),
        }
        for x in (0.0, 2.0)
    ]
    raw = judged(changes={"joints.foot.friction": 0.28})
    raw["blocks"] = {
        name: {"material": "concrete", "mesh": mesh | {"group": name.upper()}} for name in ("base", "block")
    }
    raw["supports"] = [{"block": "base", "face": "FOOT"}]
    raw["loads"] = {"gravity": (turn @ [0.0, 0.0, -G]).tolist(), "force": push} | loads
    raw["transient"] |= {"finest_step": "1 ms"}
    del raw["outputs"]["nodes"]
    return raw


TURNS = {
    "about the vertical, with water": (
        37.0 * np.array([0.0, 0.0, 1.0]),
        {"level": "1 m", "crack": "redrawn"},
    ),
    "about a skew axis": (50.0 * np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0), None),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", TURNS)
def test_a_turned_model_goes_on_and_is_judged_as_before(name, tmp_path):
    """What joints remember of an earthquake (`take: joints`), and the verdict on it, turn with the model."""
    vector, water = TURNS[name]
    shaken = np.pad(pulses(9.0, 2, 0.8), ((0, 0), (0, 300)))
    shaken[0], second = 0.4 * shaken[1], pulses(-5.0, 1, 0.5)
    seen = []
    for turn in (np.eye(3), Rotation.from_rotvec(np.radians(vector)).as_matrix()):
        loads = {}
        if water is not None:
            downstream = (turn @ [0.0, 1.0, 0.0]).tolist()
            loads["joint_water"] = [{"joints": ["foot"], "downstream": downstream} | water]
        folder = tmp_path / str(len(seen))
        folder.mkdir()
        raw = columns(folder, turn, **loads)
        result = run(raw, folder / "a", motion("a", turn @ shaken)).paths[0]
        again = run(after(raw, result, "joints"), folder / "b", motion("b", turn @ second)).results[0]
        _, joint = only(raw, result)
        seen.append((again.dataset.load(), joint))
    (straight, one), (turned, other) = seen
    for variable in ("opening", "slip", "normal_force"):
        a, b = straight[variable].values, turned[variable].values
        a, b = (np.linalg.norm(x, axis=-1) if variable == "slip" else x for x in (a, b))
        assert np.abs(a - b).max() <= 1e-6 * np.abs(a).max() > 0.0, variable
    assert one.verdict == other.verdict
    for quantity in ("factor", "compression", "shear", "water", "slip", "bonded_share", "open_share"):
        assert getattr(other, quantity) == pytest.approx(getattr(one, quantity), rel=1e-6, abs=1e-9), quantity
    assert other.resultant == pytest.approx(one.resultant, rel=1e-6), "resultant"
    assert one.bonded_share < 1.0
    assert one.shear == pytest.approx(0.5 * PUSH, rel=1e-6) and one.slip > 1e-3


def test_command_table_and_exit_code(shaken, tmp_path):
    zeros = tmp_path / "zeros.txt"
    np.savetxt(zeros, np.zeros(10))
    record = {"file": str(zeros), "dt": 0.01, "unit": "m/s2", "components": {"y": 1}}
    for required, code in ((1.3, 0), (1.5, 1)):
        path = tmp_path / "dam.yaml"
        path.write_text(yaml.safe_dump(judged(required=required, **PUSHED) | {"records": [record]}))
        found, out, err = call("stability", path, shaken, "--out", tmp_path / "out")
        assert found == code, err
        assert (STABLE in out) and ("foot" in out) and "Traceback" not in err
        rows = (tmp_path / "out" / "dam-stability.csv").read_text().splitlines()
        assert len(rows) == 2 and rows[1].split(",")[2] == (NOT_STABLE if code else STABLE)


WRONG = {
    "no section": (job(BOND) | {"records": [RECORD]}, "post_earthquake is missing"),
    "a joint": (judged(joints=["sole"]), "post_earthquake.joints: no 'sole' is defined"),
    "a path": (judged(changes={"loads.force.3.at": [0, 0, 0]}, **PUSHED), "leads nowhere"),
    "a value": (judged(changes={"joints.foot.friction": -1}, **PUSHED), "post_earthquake.changes"),
    "other gaps": (judged(BOND | {"spacing": "1.5 m"}), "has 9 gaps, and"),
}


@pytest.mark.parametrize(("configuration", "told"), WRONG.values(), ids=WRONG)
def test_wrong_jobs_are_refused(configuration, told, shaken, tmp_path):
    with pytest.raises(ConfigError, match=told):
        assess_stability(configuration, [shaken], tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_check_refuses_changes_that_lead_nowhere(tmp_path):
    np.savetxt(tmp_path / "b.txt", pulses(1.0, 1, 0.4)[1])
    record = {"file": str(tmp_path / "b.txt"), "dt": 0.002, "unit": "m/s2", "components": {"y": 1}}
    with pytest.raises(ConfigError, match=r"post_earthquake\.changes\.loads\.force\.3\.at"):
        romdam.check(judged(changes={"loads.force.3.at": [0, 0, 0]}, **PUSHED) | {"records": [record]})


def test_pressure_at_the_toe_beyond_the_kern_is_that_of_a_triangle():
    """N acts in the third of what is pressed: at 0.8 of the base over 0.6 of it, with 2 N / (0.6 A)."""
    assert _toe_pressure(1.0, 0.8) == pytest.approx(2.0 / 0.6, rel=1e-12)
    assert _toe_pressure(1.0, 2.0 / 3.0) == pytest.approx(2.0, rel=1e-9)
    assert _toe_pressure(1.0, 0.5) == 1.0 and _toe_pressure(1.0, 0.2) == 0.0
    assert np.isnan(_toe_pressure(1.0, 1.1))


@pytest.mark.slow
def test_a_job_with_a_linear_stage_and_runs_of_a_suite_are_judged(tmp_path):
    """The linear stage ties joints, and is left out; a sample has its own friction, here 0.5 of 0.3."""
    np.savetxt(tmp_path / "r.txt", 0.01 * np.sin(np.linspace(0.0, 12.0, 40)))
    record = RECORD | {"file": str(tmp_path / "r.txt"), "name": "r"}
    raw = judged({**BOND, "friction": 0.3}, **PUSHED) | {"records": [record]}
    raw["outputs"] = raw["outputs"] | {"mesh_error": False}
    staged = raw | {"linear_stage": {}}
    (tmp_path / "staged.yaml").write_text(yaml.safe_dump(staged))
    (result,) = romdam.run(romdam.load_config(tmp_path / "staged.yaml"), tmp_path / "staged").paths
    (joint,) = assess_stability(romdam.load_config(tmp_path / "staged.yaml"), [result]).joints
    suite = {"keep": "full", "parameters": {"mu": {"path": "joints.foot.friction", "values": [0.3, 0.5]}}}
    (tmp_path / "suite.yaml").write_text(yaml.safe_dump(raw | {"pipeline": "suite", "suite": suite}))
    job = romdam.load_config(tmp_path / "suite.yaml")
    romdam.run_suite(job, tmp_path / "suite", romdam.SuiteOptions(workers=1))
    kept = sorted((tmp_path / "suite" / "runs").glob("*.nc"))
    factors = sorted(assess_stability(job, [path]).joints[0].factor for path in kept)
    assert len(kept) == 2 and factors[0] == pytest.approx(joint.factor, rel=1e-5)
    # the bond holds cohesion times area besides
    assert factors[1] - factors[0] == pytest.approx((0.5 - 0.3) * WEIGHT / PUSH, rel=1e-5)
