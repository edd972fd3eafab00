"""Runs that are integrated together: their arrays, the loop, and their histories."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from romdam.contact.problem import GapMemory
from romdam.contact.solvers.state import SolverState, condensed_contacts, iterations, solver_state
from romdam.core.arrays import Floats, Ints, Record, at
from romdam.core.errors import ConvergenceError
from romdam.core.system import History, System
from romdam.timestepping.energy import ENERGIES, ledger
from romdam.timestepping.equilibrium import GapState, resumed, static_equilibrium, take_over, undeformed
from romdam.timestepping.modal.arrays import (
    CLOCK,
    TRIES,
    VARIANT,
    Arrays,
    Batch,
    HistoryBuffer,
    ModalModel,
    ModalState,
    StepHierarchy,
    new_work,
)
from romdam.timestepping.modal.loop import integrate
from romdam.timestepping.modal.mode_split import (
    StateSplit,
    modal_model,
    observed_motion,
    run_memory,
    step_levels,
    whole_motion,
)
from romdam.timestepping.options import TransientOptions
from romdam.timestepping.peaks import first_peaks, named_peaks

Progress = Callable[[int, int], None]

_ROWS = tuple(name for name in HistoryBuffer._fields if name != "stride")
_STEPS = 400  # of every run between two reports of progress


@dataclass(frozen=True)
class Case:
    """One run: a system and its ground motion.

    Attributes
    ----------
    system : diagonal; those of one march differ in damping and in the joints' parameters at most. Runs with
        the same object share its arrays
    ground : (3, nt) ground acceleration at every base step [m/s2]
    """

    system: System
    ground: Floats


class Initial(NamedTuple):
    """Displacement and velocity of the modes, and the gaps, to start from."""

    q: Floats
    v: Floats
    gaps: GapState


def march_cases(
    cases: Sequence[Case],
    split: StateSplit,
    options: TransientOptions,
    progress: Progress,
    conserving: bool = False,
) -> list[History | ConvergenceError]:
    """March all cases over their whole ground motions.

    Parameters
    ----------
    split : the states, the same for all
    conserving : whether the joint force acts with its mean over a step
    progress : called with (base steps done, base steps in all), of all runs

    Returns
    -------
    list, in the order of the cases: the history, or why there is none
    """
    found = {id(case.system): case.system for case in cases}
    initial = {key: _initial(system, options) for key, system in found.items()}
    chosen, starts = [], []
    for case in cases:
        start = initial[id(case.system)]
        if not isinstance(start, ConvergenceError):
            chosen.append(case)
            starts.append(start)
    marched = iter(_march(chosen, split, options, progress, (starts, conserving)) if chosen else ())
    starts_of_all = (initial[id(case.system)] for case in cases)
    return [start if isinstance(start, ConvergenceError) else next(marched) for start in starts_of_all]


def _march(
    cases: Sequence[Case],
    split: StateSplit,
    options: TransientOptions,
    progress: Progress,
    start: tuple[Sequence[Initial], bool],
) -> list[History | ConvergenceError]:
    """March the cases from their initial states to their ends."""
    begun = time.process_time()
    arrays = _arrays(cases, split, options, *start)
    # no step: a first start compiles here, not in the timed loop
    integrate(*arrays, (options.tolerance, 0))
    setup, loop = time.process_time() - begun, time.process_time()
    _integrate_to_the_end(arrays, options, progress)
    return _outcomes(cases, split, arrays, options, (setup, time.process_time() - loop))


def _initial(system: System, options: TransientOptions) -> Initial | ConvergenceError:
    if options.start is not None:
        return Initial(options.start.q, options.start.v, resumed(system, options.start))
    kind, tolerance = options.initial_state, options.tolerance
    try:
        q, gaps = system.kept.of(
            ("initial", kind, tolerance),
            lambda: static_equilibrium(system, tolerance) if kind == "static" else undeformed(system),
        )
    except ConvergenceError as error:
        return error
    return Initial(q, np.zeros_like(q), gaps)


def _arrays(
    cases: Sequence[Case],
    split: StateSplit,
    options: TransientOptions,
    starts: Sequence[Initial],
    conserving: bool,
) -> Arrays:
    """Everything that the hot loop needs, at its beginning."""
    active = np.flatnonzero([any(np.any(case.ground[a]) for case in cases) for a in range(3)])
    variants = {id(case.system): case.system for case in cases}
    model, levels, damping = _constant(list(variants.values()), split, options, active, conserving)
    problem = np.array([list(variants).index(id(case.system)) for case in cases], dtype=np.int64)
    memory = run_memory(levels.problem, problem)
    variant = np.zeros(len(cases), VARIANT)
    variant["step"], variant["problem"] = damping[problem], problem
    N, n = levels.problem.W.shape[-1], levels.problem.gap.shape[-1]
    solver = solver_state(n, n != N, (len(cases), len(levels.size)))
    runs = _runs(cases, options, active, variant, memory, solver)
    states = _states((model, split), starts, runs)
    for run, start in enumerate(starts):
        take_over(at(memory, run), start.gaps)
    buffer = _history_buffer(states, options.stride, runs)
    work = new_work(states, len(model.shift) > 0)
    arrays = Arrays(model, levels, runs, states, work, buffer)
    _begin(arrays)
    return arrays


def _constant(
    variants: Sequence[System], split: StateSplit, options: TransientOptions, active: Ints, conserving: bool
) -> tuple[ModalModel, StepHierarchy, Ints]:
    """What the march reads and does not change, kept where there is one system without added jumps."""
    system, shift = variants[0], options.shift

    def make() -> tuple[ModalModel, StepHierarchy, Ints]:
        model = modal_model(system, split, active, conserving, shift)
        return model, *step_levels(variants, model, split, options)

    if len(variants) > 1 or shift is not None:
        return make()
    how = (options.dt, options.cuts, options.midpoint, options.flexible_ratio)
    return system.kept.of(("march", split.states.tobytes(), active.tobytes(), conserving, *how), make)


def _begin(arrays: Arrays) -> None:
    """Write the first row of every run, and bring the external force at both ends of its first base step."""
    model, runs, states, work = arrays.model, arrays.runs, arrays.states, arrays.work
    for name in _ROWS:
        getattr(arrays.buffer, name)[runs.rows] = getattr(states, name)
    work.f_0[:] = states.f
    work.f_end[:] = _external_force(model, runs.acc[:, runs.samples + np.minimum(runs.last, 1)])
    if len(model.shift):
        work.start_shift[:], work.end_shift[:] = model.shift[:2]


def _external_force(model: ModalModel, acc: Floats) -> Floats:
    """External modal force of every run (runs, m), at one ground acceleration of each (components, runs)."""
    force = np.tile(model.static, (acc.shape[1], 1))
    for load, a in zip(model.load, acc, strict=True):  # a product's round-off depends on the number of runs
        force += a[:, None] * load
    return force


def _runs(
    cases: Sequence[Case],
    options: TransientOptions,
    active: Ints,
    variant: Record,
    memory: GapMemory,
    solver: SolverState,
) -> Batch:
    samples = np.array([case.ground.shape[1] for case in cases])
    rows = (samples - 1) // options.stride + 1
    return Batch(
        variant=variant,
        samples=np.concatenate([[0], np.cumsum(samples)[:-1]]),
        rows=np.concatenate([[0], np.cumsum(rows)[:-1]]),
        last=samples - 1,
        impulse=np.array([_impulse_limit(case.ground, options) for case in cases]),
        clock=np.zeros(len(cases), CLOCK),
        failed=np.zeros(len(cases), dtype=np.bool_),
        acc=np.ascontiguousarray(np.concatenate([case.ground[active] for case in cases], axis=1)),
        memory=memory,
        solver=solver,
    )


def _impulse_limit(ground: Floats, options: TransientOptions) -> float:
    """Gap velocity that the change of a joint force over a step may stand for [m/s].

    Impacts happen at about the peak ground velocity. On the two-cantilever model anything below 1 % of it no
    longer changes the error, with a tenth of the joints' stiffness 0.3 %; without that limit it stays above
    1 % at any step.
    """
    velocity = np.cumsum(ground, axis=1) * options.dt
    peak = float(np.abs(velocity).max(initial=0.0))
    return options.force_change * peak if peak > 0.0 else math.inf


def _states(arrays: tuple[ModalModel, StateSplit], starts: Sequence[Initial], runs: Batch) -> ModalState:
    model, split = arrays
    q = np.stack([start.q[split.states] for start in starts])
    gaps = [start.gaps for start in starts]
    jump, force = np.stack([gap.jump for gap in gaps]), np.stack([gap.force for gap in gaps])
    state = np.stack([gap.state for gap in gaps])
    p = force.reshape(len(gaps), -1)
    relaxed = len(model.R) > 0
    energies = np.zeros(len(gaps), ENERGIES)
    energies["stored"] = [gap.stored for gap in gaps]
    return ModalState(
        q=q,
        v=np.stack([start.v[split.states] for start in starts]),
        f=_external_force(model, runs.acc[:, runs.samples]),
        s=p.copy() if relaxed else p[:, :0].copy(),
        u_r=p @ model.R if relaxed else p[:, :0].copy(),
        jump=jump,
        force=force,
        mean=p.copy(),
        w=q @ split.G.T,
        state=state,
        closed=state > 0,
        impulse=np.zeros_like(force),
        energies=energies,
        tries=np.zeros(len(gaps), TRIES),
        peaks=np.stack([first_peaks(gap.jump, gap.force) for gap in gaps]),
    )


def _history_buffer(states: ModalState, stride: int, runs: Batch) -> HistoryBuffer:
    rows = int(sum(runs.last // stride + 1))

    def kept(values: NDArray[Any]) -> NDArray[Any]:
        return np.zeros((rows, *values.shape[1:]), dtype=values.dtype)

    return HistoryBuffer(
        stride=stride,
        q=kept(states.q),
        v=kept(states.v),
        s=kept(states.s),
        jump=kept(states.jump),
        force=kept(states.force),
        impulse=kept(states.impulse),
        state=kept(states.state),
        energies=kept(states.energies),
    )


def _integrate_to_the_end(arrays: Arrays, options: TransientOptions, progress: Progress) -> None:
    runs = arrays.runs
    active, total = 1, int(runs.last.sum())
    while active:
        active = integrate(*arrays, (options.tolerance, _STEPS))
        progress(int(np.where(runs.failed, runs.last, runs.clock["base_steps"]).sum()), total)


def not_converged(step: int, options: TransientOptions, residual: float, place: str) -> str:
    """Message for a step whose gap-space problem did not converge."""
    return (
        f"step {step}, t = {step * options.dt:.6g} s: the gap-space problem stopped at a relative residual "
        f"of {residual:.2g}, limit {options.tolerance:.2g}, farthest at {place}; halve transient.dt, or "
        "lower the friction"
    )


def _outcomes(
    cases: Sequence[Case],
    split: StateSplit,
    arrays: Arrays,
    options: TransientOptions,
    spent: tuple[float, float],
) -> list[History | ConvergenceError]:
    model, levels, runs, states, buffer = (
        arrays.model, arrays.levels, arrays.runs, arrays.states, arrays.buffer
    )  # fmt: skip
    (setup, loop), tries = spent, (states.tries["accepted"] + states.tries["refused"]).astype(float)
    outcomes: list[History | ConvergenceError] = []
    for run, case in enumerate(cases):
        place = case.system.law.place(int(runs.memory.failure[run].gap))
        if runs.failed[run]:
            step, residual = int(runs.clock[run].base_steps) + 1, float(states.tries[run].residual)
            outcomes.append(ConvergenceError(not_converged(step, options, residual, place)))
            continue
        share = tries[run] / max(tries.sum(), 1.0)
        stats = _stats(runs, states, run) | {
            "finest_step": float(levels.step.dt.min()),
            "state_modes": float(len(split.states)),
            "flexible_modes": float(len(split.rest)),
            "marched_gaps": float(len(case.system.law)),
            "setup_cpu_seconds": setup / len(cases),
            "loop_cpu_seconds": loop * share,
            "batch": float(len(cases)),
        }
        acc = runs.acc[:, runs.samples[run] :][:, : runs.last[run] + 1 : buffer.stride]
        rows = slice(runs.rows[run], runs.rows[run] + acc.shape[1])
        written = buffer._replace(**{name: getattr(buffer, name)[rows] for name in _ROWS})
        history = _history(case.system, (model, split), written, acc, options)
        outcomes.append(replace(history, peaks=named_peaks(states.peaks[run]), stats=stats))
    return outcomes


def _stats(runs: Batch, states: ModalState, run: int) -> dict[str, float]:
    """Counts of one run."""
    tries, solver = states.tries[run], at(runs.solver, run)
    total, most = iterations(solver)
    return {
        "base_steps": float(runs.last[run]),
        "steps": float(tries.accepted),
        "refused_steps": float(tries.refused),
        "solver_iterations": total,
        "largest_iterations": most,
        "largest_residual": float(tries.residual),
        "condensed_contacts": condensed_contacts(solver) / max(tries.accepted + tries.refused, 1),
    }


def _history(
    system: System,
    arrays: tuple[ModalModel, StateSplit],
    buffer: HistoryBuffer,
    acc: Floats,
    options: TransientOptions,
) -> History:
    """The written rows of one run, without peaks and stats."""
    model, split = arrays
    q, v = whole_motion(system, split, buffer) if options.coordinates else (None, None)
    disp, vel = observed_motion(system, split, buffer)
    k, c = system.K.diagonal()[split.states], system.C.diagonal()[split.states]
    seen = system.observe.toarray().T[split.states]
    rate = model.static @ seen + acc.T @ (model.load @ seen)
    rate += buffer.force.reshape(len(disp), -1) @ (split.G @ seen)
    rate -= buffer.v @ (c[:, None] * seen) + buffer.q @ (k[:, None] * seen)
    strain = 0.5 * (buffer.q**2) @ k
    if len(model.R):
        strain += 0.5 * np.einsum("ti,ij,tj->t", buffer.s, model.R, buffer.s, optimize=True)
    return History(
        time=np.arange(len(disp), dtype=np.float64) * (options.dt * options.stride),
        jump=buffer.jump,
        traction=buffer.force,
        mean_traction=buffer.impulse / (options.dt * options.stride),
        state=buffer.state,
        disp=disp,
        vel=vel,
        acc=rate,
        q=q,
        v=v,
        energy=ledger(buffer.energies, 0.5 * (buffer.v**2).sum(axis=1), strain),
        peaks={},
        stats={},
        integrator=options.integrator,
    )
