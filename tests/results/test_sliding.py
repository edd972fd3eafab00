"""Factor of safety, table and verdict of sliding: closed forms of a block on a plane, a synthetic result."""

import csv
import json
import re
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from simulating import simulated

from romdam.config import parse_config
from romdam.core.motion import GroundMotion
from romdam.core.system import SLIP
from romdam.postprocess.responses import response_of
from romdam.postprocess.sliding import HEAD, safety_factor, sliding, sliding_rows
from romdam.reduction.synthesis import reduce_scene
from romdam.results.dataset import build_dataset
from romdam.results.sliding import SLIDING_ROWS
from romdam.results.suite.rows import row_values
from romdam.results.table import write_sliding
from romdam.results.variables import Case
from romdam.scene.build import build_scene
from romdam.terminal.tables import sliding_tables

from .conftest import make_case

G, MU, RHO, SIDE, HEIGHT, DT = 9.81, 0.4, 2400.0, 4.0, 1.0, 0.002
WEIGHT = RHO * SIDE**2 * HEIGHT * G


def block(**joint):
    """A block of 4 x 4 x 1 m on held rock of the same, its joint of nine gaps."""
    springs = {"normal_stiffness": 200e9, "shear_stiffness": 100e9, "friction": MU}
    return {
        "materials": {"stiff": {"E": 3e13, "nu": 0.2, "rho": RHO}},
        "blocks": {
            name: {
                "material": "stiff",
                "mass": name == "block",
                "box": {"origin": [0, 0, z], "size": [SIDE, SIDE, HEIGHT], "element_size": [2.0, 2.0, 1.0]},
            }
            for name, z in (("rock", -HEIGHT), ("block", 0.0))
        },
        "supports": [{"block": "rock", "face": "zmin"}],
        "joints": {"base": {"between": ["rock", "block"]} | springs | joint},
        "loads": {"gravity": [0, 0, -G]},
        "records": [{"file": "none.txt", "unit": "m/s2", "dt": 0.01, "components": {"x": 1}}],
        "damping": {"rayleigh": {"alpha": 0.0, "beta": 1e-4}},
        "model": {"modes": 4},
        "transient": {"finest_step": 0.001},
    }


def run(job, timing, acc, integrator="adaptive", along=0, **joint):
    """Result of a block under ground acceleration along x or another axis, as a case and a dataset."""
    import pathlib

    config = parse_config(block(**joint), "s.yaml")
    scene = build_scene(config, pathlib.Path(), "s.yaml")
    ground = np.outer(np.eye(3)[along], acc)
    system = reduce_scene(scene, config.model, config.damping).system
    history = simulated(system, ground, DT, integrator=integrator, initial_state="static")
    case = Case(scene, GroundMotion("pulse", ground, DT, {}, ()), history)
    return case, build_dataset(case, job, timing, None)


def ramp(*corners):
    """Ground acceleration linear between (time, acceleration)."""
    t, a = np.array(corners).T
    return np.interp(np.arange(round(t[-1] / DT) + 1) * DT, t, a)


@pytest.mark.parametrize(
    ("strength", "shear", "factor"),
    [
        ([8.0, 0.0], [4.0, 0.0], 2.0),  # no friction along k, and no shear
        ([8.0, 0.0], [4.0, 1e-15], 2.0),
        ([8.0, np.inf], [4.0, 3.0], 2.0),  # a key holds along k
        ([8.0, np.nan], [4.0, 3.0], 2.0),
        ([np.nan, 6.0], [4.0, 3.0], 2.0),
        ([8.0, 3.0], [4.0, 3.0], 1.0),
        ([10.0, 10.0], [4.0, 3.0], 2.0),
        ([np.nan, 6.0], [4.0, 0.0], np.nan),
        ([0.0, 0.0], [0.0, 0.0], np.nan),
        ([np.nan, np.nan], [4.0, 3.0], np.nan),
    ],
)
def test_directions_that_are_bounded_and_loaded_count(strength, shear, factor):
    found = safety_factor(np.array([strength]), np.array([shear]))
    np.testing.assert_allclose(found, [factor], rtol=1e-12)


@pytest.mark.parametrize(
    "joint", [{"friction": [MU, 0.0]}, {"shear_key": {"depth": 0.05, "directions": ["k"]}}]
)
def test_a_block_that_slides_along_j_alone_slides(job, timing, joint):
    """Along y, the local j of a level base: friction there, nothing or a key along k."""
    acc = ramp((0.0, 0.0), (0.1, 6.0), (0.5, 6.0), (0.6, 0.0), (2.0, 0.0))
    _, ds = run(job, timing, acc, along=1, **joint)
    (one,) = sliding(ds)
    assert abs(abs(ds.gap_tangent.values[0]) - [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]).max() < 1e-12
    assert one.verdict == "slides" and one.sliding_time > 0.3 and one.residual_slip > 0.05
    assert one.factor == pytest.approx(1.0, abs=1e-6)


