"""The cheap estimates that every reduced run makes of its error: of its modes, and of its steps.

A finer reduced model, made with the same factors, is started from the run's own state and integrated around
the largest opening. How far the two part there is about what the run is off. Where joints slide it goes on
through all rows in which they move: before, the two are one; after, how far they are apart is what slip left.
Steps are judged likewise, by the same model with a quarter of them. Where they were chosen for an accuracy,
`romdam.timestepping.step_control` has stated that already.

Histories of blocks that joints alone hold part in time, however little they differ at first. Cheaper means
state the same of them: an end before all joints are quiet, and steps twice as long instead of half as long.

With plain friction the better runs solve contact less tightly than the run: what that changes in them is a
thousandth of what they tell, or less.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix, eye

from romdam.contact.laws.law import Law, Past
from romdam.contact.problem import law_memory
from romdam.core.arrays import Floats
from romdam.core.system import SLIP, STICK, GapLaw, History, System
from romdam.error.comparison import ComparedRun, compare
from romdam.error.metrics import FLOOR
from romdam.error.statement import ErrorStatement
from romdam.postprocess.stated_errors import percent
from romdam.timestepping.prepared import Prepared
from romdam.timestepping.settings import Settings, Start
from romdam.timestepping.simulate import simulate_one
from romdam.timestepping.step_control import jump_differences

WINDOW = 6.0  # [s], a twelfth of it after the largest opening
QUIET = 0.02  # of a joint's squared opening increments: all that is left out at either end of the record
_SEEN = 0.9  # of the error of a run's steps, which a quarter of them shows; twice of them where blocks rock
LATE = 0.2  # of all joints' where blocks rock: models part by where they begin, not by when they end
_LOOSE = 1e-4  # tolerance of contact with plain friction: sweeps end at single precision
_REST = 1.0  # [s] at the window's end, over which the two models' distance is averaged


@dataclass(frozen=True)
class FinerModel:
    """A finer reduced model.

    Attributes
    ----------
    prepared : its system
    embed : (fine, coarse) matrix that writes a motion of the run in it
    not_finer : parts of which it is no finer than the run's model, see `parts_without_refinement`
    """

    prepared: Prepared
    embed: csr_matrix
    not_finer: tuple[str, ...] = ()


def estimate_error(finer: FinerModel, history: History, ground: Floats, settings: Settings) -> ErrorStatement:
    """Estimate what leaving out modes has changed in a run, over all gaps and joint by joint.

    Parameters
    ----------
    finer : see `romdam.reduction.synthesis.reduce_scene_twice`
    history : of the reduced run, with its coordinates
    ground : (3, nt) ground acceleration at every base step [m/s2]
    settings : those of `history`

    Raises
    ------
    ConvergenceError
        where a step of the finer model does not converge.
    """
    settings = _with_loose_contact(settings, finer.prepared.system.law)
    judged, better, rows = _both_runs(finer, history, ground, settings)
    error = compare("estimate", judged, better).errors["opening"]
    first, last = (float(history.time[row]) for row in (rows.start, rows.stop - 1))
    rocks = finer.prepared.system.floating
    return ErrorStatement("estimate", _sentence(error.l2, error.peak, first, last, rocks), {"opening": error})


def _sentence(l2: float, peak: float, first: float, last: float, rocks: bool) -> str:
    """Say what leaving out modes changes.

    Parameters
    ----------
    first, last : ends of the time that was compared [s]
    rocks : whether a part is held by joints alone, so that it can rock on them
    """
    compared = f"estimated from {first:g} to {last:g} s with a finer model"
    if rocks:
        return (
            f"Leaving out modes changes the openings by {percent(l2)} in L2 and the largest one by "
            f"{percent(peak)}, {compared}. That may be a tenth of the truth, or four times: blocks that "
            "joints alone hold rock on them, and histories of rocking part whatever the basis. Compare "
            "residual slips and peaks with those of twice the cutoff, or run `modes: all`."
        )
    return (
        f"Leaving out modes changes the openings by about {percent(l2)} in L2, mostly good to a factor of "
        f"two, and the largest one by about {percent(peak)}, mostly by less than half of that; {compared}. "
        "`romdam certify` states it for the whole record."
    )


def rocks_on_joints(system: System) -> bool:
    """Tell whether joints alone hold a part, by friction, and remember nothing but its slip."""
    return system.floating and system.law.directions > 1 and not system.law.laws


def _with_loose_contact(settings: Settings, law: GapLaw) -> Settings:
    """Settings of a run that another is judged by: what further laws give up hangs on their last digits."""
    if law.directions == 1 or law.laws:
        return settings
    return replace(settings, tolerance=max(settings.tolerance, _LOOSE))


def estimate_time_error(prepared: Prepared, history: History, ground: Floats, other: Settings) -> Floats:
    """Estimate what the steps of a run have changed in what moves, see `jump_differences`.

    (2,) of openings and their peaks, or (4,) with slips and residual slips where joints carry shear. What
    joints with bonds or other memory keep is not in a written row: there the whole record is run again.

    Parameters
    ----------
    prepared : the system of the run
    ground : (3, nt) ground acceleration at every base step of `other` [m/s2]
    other : the settings of `history`, with a quarter of its finest step; or twice it, where `rocks_on_joints`

    Raises
    ------
    ConvergenceError
        where a step does not converge.
    """
    itself, law = FinerModel(prepared, csr_matrix(eye(prepared.system.size))), prepared.system.law
    if law.directions == 1 and not law.laws:
        judged, better, _ = _both_runs(itself, history, ground, other)
        return jump_differences(judged.opening, better.opening, history.jump[0, :, 0]) / _SEEN
    longer, interval = other.steps.finest > history.stats["finest_step"], other.steps.interval
    rows = slice(0, len(history.time))
    if longer or not law.laws:
        rows = _rows_to_run(prepared, history, interval, law.joints, rocks=longer)
    jump = run_window(itself, history, ground, _with_loose_contact(other, law), rows).jump
    jump = continued(history.jump, jump, rows, max(1, round(_REST / interval)))
    coarse, fine = (jump, history.jump) if longer else (history.jump, jump)
    return jump_differences(coarse, fine) / _SEEN


def _both_runs(
    finer: FinerModel, history: History, ground: Floats, settings: Settings
) -> tuple[ComparedRun, ComparedRun, slice]:
    """A run and a better one as their openings are compared, and the rows in which that was integrated."""
    law, interval, opening = finer.prepared.system.law, settings.steps.interval, history.jump[..., :1]
    slides, rocks = law.directions > 1, rocks_on_joints(finer.prepared.system)
    rows = _rows_to_run(finer.prepared, history, interval, law.joints if slides else {}, rocks=rocks)
    if slides and law.laws:  # what they remember, such as lost bonds, no row tells: both begin at rest
        rows = slice(0, rows.stop)
    better = run_window(finer, history, ground, settings, rows).jump[..., :1]
    compared = slice(None) if slides else rows
    if slides:
        better = continued(opening, better, rows, max(1, round(_REST / interval)))
    time, rest = history.time[compared], history.jump[0, :, :1]
    judged = ComparedRun(time, opening[compared], joints=law.joints, rest=rest)
    return judged, replace(judged, jump=better), rows


def _rows_to_run(
    prepared: Prepared, history: History, interval: float, joints: Mapping[str, slice], *, rocks: bool
) -> slice:
    """The rows in which joints move; those before too where the integrator does not resume.

    Where blocks rock all joints count as one. All rows are run where a part of the record does not tell what
    drives the system in it.

    Parameters
    ----------
    interval, joints : see `moving_rows`
    """
    if prepared.system.needs_whole_record:
        return slice(0, len(history.time))
    rows = moving_rows(history, joints, interval)
    if rocks:
        rows = moving_rows(history, {"all": slice(None)}, interval, LATE)
    return rows if prepared.integrator.resumes else slice(0, rows.stop)


def run_window(
    finer: FinerModel, history: History, ground: Floats, settings: Settings, rows: slice
) -> History:
    """Run the finer model, from the run's own state, over some rows of `history`: its jumps.

    From the first row on it begins as the run did, in its own equilibrium: in the run's it would lack what
    its further modes carry at rest, and swing. A run that goes on in motion has no equilibrium to begin with.

    Parameters
    ----------
    history, ground, settings : see `estimate_error`
    """
    first, last, stride, start = rows.start, rows.stop - 1, settings.steps.stride, None
    system = finer.prepared.system
    initial = system.initial
    goes_on = initial is not None and initial.take == "all" and initial.moves
    if first > 0 or (goes_on and finer.prepared.integrator.resumes):
        assert history.coordinates is not None
        q, v = (finer.embed @ motion for motion in history.coordinates.row(first))
        jump = jump_of_forces(history, system, q, first)
        start = replace(
            start_at(history, system.law, first, jump, settings.initial_state == "static"), q=q, v=v
        )
    shaken = ground[:, first * stride : last * stride + 1]
    only = replace(settings, start=start, only_jumps=True)
    return simulate_one(finer.prepared, shaken, only)


def moving_rows(history: History, joints: Mapping[str, slice], interval: float, late: float = QUIET) -> slice:
    """The rows in which any of the joints moves, at least `WINDOW` up to half a second after the peak.

    A joint moves but for `QUIET` of its squared opening increments at the record's beginning, and `late` at
    its end; one that hardly does, but for those shares of what it is measured by, see `romdam.error.metrics`.

    Parameters
    ----------
    joints : name -> slice of its gaps; none for the window at the peak alone
    interval : of the rows [s]
    """
    rows, opening = len(history.time), history.jump[..., 0]
    peak, length = int(opening.max(axis=1).argmax()), max(2, round(WINDOW / interval))
    last = min(max(peak + length // 12, length), rows - 1)
    first = max(last - length, 0)
    motions = [(np.diff(opening[:, gaps], axis=0) ** 2).sum(axis=1).cumsum() for gaps in joints.values()]
    least = FLOOR**2 * sum(motion[-1] for motion in motions)
    for motion in motions:
        size = max(motion[-1], least)
        begin, end = np.searchsorted(motion, [QUIET * size, motion[-1] - late * size])
        first, last = min(first, int(begin)), max(last, int(end) + 1)
    return slice(first, last + 1)


def continued(opening: Floats, finer: Floats, rows: slice, rest: int) -> Floats:
    """Extend the finer model's openings, or jumps, over the whole record.

    The run's own before `rows`; after them as far from the run's as on average over the last of them.

    Parameters
    ----------
    opening : (nt, gaps), or (nt, gaps, 3) jumps, of the run [m]
    finer : of the finer model in `rows` [m]
    rest : how many rows are averaged over

    Returns
    -------
    (nt, gaps) or (nt, gaps, 3) [m]
    """
    better = opening.copy()
    better[rows] = finer
    better[rows.stop :] += (finer - opening[rows])[-rest:].mean(axis=0)
    return better


def jump_of_forces(history: History, system: System, motion: Floats, row: int) -> Floats:
    """The jumps (ng, d) of a row that joint forces see, in which a system moves by `motion`."""
    jump = history.jump[row]
    if system.at_point is None:
        return jump
    more = system.more_at_points(motion)
    if system.pseudo_static is not None:
        more += system.pseudo_static.at_point @ history.supports[row]
    return jump - more.reshape(jump.shape)


def start_at(history: History, law: GapLaw, row: int, jump: Floats, static: bool = False) -> Start:
    """The state of a row of a reduced run, to go on from, its jumps those that joint forces see.

    A bond counts as lost where a row so far shows its gap open or sliding, an unloaded start aside; `static`
    is a start in equilibrium, which counts.
    """
    assert history.coordinates is not None
    memory, (q, v) = None, history.coordinates.row(row)
    if law.laws:
        has_moved = (history.state[0 if static else 1 : row + 1] != STICK).any(axis=0)
        widest = history.jump[: row + 1, :, 0].max(axis=0)
        slips = np.linalg.norm(np.diff(history.jump[: row + 1, :, 1:], axis=0), axis=2)
        rate = np.zeros(len(widest))  # of slip, in the interval that ends at the row [m/s]
        if row > 0:
            rate = slips[-1] / (history.time[row] - history.time[row - 1])
        path = (slips * (history.state[1 : row + 1] == SLIP)).sum(axis=0)  # while they slide [m]
        if law.memory.size:  # what a gap lost in the grouting of other joints it has not
            fresh = law_memory(law, lambda each, values, i: each.initial(values, law.gap[i]))
            has_moved |= (law.memory != fresh).any(axis=(0, 2))

        def resumed(each: type[Law], values: Floats, i: int) -> tuple[float, ...]:
            sliding, opening = bool(history.state[row, i] == SLIP), float(jump[i, 0])
            moved = bool(has_moved[i])
            past = Past(law.gap[i], opening, sliding, moved, rate[i], float(widest[i]), float(path[i]))
            return each.resumed(values, past)

        memory = law_memory(law, resumed)
    return Start(q, v, jump, history.traction[row], memory)
