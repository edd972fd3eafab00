"""Choose the step: from an explicit finest step, or by refinement until an accuracy is reached."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.errors import ConvergenceError
from romdam.core.system import History, System
from romdam.timestepping.modal.runs import Case, Progress
from romdam.timestepping.options import TransientOptions
from romdam.timestepping.simulate import Outcome, integrate_cases

_FRACTION = 1.0 / 400.0  # of the longest period: the finest step that leaves about 1 %; longer ones far more
_LIMIT = 0.01  # accuracy below which shorter ones are needed
_USUAL_HALVINGS = 3  # of the coarse step, where the period is not known
_MOST_HALVINGS = 9
_SHRINK = (0.4, 0.7)  # believed range of the ratio of two successive differences (order 1.3 to 0.5)
_USUAL_SHRINK = 0.45  # with it 50 of 50 estimates were at least the true error, with 0.35 (and 0.3 above) 39
_LATE = 0.005  # of the squared openings, the last ones, which the check leaves out
_LATE_ERROR = 4.0  # their relative error, believed, over that of the others: 1.7, 6.4 at most on 50 records
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
    (base step, cuts), see `romdam.timestepping.options.TransientOptions`
    """

    def fits(step: float) -> bool:
        rows = 1.0 if every is None else every / step
        return step <= coarse * (1.0 + 1e-9) and rows > 1.0 - 1e-6 and abs(rows - round(rows)) <= 1e-6 * rows

    base, cuts = finest, tuple[int, ...]()
    while fits(4.0 * base):
        base, cuts = 4.0 * base, (4, *cuts)
    return (2.0 * base, (2, *cuts)) if fits(2.0 * base) else (base, cuts)


def dividing_step(interval: float, longest: float) -> float:
    """The longest step up to `longest` that divides an interval [s]."""
    return interval / math.ceil(interval / longest * (1.0 - 1e-9))


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

    The first step follows from the longest period of the open joints. A check with twice that step says how
    good it is, and goes on until nearly all of the squared openings are past. Where that is not enough, runs
    of half the step follow. Two successive runs differ by most of the coarser one's error; the finer one's is
    taken as the difference times r/(1 - r), r being the ratio of the last two differences within what the
    scheme shows (0.4 to 0.7). The error is in L2 over all openings and times, or in the peak opening for a
    scheme that conserves energy, whose histories part in time while peaks and energy do not.

    Returns
    -------
    list, in the order of the cases: the history of the finest run, or why there is none. The stats gain
    "estimated_time_error", "accuracy" and "runs"; the estimate exceeds the accuracy where the finest step
    allowed did not reach it.
    """
    cases = _Cases(systems, grounds, options, progress)
    outcomes: dict[int, Outcome] = {}
    trials = {i: _Trial() for i in range(len(systems))}
    first = _first_halvings(systems[0], options, accuracy) if systems else 0
    for halvings in range(first, _MOST_HALVINGS + 1):
        for i, found in cases.march(trials, halvings):
            if isinstance(found, ConvergenceError):
                outcomes[i] = found
                del trials[i]
            else:
                trials[i] = trials[i].after(found)
        if halvings == first:
            for i, found in cases.march(trials, first - 1, coordinates=False):
                trials[i] = trials[i].checked(found)
        for i, trial in list(trials.items()):
            if trial.estimate <= accuracy or halvings == _MOST_HALVINGS:
                outcomes[i] = trial.result(accuracy)
                del trials[i]
            else:  # its whole history need not stay in memory beside that of the next run
                trials[i] = replace(trial, history=None)
        if not trials:
            break
    return [outcomes[i] for i in range(len(systems))]


def _first_halvings(system: System, options: TransientOptions, accuracy: float) -> int:
    """How often the coarse step is halved in the first run; the impacts' times scale with the period."""
    k = system.K.diagonal() if system.diagonal else np.zeros(1)
    elastic = k[k > 1e-9 * k.max(initial=0.0)]
    if len(elastic) == 0:
        return _USUAL_HALVINGS
    wanted = _FRACTION * 2.0 * math.pi / math.sqrt(elastic.min()) * min(1.0, accuracy / _LIMIT)
    return int(np.clip(round(math.log2(options.dt / wanted)), 1, _MOST_HALVINGS))


