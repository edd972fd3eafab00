"""Rows of a suite: how much of a joint is open and for how long, and measures of what was analysed."""

import dataclasses

import numpy as np
import pytest

from romdam.core.motion import GroundMotion
from romdam.postprocess.record_measures import analysed, measures_at_scales
from romdam.results.dataset import build_dataset
from romdam.results.renamed import RENAMED
from romdam.results.suite.rows import ROWS

from .conftest import make_case

OPEN, STICK, SLIP = 0, 1, 2


def test_open_durations_tell_one_gap_from_half_of_the_joint():
    """J1 has gaps of 0.5 m2 each, J2 three; rows of 0.05 s: one gap of J2 open in 10, two in 6 of them.

    Half an interval belongs to the first row.
    """
    case = make_case()
    state = np.full((41, 5), STICK, dtype=np.uint8)
    state[:10, 2], state[:6, 3] = OPEN, OPEN
    case = dataclasses.replace(case, history=dataclasses.replace(case.history, state=state))
    np.testing.assert_allclose(ROWS["any_gap_open_duration"].get(case), [0.0, 0.475])
    np.testing.assert_allclose(ROWS["half_open_duration"].get(case), [0.0, 0.275])
    np.testing.assert_allclose(ROWS["mean_open_share"].get(case), [0.0, 16 / 41 / 3])
    j2 = case.scene.joints["J2"]
    wide = dataclasses.replace(j2, share=j2.area * [2.0, 0.0, 0.0])  # the first stands for 3/5 of the joint
    scene = dataclasses.replace(case.scene, joints=case.scene.joints | {"J2": wide})
    case = dataclasses.replace(case, scene=scene)
    np.testing.assert_allclose(ROWS["half_open_duration"].get(case), [0.0, 0.475])
    np.testing.assert_allclose(ROWS["mean_open_share"].get(case), [0.0, (10 * 3 + 6) / 5 / 41])
    assert set(RENAMED.values()) >= {"any_gap_open_duration", "any_gap_sliding_duration"}


def test_mean_compression_is_that_of_the_result_and_comes_before_the_instants(job, timing):
    """Half of the largest force, over gaps of 0.5 m2."""
    case, names = make_case(), list(ROWS)
    dataset = build_dataset(case, job, timing, None)
    found = ROWS["peak_mean_compressive_stress"].get(case)
    np.testing.assert_array_equal(found, dataset.peak_mean_compressive_stress)
    np.testing.assert_allclose(found[0], -case.history.mean_traction[:, :2, 0].max() / 0.5)
    assert names.index("peak_mean_compressive_stress") < names.index("peak_compressive_stress")
    for name in ("peak_compression", "peak_compressive_stress"):
        assert "at one instant" in ROWS[name].long_name


@pytest.mark.parametrize("name", ["any_gap_open_duration", "half_open_duration", "any_gap_sliding_duration"])
def test_no_duration_is_longer_than_the_run(name):
    """41 rows of 0.05 s are 2 s."""
    case = make_case()
    state = np.full((41, 5), SLIP if "sliding" in name else OPEN, dtype=np.uint8)
    case = dataclasses.replace(case, history=dataclasses.replace(case.history, state=state))
    np.testing.assert_allclose(ROWS[name].get(case), [2.0, 2.0], rtol=1e-12)


@pytest.mark.parametrize(("duration", "pga"), [(None, 3.0), (2.0, 1.0), (9.0, 3.0)])
def test_measures_are_of_what_was_analysed(duration, pga):
    """1 m/s2 for 2 s, then 3 m/s2: Arias intensity pi / 2g int a^2 dt, longest time that of the analysis."""
    acc = np.zeros((3, 401))
    acc[0] = np.where(np.arange(401) * 0.01 <= 2.0, 1.0, 3.0)
    motion = GroundMotion("steps", acc, 0.01, {}, ())
    found = measures_at_scales(analysed(motion, duration), np.array([1.0]), 0.3)
    assert found["pga"] == pga
    assert found["duration"] == pytest.approx(duration or 4.0)
    energy = 2.0 if duration == 2.0 else 2.0 + 2.0 * 9.0
    assert found["arias"] == pytest.approx(np.pi / 2 / 9.80665 * energy, rel=0.02)


def test_energy_that_a_joint_dissipates_is_the_sum_over_its_gaps_at_the_end():
    case = make_case()
    row, energy = ROWS["dissipated_energy"], case.history.dissipated_energy
    assert row.dims == ("joint",) and row.units == "J"
    np.testing.assert_allclose(row.get(case), [energy[-1, :2].sum(), energy[-1, 2:].sum()], rtol=1e-14)
    assert row.when(case) and not row.when(make_case(joints=False))
