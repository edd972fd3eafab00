"""What is computed from results, worked out on paper: areas, scales and numbers of records are unlike."""

import numpy as np
import pytest
import xarray as xr

from romdam.core.motion import GroundMotion
from romdam.core.scene import Section
from romdam.postprocess.dependence import correlation
from romdam.postprocess.floor_spectra import _spline_slopes
from romdam.postprocess.fragility import product_limit
from romdam.postprocess.lognormal import Observations
from romdam.postprocess.maxima import maxima
from romdam.postprocess.record_curves import record_curves
from romdam.postprocess.record_measures import measures_at_scales
from romdam.postprocess.responses import Curve
from romdam.postprocess.sliding import row_seconds, sliding
from romdam.postprocess.stability import joint_stability
from romdam.postprocess.stress.sections import gap_section_forces, linearised_stress
from romdam.postprocess.stress.summary import principal_stresses, stress_along


def joint_of_three():
    """Gaps of 1, 2 and 1 m2 at x = 0, 1 and 3 m on a level joint; the last is 4 mm along y after 1 s."""
    time = np.array([0.0, 0.5, 1.0, 1.5, 2.0])
    slip = np.zeros((5, 3, 2))
    slip[2:, 2, 1] = 4e-3
    zeros = np.zeros((5, 3))
    over = ("time", "gap")
    axes = np.tile(np.eye(3)[[2, 0, 1]], (3, 1, 1))  # k is y
    moved = np.zeros((5, 1, 3))
    moved[2:, 0, 1] = 1e-3
    data = {
        "opening": (over, zeros),
        "slip": (("time", "gap", "tangent"), slip),
        "joint_state": (over, np.array([[1, 1, 1], [1, 2, 1], [2, 2, 2], [2, 2, 0], [0, 0, 0]])),
        "joint_displacement": (("time", "joint", "component"), moved),
        "joint_shear_strength": (("time", "joint", "tangent"), np.full((5, 1, 2), 5.0)),
        "sliding_safety_factor": (("time", "joint"), np.array([[3.0], [2.0], [1.0], [1.0], [np.nan]])),
    }
    coords = {
        "time": time,
        "joint": ["base"],
        "joint_blocks": (("joint", "side"), [["rock", "dam"]]),
        "gap_joint": ("gap", ["base"] * 3),
        "gap_area": ("gap", [1.0, 2.0, 1.0]),
        "gap_position": (("gap", "component"), [[0.0, 0, 0], [1, 0, 0], [3, 0, 0]]),
        "gap_normal": (("gap", "component"), axes[:, 0]),
        "gap_tangent": (("gap", "tangent", "component"), axes[:, 1:]),
    }
    return xr.Dataset(data, coords)


def test_sliding_of_a_joint_whose_gaps_have_unlike_areas():
    """Weights 1, 2, 1 at -1.25, -0.25, 1.75 m of the middle: the mean of 0, 0, 4 is 1, the slope 7 / 4.75."""
    (found,) = sliding(joint_of_three())
    np.testing.assert_allclose(found.residual, [0, 1e-3, 0], atol=1e-15)
    assert found.rotation == pytest.approx(7e-3 / 4.75, rel=1e-9)
    assert found.residual_slip == pytest.approx(1e-3) and found.largest_slip == pytest.approx(4e-3)
    assert (found.factor, found.factor_time) == (1.0, 1.0)
    assert found.sliding_time == pytest.approx(1.0)  # rows 2 and 3; in row 1 a gap sticks
    assert found.open_time == pytest.approx(0.25)  # the last row stands for half an interval
    assert found.cumulative_slip == pytest.approx(1e-3)
    assert found.blocks == ("rock", "dam") and found.verdict == "slides, opens wholly"


def test_rows_stand_for_half_of_the_intervals_beside_them():
    np.testing.assert_allclose(row_seconds(np.array([0.0, 0.2, 0.6, 1.6])), [0.1, 0.3, 0.7, 0.5])


def test_correlation_of_four_records():
    """ln y = 0, 1, 1, 2 over ln x = 0 to 3: slope 0.6, left 0.2 with 4 - 2 degrees; ranks 1, 2.5, 2.5, 4."""
    dims = ("record", "scale", "sample")
    peak = np.exp([0.0, 1.0, 1.0, 2.0]).reshape(4, 1, 1)
    summary = xr.Dataset(
        {
            "peak_opening": (dims, peak),
            "record_pga": (("record", "scale"), np.exp(np.arange(4.0))[:, None]),
            "scale_factor": (("record", "scale"), np.ones((4, 1))),
        },
        {"scale": [2.0], "record": list("abcd"), "sample": [0]},
    )
    found = correlation(summary, "peak_opening").sel(measure="pga")
    assert float(found.slope) == pytest.approx(0.6) and float(found.dispersion) == pytest.approx(0.1**0.5)
    assert float(found.pearson) == pytest.approx(3 / (5 * 2) ** 0.5)
    assert float(found.spearman) == pytest.approx(4.5 / (5 * 4.5) ** 0.5)


