"""Energy, steps, estimates of the step's error and moving supports, worked out on paper."""

from types import SimpleNamespace

import numpy as np
import pytest

from romdam.core.system import ENERGY_TERMS, History
from romdam.timestepping.energy import ENERGIES, imbalance, ledger
from romdam.timestepping.step_control import error_over_difference, jump_differences
from romdam.timestepping.steps import Steps, cut_steps, grid_steps
from romdam.timestepping.support_motion import add_support_motion


def test_ledger_of_two_rows():
    """Springs hold 4 J at the start. The gaps took 5 J: 2 J are stored, 2 J went in sliding, 1 J is left.

    Kinetic and strain energy rise by 2 J each, damping takes 1 J and the scheme 3 J: with the gaps' 5 J all
    13 J that came in.
    """
    works = np.zeros(2, ENERGIES)
    works[1] = tuple(
        {"input": 13, "damping": 1, "joint_work": -5, "friction": 2}.get(n, 0) for n in ENERGIES.names
    )
    works["stored"] = [4.0, 6.0]
    found = ledger(works, np.array([1.0, 3.0]), np.array([2.0, 4.0]), np.array([0.0, 3.0]))
    assert {name: values[1] for name, values in found.items()} == {
        "input": 13, "kinetic": 3, "strain": 4, "joint_stored": 6, "damping": 1, "friction": 2, "contact": 1,
        "numerical": 3, "residual": 0,
    }  # fmt: skip
    assert set(found) == {*ENERGY_TERMS, "numerical"} and found["contact"][0] == 0.0
    assert imbalance(found | {"residual": np.array([0.0, -2.6])}) == pytest.approx(0.2)  # of 13 J


@pytest.mark.parametrize(
    ("dt", "interval", "base", "stride"),
    [
        (0.01, 0.025, 0.005, 5),  # 2 samples in 5 steps
        (0.01, 0.004, 0.002, 2),
        (0.013, 0.003, 0.001, 3),  # 13 steps a sample, above an eighth of the written row
        (0.01, 0.021, 0.021 / 17, 17),  # 1 ms would be the longest common step, below an eighth of 10 ms
    ],
)
def test_grid_of_a_record_and_its_written_rows(dt, interval, base, stride):
    found = grid_steps(dt, interval)
    assert (found.base, found.stride) == (pytest.approx(base, rel=1e-12), stride)


def test_steps_that_are_cut():
    """10 ms into 0.4 ms are 25: 5 and 5; into 0.45 ms 22.2, the next of 2, 3, 5 is 24: 2, 3 and 4."""
    assert cut_steps(4e-4, 0.01, None).cuts == (5, 5)
    found = cut_steps(4.5e-4, 0.01, None)
    assert found.cuts == (2, 3, 4) and found.finest == pytest.approx(0.01 / 24)
    steps = Steps(0.06, 5, (2, 3))
    assert steps.interval == pytest.approx(0.3) and steps.sizes == pytest.approx([0.06, 0.03, 0.01])


@pytest.mark.parametrize(
    ("order", "coarse", "fine", "factor"),
    [(1, 1, 2, 1.0), (2, 1, 3, 1 / 8), (1, 2, 3, 2.0), (2, 2, 4, 1 / 3)],
)
def test_error_of_the_finer_of_two_runs(order, coarse, fine, factor):
    """e = c h^p: the difference of runs at h and h/2 of first order is twice the finer's error."""
    assert error_over_difference(order, coarse, fine) == pytest.approx(factor, rel=1e-14)