def test_the_time_of_the_least_factor_is_when_sliding_begins(job, timing):
    """While all gaps slide the factor is 1 to the solver's tolerance; its last digits name no time."""
    _, ds = run(job, timing, ramp((0.0, 0.0), (0.1, 6.0), (0.5, 6.0), (0.6, 0.0), (1.0, 0.0)))
    begin = float(ds.time.values[(ds.joint_state.values == SLIP).all(axis=1).argmax()])
    assert 0.0 < begin < 0.1
    late = ds.time.values >= 0.4
    ds["sliding_safety_factor"] = ds.sliding_safety_factor - 1e-8 * late[:, None]
    (one,) = sliding(ds)
    assert one.factor_time == begin and one.factor == ds.sliding_safety_factor.min()


def test_a_block_that_holds_has_friction_over_inertia(job, timing):
    """FS = mu W / (m a), at a = 2 m/s2 along x 1.96; it does not slide, and stays where it is."""
    _, ds = run(job, timing, ramp((0.0, 0.0), (0.5, 2.0), (1.0, 2.0), (1.5, 0.0)))
    slow = ds.sel(time=slice(0.7, 0.9))
    assert slow.sliding_safety_factor.values == pytest.approx(MU * G / 2.0, rel=1e-6)
    assert ds.joint_normal_force.values == pytest.approx(-WEIGHT, rel=1e-6)
    assert abs(slow.joint_shear_force).max("tangent").values == pytest.approx(2.0 * WEIGHT / G, rel=1e-6)
    (one,) = sliding(ds)
    assert (one.verdict, one.blocks, one.sliding_time) == ("does not slide", ("rock", "block"), 0.0)
    assert one.factor == pytest.approx(MU * G / 2.0, rel=1e-3)
    assert one.residual_slip <= RHO * HEIGHT * 2.0 / 100e9  # the shear spring's deformation
    assert "bonded_area" not in ds


@pytest.mark.parametrize("rests", [True, False])
def test_a_run_that_ends_while_a_block_slides_says_so(job, timing, rests):
    """The slip (5 - 3.924) t^2 / 2 goes on to the end, from 0.538 to 2.152 m in the last second."""
    corners = (0.0, 0.0), (0.002, 5.0), (1.0, 5.0), (1.002, 0.0), (3.0, 0.0)
    _, ds = run(job, timing, ramp(*corners) if rests else ramp((0.0, 0.0), (0.002, 5.0), (2.0, 5.0)))
    said = [text for text in json.loads(ds.attrs["run_warnings"]) if "still slides" in text]
    assert len(said) == (0 if rests else 1)
    if said:
        left, right = (1e3 * 0.5 * (5.0 - MU * G) * t**2 for t in (1.0, 2.0))
        numbers = re.search(r"its slip there is ([\d.e+]+) to ([\d.e+]+) mm", said[0])
        assert (
            said[0].startswith("joint base still slides in the last 1 s") and "transient.duration" in said[0]
        )
        assert [float(number) for number in numbers.groups()] == pytest.approx([left, right], rel=0.02)


@pytest.mark.parametrize("integrator", ["adaptive", "generalized_alpha"])
def test_cohesion_is_lost_with_the_first_slip(integrator, job, timing):
    """c A + mu N before, mu N for good after: FS at 2 m/s2 is 5.1, then 1.96, and 1 while it slides."""
    cohesion = 0.64 * MU * WEIGHT / SIDE**2 * 2.5  # 1.6 times the friction
    acc = ramp((0.0, 0.0), (0.3, 2.0), (0.6, 2.0), (1.0, 12.0), (1.2, 2.0), (3.0, 2.0))
    case, ds = run(job, timing, acc, integrator, cohesion=cohesion)
    factor = ds.sliding_safety_factor.sel(joint="base")
    assert factor.sel(time=0.5, method="nearest") == pytest.approx(2.6 * MU * G / 2.0, rel=1e-3)
    assert factor.sel(time=2.1, method="nearest") == pytest.approx(MU * G / 2.0, rel=1e-3)
    area = ds.bonded_area.sel(joint="base").values
    assert area[0] == pytest.approx(SIDE**2) and area[-1] == 0.0 and (np.diff(area) <= 0.0).all()
    (one,) = sliding(ds)
    assert one.verdict.startswith("slides") and one.sliding_time > 0.1
    assert one.factor == pytest.approx(1.0, abs=1e-9) and (factor.dropna("time") >= 1.0 - 1e-9).all()
    assert one.residual[0] < 0.0 and abs(one.residual[1]) <= 1e-9  # against the ground's acceleration
    assert one.residual_slip == pytest.approx(one.largest_slip, rel=1e-3)
    assert one.cumulative_slip == pytest.approx(one.residual_slip, rel=0.02)
    values = row_values(case, {})
    assert values["sliding_demand_ratio"] == pytest.approx([1.0 / one.factor])
    assert values["residual_sliding"] == pytest.approx([one.residual_slip])


