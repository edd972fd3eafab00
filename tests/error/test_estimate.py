"""The estimate sees every joint's motion, and what slip leaves after it."""

from types import SimpleNamespace

import numpy as np
import pytest

from romdam.error import estimate
from romdam.error.estimate import continued, estimate_error, estimate_time_error, moving_rows
from romdam.error.metrics import opening_error
from romdam.timestepping.settings import Settings
from romdam.timestepping.steps import Steps

INTERVAL, SECONDS = 0.01, 30.0
TIME = np.arange(0.0, SECONDS, INTERVAL)


def history_of(*openings):
    """Of gaps that open so (nt,) [m]."""
    jump = np.stack(openings, axis=1)[..., None]
    return SimpleNamespace(time=TIME, jump=jump)


def burst(at, size, seconds=0.5):
    """A gap that opens and shuts a few times around a second."""
    return size * np.sin(20.0 * TIME) * np.exp(-(((TIME - at) / seconds) ** 2))


def first_and_last(joints, *openings):
    """Seconds of the moving rows, each joint of one gap if none are named."""
    joints = joints or {str(k): slice(k, k + 1) for k in range(len(openings))}
    rows = moving_rows(history_of(*openings), joints, INTERVAL)
    return TIME[rows.start], TIME[rows.stop - 1]


def test_one_joint_that_opens_once_is_seen_from_five_and_a_half_seconds_before():
    peak = TIME[burst(15.0, 1.0).argmax()]
    assert first_and_last(None, burst(15.0, 1.0)) == pytest.approx((peak - 5.5, peak + 0.5), abs=0.6)


@pytest.mark.parametrize("size", [1.0, 0.05])
def test_joints_that_move_before_and_after_the_largest_opening_are_seen(size):
    first, last = first_and_last(None, burst(15.0, 1.0), burst(3.0, size), burst(24.0, size))
    assert 2.0 < first < 3.0 and 24.0 < last < 25.0


def test_joints_that_hardly_move_or_never_do_count_for_nothing():
    alone = first_and_last(None, burst(15.0, 1.0))
    still, hardly = 0.02 * np.ones_like(TIME), burst(25.0, 1e-4)
    assert first_and_last(None, burst(15.0, 1.0), still, hardly) == alone


def test_a_gap_that_stays_open_moves_only_while_it_opens():
    slid = 0.5 / (1.0 + np.exp(-8.0 * (TIME - 18.0)))
    first, last = first_and_last({"J": slice(0, 2)}, burst(15.0, 1.0), slid)
    assert first > 8.0 and last < 19.0


def test_without_joints_that_slide_the_window_is_that_of_the_peak():
    peak = TIME[burst(15.0, 1.0).argmax()]
    rows = moving_rows(history_of(burst(15.0, 1.0), burst(3.0, 0.5)), {}, INTERVAL)
    assert (TIME[rows.start], TIME[rows.stop - 1]) == pytest.approx((peak - 5.5, peak + 0.5), abs=0.02)


@pytest.mark.parametrize(("directions", "seconds"), [(1, (9.4, 15.4)), (3, (2.7, 24.3))])
def test_only_joints_that_slide_are_followed_for_as_long_as_they_move(monkeypatch, directions, seconds):
    """The finer model is 1 % larger wherever it runs: what it was asked to run over is what is stated."""
    run, asked = history_of(burst(15.0, 1.0), burst(3.0, 0.5), burst(24.0, 0.5)), []

    def larger(finer, history, ground, settings, rows):
        asked.append((TIME[rows.start], TIME[rows.stop - 1]))
        return SimpleNamespace(jump=1.01 * history.jump[rows])

    monkeypatch.setattr(estimate, "run_window", larger)
    law = SimpleNamespace(directions=directions, joints={"J": slice(0, 3)}, laws=())
    system = SimpleNamespace(law=law, needs_whole_record=False, floating=False)
    prepared = SimpleNamespace(system=system, integrator=SimpleNamespace(resumes=True))
    finer = SimpleNamespace(prepared=prepared)
    statement = estimate_error(finer, run, None, Settings(Steps(INTERVAL)))
    assert asked[0] == pytest.approx(seconds, abs=0.2)
    assert f"from {asked[0][0]:g} to {asked[0][1]:g} s" in statement.sentence
    assert statement.errors["opening"].l2 == pytest.approx(0.01 / 1.01, rel=0.03)


def rocking(laws=()):
    """A prepared system of two joints with friction, of a gap each, that alone hold a block."""
    law = SimpleNamespace(directions=3, joints={"J": slice(0, 1), "K": slice(1, 2)}, laws=laws)
    system = SimpleNamespace(law=law, needs_whole_record=False, floating=True, size=1)
    return SimpleNamespace(system=system, integrator=SimpleNamespace(resumes=True))


