"""Choose the step: from an explicit finest step, or by refinement until an accuracy is reached."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from romdam.dynamics.arrays import RATIO
from romdam.dynamics.options import TransientOptions
from romdam.dynamics.system import History, System
from romdam.dynamics.transient import Progress, integrate

Floats = NDArray[np.float64]

_FIRST_HALVINGS = 2  # of the coarse step in the first trial
_MOST_HALVINGS = 9
_SHRINK = (0.3, 0.7)  # believed range of the ratio of two successive differences (order 1.7 to 0.5)
_NEGLIGIBLE = 1e-12


def refined_step(finest: float, coarse: float, every: float | None) -> tuple[float, int]:
    """Base step and levels below it for a finest step.

    Parameters
    ----------
    finest : step where contact changes [s]
    coarse : longest base step wanted, the record's own [s]
    every : interval of the written rows, which the base step must divide [s]

    Returns
    -------
    (base step, levels) with finest = base / RATIO^levels
    """
    levels = 0
    while finest * RATIO ** (levels + 1) <= coarse * (1.0 + 1e-9):
        rows = 1.0 if every is None else every / (finest * RATIO ** (levels + 1))
        if rows < 1.0 - 1e-6 or abs(rows - round(rows)) > 1e-6 * rows:
            break
        levels += 1
    return finest * RATIO**levels, levels


def integrate_to(
    system: System,
    ground: Callable[[float], Floats],
    options: TransientOptions,
    accuracy: float,
    progress: Progress | None = None,
) -> History:
    """Integrate with ever finer steps until the estimated time-stepping error meets an accuracy.

    Two successive runs differ by most of the coarser one's error; the finer one's is taken as the
    difference times r/(1 - r), r being the ratio of the last two differences within what the scheme shows
    (0.3 to 0.7). The error is in L2 over all openings and times, or in the peak opening for a
    scheme that conserves energy, whose histories part in time while peaks and energy do not.

    Parameters
    ----------
    system : the open-joint system
    ground : step -> (3, nt) ground acceleration at every step
    options : `dt` is the coarse step to start from, `stride` its steps per row
    accuracy : wanted, relative
    progress : called with (steps done, steps in all) of every run

    Returns
    -------
    History of the finest run; stats gain "estimated_time_error", "accuracy" and "runs". The estimate
    exceeds the accuracy where the finest step allowed did not reach it.
    """
    coarse, every = options.dt, options.dt * options.stride
    previous: History | None = None
    difference, estimate, cpu = math.nan, math.inf, 0.0
    for halvings in range(_FIRST_HALVINGS, _MOST_HALVINGS + 1):
        finest = coarse / 2.0**halvings
        base, levels = _step_of(options.integrator, finest, coarse, every)
        trial = replace(options, dt=base, levels=levels, stride=round(every / base))
        history = integrate(system, ground(base), trial, progress)
        cpu += history.stats["loop_cpu_seconds"]
        if previous is not None:
            last, difference = difference, _difference(history, previous, options.integrator)
            shrink = np.clip(difference / last, *_SHRINK) if last > 0.0 else 0.5
            estimate = float(difference * shrink / (1.0 - shrink))
            if estimate <= accuracy:
                break
        previous = history
    stats = history.stats | {
        "estimated_time_error": estimate,
        "accuracy": accuracy,
        "runs": float(halvings - _FIRST_HALVINGS + 1),
        "all_runs_cpu_seconds": cpu,
    }
    return replace(history, stats=stats)


def _step_of(integrator: str, finest: float, coarse: float, every: float) -> tuple[float, int]:
    return refined_step(finest, coarse, every) if integrator == "adaptive" else (finest, 0)


def _difference(fine: History, rough: History, integrator: str) -> float:
    """Relative difference of two runs."""
    if integrator == "conserving":
        peaks = [run.peaks["opening"].max(initial=0.0) for run in (fine, rough)]
        return abs(peaks[0] - peaks[1]) / max(abs(peaks[0]), _NEGLIGIBLE)
    measured = (fine.jump[..., 0], rough.jump[..., 0]) if fine.jump.size else (fine.disp, rough.disp)
    size = float(np.linalg.norm(measured[0]))
    return float(np.linalg.norm(measured[0] - measured[1])) / max(size, _NEGLIGIBLE)