@pytest.mark.parametrize(
    ("opening", "slip", "last", "differences"),
    [
        (0.5, 0.0, 0.0, (0.1, 0.0, 0.0, 0.0)),  # of 3 and 4: 5; the peak is the other row's
        (2.0, 0.0, 0.0, (0.4, 0.25, 0.0, 0.0)),  # 5 for a peak of 4
        (0.0, 0.75, 0.0, (0.0, 0.0, 0.75 / 26**0.5, 0.0)),  # of (3, 4) and (0, 1): sqrt 26
        (0.0, 0.0, 0.1, (0.0, 0.0, 0.1 / 26**0.5, 0.1 / 1.0)),  # 0.1 of the last, 1
    ],
)
@pytest.mark.parametrize("start", [(0.0, 0.0, 0.0), (-200.0, 7.0, 9.0)])
def test_differences_of_two_runs(opening, slip, last, differences, start):
    """Rows (3; 3, 4) and (4; 0, 1) of one gap, from a start to which all is relative: a gap of 200, say."""
    fine = np.array([[[0.0, 0.0, 0.0]], [[3.0, 3.0, 4.0]], [[4.0, 0.0, 1.0]]]) + start
    coarse = fine + np.array([[[0.0, 0.0, 0.0]], [[opening, slip, 0.0]], [[0.0, 0.0, last]]])
    assert jump_differences(coarse, fine) == pytest.approx(differences, rel=1e-12)


def test_slip_that_is_hardly_left_is_measured_by_a_twentieth_of_the_largest():
    """0.001 of 0.05 max(100, 0.01), not of 0.01: 0.001 / 5."""
    fine = np.array([[[0.0, 0.0, 0.0]], [[0.0, 60.0, 80.0]], [[0.0, 0.0, 0.01]], [[0.0, 0.0, 0.01]]])
    coarse = fine.copy()
    coarse[3, 0, 2] += 0.001
    assert jump_differences(coarse, fine)[3] == pytest.approx(0.001 / 5.0, rel=1e-9)


def test_peaks_of_two_runs_that_agree_by_chance_differ_by_those_of_all_gaps():
    """Peaks of 4 and 3 where 3 and 4 are right, of values less those at rest: sqrt 2 of 5."""
    rest = np.array([[0.5], [-7.0]])
    fine = np.array([[[0.0], [0.0]], [[3.0], [0.0]], [[0.0], [4.0]]]) + rest
    coarse = np.array([[[0.0], [0.0]], [[4.0], [0.0]], [[0.0], [3.0]]]) + rest
    expected = [2.0 / 5.0 / 2.0**0.5, 2.0**0.5 / 5.0]
    assert jump_differences(coarse, fine) == pytest.approx(expected, rel=1e-12)
    assert jump_differences(coarse[1:], fine[1:], rest) == pytest.approx(expected, rel=1e-12)


def test_moving_supports_add_motion_and_strain_energy():
    """K = [[4, 1], [1, 2]]: 8 J at (1, 2) and 18 J at (3, 0); what there is at the start is no work."""
    none, zeros = np.zeros((2, 0)), np.zeros(2)
    energy = {"strain": np.array([5.0, 7.0]), "input": np.array([0.0, 1.0])}
    history = History(
        time=np.array([0.0, 0.5]), jump=np.zeros((2, 0, 1)), traction=np.zeros((2, 0, 1)),
        mean_traction=np.zeros((2, 0, 1)), state=none.astype(np.uint8), disp=np.ones((2, 3)),
        vel=np.full((2, 3), 2.0), acc=np.full((2, 3), 4.0), coordinates=None,
        energy=dict.fromkeys(ENERGY_TERMS, zeros) | energy, peaks={}, stats={}, integrator="modal",
    )  # fmt: skip
    rows = np.array([[1.0, 9.0, 3.0], [2.0, 9.0, 0.0]])  # at base steps, two a row
    observe = np.array([[1.0, 0.0], [0.5, 2.0], [0.0, 3.0]])
    by = SimpleNamespace(
        motion=lambda ground: (100.0 * ground, 10.0 * ground, ground),
        stiffness=np.array([[4.0, 1.0], [1.0, 2.0]]),
        observe=observe,
    )
    found = add_support_motion(history, SimpleNamespace(pseudo_static=by), rows, 2)
    np.testing.assert_allclose(found.energy["strain"], [13, 25])
    np.testing.assert_allclose(found.energy["input"], [0, 11])
    moved = np.array([[1.0, 4.5, 6.0], [3.0, 1.5, 0.0]])
    np.testing.assert_allclose(found.disp, 1 + moved)
    np.testing.assert_allclose(found.vel, 2 + 10 * moved)
    np.testing.assert_allclose(found.acc, 4 + 100 * moved)
    np.testing.assert_allclose(found.supports, [[1, 2], [3, 0]])