def test_where_blocks_rock_all_joints_count_as_one(monkeypatch):
    """The second joint moves a hundredth of the first's at second 24: seen joint by joint, not of both."""
    run, asked = history_of(burst(15.0, 1.0), burst(24.0, 0.1)), []

    def larger(finer, history, ground, settings, rows):
        asked.append((TIME[rows.start], TIME[rows.stop - 1]))
        return SimpleNamespace(jump=1.01 * history.jump[rows])

    monkeypatch.setattr(estimate, "run_window", larger)
    estimate_error(SimpleNamespace(prepared=rocking()), run, None, Settings(Steps(INTERVAL, 1, (4,))))
    assert asked[0] == pytest.approx((9.4, 15.4), abs=0.2)
    assert moving_rows(run, rocking().system.law.joints, INTERVAL).stop > 2400


@pytest.mark.parametrize(
    ("laws", "tolerance", "taken"), [((), 1e-8, 1e-4), ((), 1e-3, 1e-3), (("bond",), 1e-8, 1e-8)]
)
def test_better_runs_solve_contact_less_tightly_unless_laws_remember(monkeypatch, laws, tolerance, taken):
    run, asked = history_of(burst(15.0, 1.0), burst(24.0, 0.1)), []
    run.jump = np.pad(run.jump, ((0, 0), (0, 0), (0, 2)))
    run.stats = {"finest_step": INTERVAL / 4}

    def same(finer, history, ground, settings, rows):
        asked.append(settings.tolerance)
        return SimpleNamespace(jump=history.jump[rows])

    monkeypatch.setattr(estimate, "run_window", same)
    prepared, settings = rocking(laws), Settings(Steps(INTERVAL, 1, (8,)), tolerance=tolerance)
    estimate_error(SimpleNamespace(prepared=prepared), run, None, settings)
    estimate_time_error(prepared, run, None, settings)
    assert asked == [taken, taken]


@pytest.mark.parametrize("cut", [2, 8])
def test_a_run_is_the_finer_one_where_it_is_judged_by_longer_steps(monkeypatch, cut):
    """Steps of 2.5 ms against 5 and 1.25 ms, which open by a tenth more in seconds 11 to 16: 0.9 is seen.

    The peak too, of one gap: a tenth of the run's own, or of the other's.
    """
    opening = np.interp(TIME, [10.0, 15.0, 20.0], [0.0, 1.0, 0.0])
    run, more = history_of(opening, opening), 0.1 * opening * ((TIME > 11.0) & (TIME < 16.0))
    run.jump = np.pad(run.jump, ((0, 0), (0, 0), (0, 2)))
    run.stats = {"finest_step": INTERVAL / 4}

    def other(finer, history, ground, settings, rows):
        return SimpleNamespace(jump=history.jump[rows] + more[rows, None, None] * [1.0, 0.0, 0.0])

    monkeypatch.setattr(estimate, "run_window", other)
    fine = opening if cut == 2 else opening + more
    stated = estimate_time_error(rocking(), run, None, Settings(Steps(INTERVAL, 1, (cut,)), tolerance=1e-8))
    expected = np.linalg.norm(more) / np.linalg.norm(fine - opening[0]) / 0.9
    peak = 0.1 / fine.max() / 0.9
    assert stated == pytest.approx([expected, peak, 0.0, 0.0], rel=1e-9)


def test_the_rows_end_where_a_share_of_the_motion_is_left():
    """A twelfth of the squared increments is at second 24: with a fifth left out the rows end before it."""
    run = history_of(burst(15.0, 1.0), burst(24.0, 0.3))
    ends = [TIME[moving_rows(run, {"all": slice(None)}, INTERVAL, late).stop - 1] for late in (0.02, 0.2)]
    assert 23.0 < ends[0] < 25.0 and 15.0 < ends[1] < 17.0


def test_rows_of_a_short_record_are_all_rows():
    run = SimpleNamespace(time=TIME[:300], jump=burst(2.0, 1.0)[:300, None, None])
    assert moving_rows(run, {"J": slice(0, 1)}, INTERVAL) == slice(0, 300)


def test_what_slip_has_left_apart_counts_to_the_end_of_the_record():
    """A gap that is 0.01 of 0.5 m off from second 18 on: seen over a window, and stated for the record."""
    slid = 0.5 / (1.0 + np.exp(-8.0 * (TIME - 18.0)))
    truth, run = 1.01 * slid[:, None], slid[:, None]
    rows = slice(1200, 2000)
    better = continued(run, truth[rows] + 1e-4 * np.sin(40.0 * np.pi * TIME[rows, None]), rows, 100)
    assert np.array_equal(better[:1200], run[:1200])
    assert better[2000:] == pytest.approx(truth[2000:], rel=1e-5)
    true = opening_error(run, truth)
    assert opening_error(run, better).l2 == pytest.approx(true.l2, rel=1e-2)
