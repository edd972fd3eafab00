"""Two runs side by side, on numbers worked by hand."""

import numpy as np
import pytest

from romdam.core.errors import ResultError
from romdam.error.comparison import (
    Openings,
    compare_openings,
    read_reference,
)
from romdam.error.metrics import opening_peak
from romdam.error.verification import VerifiedRun, against_reference

POSITION = np.array([[0.0, 0, 0], [0, 0, 1], [0, 0, 2]])
TIME = np.arange(5) * 0.1
NAMES = ("a", "b")


def openings(values: np.ndarray, time=TIME, position=POSITION) -> Openings:
    return Openings(time, values, position)


def test_errors_by_hand():
    reference = np.zeros((5, 3))
    reference[2] = [3.0, 0.0, 4.0]  # norm 5, peak 4
    computed = reference.copy()
    computed[2, 2] = 4.4
    computed[3, 1] = 0.3
    found = compare_openings(openings(computed), openings(reference), NAMES)
    assert found.error.peak == pytest.approx(0.1)
    assert found.error.l2 == pytest.approx(np.hypot(0.4, 0.3) / 5.0)
    assert found.seconds == pytest.approx(0.4)


def test_peaks_of_joints_that_do_not_open_are_compared_by_their_closure():
    """No division by the zero of a joint that begins at rest and only closes, and no nan."""
    better = np.array([[0.0, 0.0], [-4.0, -2.0]])
    assert opening_peak(better - 0.1, better) == pytest.approx(0.1 / 4.0)
    assert opening_peak(better + 0.1, better) == pytest.approx(0.1 / 4.0)
    assert opening_peak(np.zeros((2, 2)), np.zeros((2, 2))) == 0.0
    closing = np.outer([0.0, 1.0, 1.0, 1.0, 1.0], np.ones(3))
    found = compare_openings(openings(-closing), openings(-2.0 * closing), NAMES)
    assert found.error.peak == 0.0 and found.error.l2 == pytest.approx(0.5)


def test_gaps_are_matched_by_position_and_times_by_value():
    reference = np.random.default_rng(0).normal(size=(5, 3))
    order = [2, 0, 1]
    shuffled = openings(reference[::2][:, order], TIME[::2], POSITION[order])
    assert compare_openings(openings(reference), shuffled, NAMES).error.l2 < 1e-15


def test_gaps_or_times_that_do_not_match_are_refused():
    values = np.ones((5, 3))
    with pytest.raises(ResultError, match="not at the places"):
        compare_openings(openings(values), openings(values, position=POSITION + 0.5), NAMES)
    with pytest.raises(ResultError, match="fewer than two times"):
        compare_openings(openings(values), openings(values, time=TIME + 0.05), NAMES)
    with pytest.raises(ResultError, match="nothing to compare"):
        compare_openings(openings(values), openings(0 * values), NAMES)


def test_reference_with_positions_of_its_own_or_beside_it(tmp_path):
    np.savez(tmp_path / "own.npz", time=TIME, gap=np.ones((5, 3)), position=POSITION)
    np.savez(tmp_path / "bare.npz", time=TIME, gap=np.ones((5, 3)))
    np.testing.assert_array_equal(read_reference(tmp_path / "own.npz").position, POSITION)
    with pytest.raises(ResultError, match=r"bare\.npz: is no reference"):
        read_reference(tmp_path / "bare.npz")
    np.savez(tmp_path / "model.npz", points=POSITION[::-1], pairs=np.array([[2, 0], [1, 0], [0, 0]]))
    np.testing.assert_array_equal(read_reference(tmp_path / "bare.npz").position, POSITION)


def test_both_runs_are_compared_with_a_stored_one():
    stored = openings(np.array([[0.0, 0.0, 0.0]] * 4 + [[3.0, 0.0, 4.0]]))
    reduced, full = (
        VerifiedRun(history=None, openings=openings(factor * stored.opening), stress=None)
        for factor in (1.2, 1.1)
    )
    found = against_reference(reduced, full, stored, "stored.npz")
    assert found["reduced_against_reference"] == pytest.approx(
        {"peak": 4.8, "peak_reference": 4.0, "peak_error": 0.2, "l2_error": 0.2, "seconds": 0.4}
    )
    assert found["full_against_reference"]["l2_error"] == pytest.approx(0.1)


def test_gaps_of_joints_that_meet_are_told_apart_by_their_order():
    """Two gaps at one place: no pairing by position knows them, and the runs have them in one order."""
    position = np.array([[0.0, 0, 0], [0, 0, 0], [0, 0, 2]])
    reference = np.tile([3.0, 4.0, 0.0], (5, 1))
    found = compare_openings(*(openings(reference, position=position) for _ in range(2)), NAMES)
    assert found.error.l2 == 0.0
    with pytest.raises(ResultError):  # in another order nothing tells them apart
        moved = openings(reference, position=position[::-1])
        compare_openings(openings(reference, position=position), moved, NAMES)
