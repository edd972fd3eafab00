"""Measures of error and of cost whose factors are unlike, worked out on paper."""

from types import SimpleNamespace

import numpy as np
import pytest
from mesh_runs import mesh_run

from romdam.core.system import SLIP, STICK, GapLaw
from romdam.error.discretisation import discretisation
from romdam.error.estimate import continued, start_at
from romdam.error.metrics import RelativeError, magnitude_error, peak_bound
from romdam.error.study import Setting, case_result, pareto_front
from romdam.error.two_results import phase


def test_a_component_that_hardly_moves_is_measured_by_the_largest_component():
    """0.01 against 0: of a hundredth of sqrt(18e4 / 4) and of 400, the other component's."""
    scale = np.array([[0.0, 0.0], [50.0, 4e2], [50.0, -1e2], [0.0, -1e2]])
    off, rest = np.full((4, 1), 0.01), np.zeros((4, 1))
    rms = (18e4 / 4) ** 0.5
    found = magnitude_error(off, rest, scale)
    assert found.l2 == pytest.approx(0.02 / (0.01 * rms * 2.0), rel=1e-12)
    assert found.peak == pytest.approx(0.01 / 4.0, rel=1e-12)


def test_bound_of_a_peak_looks_at_what_is_near_it_in_either_history():
    """The largest is 10, so from 8 on: 8.5 against 5 counts, and 7 against 1 does not."""
    judged, better = np.array([[9.0, 8.5, 7.0]]), np.array([[10.0, 5.0, 1.0]])
    assert peak_bound(judged, better) == pytest.approx(0.35)


def test_openings_go_on_as_far_apart_as_on_average_over_the_last_rows():
    """2 and 4 more in the last two rows of three: 3 afterwards."""
    opening = np.array([[1.0], [2.0], [3.0], [4.0], [5.0]])
    found = continued(opening, np.array([[9.0], [5.0], [8.0]]), slice(1, 4), 2)
    np.testing.assert_allclose(found[:, 0], [1, 9, 5, 8, 5 + 0.5 * (2 + 4)])


def test_a_run_is_resumed_with_the_speed_of_its_last_interval(monkeypatch):
    """(3, 4) mm in 0.25 s after 1.5 s: 20 mm/s; the first row has none."""
    seen = []
    monkeypatch.setattr(
        "romdam.error.estimate.law_memory",
        lambda law, memory_of: np.array(
            [memory_of(SimpleNamespace(resumed=lambda values, past: seen.append(past) or (0.0,)), (), 0)]
        ),
    )
    jump = np.zeros((3, 1, 3))
    jump[1, 0], jump[2, 0] = (0.0, 1e-3, 1e-3), (2e-3, 4e-3, -3e-3)
    history = SimpleNamespace(
        coordinates=SimpleNamespace(row=lambda row: (np.zeros(2), np.ones(2))),
        state=np.array([[STICK], [STICK], [SLIP]]), jump=jump, time=np.array([0.0, 1.5, 1.75]),
        traction=np.zeros((3, 1, 3)),
    )  # fmt: skip
    one = np.ones(1)
    law = GapLaw(one, 0 * one, one, np.ones((1, 2)), 0.5e-3 * one, {}, laws=(object(),))
    start_at(history, law, 2, jump[2])
    start_at(history, law, 0, jump[0])
    assert seen[0].rate == pytest.approx(0.02) and seen[1].rate == 0.0
    assert (seen[0].gap, seen[0].opening, seen[0].sliding, seen[0].has_moved) == (0.5e-3, 2e-3, True, True)
    assert not seen[1].sliding and not seen[1].has_moved


def test_slip_that_is_left_is_a_mean_over_the_area():
    """Gaps of 1 and 3 m2 slide by 4 and 8 mm, on the other mesh by 4 and 4: 7 against 4 mm."""
    time = np.linspace(0.0, 3.0, 31)

    def run(slips):
        jump = np.zeros((31, 2, 3))
        jump[:, :, 0], jump[time >= 1.5, :, 1] = 1.0, slips
        state = np.zeros((31, 2), dtype=int)
        history = SimpleNamespace(
            time=time,
            jump=jump,
            mean_traction=np.ones((31, 2, 3)),
            traction=np.ones((31, 2, 3)),
            water=np.zeros((0, 0)),
            state=state,
        )
        at = np.array([[0.0, 0, 0], [0, 0, 1]])
        return mesh_run(history, at, np.array([1.0, 3.0]), {"j": slice(0, 2)}, 9)

    about = {"record": "r", "seconds": 3.0}
    stated = discretisation(run([4e-3, 8e-3]), run([4e-3, 4e-3]), finer=True, about=about)
    assert stated.errors["residual_slip"].l2 == pytest.approx(1.5 * 3 / 4)


def test_cost_of_a_setting_is_the_median_of_its_runs():
    """4, 1 and 2.5 s."""
    runs = [
        SimpleNamespace(stats={"loop_cpu_seconds": s, "finest_step": 0.002, "steps": 7.0})
        for s in (4, 1, 2.5)
    ]
    comparison = SimpleNamespace(peak=0.03, errors={"opening": RelativeError(0.2, 0.1)}, gaps=6)
    found = case_result(Setting("modal", 0.005, "20", 3, 400), runs, comparison)
    assert (found.cpu_seconds, found.cpu_spread) == (2.5, pytest.approx(3 / 2.5))
    assert (found.peak_opening, found.peak_error, found.l2_error, found.steps) == (0.03, 0.1, 0.2, 7)
    assert (found.finest_step, found.compared_gaps) == (0.002, 6)
    runs[0].stats["all_runs_cpu_seconds"] = 6.0  # what it took to choose the step
    assert case_result(Setting("modal", 0.005, "20", 3, 400), runs, comparison).cpu_seconds == 2.5
    assert case_result(Setting("modal", 0.005, "20", 3, 400), runs[:1], comparison).cpu_seconds == 6.0
    front = pareto_front(np.array([1.0, 2.0, 2.0, 3.0, np.nan]), np.array([5.0, 4.0, 4.5, 4.0, 0.0]))
    assert front.tolist() == [True, True, False, False, False]


def test_lateness_between_two_rows():
    """A sine of 2 s that is 0.03 s late, in rows of 0.1 s."""
    time = 0.1 * np.arange(201)
    first, second = (np.sin(np.pi * (time - late))[:, None] for late in (0.03, 0.0))
    assert phase(first, second, 0.1) == pytest.approx(0.03, abs=2e-3)