def test_a_record_cut_off_at_a_capacity_counts_there():
    """1 of 3 at the first; of the last two, one is cut off at the second: 1 - 2/3 1/2."""
    seen = Observations(np.array([0.0, 1.0]), np.zeros(0), np.array([1.0]))
    np.testing.assert_allclose(product_limit(seen), [[1.0, 1 / 3, 1], [np.e, 2 / 3, 1]])


def test_measures_grow_with_the_scale():
    """1 m/s2 for 2 s and then nothing; the Arias intensity grows with the square, durations do not grow."""
    acc = np.zeros((3, 401))
    acc[1, :201] = 1.0
    once = measures_at_scales(GroundMotion("m", acc, 0.01, {}, ()), np.array([1.0]), 0.5)
    found = measures_at_scales(GroundMotion("m", acc, 0.01, {}, ()), np.array([1.0, 3.0]), 0.5)
    factor = {name: values[1] / once[name][0] for name, values in found.items()}
    power = {
        "pga": 3,
        "pgv": 3,
        "pgd": 3,
        "arias": 9,
        "cav": 3,
        "d5_75": 1,
        "d5_95": 1,
        "duration": 1,
        "dt": 1,
    }
    assert factor == pytest.approx(power | {"sa": 3}, rel=1e-12)


def test_smoothed_amplitude_is_a_root_mean_square():
    """White noise of which every band of many lines has the root mean square of its lines."""
    acc = np.zeros((3, 2**15))
    acc[0] = np.random.default_rng(1).normal(size=2**15)
    curves = record_curves(GroundMotion("m", acc, 0.01, {}, ()), 0)
    lines = np.abs(np.fft.rfft(acc[0])) * 0.01
    freq = np.fft.rfftfreq(2**15, 0.01)
    edges = np.geomspace(max(freq[1], 0.01), freq[-1], 301)
    k = int(np.argmin(np.abs(curves.freq - 30.0)))
    lower = np.flatnonzero(edges <= curves.freq[k])[-1]
    inside = (freq >= edges[lower]) & (freq < edges[lower + 1])
    assert inside.sum() > 100
    assert curves.amplitude[k] == pytest.approx((lines[inside] ** 2).mean() ** 0.5, rel=1e-9)
    assert curves.amplitude[k] > 1.05 * lines[inside].mean(), "of Rayleigh's distribution 1.13 times the mean"


def test_curves_between_and_at_their_points():
    """Linear in logarithms: sqrt(2 8) = 4 at sqrt(1 4) = 2; 4 is exceeded there first."""
    curve = Curve(np.array([1.0, 4.0, 16.0]), np.array([2.0, 8.0, 8.0]))
    np.testing.assert_allclose(curve.at(np.array([0.5, 2.0, 8.0])), [np.nan, 4.0, 8.0])
    assert curve.reaches(4.0) == pytest.approx(2.0)


def test_overstressed_part_of_a_face_is_that_above_the_strength():
    """1.5 of 6 m2 exceed the strength itself, 0.5 m2 twice that."""
    node, level = ("stress_node",), ("stress_node", "dcr_level")
    dataset = xr.Dataset(
        {
            "demand_capacity_ratio": (node, [1.2], {"units": "1"}),
            "cumulative_inelastic_duration": (level, [[0.3, 0.1]], {"units": "s"}),
            "overstressed_area": (("stress_face", "dcr_level"), [[1.5, 0.5]]),
            "stress_face_area": (("stress_face",), [6.0]),
        },
        {
            "joint": ("joint", np.zeros(0, dtype=str)), "section": ("section", np.zeros(0, dtype=str)),
            "stress_face": ["top"], "dcr_level": [1.0, 2.0], "stress_block": (node, ["dam"]),
            "stress_position": (("stress_node", "component"), [[1.0, 2.0, 3.0]]),
        },
    )  # fmt: skip
    found = {row.quantity: row.value for row in maxima(dataset)}
    assert found["overstressed part of the face, with the ring"] == pytest.approx(25.0)
    assert found["demand-capacity ratio"] == 1.2 and found["cumulative inelastic duration"] == 0.3