def test_residual_sliding_leaves_out_what_the_joint_opens():
    """Every gap ends 3 mm open and 4 mm along j: 4 mm of sliding, not 5."""
    case = make_case()
    jump = np.zeros_like(case.history.jump)
    jump[1:] = 3e-3, 4e-3, 0.0
    case = replace(case, history=replace(case.history, jump=jump))
    assert SLIDING_ROWS["residual_sliding"].get(case) == pytest.approx([4e-3, 4e-3], rel=1e-9)


def test_two_coefficients_bound_each_direction(job, timing):
    """mu_k = 0.2 along x, where k points: FS = 0.2 g / a, of the lesser direction."""
    _, ds = run(job, timing, ramp((0.0, 0.0), (0.5, 1.0), (1.0, 1.0)), friction=(0.6, 0.2))
    assert float(ds.sliding_safety_factor[-1, 0]) == pytest.approx(0.2 * G / 1.0, rel=1e-3)
    assert ds.joint_shear_strength.values[-1, 0] == pytest.approx([0.6 * WEIGHT, 0.2 * WEIGHT], rel=1e-6)


def test_a_shear_key_has_no_bound(job, timing):
    _, ds = run(job, timing, ramp((0.0, 0.0), (0.2, 1.0)), shear_key={"depth": 0.1})
    assert ds.sliding_safety_factor.isnull().all() and ds.joint_shear_strength.isnull().all()
    assert sliding(ds)[0].verdict == "carries no shear"


@pytest.mark.parametrize(
    ("strength", "shear", "factor"),
    [
        ([10.0, 10.0], [3.0, 4.0], 2.0),  # the resultant
        ([10.0, 8.0], [5.0, 2.0], 2.0),  # the lesser of 2 and 4
        ([0.0, 0.0], [0.0, 0.0], np.nan),  # open
        ([10.0, 10.0], [0.0, 0.0], np.nan),  # no shear
        ([np.nan, np.nan], [1.0, 0.0], np.nan),  # a shear key
    ],
)
def test_the_factor_of_a_joint(strength, shear, factor):
    assert safety_factor(np.array(strength), np.array(shear)) == pytest.approx(factor, nan_ok=True)


def test_rigid_motion_of_a_joint_is_read_off_its_gaps(job, timing):
    """Gaps in a row displaced by d + r x (x - middle): the table has d and the turn about the normal y."""
    case = make_case()
    ds = build_dataset(case, job, timing, None)
    gaps = ds.gap_joint.values == "J2"
    middle = ds.gap_position.values[gaps].mean(axis=0)
    d, turn = np.array([3e-3, 0.0, -2e-3]), np.array([0.0, 1e-3, 0.0])
    moved = d + np.cross(turn, ds.gap_position.values[gaps] - middle)
    opening, slip = ds.opening.values.copy(), ds.slip.values.copy()
    opening[:, gaps], slip[:, gaps] = 0.0, 0.0
    slip[1:, gaps] = moved[:, [2, 0]]  # the axes j and k are z and x
    ds = ds.assign(opening=ds.opening.copy(data=opening), slip=ds.slip.copy(data=slip))
    one = sliding(ds)[1]
    assert one.residual == pytest.approx(d, abs=1e-15)
    assert one.rotation == pytest.approx(1e-3, rel=1e-9)
    assert one.residual_slip == pytest.approx(np.linalg.norm(d), rel=1e-12)


def test_the_table_is_written(case, job, timing, tmp_path):
    ds = build_dataset(case, job, timing, None)
    rows = sliding_rows(ds)
    assert [row[0] for row in rows] == ["J1", "J2"] and all(len(row) == len(HEAD) for row in rows)
    (path,) = write_sliding(ds, tmp_path, "quake")
    with path.open() as file:
        assert list(csv.reader(file)) == [list(HEAD), *map(list, rows)]
    (table,) = sliding_tables({"quake": ds})
    assert table.row_count == 2
    without = build_dataset(make_case(mu=0.0), job, timing, None)
    assert sliding_tables({"quake": without}) == write_sliding(without, tmp_path, "quake") == []


def test_a_response_of_a_suite_is_that_of_the_worst_joint():
    runs = ("record", "scale", "sample", "joint")
    ratio = xr.DataArray([[[[0.4, 0.7]], [[np.nan, 0.9]]]], dims=runs, attrs={"long_name": "largest shear"})
    found = response_of(xr.Dataset({"sliding_demand_ratio": ratio}), "sliding_demand_ratio")
    assert found.values.ravel() == pytest.approx([0.7, 0.9])
