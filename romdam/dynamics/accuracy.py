"""Choose the step: from an explicit finest step, or by refinement until an accuracy is reached."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from romdam.dynamics.options import TransientOptions
from romdam.dynamics.runs import Case, Progress
from romdam.dynamics.system import History, System
from romdam.dynamics.transient import Outcome, integrate_cases
from romdam.errors import ConvergenceError

Floats = NDArray[np.float64]

_FIRST_HALVINGS = 2  # of the coarse step in the first trial
_MOST_HALVINGS = 9
_SHRINK = (0.3, 0.7)  # believed range of the ratio of two successive differences (order 1.7 to 0.5)
_USUAL_SHRINK = 0.35  # 0.22 to 0.38 on five records, soft, stiff and rough joints
_NEGLIGIBLE = 1e-12


def refined_step(finest: float, coarse: float, every: float | None) -> tuple[float, tuple[int, ...]]:
    """Base step and how it is cut down to a finest step.

    A cut into 2 refuses more steps than one into 4, one into 8 takes more small ones; both cost more, so only
    the base step is cut into 2, where that brings it nearer to the coarse one.

    Parameters
    ----------
    finest : step where contact changes [s]
    coarse : longest base step wanted, the record's own [s]
    every : interval of the written rows, which the base step must divide [s]

    Returns
    -------
    (base step, cuts), see `romdam.dynamics.options.TransientOptions`
    """

    def fits(step: float) -> bool:
        rows = 1.0 if every is None else every / step
        return step <= coarse * (1.0 + 1e-9) and rows > 1.0 - 1e-6 and abs(rows - round(rows)) <= 1e-6 * rows

    base, cuts = finest, tuple[int, ...]()
    while fits(4.0 * base):
        base, cuts = 4.0 * base, (4, *cuts)
    return (2.0 * base, (2, *cuts)) if fits(2.0 * base) else (base, cuts)


def integrate_to(
    system: System,
    ground: Callable[[float], Floats],
    options: TransientOptions,
    accuracy: float,
    progress: Progress | None = None,
) -> History:
    """Integrate with ever finer steps until the estimated time-stepping error meets an accuracy.

    Parameters
    ----------
    system : the open-joint system
    ground : step -> (3, nt) ground acceleration at every step
    options : `dt` is the coarse step to start from, `stride` its steps per row
    accuracy : wanted, relative
    progress : called with (steps done, steps in all) of every run

    Returns
    -------
    History of the finest run, see `integrate_cases_to`.

    Raises
    ------
    ConvergenceError
        where a step does not converge.
    """
    outcome = integrate_cases_to([system], [ground], options, accuracy, progress)[0]
    if isinstance(outcome, ConvergenceError):
        raise outcome
    return outcome


def integrate_cases_to(
    systems: Sequence[System],
    grounds: Sequence[Callable[[float], Floats]],
    options: TransientOptions,
    accuracy: float,
    progress: Progress | None = None,
) -> list[Outcome]:
    """Integrate several cases together, each with ever finer steps until its own estimated error is small.

    Two successive runs differ by most of the coarser one's error; the finer one's is taken as the
    difference times r/(1 - r), r being the ratio of the last two differences within what the scheme shows
    (0.3 to 0.7). The error is in L2 over all openings and times, or in the peak opening for a
    scheme that conserves energy, whose histories part in time while peaks and energy do not.

    Returns
    -------
    list, in the order of the cases: the history of the finest run, or why there is none. The stats gain
    "estimated_time_error", "accuracy" and "runs"; the estimate exceeds the accuracy where the finest step
    allowed did not reach it.
    """
    coarse, every = options.dt, options.dt * options.stride
    outcomes: dict[int, Outcome] = {}
    trials = {i: _Trial() for i in range(len(systems))}
    for halvings in range(_FIRST_HALVINGS, _MOST_HALVINGS + 1):
        base, cuts = _step_of(options.integrator, coarse / 2.0**halvings, coarse, every)
        trial = replace(options, dt=base, cuts=cuts, stride=round(every / base))
        cases = [Case(systems[i], grounds[i](base)) for i in trials]
        for i, found in zip(list(trials), integrate_cases(cases, trial, progress), strict=True):
            if isinstance(found, ConvergenceError):
                outcomes[i] = found
                del trials[i]
                continue
            trials[i] = known = trials[i].after(found)
            outcomes[i] = replace(found, stats=found.stats | known.stats(accuracy))
            if known.estimate <= accuracy:
                del trials[i]
        if not trials:
            break
    return [outcomes[i] for i in range(len(systems))]


@dataclass(frozen=True)
class _Trial:
    """What is known of a case's error after its last run: (nt, ng) openings or the peak, and the estimate."""

    measured: Floats | None = None
    difference: float = math.nan
    estimate: float = math.inf
    runs: int = 0
    cpu: float = 0.0

    def after(self, history: History) -> _Trial:
        """What is known after one more run."""
        measured = _measured(history)
        cpu = self.cpu + history.stats["loop_cpu_seconds"]
        if self.measured is None:
            return _Trial(measured, runs=1, cpu=cpu)
        size = float(np.linalg.norm(measured))
        difference = float(np.linalg.norm(measured - self.measured)) / max(size, _NEGLIGIBLE)
        shrink = np.clip(difference / self.difference, *_SHRINK) if self.difference > 0.0 else _USUAL_SHRINK
        return _Trial(measured, difference, float(difference * shrink / (1.0 - shrink)), self.runs + 1, cpu)

    def stats(self, accuracy: float) -> dict[str, float]:
        """What the history's stats gain."""
        return {
            "estimated_time_error": self.estimate,
            "accuracy": accuracy,
            "runs": float(self.runs),
            "all_runs_cpu_seconds": self.cpu,
        }


def _measured(history: History) -> Floats:
    """What is compared between two runs."""
    if history.integrator == "conserving":
        return np.array([history.peaks["opening"].max(initial=0.0)])
    return history.jump[..., 0].copy() if history.jump.size else history.disp


def _step_of(integrator: str, finest: float, coarse: float, every: float) -> tuple[float, tuple[int, ...]]:
    return refined_step(finest, coarse, every) if integrator == "adaptive" else (finest, ())