def test_stress_along_a_direction():
    """d = (1, 2, 2)/3 of xx 9, yy 18, zz 27, xy 4.5, yz 9, xz 18: (9 + 72 + 108 + 2 (9 + 36 + 36)) / 9."""
    stress = np.array([9.0, 18, 27, 4.5, 9, 18])
    assert stress_along(stress, np.array([1.0, 2, 2]) / 3.0) == pytest.approx((189 + 162) / 9)


def test_linear_stress_on_a_section_with_turned_axes():
    """J = [[2, 1], [1, 3]], M = (6, 12): k = (-42, 24) / 5; N / A = 2."""
    sides = np.array([[0.0, 1, 0], [0, 0, 2], [0, -2, 0], [0, 0, -1]])
    section = Section("s", {}, {}, np.eye(3), np.zeros(3), 4.0, np.array([[2.0, 1], [1, 3]]), sides)
    found = linearised_stress(section, np.array([[8.0, 1, 2, 3, 6, 12]]))
    np.testing.assert_allclose(found, [[2 - 8.4, 2 + 9.6, 2 + 16.8, 2 - 4.8]])


def test_forces_in_gaps_have_a_share_in_those_on_a_section():
    """Contact (2, 1) and water 3 along the normal, through [1 10; ...]."""
    operator = np.zeros((6, 2))
    operator[0], operator[4] = [1.0, 10.0], [0.5, 0.0]
    contact, water = np.array([[[2.0, 1.0]]]), [np.array([[3.0]]), np.zeros(0)]
    np.testing.assert_allclose(gap_section_forces(operator, contact, water), [[[15, 0, 0, 0, 2.5, 0]]])


def test_slopes_of_a_spline_are_those_of_its_cubic():
    """A cubic is its own spline, whatever its slopes at the ends."""
    t = 0.25 * np.arange(7)
    values = np.stack([2.0 * t**3 - t**2 + 5.0, -(t**3) + 4.0 * t], axis=1)
    slopes = np.stack([6.0 * t**2 - 2.0 * t, -3.0 * t**2 + 4.0], axis=1)
    assert _spline_slopes(values, slopes[[0, -1]], 0.25) == pytest.approx(slopes, rel=1e-12, abs=1e-12)
    assert np.abs(slopes[0] - slopes[-1]).min() > 1.0


