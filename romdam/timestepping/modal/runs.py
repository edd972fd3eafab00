"""Runs that march together: their arrays, the march, and their histories."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from romdam.contact.problem import GapMemory
from romdam.core.arrays import Floats, Ints
from romdam.core.errors import ConvergenceError
from romdam.core.system import History, System
from romdam.timestepping.energy import ledger
from romdam.timestepping.equilibrium import GapState, resumed, static_equilibrium, take_over, undeformed
from romdam.timestepping.modal.arrays import Levels, ModalModel, ModalState, Runs, Track, Work
from romdam.timestepping.modal.loop import march
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

_ROWS = tuple(name for name in Track._fields if name != "stride")
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


Initial = tuple[Floats, Floats, GapState]
Arrays = tuple[ModalModel, Levels, Runs, ModalState, Work, Track]


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
    march(*arrays, (options.tolerance, 0))
    setup, loop = time.process_time() - begun, time.process_time()
    _march_to_the_end(arrays, options, progress)
    return _outcomes(cases, split, arrays, options, (setup, time.process_time() - loop))


def _initial(system: System, options: TransientOptions) -> Initial | ConvergenceError:
    if options.start is not None:
        return options.start.q, options.start.v, resumed(system, options.start)
    kind, tolerance = options.initial_state, options.tolerance
    try:
        q, gaps = system.kept.of(
            ("initial", kind, tolerance),
            lambda: static_equilibrium(system, tolerance) if kind == "static" else undeformed(system),
        )
    except ConvergenceError as error:
        return error
    return q, np.zeros_like(q), gaps


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
    runs = _runs(cases, options, active, np.stack([damping[problem], problem]), memory)
    states = _states((model, split), starts, runs)
    for run, (_, _, gaps) in enumerate(starts):
        take_over(_memory_of(memory, run), gaps)
    track = _track(states, options.stride, runs)
    work = _work(states, len(model.shift) > 0)
    _begin(model, runs, states, work, track)
    return model, levels, runs, states, work, track


def _constant(
    variants: Sequence[System], split: StateSplit, options: TransientOptions, active: Ints, conserving: bool
) -> tuple[ModalModel, Levels, Ints]:
    """What the march reads and does not change, kept where there is one system without added jumps."""
    system, shift = variants[0], options.shift

    def make() -> tuple[ModalModel, Levels, Ints]:
        model = modal_model(system, split, active, conserving, shift)
        return model, *step_levels(variants, model, split, options)

    if len(variants) > 1 or shift is not None:
        return make()
    how = (options.dt, options.cuts, options.midpoint, options.flexible_ratio)
    return system.kept.of(("march", split.states.tobytes(), active.tobytes(), conserving, *how), make)


def _begin(model: ModalModel, runs: Runs, states: ModalState, work: Work, track: Track) -> None:
    """Write the first row of every run, and bring the external force at both ends of its first base step."""
    for name in _ROWS:
        getattr(track, name)[runs.rows] = states.stored[:, 0] if name == "stored" else getattr(states, name)
    work.f_0[:] = states.f
    work.f_end[:] = _external_force(model, runs.acc[:, runs.samples + np.minimum(runs.last, 1)])
    if len(model.shift):
        work.ends[:] = model.shift[:2]


def _external_force(model: ModalModel, acc: Floats) -> Floats:
    """External modal force of every run (runs, m), at one ground acceleration of each (components, runs)."""
    force = np.tile(model.static, (acc.shape[1], 1))
    for load, a in zip(model.load, acc, strict=True):  # a product's round-off depends on the number of runs
        force += a[:, None] * load
    return force


def _memory_of(memory: GapMemory, run: int) -> GapMemory:
    """What `take_over` sets, of one run."""
    return memory._replace(
        force=memory.force[run], anchor=memory.anchor[run], weak=memory.weak[run], spring=memory.spring[run]
    )


def _runs(
    cases: Sequence[Case], options: TransientOptions, active: Ints, variant: Ints, memory: GapMemory
) -> Runs:
    samples = np.array([case.ground.shape[1] for case in cases])
    rows = (samples - 1) // options.stride + 1
    return Runs(
        variant=variant,
        samples=np.concatenate([[0], np.cumsum(samples)[:-1]]),
        rows=np.concatenate([[0], np.cumsum(rows)[:-1]]),
        last=samples - 1,
        impulse=np.array([_impulse_limit(case.ground, options) for case in cases]),
        clock=np.zeros((len(cases), 4), dtype=np.int64),
        failed=np.zeros(len(cases), dtype=np.bool_),
        acc=np.ascontiguousarray(np.concatenate([case.ground[active] for case in cases], axis=1)),
        memory=memory,
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


def _states(arrays: tuple[ModalModel, StateSplit], starts: Sequence[Initial], runs: Runs) -> ModalState:
    model, split = arrays
    q = np.stack([start[0][split.states] for start in starts])
    gaps: list[GapState] = [start[2] for start in starts]
    jump, force = np.stack([gap.jump for gap in gaps]), np.stack([gap.force for gap in gaps])
    state = np.stack([gap.state for gap in gaps])
    p = force.reshape(len(gaps), -1)
    relaxed = len(model.R) > 0
    return ModalState(
        q=q,
        v=np.stack([start[1][split.states] for start in starts]),
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
        works=np.zeros((len(gaps), 4)),
        stored=np.array([[gap.stored] for gap in gaps]),
        counts=np.zeros((len(gaps), 3)),
        peaks=np.stack([first_peaks(gap.jump, gap.force) for gap in gaps]),
    )


def _work(states: ModalState, shifted: bool) -> Work:
    (runs, m), N = states.q.shape, states.mean.shape[1]
    modes, gaps = np.zeros((5, runs, m)), np.zeros((3, runs, N))
    return Work(
        f_0=modes[0],
        f_end=modes[1],
        f_1=modes[2],
        q_free=modes[3],
        r=modes[4],
        w=gaps[0],
        y=gaps[1],
        old_force=gaps[2],
        ends=np.zeros((runs, 2, N if shifted else 0)),
        shift=np.zeros((runs, N if shifted else 0)),
        underway=np.zeros(runs, dtype=np.int64),
        accepted=np.zeros(runs, dtype=np.int64),
    )


def _track(states: ModalState, stride: int, runs: Runs) -> Track:
    rows = int(sum(runs.last // stride + 1))

    def kept(values: NDArray[Any]) -> NDArray[Any]:
        return np.zeros((rows, *values.shape[1:]), dtype=values.dtype)

    return Track(
        stride=stride,
        q=kept(states.q),
        v=kept(states.v),
        s=kept(states.s),
        jump=kept(states.jump),
        force=kept(states.force),
        impulse=kept(states.impulse),
        state=kept(states.state),
        works=kept(states.works),
        stored=np.zeros(rows),
    )


def _march_to_the_end(arrays: Arrays, options: TransientOptions, progress: Progress) -> None:
    runs = arrays[2]
    under_way, total = 1, int(runs.last.sum())
    while under_way:
        under_way = march(*arrays, (options.tolerance, _STEPS))
        progress(int(np.where(runs.failed, runs.last, runs.clock[:, 0]).sum()), total)


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
    model, levels, runs, states, _, track = arrays
    tries = states.counts[:, :2].sum(axis=1)
    outcomes: list[History | ConvergenceError] = []
    for run, case in enumerate(cases):
        place = case.system.law.place(int(runs.memory.worst[run, 0]))
        if runs.failed[run]:
            step, residual = int(runs.clock[run, 0]) + 1, float(states.counts[run, 2])
            outcomes.append(ConvergenceError(not_converged(step, options, residual, place)))
            continue
        share = (spent[0] / len(cases), spent[1] * tries[run] / max(tries.sum(), 1.0))
        stats = _stats(runs, states, run) | {
            "finest_step": float(levels.step.dt[0, -1]),
            "state_modes": float(len(split.states)),
            "flexible_modes": float(len(split.rest)),
            "marched_gaps": float(len(case.system.law)),
            "setup_cpu_seconds": share[0],
            "loop_cpu_seconds": share[1],
            "batch": float(len(cases)),
        }
        acc = runs.acc[:, runs.samples[run] :][:, : runs.last[run] + 1 : track.stride]
        rows = slice(runs.rows[run], runs.rows[run] + acc.shape[1])
        part = track._replace(**{name: getattr(track, name)[rows] for name in _ROWS})
        history = _history(case.system, (model, split), part, acc, options)
        outcomes.append(replace(history, peaks=named_peaks(states.peaks[run]), stats=stats))
    return outcomes


def _stats(runs: Runs, states: ModalState, run: int) -> dict[str, float]:
    """Counts of one run."""
    counts, tries = runs.memory.counts[run], max(states.counts[run, :2].sum(), 1.0)
    held = counts[:, 1, 1].sum() / tries if runs.memory.anchor.shape[1] else 0.0
    return {
        "base_steps": float(runs.last[run]),
        "steps": states.counts[run, 0],
        "refused_steps": states.counts[run, 1],
        "solver_iterations": float(counts[..., 2].sum()),
        "largest_iterations": float(counts[..., 3].max(initial=0)),
        "largest_residual": states.counts[run, 2],
        "condensed_contacts": float(held),
    }


def _history(
    system: System,
    arrays: tuple[ModalModel, StateSplit],
    track: Track,
    acc: Floats,
    options: TransientOptions,
) -> History:
    """The written rows of one run, without peaks and stats."""
    model, split = arrays
    q, v = whole_motion(system, split, track) if options.coordinates else (None, None)
    disp, vel = observed_motion(system, split, track)
    k, c = system.K.diagonal()[split.states], system.C.diagonal()[split.states]
    seen = system.observe.toarray().T[split.states]
    rate = model.static @ seen + acc.T @ (model.load @ seen)
    rate += track.force.reshape(len(disp), -1) @ (split.G @ seen)
    rate -= track.v @ (c[:, None] * seen) + track.q @ (k[:, None] * seen)
    strain = 0.5 * (track.q**2) @ k
    if len(model.R):
        strain += 0.5 * np.einsum("ti,ij,tj->t", track.s, model.R, track.s, optimize=True)
    return History(
        time=np.arange(len(disp), dtype=np.float64) * (options.dt * options.stride),
        jump=track.jump,
        traction=track.force,
        mean_traction=track.impulse / (options.dt * options.stride),
        state=track.state,
        disp=disp,
        vel=vel,
        acc=rate,
        q=q,
        v=v,
        energy=ledger(track.works, 0.5 * (track.v**2).sum(axis=1), strain, track.stored),
        peaks={},
        stats={},
        integrator=options.integrator,
    )