@dataclass(frozen=True)
class _Cases:
    """The cases at any step."""

    systems: Sequence[System]
    grounds: Sequence[Callable[[float], Floats]]
    options: TransientOptions
    progress: Progress | None

    def march(
        self, trials: Mapping[int, _Trial], halvings: int, coordinates: bool = True
    ) -> list[tuple[int, Outcome]]:
        """March some of them as far as their trials need; their numbers and outcomes."""
        coarse, every = self.options.dt, self.options.dt * self.options.stride
        base, cuts = _step_of(self.options.integrator, coarse / 2.0**halvings, coarse, every)
        step = replace(self.options, dt=base, cuts=cuts, stride=round(every / base))
        step = replace(step, coordinates=coordinates and step.coordinates)
        cases = []
        for i, trial in trials.items():
            ground = self.grounds[i](base)
            columns = ground.shape[1] if trial.rows is None else (trial.rows - 1) * step.stride + 1
            cases.append(Case(self.systems[i], ground[:, :columns]))
        return list(zip(list(trials), integrate_cases(cases, step, self.progress), strict=True))


@dataclass(frozen=True)
class _Trial:
    """What is known of a case after its last run.

    Attributes
    ----------
    history : of the last run
    measured : (nt, ng) openings of the last run, or its peak opening
    difference : of the last two runs, relative
    estimate : of the error of the last run
    runs, cpu : how many there were, and what they took [s]
    rows : how far a check has to go; None for the whole ground motion
    """

    history: History | None = None
    measured: Floats | None = None
    difference: float = math.nan
    estimate: float = math.inf
    runs: int = 0
    cpu: float = 0.0
    rows: int | None = None

    def after(self, history: History) -> _Trial:
        """What is known after one more run."""
        measured = _measured(history)
        cpu = self.cpu + history.stats["loop_cpu_seconds"]
        known = replace(self, history=history, measured=measured, runs=self.runs + 1, cpu=cpu, rows=None)
        if self.measured is None:
            return replace(known, rows=None if measured.ndim == 1 else _past(measured))
        difference = _difference(self.measured, measured)
        shrink = np.clip(difference / self.difference, *_SHRINK) if self.difference > 0.0 else _USUAL_SHRINK
        return replace(known, difference=difference, estimate=float(difference * shrink / (1.0 - shrink)))

    def checked(self, check: Outcome) -> _Trial:
        """What is known after a run of twice the step; nothing more where that did not converge."""
        assert self.measured is not None
        if isinstance(check, ConvergenceError):
            return replace(self, runs=self.runs + 1, rows=None)
        compared, late = self.measured, 1.0
        if self.rows is not None:
            compared = self.measured[: self.rows]
            late = math.sqrt(1.0 + _LATE * (_LATE_ERROR**2 - 1.0))
        difference = late * _difference(_measured(check), compared)
        estimate = difference * _USUAL_SHRINK / (1.0 - _USUAL_SHRINK)
        cpu = self.cpu + check.stats["loop_cpu_seconds"]
        return replace(self, difference=difference, estimate=estimate, runs=self.runs + 1, cpu=cpu, rows=None)

    def result(self, accuracy: float) -> History:
        """The history of the last run, and what is known of its error."""
        assert self.history is not None
        stats = {
            "estimated_time_error": self.estimate,
            "accuracy": accuracy,
            "runs": float(self.runs),
            "all_runs_cpu_seconds": self.cpu,
        }
        return replace(self.history, stats=self.history.stats | stats)


def _past(measured: Floats) -> int:
    """Rows until nearly all of the squares are past."""
    share = np.cumsum((measured**2).sum(axis=1))
    return max(2, int(np.searchsorted(share, (1.0 - _LATE) * share[-1])) + 1)


def _difference(coarse: Floats, fine: Floats) -> float:
    return float(np.linalg.norm(fine - coarse)) / max(float(np.linalg.norm(fine)), _NEGLIGIBLE)


def _measured(history: History) -> Floats:
    """What is compared between two runs."""
    if history.integrator == "conserving":
        return np.array([history.peaks["opening"].max(initial=0.0)])
    return history.jump[..., 0].copy() if history.jump.size else history.disp


def _step_of(integrator: str, finest: float, coarse: float, every: float) -> tuple[float, tuple[int, ...]]:
    return refined_step(finest, coarse, every) if integrator == "adaptive" else (finest, ())
