"""Refine the step until an accuracy is reached."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from romdam.contact.components import NORMAL
from romdam.core.arrays import Bools, Floats
from romdam.core.errors import ConvergenceError
from romdam.core.system import GapLaw, History, System
from romdam.timestepping.prepared import Outcome, Prepared, Progress
from romdam.timestepping.settings import Settings
from romdam.timestepping.simulate import simulate

_FRACTION = 1.0 / 400.0  # of the longest period: the finest step that leaves about 1 %; longer ones far more
_LIMIT = 0.01  # accuracy below which shorter ones are needed
_USUAL_HALVINGS = 3  # of the coarse step, where the period is not known
_MOST_HALVINGS = 9  # of the coarse step, before the accuracy is reported as missed; limit
_ORDERS = (0.5, 1.3)  # believed range of the order at which the error falls with the step
_ORDERS_OF_FRICTION = (0.25, 1.3)  # the same of plain friction: on stiff joints it begins at 0.25 to 0.4
_UNEVEN = 9.0 / 8.0  # more parts in every second run, so that successive steps are no multiples: 4, 9, 16, 36
_SAFETY = 1.25  # of estimates by three such runs, see `simulate_to`
_UNEVEN_BASE = 2  # halvings of the base step from which on it is uneven, too
_UNEVEN_FROM = 3  # halvings in the first of such runs at least: the parts of half a base step are whole
_USUAL_ORDER = 1.15  # with it 50 of 50 estimates were at least the true error, with 1.5 (and up to 1.7) 39
_LATE = 0.005  # of the squared openings, the last ones, which the check leaves out
_LATE_ERROR = 4.0  # their relative error, believed, over that of the others: 1.7, 6.4 at most on 50 records
_QUIET_RUNS = 3  # of jobs whose first run hardly cut a base step, or with memory
_BEFORE = 2  # doublings of the step in the first of three runs that show their order
_TRIED = 0.5  # of the squared openings, the first ones, which the trial of the base step covers
_MATTERS = 0.25  # of the accuracy: what the base step may leave without being halved
_RETRIES = 2  # further halvings of a first step that does not converge
_BASE_HALVINGS = 4  # of the base step at least, where it makes the error
_NEGLIGIBLE = 1e-12  # [m] smaller openings are none
_STILL = 1e-6  # of the values themselves: what moves less is round-off
_QUIET_RUN = 1.5  # steps in a base step, on average, below which the base step's own error may count
_CUT = 0.5  # of the time in which joints are closed: where more was cut, it was impacts
_LEFT = 0.05  # of the largest slips: smaller ones that are left are measured by that
_FLOOR = 0.01  # of what all jumps do: openings, or slips, that do less are measured by that
QUANTITIES = ("openings", "peaks", "slips", "residual_slips")  # of which errors are stated, in this order


def simulate_to(
    prepared: Sequence[Prepared],
    grounds: Sequence[Callable[[float], Floats]],
    settings: Settings,
    accuracy: float,
    progress: Progress | None = None,
    of_slips: Mapping[str, float] | None = None,
) -> list[Outcome]:
    """Integrate ground motions together, each with ever finer steps until its own estimated error is small.

    The first step follows from the longest period of the open joints. A check with twice that step, and half
    of the base step, says how good it is, and goes on until nearly all of the squared openings are past.
    Where that is not enough, runs of half the step follow. Two successive runs differ by most of the coarser
    one's error; the finer one's is taken as the difference over (r**p - 1), r being the ratio of their steps
    and p the order that the last two differences show, within what the scheme shows elsewhere (0.5 to 1.3).
    The error is that of the openings in L2; or of the peak opening for a scheme that conserves energy. See
    `jump_differences`.

    Friction may converge at half the order. So it takes three runs at least, the first of four times the
    step, whose two differences show the order. The errors of slips and residual slips are stated, too, and
    count where `of_slips` asks for them; slip that is left may hang on the base step, which is halved then.

    Two runs on nested grids may break the same bonds in the same wrong order, or leave the same wrong slip.
    So where joints have bonds or other memory, or slips are asked for, the steps of three runs at least are
    no multiples of each other, and the bonds that are broken at every row are compared, too. Their two
    refinements state no less than follows from the first difference alone, with the factor of safety that
    Roache's grid convergence index has for three grids (J. Fluids Eng. 116 (1994) 405).

    Where contact does not change, the base step makes the error: closed springs follow it. So with friction
    or memory every second run has half of it, and its error is in the differences. Where they are too
    large, a trial repeats the last run but one with the other base step. Only if that matters is the base
    step halved with the finest from there on. Joints without shear halve it from the first where they have
    a tension stiffness, and from the second run on where the first hardly cut a base step above what
    impacts ask for.

    Parameters
    ----------
    prepared : one for each motion, see `romdam.timestepping.simulate.simulate`
    grounds : step -> (3, nt) ground acceleration at every step [m/s2]
    settings : their base step is the coarse one to start from, their written rows those of every run
    accuracy : of the openings, wanted, relative
    progress : called with (base steps done, base steps in all) of every run
    of_slips : "slips" or "residual_slips" -> accuracy wanted of them, relative

    Returns
    -------
    list, in the order of the motions: the history of the finest run, or why there is none. The stats gain
    "estimated_time_error" and "accuracy" of the openings, the same with "_slips" and "_residual_slips" where
    joints carry shear, and "runs"; an estimate exceeds its accuracy where the finest step allowed did not
    reach it.
    """
    motions = _Motions(prepared, grounds, settings, progress)
    outcomes: dict[int, Outcome] = {}
    asked = {"openings": accuracy, **(of_slips or {})}
    wanted = _wanted_step(prepared[0].system, accuracy) if prepared else 0.0
    first = _USUAL_HALVINGS
    if wanted > 0.0:
        first = int(np.clip(round(math.log2(settings.steps.base / wanted)), 1, _MOST_HALVINGS))
    trials = {i: _Trial.before_runs(one.system.law, first, asked) for i, one in enumerate(prepared)}
    begin = min((trial.first for trial in trials.values()), default=first)
    for halvings in range(begin, max(_MOST_HALVINGS, first + _BASE_HALVINGS) + 1):
        due = {i: trial for i, trial in trials.items() if trial.first <= halvings}
        early = {i: trial for i, trial in due.items() if trial.is_early}
        others = {i: trial for i, trial in due.items() if i not in early}
        done = motions.simulate(early, halvings, only_compared=True) + motions.simulate(others, halvings)
        for i, outcome in done:
            trial = trials[i]
            if not isinstance(outcome, ConvergenceError):
                trials[i] = trial.after(outcome, motions.compared(i, outcome), halvings)
                coarse = trial.checks and settings.steps.base > wanted
                if coarse and halvings == trials[i].first and hardly_cut(outcome):
                    trials[i] = trials[i].quiet()
            elif trial.measured is not None or halvings >= min(first + _RETRIES, _MOST_HALVINGS):
                outcomes[i] = outcome
                del trials[i], due[i]
        motions.check(trials, [i for i in due if trials[i].checked_at(halvings)], halvings)
        motions.try_base_step(trials, [i for i in due if trials[i].in_doubt])
        for i in due:
            if trials[i].reached or halvings == trials[i].last:
                outcomes[i] = trials[i].result()
                del trials[i]
            else:  # its whole history need not stay in memory beside that of the next run
                trials[i] = replace(trials[i], history=None, rows=None)
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
        for kind in dict.fromkeys(one.steps_at(halvings) for one in trials.values()):
            alike = {i: one for i, one in trials.items() if one.steps_at(halvings) == kind}
            outcomes.update(self._alike(alike, kind, only_compared))
        return [(i, outcomes[i]) for i in trials]

    def check(self, trials: dict[int, _Trial], some: Sequence[int], halvings: int) -> None:
        """Check some trials with twice the finest step of their first run, and half of its base step."""
        halved = dict[int, _Trial]()  # closed springs follow the base step, which is not to be in both runs
        for i in some:
            shared = trials[i].refined_from is None and halvings > 1
            halved[i] = replace(trials[i], refined_from=halvings - 2) if shared else trials[i]
        for i, check in self.simulate(halved, halvings - 1, only_compared=True):
            if isinstance(check, ConvergenceError):
                trials[i] = trials[i].unchecked()
            else:
                trials[i] = trials[i].checked(check, self.compared(i, check))

    def try_base_step(self, trials: dict[int, _Trial], some: Sequence[int]) -> None:
        """Repeat the last run but one of some trials with the other base step, and learn if it matters."""
        for i in some:
            trial = trials[i]
            assert trial.former is not None
            halvings = trial.former_halvings
            since = halvings if trial.steps_at(halvings)[0] > 1.0 else halvings - 1
            other = replace(trial, refined_from=since, rows=trial.rows_of(trial.former, _TRIED))
            for _, tried in self.simulate({i: other}, halvings, only_compared=True):
                if not isinstance(tried, ConvergenceError):
                    trials[i] = trial.tried(tried, self.compared(i, tried))

    def _alike(
        self, trials: Mapping[int, _Trial], kind: tuple[float, float, float], only_compared: bool
    ) -> list[tuple[int, Outcome]]:
        """Integrate those whose steps are the same, see `_Trial.steps_at`."""
        coarse, integrator = self.settings.steps, self.prepared[0].integrator
        of_base, parts, shear_share = kind
        base = coarse.base / of_base
        settings = replace(
            self.settings,
            steps=integrator.steps(min(base, coarse.base / parts), base, coarse.interval),
            to_accuracy=True,
            shear_share=shear_share,
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
    asked : accuracy wanted of openings, and of slips and residual slips where they are asked for
    first : halvings of the coarse step in the first run
    history : of the last run
    measured, former : what the last run is compared by, and the one before, see `Integrator.compared`
    former_halvings : those of the run before
    difference : of the last two runs, relative, of each quantity of `jump_differences`
    parts : into which the last runs divided the coarse step, at most two of them
    estimate : of the errors of the last run
    runs, cpu : how many there were, and what they took [s]
    rows : how far a check has to go; None for the whole ground motion
    refined_from : halvings from which on the base step is halved too; None where it stays
    uneven : whether every second run's steps are shorter by `_UNEVEN`; then three runs are compared, and the
        bonds that are broken, too
    broken : (nt, ng) bonds broken in the last run, see `History.bonded`
    least_runs : before an estimate is believed; a spring that two steps damp away alike takes three
    checks : whether a run of twice the step checks the first
    base_tried : whether the base step was found not to matter
    """

    asked: Mapping[str, float]
    first: int = _USUAL_HALVINGS
    history: History | None = None
    measured: Floats | None = None
    former: Floats | None = None
    former_halvings: int = 0
    difference: Floats = field(default_factory=lambda: np.array([math.nan]))
    parts: tuple[float, ...] = ()
    estimate: Floats = field(default_factory=lambda: np.array([math.inf]))
    runs: int = 0
    cpu: float = 0.0
    rows: int | None = None
    refined_from: int | None = None
    uneven: bool = False
    broken: Bools | None = None
    least_runs: int = 2
    checks: bool = True
    base_tried: bool = False

    @classmethod
    def before_runs(cls, law: GapLaw, first: int, asked: Mapping[str, float]) -> Self:
        """Knowledge before the first run, of so many halvings where friction is not to show its order."""
        if law.laws or len(asked) > 1:
            first = max(first, _UNEVEN_FROM)
            since = first - _UNEVEN_BASE if len(asked) > 1 else None
            return cls(asked, first, refined_from=since, uneven=True, least_runs=_QUIET_RUNS, checks=False)
        if law.directions > 1:
            return cls(asked, max(first - _BEFORE, 1), least_runs=_QUIET_RUNS, checks=False)
        halved = follows_base_step(law)
        return cls(asked, first, refined_from=first - 1 if halved else None)

    def quiet(self) -> _Trial:
        """Knowledge after a first run that hardly cut its base step."""
        since = self.first if self.refined_from is None else self.refined_from
        rows = None if self.refined_from is None else self.rows
        return replace(self, refined_from=since, least_runs=_QUIET_RUNS, rows=rows)

    @property
    def is_early(self) -> bool:
        """Tell whether the next run cannot be the last, and only its jumps are compared."""
        return not self.checks and not self.uneven and self.runs + 1 < self.least_runs

    def checked_at(self, halvings: int) -> bool:
        """Tell whether a check follows the run of so many halvings: the first, if the next is like it."""
        return (
            self.checks
            and self.measured is not None
            and halvings == self.first
            and self.refined_from != halvings
        )

    @property
    def reached(self) -> bool:
        """Tell whether runs enough for an estimate to be believed say that every accuracy is kept."""
        peaks = self.measured is not None and self.measured.ndim == 1  # take two refinements
        enough = self.runs >= (_QUIET_RUNS if peaks else self.least_runs)
        found = dict(zip(QUANTITIES, self.estimate, strict=False))
        return enough and all(found.get(name, math.inf) <= wanted for name, wanted in self.asked.items())

    @property
    def in_doubt(self) -> bool:
        """Tell whether the base step is to be tried: runs enough do not do, and it may be why.

        Not after a first run and its check, unless no finer one may follow.
        """
        if self.base_tried or self.refined_from is not None or self.former is None or self.former.ndim == 1:
            return False
        finest = self.former_halvings + 1 >= _MOST_HALVINGS
        if self.runs < self.least_runs or (self.checks and self.runs < _QUIET_RUNS and not finest):
            return False
        return not self.reached

    @property
    def last(self) -> int:
        """Halvings of the last run allowed."""
        more = 0 if self.refined_from is None else self.first + _BASE_HALVINGS
        return max(_MOST_HALVINGS, more)

    def steps_at(self, halvings: int) -> tuple[float, float, float]:
        """Parts of the coarse step in a base step and in a finest step, and `Settings.shear_share`."""
        of_base = 0 if self.checks else (halvings - self.first) % 2
        if self.refined_from is not None:
            of_base = max(halvings - self.refined_from, 0)
        more = _UNEVEN if self.uneven and (halvings - self.first) % 2 else 1.0
        share = 2.0 ** (1 - of_base) if of_base else 1.0
        if self.uneven:
            share = min(share, 0.5 ** (1 + halvings - self.first))
        parts = more * 2.0 ** min(halvings, _MOST_HALVINGS)
        return (more if of_base >= _UNEVEN_BASE else 1.0) * 2.0**of_base, parts, share

    def fineness(self, halvings: int) -> float:
        """Parts into which a run divides the coarse step."""
        return 2.0**halvings * (_UNEVEN if self.uneven and (halvings - self.first) % 2 else 1.0)

    @staticmethod
    def rows_of(measured: Floats, share: float) -> int:
        """Rows until a share of the squares of what has moved is past."""
        squares = ((measured - measured[0]) ** 2).sum(axis=tuple(range(1, measured.ndim))).cumsum()
        return max(2, int(np.searchsorted(squares, share * squares[-1])) + 1)

    def after(self, history: History, measured: Floats, halvings: int) -> _Trial:
        """Knowledge after one more run, of so many halvings of the coarse step."""
        parts = self.fineness(halvings)
        cpu = self.cpu + history.stats["loop_cpu_seconds"]
        known = replace(
            self, history=history, measured=measured, former=self.measured, runs=self.runs + 1, cpu=cpu,
            rows=None, parts=(*self.parts, parts)[-2:], former_halvings=halvings - 1,
        )  # fmt: skip
        if self.uneven:
            known = replace(known, broken=~history.bonded)
        if self.measured is None:
            if measured.ndim == 1 or not self.checks:
                return known
            return replace(known, rows=self.rows_of(measured, 1.0 - _LATE))
        difference = jump_differences(self.measured, measured)
        if self.uneven:
            assert self.broken is not None
            broken = ~history.bonded  # time without the same bonds broken, over that of the finer run's
            disagreement = float((self.broken != broken).sum()) / max(float(broken.sum()), 1.0)
            difference = np.maximum(difference, disagreement)
        if measured.ndim == 1:  # peaks agree by chance, so the last two differences have to be small
            return replace(known, difference=difference, estimate=np.fmax(difference, self.difference))
        *before, last = self.parts
        if not before:
            estimate = difference * error_over_difference(_USUAL_ORDER, last, parts)
            return replace(known, difference=difference, estimate=estimate)
        (first,) = before
        believed = _ORDERS if self.checks or self.uneven else _ORDERS_OF_FRICTION
        orders = [
            _order_of_error(one, other, (first, last, parts), believed)
            for one, other in zip(self.difference, difference, strict=True)
        ]
        factors = [error_over_difference(order, last, parts) for order in orders]
        estimate = difference * np.array(factors)
        if self.uneven:  # two runs may agree by chance
            former = self.difference * error_over_difference(_USUAL_ORDER, first, last)
            estimate = _SAFETY * np.maximum(estimate, former * (last / parts) ** _USUAL_ORDER)
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
        difference = late * jump_differences(measured, compared)
        estimate = difference * error_over_difference(_USUAL_ORDER, 1.0, 2.0)
        cpu = self.cpu + check.stats["loop_cpu_seconds"]
        return replace(
            self, difference=difference, estimate=estimate, runs=self.runs + 1, cpu=cpu, rows=None,
            parts=(self.parts[-1] / 2.0, self.parts[-1]), former=measured, former_halvings=self.first - 1,
        )  # fmt: skip

    def tried(self, other: History, measured: Floats) -> _Trial:
        """Knowledge after the trial with the other base step, halved with the finest if it matters."""
        assert self.former is not None
        difference = jump_differences(self.former[: len(measured)], measured)
        of_base = difference * (1.0 + error_over_difference(_USUAL_ORDER, 1.0, 2.0))
        found = dict(zip(QUANTITIES, of_base, strict=False))
        matters = any(found[name] > _MATTERS * wanted for name, wanted in self.asked.items())
        since = self.former_halvings + 1 if matters else None
        cpu = self.cpu + other.stats["loop_cpu_seconds"]
        return replace(self, refined_from=since, base_tried=True, runs=self.runs + 1, cpu=cpu)

    def result(self) -> History:
        """The history of the last run, and what is known of its error."""
        assert self.history is not None
        stats = dict(zip(names_of_errors(len(self.estimate)), map(float, self.estimate), strict=True))
        for name, wanted in self.asked.items():
            stats["accuracy" if name == "openings" else f"accuracy_{name}"] = wanted
        stats |= {"runs": float(self.runs), "all_runs_cpu_seconds": self.cpu}
        return replace(self.history, stats=self.history.stats | stats)


