"""Refine the step until an accuracy is reached."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from romdam.contact.components import NORMAL
from romdam.core.arrays import Bools, Floats
from romdam.core.errors import ConvergenceError
from romdam.core.system import GapLaw, History, System
from romdam.timestepping.integrators.protocol import Outcome, Progress
from romdam.timestepping.prepared import Prepared
from romdam.timestepping.settings import Settings
from romdam.timestepping.simulate import simulate

_FRACTION = 1.0 / 400.0  # of the longest period: the finest step that leaves about 1 %; longer ones far more
_LIMIT = 0.01  # accuracy below which shorter ones are needed
_USUAL_HALVINGS = 3  # of the coarse step, where the period is not known
_MOST_HALVINGS = 9  # of the coarse step, before the accuracy is reported as missed; limit
_ORDERS = (0.5, 1.3)  # believed range of the order at which the error falls with the step
_UNEVEN = 9.0 / 8.0  # more parts in every second run, so that successive steps are no multiples: 4, 9, 16, 36
_SAFETY = 1.25  # of estimates by three such runs, see `simulate_to`
_UNEVEN_FROM = 2  # halvings of the base step in the first of such runs: 9 has to be a whole number
_USUAL_ORDER = 1.15  # with it 50 of 50 estimates were at least the true error, with 1.5 (and up to 1.7) 39
_LATE = 0.005  # of the squared openings, the last ones, which the check leaves out
_LATE_ERROR = 4.0  # their relative error, believed, over that of the others: 1.7, 6.4 at most on 50 records
_QUIET_RUNS = 3  # of such jobs
_RETRIES = 2  # further halvings of a first step that does not converge
_BASE_HALVINGS = 4  # of the base step at least, where it makes the error
_NEGLIGIBLE = 1e-12  # [m] smaller openings are none
_QUIET_RUN = 1.5  # steps in a base step, on average, below which the base step's own error may count
_CUT = 0.5  # of the time in which joints are closed: where more was cut, it was impacts
_LEFT = 0.05  # of the largest slips: smaller ones that are left are measured by that
_FLOOR = 0.01  # of what all jumps do: openings, or slips, that do less are measured by that


def simulate_to(
    prepared: Sequence[Prepared],
    grounds: Sequence[Callable[[float], Floats]],
    settings: Settings,
    accuracy: float,
    progress: Progress | None = None,
) -> list[Outcome]:
    """Integrate ground motions together, each with ever finer steps until its own estimated error is small.

    The first step follows from the longest period of the open joints. A check with twice that step says how
    good it is, and goes on until nearly all of the squared openings are past. Where that is not enough, runs
    of half the step follow. Two successive runs differ by most of the coarser one's error; the finer one's is
    taken as the difference over (r**p - 1), r being the ratio of their steps and p the order that the last
    two differences show, within what the scheme shows elsewhere (0.5 to 1.3). The error is in L2 over all
    openings and times, and over all slips where joints carry shear, and of the slips that are left, the
    largest; or in the peak opening for a scheme that conserves energy.

    Two runs on nested grids may break the same bonds in the same wrong order, or stick and slide at the same
    wrong steps. So where joints have friction, bonds or other memory there is no check: three runs at least,
    whose steps are no multiples of each other, and the bonds that are broken at every row are compared, too.
    Their two refinements state no less than follows from the first difference alone, with the factor of
    safety that Roache's grid convergence index has for three grids (J. Fluids Eng. 116 (1994) 405).

    Where contact does not change, the base step makes the error: closed springs follow it. So it is halved
    with the finest where joints have a tension stiffness or carry shear, and from the second run on where the
    first hardly cut a base step above what impacts ask for (see `_Motions.quiet`); elsewhere impacts make it.

    Parameters
    ----------
    prepared : one for each motion, see `romdam.timestepping.simulate.simulate`
    grounds : step -> (3, nt) ground acceleration at every step [m/s2]
    settings : their base step is the coarse one to start from, their written rows those of every run
    accuracy : wanted, relative
    progress : called with (base steps done, base steps in all) of every run

    Returns
    -------
    list, in the order of the motions: the history of the finest run, or why there is none. The stats gain
    "estimated_time_error", "accuracy" and "runs"; the estimate exceeds the accuracy where the finest step
    allowed did not reach it.
    """
    motions = _Motions(prepared, grounds, settings, progress)
    outcomes: dict[int, Outcome] = {}
    wanted = _wanted_step(prepared[0].system, accuracy) if prepared else 0.0
    first = _USUAL_HALVINGS
    if wanted > 0.0:
        first = int(np.clip(round(math.log2(settings.steps.base / wanted)), 1, _MOST_HALVINGS))
    trials = {i: _Trial.before_runs(one.system.law, first) for i, one in enumerate(prepared)}
    for halvings in range(first, max(_MOST_HALVINGS, first + _BASE_HALVINGS) + 1):
        for i, outcome in motions.simulate(trials, halvings):
            if not isinstance(outcome, ConvergenceError):
                fineness = trials[i].fineness(halvings)
                trials[i] = trials[i].after(outcome, motions.compared(i, outcome), fineness)
                if halvings == first and settings.steps.base > wanted and hardly_cut(outcome):
                    trials[i] = trials[i].quiet(first)
            elif trials[i].measured is not None or halvings >= min(first + _RETRIES, _MOST_HALVINGS):
                outcomes[i] = outcome
                del trials[i]
        if halvings == first:  # checked with twice the step, but those that the next run is compared with
            ready = {
                i: one
                for i, one in trials.items()
                if one.measured is not None and one.refined_from != first and not one.uneven
            }
            for i, check in motions.simulate(ready, first - 1, only_compared=True):
                if isinstance(check, ConvergenceError):
                    trials[i] = trials[i].unchecked()
                else:
                    trials[i] = trials[i].checked(check, motions.compared(i, check))
        for i, trial in list(trials.items()):
            reached = trial.estimate <= accuracy and trial.agrees
            if reached or halvings == trial.last(first):
                outcomes[i] = trial.result(accuracy)
                del trials[i]
            else:  # its whole history need not stay in memory beside that of the next run
                trials[i] = replace(trial, history=None, rows=None)
        if not trials:
            break
    return [outcomes[i] for i in range(len(prepared))]


def _wanted_step(system: System, accuracy: float) -> float:
    """Finest step of the first run, as impacts scale with the period; 0 where that is unknown [s]."""
    k = system.K.diagonal()[system.M.diagonal() > 0.0] if system.diagonal else np.zeros(1)
    elastic = k[k > 1e-9 * k.max(initial=0.0)]
    if len(elastic) == 0:
        return 0.0
    return _FRACTION * 2.0 * math.pi / math.sqrt(float(elastic.min())) * min(1.0, accuracy / _LIMIT)


def follows_base_step(law: GapLaw) -> bool:
    """Tell whether the base step makes an error of its own: in shear, tension or further laws."""
    return len(law) > 0 and (law.directions > 1 or bool(law.K_nz.any()) or bool(law.laws))


def hardly_cut(history: History) -> bool:
    """Tell whether a run hardly cut its base step, though joints were closed meanwhile."""
    stats, force = history.stats, history.traction[..., NORMAL]
    closed = float((force != 0.0).any(axis=1).mean()) if force.size else 0.0
    if "base_steps" not in stats or closed == 0.0:
        return False
    parts, more = stats["base_step"] / stats["finest_step"], stats["steps"] / stats["base_steps"] - 1.0
    return more <= min(_QUIET_RUN - 1.0, _CUT * closed * (parts - 1.0))


@dataclass(frozen=True)
class _Motions:
    """The motions at any step."""

    prepared: Sequence[Prepared]
    grounds: Sequence[Callable[[float], Floats]]
    settings: Settings
    progress: Progress | None

    def simulate(
        self, trials: Mapping[int, _Trial], halvings: int, only_compared: bool = False
    ) -> list[tuple[int, Outcome]]:
        """Integrate some of them as far as their trials need; their numbers and outcomes.

        Parameters
        ----------
        only_compared : whether nothing but `compared` is made of the histories
        """
        outcomes: dict[int, Outcome] = {}
        for since, uneven in dict.fromkeys((one.refined_from, one.uneven) for one in trials.values()):
            alike = {i: one for i, one in trials.items() if (one.refined_from, one.uneven) == (since, uneven)}
            outcomes.update(self._alike(alike, halvings, since, uneven, only_compared))
        return [(i, outcomes[i]) for i in trials]

    def _alike(
        self,
        trials: Mapping[int, _Trial],
        halvings: int,
        since: int | None,
        uneven: bool,
        only_compared: bool,
    ) -> list[tuple[int, Outcome]]:
        """Integrate those whose steps are the same: `refined_from` is `since`, and `uneven`."""
        coarse, integrator = self.settings.steps, self.prepared[0].integrator
        of_base = 0 if since is None else halvings - since
        more = _uneven_share(since, uneven, halvings)
        base = coarse.base / (more * 2.0**of_base)
        finest = min(base, coarse.base / (more * 2.0 ** min(halvings, _MOST_HALVINGS)))
        settings = replace(
            self.settings,
            steps=integrator.steps(finest, base, coarse.interval),
            to_accuracy=True,
            shear_share=2.0 ** (1 - of_base) if of_base else 1.0,
        )
        steps = settings.steps
        if only_compared:
            settings = replace(settings, only_jumps=len(self.prepared[0].system.law) > 0)
        grounds = []
        for i, trial in trials.items():
            ground = self.grounds[i](steps.base)
            columns = ground.shape[1] if trial.rows is None else (trial.rows - 1) * steps.stride + 1
            grounds.append(ground[:, :columns])
        outcomes = simulate([self.prepared[i] for i in trials], grounds, settings, self.progress)
        return list(zip(list(trials), outcomes, strict=True))

    def compared(self, number: int, history: History) -> Floats:
        """Values by which a run of one of them is compared with its next."""
        return self.prepared[number].integrator.compared(history)


@dataclass(frozen=True)
class _Trial:
    """Knowledge of a motion after its last run.

    Attributes
    ----------
    history : of the last run
    measured : what the last run is compared by, see `Integrator.compared`
    difference : of the last two runs, relative
    parts : into which the last runs divided the coarse step, at most two of them
    estimate : of the error of the last run
    runs, cpu : how many there were, and what they took [s]
    rows : how far a check has to go; None for the whole ground motion
    refined_from : halvings from which on the base step is halved too; None where it stays
    uneven : whether every second run's steps are shorter by `_UNEVEN`; then three runs are compared, and the
        bonds that are broken, too
    broken : (nt, ng) bonds broken in the last run, see `History.bonded`
    least_runs : before an estimate is believed; a spring that two steps damp away alike takes three
    """

    history: History | None = None
    measured: Floats | None = None
    difference: float = math.nan
    parts: tuple[float, ...] = ()
    estimate: float = math.inf
    runs: int = 0
    cpu: float = 0.0
    rows: int | None = None
    refined_from: int | None = None
    uneven: bool = False
    broken: Bools | None = None
    least_runs: int = 2

    @classmethod
    def before_runs(cls, law: GapLaw, first: int) -> Self:
        """Knowledge before the first run of so many halvings, see `simulate_to`; slip is a memory, too."""
        if law.laws or law.directions > 1:
            return cls(refined_from=first - _UNEVEN_FROM, uneven=True, least_runs=_QUIET_RUNS)
        return cls(refined_from=first - 1 if follows_base_step(law) else None)

    def quiet(self, first: int) -> _Trial:
        """Knowledge after a first run that hardly cut its base step."""
        if self.refined_from is None:
            return replace(self, refined_from=first, least_runs=_QUIET_RUNS, rows=None)
        return replace(self, least_runs=_QUIET_RUNS)

    @property
    def agrees(self) -> bool:
        """Tell whether there were runs enough for an estimate to be believed; peaks take two refinements."""
        peaks = self.measured is not None and self.measured.ndim == 1
        return self.runs >= (_QUIET_RUNS if peaks else self.least_runs)

    def last(self, first: int) -> int:
        """Halvings of the last run allowed, where there were so many in the first."""
        return _MOST_HALVINGS if self.refined_from is None else max(_MOST_HALVINGS, first + _BASE_HALVINGS)

    def fineness(self, halvings: int) -> float:
        """Parts into which a run divides the coarse step."""
        return 2.0**halvings * _uneven_share(self.refined_from, self.uneven, halvings)

    def after(self, history: History, measured: Floats, parts: float) -> _Trial:
        """Knowledge after one more run, which divided the coarse step into so many parts."""
        cpu = self.cpu + history.stats["loop_cpu_seconds"]
        known = replace(self, history=history, measured=measured, runs=self.runs + 1, cpu=cpu, rows=None)
        known = replace(known, parts=(*self.parts, parts)[-2:])
        if self.uneven:
            known = replace(known, broken=~history.bonded)
        if self.measured is None:
            if measured.ndim == 1 or self.uneven:
                return known
            # rows until nearly all of the squares are past
            share = np.cumsum((measured**2).sum(axis=tuple(range(1, measured.ndim))))
            past = max(2, int(np.searchsorted(share, (1.0 - _LATE) * share[-1])) + 1)
            return replace(known, rows=past)
        difference = jump_difference(self.measured, measured)
        if self.uneven:
            assert self.broken is not None
            broken = ~history.bonded  # time without the same bonds broken, over that of the finer run's
            disagreement = float((self.broken != broken).sum()) / max(float(broken.sum()), 1.0)
            difference = max(difference, disagreement)
        if measured.ndim == 1:  # peaks agree by chance, so the last two differences have to be small
            return replace(known, difference=difference, estimate=max(difference, self.difference))
        *before, last = self.parts
        if not before:
            estimate = difference * error_over_difference(_USUAL_ORDER, last, parts)
            return replace(known, difference=difference, estimate=estimate)
        (first,) = before
        order = _order_of_error(self.difference, difference, first, last, parts)
        estimate = difference * error_over_difference(order, last, parts)
        if self.uneven:  # two runs may agree by chance
            former = self.difference * error_over_difference(_USUAL_ORDER, first, last)
            estimate = _SAFETY * max(estimate, former * (last / parts) ** _USUAL_ORDER)
        return replace(known, difference=difference, estimate=estimate)

    def unchecked(self) -> _Trial:
        """Knowledge after a run of twice the step that did not converge: nothing more."""
        return replace(self, runs=self.runs + 1, rows=None)

    def checked(self, check: History, measured: Floats) -> _Trial:
        """Knowledge after a run of twice the step."""
        assert self.measured is not None
        compared, late = self.measured, 1.0
        if self.rows is not None:
            compared = self.measured[: self.rows]
            late = math.sqrt(1.0 + _LATE * (_LATE_ERROR**2 - 1.0))
        difference = late * jump_difference(measured, compared)
        estimate = difference * error_over_difference(_USUAL_ORDER, 1.0, 2.0)
        cpu = self.cpu + check.stats["loop_cpu_seconds"]
        known = replace(
            self, difference=difference, estimate=estimate, runs=self.runs + 1, cpu=cpu, rows=None
        )
        return replace(known, parts=(self.parts[-1] / 2.0, self.parts[-1]))

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


def _uneven_share(since: int | None, uneven: bool, halvings: int) -> float:
    """What more a run divides the coarse step into than its halvings do."""
    return _UNEVEN if uneven and since is not None and (halvings - since) % 2 else 1.0


def error_over_difference(order: float, coarse: float, fine: float) -> float:
    """Error of the finer of two runs over their difference, at an order; their steps are 1/coarse, 1/fine."""
    return 1.0 / ((fine / coarse) ** order - 1.0)


def _order_of_error(former: float, difference: float, first: float, last: float, parts: float) -> float:
    """Order at which three runs differ as they do, within what is believed.

    Parameters
    ----------
    former, difference : of the first two runs, and of the last two
    first, last, parts : into which the three divided a step
    """
    if not former > 0.0:
        return _USUAL_ORDER
    orders = np.linspace(*_ORDERS, 161)
    coarse, middle, fine = (divided**-orders for divided in (first, last, parts))
    return float(orders[np.argmin(np.abs((middle - fine) / (coarse - middle) - difference / former))])


def jump_difference(coarse: Floats, fine: Floats) -> float:
    """Difference of two runs, relative: of openings and slips apart, in L2, and of the slips that are left.

    The largest of the three counts. What is left is the slip in the last row, over all gaps; its difference
    counts twice, for judgements of a dam rest on it.
    """
    if fine.ndim < 3 or fine.shape[2] == 1:
        return float(np.linalg.norm(fine - coarse)) / max(float(np.linalg.norm(fine)), _NEGLIGIBLE)
    least = max(_FLOOR * float(np.linalg.norm(fine)), _NEGLIGIBLE)
    opening, slip = fine[..., NORMAL], fine[..., NORMAL + 1 :]
    of_opening, of_slip = coarse[..., NORMAL] - opening, coarse[..., NORMAL + 1 :] - slip
    largest = math.sqrt(float((slip**2).sum(axis=(1, 2)).max()))
    return max(
        float(np.linalg.norm(of_opening)) / max(float(np.linalg.norm(opening)), least),
        float(np.linalg.norm(of_slip)) / max(float(np.linalg.norm(slip)), least),
        2.0
        * float(np.linalg.norm(of_slip[-1]))
        / max(float(np.linalg.norm(slip[-1])), _LEFT * largest, least / math.sqrt(len(fine))),
    )
