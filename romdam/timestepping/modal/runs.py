"""Runs that are integrated together: their arrays, the loop over them, and their histories."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from romdam.contact.components import NORMAL
from romdam.contact.problem import GapMemory
from romdam.contact.softening import failed_law
from romdam.contact.solvers.state import SolverState, condensed_contacts, iterations, solver_state
from romdam.contact.strength import shear_strength
from romdam.core.arrays import Floats, Ints, Record, at, put, rows_like, stacked
from romdam.core.errors import ConvergenceError
from romdam.core.system import System
from romdam.core.threads import cpu_time
from romdam.timestepping.energy import ENERGIES
from romdam.timestepping.equilibrium import GapState, initial_state, resumed, take_over
from romdam.timestepping.integrators.protocol import Outcome, Progress, not_converged
from romdam.timestepping.modal.arrays import (
    BASE,
    CLOCK,
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
from romdam.timestepping.modal.histories import history_of_rows
from romdam.timestepping.modal.loop import integrate
from romdam.timestepping.modal.mode_split import (
    ModeSplit,
    modal_model,
    run_memory,
    step_levels,
)
from romdam.timestepping.peaks import first_peaks, named_peaks, peaks_at_points
from romdam.timestepping.prepared import Prepared, Simulation
from romdam.timestepping.settings import Settings
from romdam.timestepping.support_motion import add_carried_jumps

if TYPE_CHECKING:
    from romdam.timestepping.modal.integrator import ModalIntegrator

_STEPS = 400  # of every run between two reports of progress


class Initial(NamedTuple):
    """Displacement and velocity of the modes, and the gaps, to start from."""

    q: Floats
    v: Floats
    gaps: GapState


def integrate_batch(
    batch: Sequence[Simulation], integrator: ModalIntegrator, settings: Settings, progress: Progress
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
    initial = {one.prepared: _initial(one.prepared, settings) for one in batch}
    failed = {one: state for one, state in initial.items() if isinstance(state, ConvergenceError)}
    starts = {one: state for one, state in initial.items() if not isinstance(state, ConvergenceError)}
    chosen = [one for one in batch if one.prepared in starts]
    first = [starts[one.prepared] for one in chosen]
    made = iter(_integrate(chosen, integrator, settings, progress, first) if chosen else ())
    return [failed[one.prepared] if one.prepared in failed else next(made) for one in batch]


def _integrate(
    batch: Sequence[Simulation],
    integrator: ModalIntegrator,
    settings: Settings,
    progress: Progress,
    starts: Sequence[Initial],
) -> list[Outcome]:
    """Integrate a batch from its initial states to its ends."""
    begun = cpu_time()
    split = integrator.split(batch[0].prepared, settings.steps.base)
    arrays = _arrays(batch, integrator, split, settings, starts)
    # no step: a first start compiles here, not in the timed loop
    integrate(*arrays, (settings.tolerance, 0))
    setup, loop = cpu_time() - begun, cpu_time()
    runs, active = arrays.runs, 1
    total = int(runs.last.sum())
    while active:
        active = integrate(*arrays, (settings.tolerance, _STEPS))
        progress(int(np.where(runs.failed, runs.last, runs.clock["base_steps"]).sum()), total)
    return _outcomes(batch, split, arrays, settings, (setup, cpu_time() - loop))


def _initial(prepared: Prepared, settings: Settings) -> Initial | ConvergenceError:
    if settings.start is not None:
        return Initial(settings.start.q, settings.start.v, resumed(prepared.system, settings.start))
    try:
        q, gaps = initial_state(prepared, settings)
    except ConvergenceError as error:
        return error
    return Initial(q, np.zeros_like(q), gaps)


def _arrays(
    batch: Sequence[Simulation],
    integrator: ModalIntegrator,
    split: ModeSplit,
    settings: Settings,
    starts: Sequence[Initial],
) -> Arrays:
    """Everything that the hot loop needs, at its beginning."""
    shaken = [one.prepared.system.inertial(one.ground).any(axis=1) for one in batch]
    active = np.flatnonzero(np.any(shaken, axis=0))
    variants = list(dict.fromkeys(one.prepared for one in batch))
    model, levels, damping = _constant(variants, integrator, split, settings, active)
    problem = np.array([variants.index(one.prepared) for one in batch], dtype=np.int64)
    memory = run_memory(levels.problem, problem)
    variant = np.zeros(len(batch), VARIANT)
    variant["step"], variant["problem"] = damping[problem], problem
    N, n = levels.problem.W.shape[-1], levels.problem.gap.shape[-1]
    solver = solver_state(n, n != N, (len(batch), len(levels.size)))
    runs = _runs(batch, integrator, settings, active, variant, memory, solver)
    states = _states(model, split, starts, runs)
    for run, start in enumerate(starts):
        take_over(at(memory, run), start.gaps)
    stride = settings.steps.stride
    rows = rows_like(at(states.recorded, 0), int(sum(runs.last // stride + 1)))
    added = len(model.shift) > 0 or len(model.ground_jump) > 0 or model.carried is not None
    arrays = Arrays(model, levels, runs, states, new_work(states, added), HistoryBuffer(stride, rows))
    _begin(arrays)
    return arrays


def _constant(
    variants: Sequence[Prepared],
    integrator: ModalIntegrator,
    split: ModeSplit,
    settings: Settings,
    active: Ints,
) -> tuple[ModalModel, StepHierarchy, Ints]:
    """Arrays that the loop reads only, cached where there is one system without added jumps."""
    prepared, steps, shift = variants[0], settings.steps, settings.shift

    def compute() -> tuple[ModalModel, StepHierarchy, Ints]:
        model = modal_model(prepared.system, split, active, integrator.massless_boundary, shift)
        return model, *step_levels(variants, integrator, model, split, steps)

    if len(variants) > 1 or shift is not None:
        return compute()
    return prepared.cache.get_or_compute(("levels", active.tobytes(), steps.base, steps.cuts), compute)


def _begin(arrays: Arrays) -> None:
    """Write the first row of every run, and bring the external force at both ends of its first base step."""
    model, runs, states, work = arrays.model, arrays.runs, arrays.states, arrays.work
    put(arrays.buffer.rows, runs.rows, states.recorded)
    work.f_0[:] = states.f
    work.f_end[:] = _external_force(model, runs.acc[:, runs.samples + np.minimum(runs.last, 1)])
    for jumps, sample in ((work.start_shift, 0 * runs.last), (work.end_shift, np.minimum(runs.last, 1))):
        if len(model.shift):
            jumps += model.shift[sample]
        for answer, a in zip(model.ground_jump, runs.acc[:, runs.samples + sample], strict=False):
            jumps += a[:, None] * answer
    if model.carried is not None:
        disp = runs.supports[-model.carried.shape[1] :, runs.samples]
        work.last_shift[:] = (model.carried @ disp).T


def _external_force(model: ModalModel, acc: Floats) -> Floats:
    """External modal force of every run (runs, m), at one ground acceleration of each (components, runs)."""
    force = np.tile(model.static, (acc.shape[1], 1))
    for load, a in zip(model.load, acc, strict=True):  # a product's round-off depends on the number of runs
        force += a[:, None] * load
    return force


def _runs(
    batch: Sequence[Simulation],
    integrator: ModalIntegrator,
    settings: Settings,
    active: Ints,
    variant: Record,
    memory: GapMemory,
    solver: SolverState,
) -> Batch:
    steps = settings.steps
    samples = np.array([one.ground.shape[1] for one in batch])
    rows = (samples - 1) // steps.stride + 1
    velocity = np.array([_peak_velocity(one, steps.base) for one in batch])
    return Batch(
        variant=variant,
        samples=np.concatenate([[0], np.cumsum(samples)[:-1]]),
        rows=np.concatenate([[0], np.cumsum(rows)[:-1]]),
        last=samples - 1,
        impulse=integrator.force_change * velocity,
        shear_impulse=settings.shear_share * integrator.shear_change * velocity,
        clock=np.zeros(len(batch), CLOCK),
        failed=np.zeros(len(batch), dtype=np.bool_),
        acc=np.ascontiguousarray(np.concatenate([one.ground[active] for one in batch], axis=1)),
        supports=np.ascontiguousarray(np.concatenate([_of_supports(one) for one in batch], axis=1)),
        memory=memory,
        solver=solver,
    )


def _of_supports(of: Simulation) -> Floats:
    """Acceleration, velocity and displacement of moving supports, (3 m, nt)."""
    by = of.prepared.system.pseudo_static
    return of.ground[:0] if by is None else np.concatenate(by.motion(of.ground))


def _peak_velocity(of: Simulation, step: float) -> float:
    """Peak velocity of the ground, infinite without any [m/s].

    Gap velocities are measured by it: the change of a joint force over a step may stand for a share of it.
    Impacts happen at about the peak ground velocity. On the two-cantilever model anything below 1 % of it no
    longer changes the error, with a tenth of the joints' stiffness 0.3 %; without that limit it stays above
    1 % at any step.
    """
    velocity = np.cumsum(of.prepared.system.inertial(of.ground), axis=1) * step
    peak = float(np.linalg.norm(velocity, axis=0).max(initial=0.0))
    return peak if peak > 0.0 else math.inf


def _states(model: ModalModel, split: ModeSplit, starts: Sequence[Initial], runs: Batch) -> ModalState:
    q = np.stack([start.q[split.dynamic] for start in starts])
    gaps = stacked([start.gaps.recorded() for start in starts])
    p = np.stack([start.gaps.acting for start in starts]).reshape(len(starts), -1)
    relaxed = len(model.R) > 0
    energies = np.zeros(len(starts), ENERGIES)
    energies["stored"] = [start.gaps.stored for start in starts]
    _, n, d = gaps.jump.shape
    recorded = Recorded(
        q=q,
        v=np.stack([start.v[split.dynamic] for start in starts]),
        s=p.copy() if relaxed else p[:, :0].copy(),
        gaps=gaps,
        memory=runs.memory.history,
        energies=energies,
    )
    return ModalState(
        recorded=recorded,
        f=_external_force(model, runs.acc[:, runs.samples]),
        u_r=p @ model.R if relaxed else p[:, :0].copy(),
        mean=p.copy(),
        w=q @ split.G.T,
        closed=gaps.state > 0,
        slip_rate=np.zeros((len(starts), n if d > 1 else 0, 2)),
        tries=np.zeros(len(starts), TRIES),
        peaks=np.stack([first_peaks(start.gaps.jump, start.gaps.force) for start in starts]),
    )


def _outcomes(
    batch: Sequence[Simulation],
    split: ModeSplit,
    arrays: Arrays,
    settings: Settings,
    spent: tuple[float, float],
) -> list[Outcome]:
    model, levels, runs, states, buffer = (
        arrays.model, arrays.levels, arrays.runs, arrays.states, arrays.buffer
    )  # fmt: skip
    (setup, loop), tries = spent, (states.tries["accepted"] + states.tries["refused"]).astype(float)
    outcomes: list[Outcome] = []
    for run, (prepared, ground) in enumerate(batch):
        place = prepared.system.law.place(int(runs.memory.failure[run].gap))
        laws = at(levels.problem.laws, (runs.variant[run].problem, BASE))
        if failed := failed_law(laws, at(runs.memory, run), place):
            outcomes.append(ConvergenceError(failed))
            continue
        if runs.failed[run]:
            step, residual = int(runs.clock[run].base_steps) + 1, float(states.tries[run].residual)
            outcomes.append(ConvergenceError(not_converged(step, settings, residual, place)))
            continue
        share = tries[run] / max(tries.sum(), 1.0)
        stats = _stats(runs, states, run) | {
            "base_step": settings.steps.base,
            "finest_step": float(levels.step.dt.min()),
            "dynamic_modes": float(len(split.dynamic)),
            "quasi_static_modes": float(len(split.quasi_static)),
            "quasi_static_mass": _mass_left(prepared.system, split, ground),
            "integrated_gaps": float(len(prepared.system.law)),
            "setup_cpu_seconds": setup / len(batch),
            "loop_cpu_seconds": loop * share,
            "batch": float(len(batch)),
        }
        acc = prepared.system.inertial(ground)[:, : runs.last[run] + 1 : buffer.stride]
        rows = slice(runs.rows[run], runs.rows[run] + acc.shape[1])
        written = at(buffer.rows, rows)
        history = history_of_rows(prepared, model, split, written, acc, settings)
        history = add_carried_jumps(history, prepared.system, ground, buffer.stride)
        peaks = peaks_at_points(named_peaks(states.peaks[run]), written.gaps.jump, history.jump, history.time)
        force = history.traction
        memory = written.memory[: len(force)]
        strength, bonded = shear_strength(
            prepared.system.law.mu, laws, memory, history.jump[..., NORMAL], force
        )
        outcomes.append(replace(history, peaks=peaks, stats=stats, strength=strength, bonded=bonded))
    return outcomes


def _mass_left(system: System, split: ModeSplit, ground: Floats) -> float:
    """Share of the effective mass that does not follow the ground motion, being that of quasi-static modes.

    The largest over the directions that are shaken.
    """
    if split.follows_ground:
        return 0.0
    shaken = system.inertial(ground).any(axis=1)
    mass = np.asarray(system.load)[:, shaken] ** 2
    whole = mass.sum(axis=0)
    return float((mass[split.quasi_static].sum(axis=0) / np.where(whole > 0.0, whole, 1.0)).max(initial=0.0))


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