def names_of_errors(count: int) -> list[str]:
    """Names in a run's stats of the errors of so many of `QUANTITIES`."""
    return ["estimated_time_error", *(f"estimated_time_error_{name}" for name in QUANTITIES[1:count])]


def error_over_difference(order: float, coarse: float, fine: float) -> float:
    """Error of the finer of two runs over their difference, at an order; their steps are 1/coarse, 1/fine."""
    return 1.0 / ((fine / coarse) ** order - 1.0)


def _order_of_error(
    former: float, difference: float, parts: tuple[float, float, float], believed: tuple[float, float]
) -> float:
    """Order at which three runs differ as they do, within what is believed.

    Parameters
    ----------
    former, difference : of the first two runs, and of the last two
    parts : into which the three divided a step
    """
    if not former > 0.0:
        return _USUAL_ORDER
    orders = np.linspace(*believed, 161)
    coarse, middle, fine = (divided**-orders for divided in parts)
    return float(orders[np.argmin(np.abs((middle - fine) / (coarse - middle) - difference / former))])


def jump_differences(coarse: Floats, fine: Floats, rest: Floats | None = None) -> Floats:
    """Differences of two runs, relative to what moves: to the values less those at rest.

    Parameters
    ----------
    coarse, fine : (nt, ng, d) openings and slips, or other values of any shape
    rest : the values at rest, without the first dimension; the first row of `fine` if not given

    Returns
    -------
    (4,) of openings in L2 over all gaps and times, of their peaks, of slips in L2, and of the residual slips,
    those of the last row, in L2 over all gaps. Openings, or slips, that do less than `_FLOOR` of all are
    measured by that, and residual slips below `_LEFT` of the largest by that; what moves by less than
    `_STILL` of the values by that. (2,) in L2 and of peaks where
    there are no slips; (1,) of values that are peaks themselves.
    """
    if fine.ndim == 1:
        size = max(float(np.linalg.norm(fine)), _NEGLIGIBLE)
        return np.array([float(np.linalg.norm(fine - coarse)) / size])
    rest = fine[0] if rest is None else rest
    moved, off, still = fine - rest, coarse - fine, _STILL * float(np.linalg.norm(fine))
    if fine.ndim < 3 or fine.shape[2] == 1:
        size = max(float(np.linalg.norm(moved)), still, _NEGLIGIBLE)
        of_peaks = _peak_difference(coarse - rest, moved, _STILL * float(np.abs(fine).max(initial=0.0)))
        return np.array([float(np.linalg.norm(off)) / size, of_peaks])
    least = max(_FLOOR * float(np.linalg.norm(moved)), still, _NEGLIGIBLE)
    opening, slip = moved[..., NORMAL], moved[..., NORMAL + 1 :]
    largest = math.sqrt(float((slip**2).sum(axis=(1, 2)).max()))
    of_opening, of_slip = off[..., NORMAL], off[..., NORMAL + 1 :]
    floor = max(_FLOOR * float(np.abs(moved).max()), _STILL * float(np.abs(fine).max()))
    of_peaks = _peak_difference(opening + of_opening, opening, floor)
    pairs = (
        (of_opening, max(float(np.linalg.norm(opening)), least)),
        (of_slip, max(float(np.linalg.norm(slip)), least)),
        (
            of_slip[-1],
            max(float(np.linalg.norm(slip[-1])), _LEFT * largest, least / math.sqrt(len(fine))),
        ),
    )
    in_l2, *of_slips = [float(np.linalg.norm(difference)) / size for difference, size in pairs]
    return np.array([in_l2, of_peaks, *of_slips])


def _peak_difference(coarse: Floats, fine: Floats, least: float = 0.0) -> float:
    """What peaks (nt, ...) differ by: the largest, or all places' in root mean square if that is more.

    The largest values of two runs may agree by chance. Where nothing opens, the largest motion is the
    measure, or `least` if that is more.
    """
    each, wanted = coarse.max(axis=0), fine.max(axis=0)
    largest = float(wanted.max())
    size = max(largest if largest > 0.0 else float(np.abs(fine).max()), least, _NEGLIGIBLE)
    of_places = float(np.linalg.norm(each - wanted)) / max(float(np.linalg.norm(wanted)), size)
    return max(abs(float(each.max()) - largest) / size, of_places)
