"""The cheap estimate of the reduction error that every reduced run makes of itself.

A finer reduced model, made with the same factors, is started from the run's own state and integrated through
the seconds that lead to the largest opening. How far the two have parted by then is about what the run is
off: 0.8 to 1.5 times the true error of the openings over 10 s of four records (3 s show 0.3 to 0.9 of it).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix

from romdam.contact.cone import SLIP, STICK
from romdam.contact.laws.law import Law, Past
from romdam.contact.problem import law_memory
from romdam.core.arrays import Floats
from romdam.core.system import GapLaw, History
from romdam.error.metrics import opening_error
from romdam.error.statement import ErrorStatement, percent
from romdam.timestepping.prepared import Prepared
from romdam.timestepping.settings import Settings, Start
from romdam.timestepping.simulate import simulate_one

WINDOW = 6.0  # [s]


@dataclass(frozen=True)
class FinerModel:
    """A finer reduced model, and the matrix (fine, coarse) that writes a motion of the run's own in it."""

    prepared: Prepared
    embed: csr_matrix


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
    rows, fine = run_window(finer, history, ground, settings)
    opening, joints = history.jump[rows, :, 0], finer.prepared.system.law.joints
    error = opening_error(opening, fine.jump[..., 0], joints)
    first, last = (float(history.time[row]) for row in (rows.start, rows.stop - 1))
    return ErrorStatement("estimate", _sentence(error.l2, error.peak, (first, last)), {"opening": error})


def _sentence(l2: float, peak: float, seconds: tuple[float, float]) -> str:
    return (
        f"Leaving out modes changes the openings by about {percent(l2)} in L2 and the largest one by about "
        f"{percent(peak)}, estimated from {seconds[0]:g} to {seconds[1]:g} s with a finer model, mostly good "
        "to a factor of two; `romdam certify` states it for the whole record."
    )


def run_window(
    finer: FinerModel, history: History, ground: Floats, settings: Settings, seconds: float = WINDOW
) -> tuple[slice, History]:
    """Run the finer model, from the run's own state, over the seconds that lead to the largest opening.

    Parameters
    ----------
    history, ground, settings : see `estimate_error`
    seconds : length of the window; a twelfth of it lies after the peak

    Returns
    -------
    (rows, run) : rows of `history` in the window, and the finer model's history of them
    """
    rows = _window(history, seconds / settings.steps.interval)
    assert history.q is not None and history.v is not None
    first, last, stride = rows.start, rows.stop - 1, settings.steps.stride
    static = settings.initial_state == "static"
    start = replace(
        start_at(history, finer.prepared.system.law, first, _jump_of_forces(history, finer, first), static),
        q=finer.embed @ history.q[first],
        v=finer.embed @ history.v[first],
    )
    shaken = ground[:, first * stride : last * stride + 1]
    return rows, simulate_one(finer.prepared, shaken, replace(settings, start=start))


def _window(history: History, intervals: float) -> slice:
    rows = len(history.time)
    peak = int(history.jump[:, :, 0].max(axis=1).argmax())
    length = min(max(2, round(intervals)), rows - 1)
    last = min(max(peak + length // 12, length), rows - 1)
    return slice(last - length, last + 1)


def _jump_of_forces(history: History, finer: FinerModel, row: int) -> Floats:
    """The jumps (ng, d) of a row that joint forces see."""
    system, jump = finer.prepared.system, history.jump[row]
    assert history.q is not None
    if system.at_point is None:
        return jump
    more = system.at_point @ (finer.embed @ history.q[row])
    if system.pseudo_static is not None:
        more += system.pseudo_static.at_point @ history.supports[row]
    return jump - more.reshape(jump.shape)


def start_at(history: History, law: GapLaw, row: int, jump: Floats, static: bool = False) -> Start:
    """The state of a row of a reduced run, to go on from, its jumps those that joint forces see.

    A bond counts as lost where a row so far shows its gap open or sliding, an unloaded start aside; `static`
    is a start in equilibrium, which counts.
    """
    assert history.q is not None and history.v is not None
    memory = None
    if law.laws:
        has_moved = (history.state[0 if static else 1 : row + 1] != STICK).any(axis=0)
        rate = _slip_rate(history, row)

        def resumed(each: type[Law], values: Floats, i: int) -> tuple[float, ...]:
            sliding, opening = bool(history.state[row, i] == SLIP), float(jump[i, 0])
            return each.resumed(values, Past(law.gap[i], opening, sliding, bool(has_moved[i]), rate[i]))

        memory = law_memory(law, resumed)
    return Start(history.q[row], history.v[row], jump, history.traction[row], memory)


def _slip_rate(history: History, row: int) -> Floats:
    """Mean speed of slip (ng,) over the interval that ends at a row, zero at the first [m/s]."""
    if row == 0:
        return np.zeros(history.jump.shape[1])
    slip = history.jump[row, :, 1:] - history.jump[row - 1, :, 1:]
    return np.sqrt((slip**2).sum(axis=1)) / (history.time[row] - history.time[row - 1])
