"""Integrate several runs together: prepare their arrays, call the time loop, and collect their histories.

Runs of one model differ in their ground motion, and may differ in damping and in the parameters of their
joints. Each begins at rest under the static loads, or from a state that an earlier run or stage has left. The
compiled loop is called a few hundred steps at a time, so that progress can be reported between the calls. A
run that does not converge ends with its error, and the other runs go on.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from romdam.contact.components import NORMAL
from romdam.contact.problem import GapMemory
from romdam.contact.softening import failed_law
from romdam.contact.solvers.state import condensed_contacts, iterations, solver_state
from romdam.contact.strength import shear_strength
from romdam.core.arrays import Floats, Ints, Record, at, put, rows_like, stacked
from romdam.core.errors import ConvergenceError
from romdam.core.final_state import FinalState
from romdam.core.motion import Motion
from romdam.core.system import System
from romdam.core.threads import cpu_time
from romdam.timestepping.energy import ENERGIES
from romdam.timestepping.equilibrium import GapState, ended_gaps, initial_state, resumed, take_over
from romdam.timestepping.modal.arrays import (
    BASE,
    CLOCK,
    REFUSALS,
    TRIES,
    VARIANT,
    Arrays,
    Batch,
    HistoryBuffer,
    ModalModel,
    ModalState,
    Recorded,
    StepHierarchy,
    new_work,
)
from romdam.timestepping.modal.histories import Observed, history_of_rows
from romdam.timestepping.modal.loop import integrate
from romdam.timestepping.modal.mode_split import (
    ModalScheme,
    ModeSplit,
    modal_model,
    run_memory,
    step_levels,
)
from romdam.timestepping.peaks import first_peaks, named_peaks, peaks_at_points
from romdam.timestepping.prepared import Outcome, Prepared, Progress, Simulation
from romdam.timestepping.settings import Settings, not_converged
from romdam.timestepping.support_motion import add_carried_jumps

_HELD = 1e-9  # of the largest stiffness: what has less moves freely
_STEPS = 400  # of every run between two reports of progress


class Initial(NamedTuple):
    """Displacement and velocity of the modes, and the gaps, to start from; and the state that they are of."""

    q: Floats
    v: Floats
    gaps: GapState
    final: FinalState | None = None


def integrate_batch(
    batch: Sequence[Simulation], integrator: ModalScheme, settings: Settings, progress: Progress
) -> list[Outcome]:
    """Integrate simulations together over their whole ground motions.

    Parameters
    ----------
    batch : of the same dynamic modes and kind of gaps; systems differ in damping and in the joints'
        parameters at most, and simulations of one prepared system share its arrays
    progress : called with (base steps done, base steps in all), of the batch

    Returns
    -------
    list, in the order of the batch: the history, or why there is none
    """
    initial: dict[Prepared, Initial] = {}
    failed: dict[Prepared, ConvergenceError] = {}
    for prepared in dict.fromkeys(simulation.prepared for simulation in batch):
        if isinstance(settings.start, FinalState):
            kept = settings.start.arrays
            initial[prepared] = Initial(kept["q"], kept["v"], ended_gaps(kept), settings.start)
            continue
        if settings.start is not None:
            start, gaps = settings.start, resumed(prepared.system, settings.start)
            initial[prepared] = Initial(start.q, start.v, gaps)
            continue
        try:
            q, gaps = initial_state(prepared, settings)
            initial[prepared] = Initial(q, np.zeros_like(q), gaps)
        except ConvergenceError as error:
            failed[prepared] = error
    started = [simulation for simulation in batch if simulation.prepared in initial]
    if not started:
        return [failed[simulation.prepared] for simulation in batch]
    before = cpu_time()
    split = integrator.split(started[0].prepared, settings.steps.base)
    starts = [initial[simulation.prepared] for simulation in started]
    arrays = _arrays(started, integrator, split, settings, starts)
    integrate(*arrays, settings.tolerance, 0)  # no step: a first start compiles here, not in the timed loop
    setup, loop = cpu_time() - before, cpu_time()
    runs, active = arrays.runs, 1
    total = int(runs.last.sum())
    while active:
        active = integrate(*arrays, settings.tolerance, _STEPS)
        progress(int(np.where(runs.failed, runs.last, runs.clock["base_steps"]).sum()), total)
    outcomes = iter(_outcomes(started, split, arrays, settings, setup, cpu_time() - loop, starts))
    return [failed[one.prepared] if one.prepared in failed else next(outcomes) for one in batch]


def _arrays(
    batch: Sequence[Simulation],
    integrator: ModalScheme,
    split: ModeSplit,
    settings: Settings,
    starts: Sequence[Initial],
) -> Arrays:
    """Everything that the hot loop needs, at its beginning; the first row of every run is written."""
    steps, shift, stride = settings.steps, settings.shift, settings.steps.stride
    shaken = [prepared.system.load_motion(ground).any(axis=1) for prepared, ground in batch]
    active = np.flatnonzero(np.any(shaken, axis=0))
    variants = list(dict.fromkeys(simulation.prepared for simulation in batch))
    prepared = variants[0]

    def constant() -> tuple[ModalModel, StepHierarchy, Ints]:
        """Arrays that the loop reads only."""
        model = modal_model(prepared.system, split, active, integrator.conserving, shift)
        return model, *step_levels(variants, integrator, model, split, steps)

    if len(variants) > 1 or shift is not None:
        model, levels, damping = constant()
    else:
        key = ("levels", active.tobytes(), steps.base, steps.cuts)
        model, levels, damping = prepared.cache.get_or_compute(key, constant)
    problem = np.array([variants.index(simulation.prepared) for simulation in batch], dtype=np.int64)
    memory = run_memory(levels.problem, problem)
    variant = np.zeros(len(batch), VARIANT)
    variant["step"], variant["problem"] = damping[problem], problem
    N, n = levels.problem.W.shape[-1], levels.problem.gap.shape[-1]
    samples = np.array([ground.shape[1] for _, ground in batch])
    rows_of_runs = (samples - 1) // stride + 1
    velocity = np.array(
        [
            _ground_velocity(simulation, steps.base, start.final)[-1]
            for simulation, start in zip(batch, starts, strict=True)
        ]
    )
    velocity = np.where(velocity > 0.0, velocity, math.inf)
    supports: list[Floats] = []
    for one, ground in batch:
        pseudo_static = one.system.pseudo_static
        motion = ground[:0] if pseudo_static is None else np.concatenate(pseudo_static.motion(ground))
        supports.append(motion)
    runs = Batch(
        variant=variant,
        samples=np.concatenate([[0], np.cumsum(samples)[:-1]]),
        rows=np.concatenate([[0], np.cumsum(rows_of_runs)[:-1]]),
        last=samples - 1,
        impulse=integrator.force_change * velocity,
        shear_impulse=settings.shear_share * integrator.shear_change * velocity,
        clock=np.zeros(len(batch), CLOCK),
        failed=np.zeros(len(batch), dtype=np.bool_),
        acc=np.ascontiguousarray(
            np.concatenate([one.system.load_motion(ground)[active] for one, ground in batch], axis=1)
        ),
        supports=np.ascontiguousarray(np.concatenate(supports, axis=1)),
        memory=memory,
        solver=solver_state(n, n != N, (len(batch), len(levels.size))),
    )
    states = _states(model, split, starts, runs, len(levels.size))
    for run, start in enumerate(starts):
        take_over(at(memory, run), start.gaps)
        if start.final is not None:
            _go_on(at(memory, run), at(states, run), runs.clock[run], start.final, levels)
    rows = rows_like(at(states.recorded, 0), int(rows_of_runs.sum()))
    put(rows, runs.rows, states.recorded)
    added = len(model.shift) > 0 or len(model.ground_jump) > 0 or len(model.carried) > 0
    work = new_work(states, added)
    # the external force, and the added jumps, at both ends of the first base step
    work.f_0[:] = states.f
    work.f_end[:] = _external_force(model, runs.acc[:, runs.samples + np.minimum(runs.last, 1)])
    for jumps, sample in ((work.start_shift, 0 * runs.last), (work.end_shift, np.minimum(runs.last, 1))):
        if len(model.shift):
            jumps += model.shift[sample]
        for answer, a in zip(model.ground_jump, runs.acc[:, runs.samples + sample], strict=False):
            jumps += a[:, None] * answer
    if len(model.carried):
        disp = runs.supports[-model.carried.shape[1] :, runs.samples]
        work.last_shift[:] = (model.carried @ disp).T
    probes = prepared.system.observe.shape[0]
    kept = int(samples.sum()) if stride > 1 and probes and not settings.only_jumps else 0
    by_states, by_forces = np.zeros((2, 0, 0))
    if kept:
        nodes = Observed.of(prepared, split, "observe")
        by_states = np.ascontiguousarray(nodes.states)
        by_forces = np.ascontiguousarray(nodes.forces.T) if nodes.forces.any() else by_forces
    buffer = HistoryBuffer(stride, rows, by_states, by_forces, np.zeros((kept, probes)))
    return Arrays(model, levels, runs, states, work, buffer)


def _external_force(model: ModalModel, acc: Floats) -> Floats:
    """External modal force of every run (runs, m), at one ground acceleration of each (components, runs)."""
    force = np.tile(model.static, (acc.shape[1], 1))
    for load, a in zip(model.load, acc, strict=True):  # a product's round-off depends on the number of runs
        force += a[:, None] * load
    return force


def _go_on(
    memory: GapMemory, state: ModalState, clock: Record, final: FinalState, levels: StepHierarchy
) -> None:
    """Give a run what the last step of another left behind in springs, laws and the choice of steps."""
    kept = final.arrays
    memory.spring[:] = kept["spring"].ravel()
    memory.last_step[:] = kept["last_step"]
    level, evolving, last_step, finest = kept["clock"][:4]
    clock.last_step = last_step
    if finest == float(levels.step.dt.min()) and level < len(levels.size):
        clock.level, clock.evolving = int(level), int(evolving)
    refusals = kept["clock"][4:].reshape(2, -1)
    if refusals.shape[1] == len(levels.size):  # results of earlier versions have none
        state.refusals["refused"], state.refusals["passed"] = refusals


def _final_state(
    prepared: Prepared,
    ground: Floats,
    split: ModeSplit,
    arrays: Arrays,
    run: int,
    start: Initial,
    base: float,
) -> FinalState:
    """The state at the end of a run."""
    states, runs = at(arrays.states, run), arrays.runs
    recorded, memory = states.recorded, at(runs.memory, run)
    gaps, clock, (n, d) = recorded.gaps, runs.clock[run], recorded.gaps.jump.shape
    q, v = np.zeros((2, prepared.system.size))
    q[split.dynamic], v[split.dynamic] = recorded.q, recorded.v
    kept = {
        "q": q,
        "v": v,
        "jump": gaps.jump,
        "traction": gaps.traction,
        "unilateral": memory.force.reshape(n, d),
        "relaxed": recorded.s.reshape(-1, d),
        "mean": states.mean.reshape(n, d),
        "spring": memory.spring.reshape(n, d),
        "accumulated_slip": memory.accumulated_slip,
        "slip_rate": states.slip_rate,
        "contact": gaps.state,
        "closed": states.closed,
        "memory": memory.history,
        "last_step": memory.last_step,
        "water": memory.water,
        "stored": np.array([recorded.energies.stored]),
        "clock": np.array(
            [
                *(clock.level, clock.evolving, clock.last_step, arrays.levels.step.dt.min()),
                *states.refusals["refused"],
                *states.refusals["passed"],
            ]
        ),
        "ground_velocity": _ground_velocity(Simulation(prepared, ground), base, start.final),
    }
    copies = {name: np.array(values) for name, values in kept.items()}
    return FinalState(copies, prepared.integrator.name, {})


def _ground_velocity(simulation: Simulation, step: float, before: FinalState | None = None) -> Floats:
    """Velocity of the ground at the end, and its largest size, (k + 1,), from a state before on [m/s].

    Gap velocities are measured by it: the change of a joint force over a step may stand for a share of it.
    Impacts happen at about the peak ground velocity. On the two-cantilever model anything below 1 % of it no
    longer changes the error, with a tenth of the joints' stiffness 0.3 %; without that limit it stays above
    1 % at any step.
    """
    system = simulation.prepared.system
    acc = system.shaking(simulation.ground)
    first = np.zeros(len(acc) + 1) if before is None else before.arrays["ground_velocity"]
    velocity = first[:-1, None] + np.cumsum(acc, axis=1) * step
    peak = float(np.linalg.norm(velocity, axis=0).max(initial=first[-1]))
    end = first[:-1] + acc.sum(axis=1) * step
    return np.array([*end, max(peak, _velocity_by_forces(system, simulation.ground, step))])


def _velocity_by_forces(system: System, ground: Floats, step: float) -> float:
    """Velocity that all of the mass would have with the energy of forces that vary in time [m/s].

    That is the energy of their static answer, of each force at its largest, and what they give to motions
    that no stiffness holds.
    """
    forces = system.forces(ground)
    if not len(forces):
        return 0.0
    k, columns = system.K.diagonal(), np.asarray(system.load[:, system.motions[Motion.FORCES]])
    mass = float((np.asarray(system.load[:, system.motions[Motion.BASE]]) ** 2).sum(axis=0).max())
    held = k > _HELD * k.max(initial=0.0)
    answer = columns[held] / np.sqrt(k[held])[:, None] * np.abs(forces).max(axis=1)
    impulse = columns[~held] @ (np.cumsum(forces, axis=1) * step)
    energy = float((answer**2).sum()) + float((impulse**2).sum(axis=0).max(initial=0.0))
    return float(np.sqrt(energy / mass)) if mass > 0.0 else 0.0


def _states(
    model: ModalModel, split: ModeSplit, starts: Sequence[Initial], runs: Batch, levels: int
) -> ModalState:
    """The states that the runs start from."""
    q = np.stack([start.q[split.dynamic] for start in starts])
    gaps = stacked([start.gaps.recorded() for start in starts])
    p = np.stack([start.gaps.acting for start in starts]).reshape(len(starts), -1)
    relaxed = len(model.R) > 0
    energies = np.zeros(len(starts), ENERGIES)
    energies["stored"] = [start.gaps.stored for start in starts]
    _, n, d = gaps.jump.shape
    slip_rate = np.zeros((len(starts), n if d > 1 else 0, 2))
    s, mean, closed = p.copy() if relaxed else p[:, :0].copy(), p.copy(), gaps.state > 0
    for run, start in enumerate(starts):
        if start.final is not None:
            kept = start.final.arrays
            slip_rate[run], mean[run], closed[run] = kept["slip_rate"], kept["mean"].ravel(), kept["closed"]
            s[run] = kept["relaxed"].ravel()
    recorded = Recorded(
        q=q,
        v=np.stack([start.v[split.dynamic] for start in starts]),
        s=s,
        gaps=gaps,
        memory=runs.memory.history,
        energies=energies,
    )
    return ModalState(
        recorded=recorded,
        f=_external_force(model, runs.acc[:, runs.samples]),
        u_r=s @ model.R if relaxed else p[:, :0].copy(),
        mean=mean,
        w=q @ split.G.T,
        closed=closed,
        slip_rate=slip_rate,
        tries=np.zeros(len(starts), TRIES),
        refusals=np.zeros((len(starts), levels), REFUSALS),
        peaks=np.stack([first_peaks(start.gaps.jump, start.gaps.force) for start in starts]),
    )


def _outcomes(
    batch: Sequence[Simulation],
    split: ModeSplit,
    arrays: Arrays,
    settings: Settings,
    setup: float,
    loop: float,
    starts: Sequence[Initial],
) -> list[Outcome]:
    """The history of every run, or why there is none.

    Parameters
    ----------
    setup, loop : CPU that the arrays and the loop took, of all runs together [s]
    """
    model, levels, runs, states, buffer = (
        arrays.model, arrays.levels, arrays.runs, arrays.states, arrays.buffer
    )  # fmt: skip
    steps_tried = (states.tries["accepted"] + states.tries["refused"]).astype(float)
    outcomes: list[Outcome] = []
    for run, (prepared, ground) in enumerate(batch):
        system, tries, solver = prepared.system, states.tries[run], at(runs.solver, run)
        failing_gap = system.law.gap_name(int(runs.memory.failure[run].gap))
        laws = at(levels.problem.laws, (runs.variant[run].problem, BASE))
        if failed := failed_law(laws, at(runs.memory, run), failing_gap):
            outcomes.append(ConvergenceError(failed))
            continue
        if runs.failed[run]:
            step, residual = int(runs.clock[run].base_steps) + 1, float(tries.residual)
            outcomes.append(ConvergenceError(not_converged(step, settings, residual, failing_gap)))
            continue
        mass_left = 0.0  # largest share of the effective mass, over the shaken directions, that does not move
        if not split.follows_ground:
            shaken = system.load_motion(ground).any(axis=1)
            mass = np.asarray(system.load)[:, shaken] ** 2
            whole = mass.sum(axis=0)
            shares = mass[split.quasi_static].sum(axis=0) / np.where(whole > 0.0, whole, 1.0)
            mass_left = float(shares.max(initial=0.0))
        total_iterations, most_iterations = iterations(solver)
        stats = {
            "base_steps": float(runs.last[run]),
            "steps": float(tries.accepted),
            "refused_steps": float(tries.refused),
            "solver_iterations": total_iterations,
            "largest_iterations": most_iterations,
            "largest_residual": float(tries.residual),
            "condensed_contacts": condensed_contacts(solver) / max(tries.accepted + tries.refused, 1),
            "base_step": settings.steps.base,
            "finest_step": float(levels.step.dt.min()),
            "dynamic_modes": float(len(split.dynamic)),
            "quasi_static_modes": float(len(split.quasi_static)),
            "quasi_static_mass": mass_left,
            "integrated_gaps": float(len(system.law)),
            "setup_cpu_seconds": setup / len(batch),
            "loop_cpu_seconds": loop * (steps_tried[run] / max(steps_tried.sum(), 1.0)),
            "batch": float(len(batch)),
        }
        acc = system.load_motion(ground)[:, : runs.last[run] + 1 : buffer.stride]
        written = at(buffer.rows, slice(runs.rows[run], runs.rows[run] + acc.shape[1]))
        history = history_of_rows(prepared, model, split, written, acc, settings)
        if len(buffer.node_disp):
            samples = slice(runs.samples[run], runs.samples[run] + runs.last[run] + 1)
            follows = system.load_motion(ground).T.copy()
            follows[0] = 0.0  # as in the rows
            between = buffer.node_disp[samples] + Observed.of(prepared, split, "observe").more(follows)
            between[0] = history.disp[0]
            history = replace(history, base_disp=between)
        history = add_carried_jumps(history, system, ground, buffer.stride)
        peaks = peaks_at_points(named_peaks(states.peaks[run]), written.gaps.jump, history.jump, history.time)
        force = history.traction
        strength, bonded = shear_strength(
            system.law.mu, laws, written.memory[: len(force)], history.jump[..., NORMAL], force
        )
        final = None
        if not settings.only_jumps:
            base = settings.steps.base
            final = _final_state(prepared, ground, split, arrays, run, starts[run], base)
        history = replace(history, peaks=peaks, stats=stats, final=final)
        outcomes.append(replace(history, strength=strength, bonded=bonded))
    return outcomes
