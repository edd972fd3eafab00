"""The cheap estimate of the reduction error that every reduced run makes of itself.

A slightly finer reduced model is started from the run's own state and integrated through the seconds that
lead to the largest opening. How far the two have parted by then is most of what the run is off.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix

from romdam.contact.laws.point import SLIP, STICK
from romdam.core.arrays import Floats
from romdam.core.system import GapLaw, History, System
from romdam.error.metrics import opening_error
from romdam.error.statement import ErrorStatement, percent
from romdam.timestepping.options import Start, TransientOptions
from romdam.timestepping.simulate import integrate

WINDOW = 3.0  # [s]
SHARE = 0.65  # of the true L2 error, that the window shows: 0.39 to 1.09 on the 30 cases of tests/reference


@dataclass(frozen=True)
class FinerModel:
    """A finer reduced model, and the matrix (fine, coarse) that writes a motion of the run's own in it."""

    system: System
    embed: csr_matrix


def estimate_error(
    finer: FinerModel, history: History, ground: Floats, options: TransientOptions
) -> ErrorStatement:
    """Estimate what leaving out modes has changed in a run, over all gaps and joint by joint.

    Parameters
    ----------
    finer : see `romdam.reduction.refinement.slightly_finer`
    history : of the reduced run, with its coordinates
    ground : (3, nt) ground acceleration at every base step [m/s2]
    options : those of `history`

    Raises
    ------
    ConvergenceError
        where a step of the finer model does not converge.
    """
    rows, fine = run_window(finer, history, ground, options)
    opening, joints = history.jump[rows, :, 0], finer.system.law.joints
    error = opening_error(opening, fine.jump[..., 0], joints).over(SHARE)
    first, last = (float(history.time[row]) for row in (rows.start, rows.stop - 1))
    return ErrorStatement("estimate", _sentence(error.l2, error.peak, (first, last)), {"opening": error})


def _sentence(l2: float, peak: float, seconds: tuple[float, float]) -> str:
    return (
        f"Leaving out modes changes the openings by about {percent(l2)} in L2 and the largest one by about "
        f"{percent(peak)}, estimated from {seconds[0]:g} to {seconds[1]:g} s with a finer model, good to a "
        "factor of two; `romdam certify` states it for the whole record."
    )


def run_window(
    finer: FinerModel, history: History, ground: Floats, options: TransientOptions, seconds: float = WINDOW
) -> tuple[slice, History]:
    """Run the finer model, from the run's own state, over the seconds that lead to the largest opening.

    Parameters
    ----------
    history, ground, options : see `estimate_error`
    seconds : length of the window; a twelfth of it lies after the peak

    Returns
    -------
    (rows, run) : rows of `history` in the window, and the finer model's history of them
    """
    rows = _window(history, seconds / (options.dt * options.stride))
    assert history.q is not None and history.v is not None
    first, last = rows.start, rows.stop - 1
    start = replace(
        start_at(history, finer.system.law, first),
        q=finer.embed @ history.q[first],
        v=finer.embed @ history.v[first],
    )
    shaken = ground[:, first * options.stride : last * options.stride + 1]
    return rows, integrate(finer.system, shaken, replace(options, start=start))


def _window(history: History, intervals: float) -> slice:
    rows = len(history.time)
    peak = int(history.jump[:, :, 0].max(axis=1).argmax())
    length = min(max(2, round(intervals)), rows - 1)
    last = min(max(peak + length // 12, length), rows - 1)
    return slice(last - length, last + 1)


def start_at(history: History, law: GapLaw, row: int) -> Start:
    """The state of a row of a reduced run, to go on from.

    A bond counts as lost where a row so far, the unloaded start aside, shows its gap open or sliding.
    """
    assert history.q is not None and history.v is not None
    weak = None
    if law.laws:
        depth = law.laws["shear_key"][:, 0] if "shear_key" in law.laws else np.full(len(law), np.inf)
        lost = (history.state[1 : row + 1] != STICK).any(axis=0) | (law.gap > 0.0)
        weak = np.stack([lost, history.state[row] == SLIP, history.jump[row, :, 0] > depth], axis=1)
    return Start(history.q[row], history.v[row], history.jump[row], history.traction[row], weak)
