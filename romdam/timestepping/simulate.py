"""Integrate a system with gaps under ground acceleration.

To add an integrator, write one function with the signature of `adaptive` and name it in INTEGRATORS. It gets
one case, or many that it may integrate together.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from romdam.contact.laws.catalogue import further_keys
from romdam.core.arrays import Floats
from romdam.core.errors import ConfigError, ConvergenceError
from romdam.core.system import History, System
from romdam.timestepping.energy import imbalance
from romdam.timestepping.integrators.generalized_alpha import generalized_alpha
from romdam.timestepping.modal.mode_split import StateSplit, split_conserving, split_states
from romdam.timestepping.modal.runs import Case, Progress, march_cases
from romdam.timestepping.modal.symmetry import folded, unfolded
from romdam.timestepping.options import TransientOptions

Outcome = History | ConvergenceError

_CACHE_BYTES = 0.4e6  # of the gaps of one run


def integrate(
    system: System, ground: Floats, options: TransientOptions, progress: Progress | None = None
) -> History:
    """Integrate from the initial state over the whole ground motion.

    Parameters
    ----------
    system : the open-joint system
    ground : (3, nt) ground acceleration at every step [m/s2]
    options : see `TransientOptions`
    progress : called with (steps done, steps in all)

    Raises
    ------
    ConfigError
        where the integrator does not suit the system.
    ConvergenceError
        where the initial state or a step does not converge; it names time, gap, residual and remedy.
    """
    outcome = integrate_cases([Case(system, ground)], options, progress)[0]
    if isinstance(outcome, ConvergenceError):
        raise outcome
    return outcome


def integrate_cases(
    cases: Sequence[Case], options: TransientOptions, progress: Progress | None = None
) -> list[Outcome]:
    """Integrate several cases that differ in ground motion, damping and joints' parameters at most.

    Parameters
    ----------
    progress : called with (steps done, steps in all), of all cases

    Returns
    -------
    list, in the order of the cases: the history, or why there is none

    Raises
    ------
    ConfigError
        where the integrator does not suit a system.
    """
    if options.integrator not in INTEGRATORS:
        raise ConfigError(f"no integrator {options.integrator!r}; there are {', '.join(INTEGRATORS)}")
    outcomes = INTEGRATORS[options.integrator](cases, options, progress or (lambda done, total: None))
    return [one if isinstance(one, ConvergenceError) else _with_imbalance(one) for one in outcomes]


def _with_imbalance(history: History) -> History:
    return replace(history, stats=history.stats | {"ledger_imbalance": imbalance(history.energy)})


def modal(cases: Sequence[Case], options: TransientOptions, progress: Progress) -> list[Outcome]:
    """Exact modal propagation at a fixed step, every mode a state, force and spring at its end: the baseline.

    Raises
    ------
    ConfigError
        for a system that is not diagonal.
    """
    plain = replace(options, cuts=(), midpoint=False, flexible_ratio=math.inf, alike=False)
    return adaptive(cases, plain, progress)


def adaptive(cases: Sequence[Case], options: TransientOptions, progress: Progress) -> list[Outcome]:
    """Exact modal propagation with steps cut where contact changes, damped high modes as a flexibility.

    Raises
    ------
    ConfigError
        for a system that is not diagonal.
    """

    def split(system: System) -> StateSplit:
        ratio = options.flexible_ratio
        return system.kept.of(("states", ratio), lambda: split_states(system, ratio))

    marched = [Case(_folded(case, options), case.ground) for case in cases]
    outcomes = _march_alike(marched, options, progress, split)
    for i, case in enumerate(marched):
        outcome, alike = outcomes[i], case.system.alike
        if alike is not None and isinstance(outcome, History):
            outcomes[i] = unfolded(outcome, alike)
        elif alike is not None:  # the message has to name a gap of the whole
            outcomes[i] = _march_alike([cases[i]], options, progress, split)[0]
    return outcomes


def _folded(case: Case, options: TransientOptions) -> System:
    """The system to march: folded where some of its gaps move alike under the ground motion."""
    if not options.alike or options.start is not None or options.shift is not None:
        return case.system
    shaken, folds = case.ground.any(axis=1), case.system.folds
    key = shaken.tobytes()
    if key not in folds:
        folds[key] = folded(case.system, np.flatnonzero(shaken))
    return folds[key] or case.system


def conserving(cases: Sequence[Case], options: TransientOptions, progress: Progress) -> list[Outcome]:
    """Massless boundary and joint force linear over a fixed step: for scenes without damping.

    A joint force constant over the step takes almost all energy out of impacts that nothing damps
    (94 to 99 % in 10 s on the two-cantilever model, at any step); this scheme keeps it, within a drift
    that the ledger reports as `contact`.

    Raises
    ------
    ConfigError
        for a system that is not diagonal, or damped, and for a step beyond the stability limit.
    """
    if any(case.system.C.count_nonzero() for case in cases):
        raise ConfigError(
            "transient.integrator: conserving is for scenes without damping, and this one has some: its "
            "massless joint boundary is wrong where damping acts on it; use adaptive, the default here"
        )
    laws = sorted({key for case in cases for key in further_keys(case.system.law)})
    if laws:
        raise ConfigError(
            f"transient.integrator: conserving knows no {', '.join(laws)}; "
            "use adaptive, or leave these keys out of the joints"
        )
    fixed = replace(options, cuts=())
    return _march_alike(
        cases, fixed, progress, lambda system: split_conserving(system, options.dt), conserving=True
    )


def full_order(cases: Sequence[Case], options: TransientOptions, progress: Progress) -> list[Outcome]:
    """Generalised-alpha, one case after another.

    Raises
    ------
    ConfigError
        where the integrator does not suit a system.
    """
    outcomes: list[Outcome] = []
    for case in cases:
        try:
            outcomes.append(generalized_alpha(case.system, case.ground, options, progress))
        except ConvergenceError as error:
            outcomes.append(error)
    return outcomes


def _march_alike(
    cases: Sequence[Case],
    options: TransientOptions,
    progress: Progress,
    split_of: Callable[[System], StateSplit],
    conserving: bool = False,
) -> list[Outcome]:
    """March the cases in groups whose systems have the same states and the same kind of gaps."""
    splits: dict[int, StateSplit] = {}
    groups: dict[tuple[object, ...], list[int]] = {}
    for i, case in enumerate(cases):
        system, law = case.system, case.system.law
        if not system.diagonal:
            raise ConfigError(
                f"transient.integrator: {options.integrator} needs a reduced model whose modes no dashpots "
                "couple; use generalized_alpha, or model.order: reduced and rock without viscous faces"
            )
        if id(system) not in splits:
            splits[id(system)] = split_of(system)
        groups_of = b"" if system.alike is None else system.alike.gaps.tobytes()
        laws = law.has_memory, tuple(one.law for one in law.laws), bool(law.laws and law.mu.any())
        kind = (law.directions, *laws, bool(law.K_nz.any()), groups_of)
        groups.setdefault((splits[id(system)].states.tobytes(), *kind), []).append(i)
    outcomes: dict[int, Outcome] = {}
    total = sum(case.ground.shape[1] - 1 for case in cases)
    for group in _parted(groups.values(), cases):
        before = sum(cases[i].ground.shape[1] - 1 for i in outcomes)
        split = splits[id(cases[group[0]].system)]

        def report(done: int, _: int, before: int = before) -> None:
            progress(before + done, total)

        found = march_cases([cases[i] for i in group], split, options, report, conserving)
        outcomes.update(zip(group, found, strict=True))
    return [outcomes[i] for i in range(len(cases))]


def _parted(groups: Iterable[list[int]], cases: Sequence[Case]) -> Iterator[list[int]]:
    """The groups, where runs gain by marching together: else every run of them by itself.

    The products with the modes gain by it, little since those of a lone run take four rows at a time. What
    the gaps carry from step to step (an inverse, or the gathered W) is each run's own, and beyond a core's
    cache runs crowd each other out: 8 together have 1.14 times the throughput with 100 gaps, 0.89 times with
    400, 0.90 times with 1,500 (`tests/benchmarks/bench_batch.py`).
    """
    for group in groups:
        law = cases[group[0]].system.law
        carried = 8.0 * (law.directions * len(law)) ** 2
        most = len(group) if carried < _CACHE_BYTES else 1
        for first in range(0, len(group), most):
            yield group[first : first + most]


Integrator = Callable[[Sequence[Case], TransientOptions, Progress], list[Outcome]]
INTEGRATORS: dict[str, Integrator] = {
    "adaptive": adaptive,
    "conserving": conserving,
    "modal": modal,
    "generalized_alpha": full_order,
}
