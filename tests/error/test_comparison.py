"""Two runs side by side, on numbers worked by hand."""

import numpy as np
import pytest

from romdam.core.errors import ResultError
from romdam.error.comparison import ComparedRun, compare
from romdam.error.histories import read_reference
from romdam.error.metrics import opening_peak
from romdam.error.verification import against_stored

POSITION = np.array([[0.0, 0, 0], [0, 0, 1], [0, 0, 2]])
TIME = np.arange(5) * 0.1


def openings(values: np.ndarray, time=TIME, position=POSITION) -> ComparedRun:
    return ComparedRun(time, values[..., None], position)


def difference(computed: ComparedRun, reference: ComparedRun):
    """The error of the openings, as a verification compares them."""
    return compare("verification", computed, reference).errors["opening"]


def test_errors_by_hand():
    reference = np.zeros((5, 3))
    reference[2] = [3.0, 0.0, 4.0]  # norm 5, peak 4
    computed = reference.copy()
    computed[2, 2] = 4.4
    computed[3, 1] = 0.3
    found = compare("verification", openings(computed), openings(reference))
    assert found.errors["opening"].peak == pytest.approx(0.1)
    assert found.errors["opening"].l2 == pytest.approx(np.hypot(0.4, 0.3) / 5.0)
    assert found.seconds == pytest.approx(0.4)


def test_peaks_of_joints_that_do_not_open_are_compared_by_their_closure():
    """No division by the zero of a joint that begins at rest and only closes, and no nan."""
    better = np.array([[0.0, 0.0], [-4.0, -2.0]])
    assert opening_peak(better - 0.1, better) == pytest.approx(0.1 / 4.0)
    assert opening_peak(better + 0.1, better) == pytest.approx(0.1 / 4.0)
    assert opening_peak(np.zeros((2, 2)), np.zeros((2, 2))) == 0.0
    closing = np.outer([0.0, 1.0, 1.0, 1.0, 1.0], np.ones(3))
    found = difference(openings(-closing), openings(-2.0 * closing))
    assert found.peak == 0.0 and found.l2 == pytest.approx(0.5)


def test_gaps_are_matched_by_position_and_times_by_value():
    reference = np.random.default_rng(0).normal(size=(5, 3))
    order = [2, 0, 1]
    shuffled = openings(reference[::2][:, order], TIME[::2], POSITION[order])
    assert difference(openings(reference), shuffled).l2 < 1e-15


def test_gaps_or_times_that_do_not_match_are_refused():
    values = np.ones((5, 3))
    with pytest.raises(ResultError, match="not at the places"):
        difference(openings(values), openings(values, position=POSITION + 0.5))
    with pytest.raises(ResultError, match="fewer than two times"):
        difference(openings(values), openings(values, time=TIME + 0.05))
    with pytest.raises(ResultError, match="nothing to compare"):
        difference(openings(values), openings(0 * values))


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
    found = against_stored(*(openings(factor * stored.opening) for factor in (1.2, 1.1)), stored)
    assert found["reduced_against_reference"] == pytest.approx(
        {"peak": 4.8, "peak_reference": 4.0, "peak_error": 0.2, "l2_error": 0.2, "seconds": 0.4}
    )
    assert found["full_against_reference"]["l2_error"] == pytest.approx(0.1)


def test_gaps_of_joints_that_meet_are_told_apart_by_their_order():
    """Two gaps at one place: no pairing by position knows them, and the runs have them in one order."""
    position = np.array([[0.0, 0, 0], [0, 0, 0], [0, 0, 2]])
    reference = np.tile([3.0, 4.0, 0.0], (5, 1))
    assert difference(*(openings(reference, position=position) for _ in range(2))).l2 == 0.0
    with pytest.raises(ResultError):  # in another order nothing tells them apart
        moved = openings(reference, position=position[::-1])
        difference(openings(reference, position=position), moved)