def two_joints_on_rock():
    """A dam of two blocks on rock: block J of joint `foot`, block I of `side`; a joint between them.

    Gaps of the foot at x = 0, 1 and 4 m with unlike areas, normals that lean by unlike angles and forces.
    """
    lean = np.array([[0.6, 0.0, 0.8], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    tangent = np.tile(np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), (5, 1, 1))
    of_gap = ["foot", "foot", "foot", "side", "between"]
    names = ["foot", "side", "between"]
    over_gap, over_joint = ("time", "gap"), ("time", "joint")
    shear = np.array([[-3e6, 0], [-1e6, 0], [-2e6, 0], [1e6, 4e6], [0, 7e6]])
    slip = np.array([[2e-3, 0], [0, 0], [4e-3, 0], [0, 5e-3], [0, 0]])
    data = {
        "normal_force": (over_gap, [[0.0, -6e6, -2e6, -5e6, -1e6]]),
        "shear_force": (("time", "gap", "tangent"), shear[None]),
        "joint_state": (over_gap, [[0, 1, 1, 1, 1]]),
        "slip": (("time", "gap", "tangent"), slip[None]),
        "sliding_safety_factor": (over_joint, [[1.5, 2.5, np.nan]]),
        "joint_shear_strength": (("time", "joint", "tangent"), [[[9e6, 12e6], [8e6, 7e6], [1e6, 1e6]]]),
        "bonded_area": (over_joint, [[1.0, 3.0, 0.0]]),
        "joint_water_force": ((*over_joint, "component"), [[[3e5, 0, 1.4e6], [0, 0, 2e6], [0, 0, 0]]]),
        # contact, shear and water on block J
        "joint_force": (
            (*over_joint, "component"),
            [[[-6e6 + 3e5, 0, 8e6 + 1.4e6], [1e6, 4e6, -5e6 + 2e6], [0, 7e6 + 1e6, 0]]],
        ),
    }
    coords = {
        "time": [0.0],
        "joint": names,
        "gap_joint": ("gap", of_gap),
        "gap_area": ("gap", [8.0, 1.0, 3.0, 4.0, 9.0]),
        "gap_position": (
            ("gap", "component"),
            np.array([[0, 0, 0], [1, 0, 0], [4, 0, 0], [0, 9, 5], [2, 2, 2]]),
        ),
        "gap_normal": (("gap", "component"), lean),
        "gap_tangent": (("gap", "tangent", "component"), tangent),
        "joint_blocks": (("joint", "side"), [["rock", "a"], ["b", "rock"], ["a", "b"]]),
    }
    return xr.Dataset(data, coords, {"rock_blocks": '["rock"]'})


def test_stability_of_joints_and_of_what_slides_as_one():
    """The foot's (-6, 8) MN along x and z, on a plane whose mean normal is along (4.8, 10.4), hold block a.

    It would slide along +x: heel at 0, toe at 4 m. Both joints together: the foot's shear less (1, 4) MN
    along x and y, strengths 9 and 7 MN; means by area.
    """
    lean = np.array([4.8, 0.0, 10.4]) / np.hypot(4.8, 10.4)
    force = np.array([-6e6, 0.0, 8e6])
    whole = float(force @ lean)
    across = force - whole * lean
    judged = {joint.joint: joint for joint in joint_stability(two_joints_on_rock(), "r", 1.6, None)}
    assert [*judged] == ["foot", "side", "between", "foot + side"]
    foot, side, both = judged["foot"], judged["side"], judged["foot + side"]
    assert foot.shear == pytest.approx(np.linalg.norm(across)) and foot.verdict == "not stable"
    assert foot.compression == pytest.approx(whole)
    assert foot.resultant == pytest.approx((6.0 * 1.0 + 2.0 * 4.0) / 8.0 / 4.0)
    assert foot.toe_pressure == pytest.approx(
        whole / 12.0 * (1.0 + 6.0 * (14.0 / 32.0 - 0.5))
    )  # N/A (1 + 6 e/L)
    assert foot.open_share == pytest.approx(8.0 / 12.0) and foot.cracked_length == pytest.approx(
        4.0 * lean[2] * 8.0 / 12.0
    )
    assert foot.water == pytest.approx(1e6 * np.hypot(0.3, 1.4))
    assert foot.slip == pytest.approx((8.0 * 2e-3 + 3.0 * 4e-3) / 12.0) and foot.bonded_share == 1.0 / 12.0
    assert side.slip == 5e-3 and side.bonded_share == 0.75 and side.verdict == "stable"
    both_across = float(np.linalg.norm(across - np.array([1e6, 4e6, 0.0])))
    assert both.shear == pytest.approx(both_across)
    assert both.factor == pytest.approx(16e6 / both_across)
    assert both.compression == pytest.approx(whole + 5e6) and both.water == pytest.approx(foot.water + 2e6)
    assert both.open_share == pytest.approx(8.0 / 16.0) and both.bonded_share == pytest.approx(4.0 / 16.0)
    assert both.slip == pytest.approx((12.0 * foot.slip + 4.0 * 5e-3) / 16.0)


def test_normals_count_by_their_areas():
    """Of 8 m2 that lean down by 0.8 and 4 m2 that look up: block I stands on block J, and slides along -x.

    The gaps press by 10, 1 and 1 MN: with the shear (0, -6) MN along x and z on block J.
    """
    dataset = two_joints_on_rock()
    normal, pressed = dataset.gap_normal.values.copy(), dataset.normal_force.values.copy()
    normal[0], pressed[0, :3] = (0.6, 0.0, -0.8), (-10e6, -1e6, -1e6)
    force = dataset.joint_force.values.copy()
    force[0, 0] = dataset.joint_water_force.values[0, 0] + np.array([0.0, 0.0, -6e6])
    dataset = dataset.assign_coords(gap_normal=(("gap", "component"), normal))
    dataset = dataset.assign(
        normal_force=dataset.normal_force.copy(data=pressed), joint_force=dataset.joint_force.copy(data=force)
    )
    foot = joint_stability(dataset, "r", 1.0, ["foot"])[0]
    assert foot.resultant == pytest.approx(1.0 - (1.0 * 1.0 + 1.0 * 4.0) / 12.0 / 4.0)


def test_principal_stresses_are_the_eigenvalues_of_the_tensor():
    """Of tensors without a zero component: LAPACK's."""
    tensors = np.random.default_rng(4).normal(size=(20, 3, 3))
    tensors += tensors.transpose(0, 2, 1)
    components = tensors[:, [0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]]
    expected = np.linalg.eigvalsh(tensors)[:, ::-1]
    np.testing.assert_allclose(principal_stresses(components), expected, rtol=1e-7, atol=1e-7)
