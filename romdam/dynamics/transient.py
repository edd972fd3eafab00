"""Integrate a system with gaps under ground acceleration.

To add an integrator, write one function with the signature of `modal` and name it in INTEGRATORS.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from romdam.dynamics.energy import ledger
from romdam.dynamics.full_order import generalized_alpha
from romdam.dynamics.march import ModalModel, ModalState, Track, march, record_row
from romdam.dynamics.options import TransientOptions
from romdam.dynamics.peaks import first_peaks, named_peaks
from romdam.dynamics.propagator import Propagator, modal_propagator
from romdam.dynamics.static import GapState, static_equilibrium, system_gap_problem, undeformed
from romdam.dynamics.system import History, System
from romdam.errors import ConfigError, ConvergenceError
from romdam.joints.problem import GapMemory, GapProblem, gap_memory

Floats = NDArray[np.float64]
Progress = Callable[[int, int], None]

_CHUNK = 400  # steps between two reports of progress


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
    if options.integrator not in INTEGRATORS:
        raise ConfigError(f"no integrator {options.integrator!r}; there are {', '.join(INTEGRATORS)}")
    return INTEGRATORS[options.integrator](system, ground, options, progress or (lambda done, total: None))


def modal(system: System, ground: Floats, options: TransientOptions, progress: Progress) -> History:
    """Exact modal propagation with the joint force constant over the step and implicit at its end.

    Raises
    ------
    ConfigError
        for a system that is not diagonal.
    """
    if not system.diagonal:
        raise ConfigError(
            "transient.integrator: modal needs a reduced model; use generalized_alpha, or model.order: reduced"
        )
    start = time.process_time()
    active = np.flatnonzero(np.abs(ground).max(axis=1) > 0.0)
    model = modal_model(system, active)
    step = modal_propagator(model.k, model.c, options.dt)
    problem, memory = _gap_arrays(system, step, options.dt)
    q, gaps = _initial(system, options)
    acc = np.ascontiguousarray(ground[active])
    state = _modal_state(model, q, gaps, acc)
    memory.force[:], memory.anchor[:] = gaps.p_c, gaps.anchor
    track = _track(model, state, options.stride, ground.shape[1])
    setup = time.process_time() - start
    loop = time.process_time()
    worst = _march_in_chunks((model, step, problem, memory), state, acc, track, options, progress)
    stats = {
        "steps": float(ground.shape[1] - 1),
        "solver_iterations": float(memory.counts[2]),
        "largest_iterations": float(memory.counts[3]),
        "largest_residual": worst,
        "setup_cpu_seconds": setup,
        "loop_cpu_seconds": time.process_time() - loop,
    }
    return _history(system, model, track, acc[:, :: options.stride], options, stats)


def modal_model(system: System, active: NDArray[np.int64]) -> ModalModel:
    """Arrays of a diagonal system for the hot loop; `active` are the shaken components."""
    rows, offset, tiles, values = system.law.directions, 0, [], []
    dense = system.B.tocsc()
    for columns in system.parts.values():
        part = dense[:, columns].tocsr()
        for gaps in system.law.joints.values():
            block = part[rows * gaps.start : rows * gaps.stop]
            if block.nnz:
                tiles.append((rows * gaps.start, rows * gaps.stop, columns.start, columns.stop, offset))
                values.append(block.toarray().ravel())
                offset += values[-1].size
    return ModalModel(
        k=system.K.diagonal(),
        c=system.C.diagonal(),
        static=np.ascontiguousarray(system.force),
        load=np.ascontiguousarray(-system.load[:, active].T),
        tiles=np.array(tiles, dtype=np.int64).reshape(-1, 5),
        values=np.concatenate(values) if values else np.zeros(0),
    )


def _gap_arrays(system: System, step: Propagator, dt: float) -> tuple[GapProblem, GapMemory]:
    G = system.B.toarray()
    problem = system_gap_problem(system, (G * step.q_p) @ G.T)
    return problem, gap_memory(problem)


def _initial(system: System, options: TransientOptions) -> tuple[Floats, GapState]:
    if options.initial_state == "static":
        return static_equilibrium(system, options.tolerance)
    return undeformed(system)


def _modal_state(model: ModalModel, q: Floats, gaps: GapState, acc: Floats) -> ModalState:
    return ModalState(
        q=q,
        v=np.zeros_like(q),
        f=model.static + model.load.T @ acc[:, 0],
        jump=gaps.jump.copy(),
        force=gaps.force.copy(),
        state=gaps.state.copy(),
        works=np.zeros(4),
        stored=np.array([gaps.stored]),
    )


def _track(model: ModalModel, state: ModalState, stride: int, samples: int) -> Track:
    rows, m = (samples - 1) // stride + 1, len(model.k)
    track = Track(
        stride=stride,
        q=np.zeros((rows, m)),
        v=np.zeros((rows, m)),
        jump=np.zeros((rows, *state.jump.shape)),
        force=np.zeros((rows, *state.force.shape)),
        state=np.zeros((rows, len(state.state)), dtype=np.uint8),
        works=np.zeros((rows, 4)),
        stored=np.zeros(rows),
        peaks=first_peaks(state.jump, state.force),
    )
    record_row(track, state, 0)
    return track


def _march_in_chunks(
    arrays: tuple[ModalModel, Propagator, GapProblem, GapMemory],
    state: ModalState,
    acc: Floats,
    track: Track,
    options: TransientOptions,
    progress: Progress,
) -> float:
    """March over all steps; the largest gap residual met."""
    model, step, problem, memory = arrays
    last, worst = acc.shape[1] - 1, 0.0
    for first in range(0, last, _CHUNK):
        until = min(first + _CHUNK, last)
        gaps = (problem, memory, options.tolerance)
        reached, residual = march(model, step, gaps, state, (acc, first, until), track)
        if reached < until:
            raise ConvergenceError(not_converged(reached + 1, options, residual))
        worst = max(worst, residual)
        progress(until, last)
    return worst


def not_converged(step: int, options: TransientOptions, residual: float) -> str:
    """Message for a step whose gap-space problem did not converge."""
    return (
        f"step {step}, t = {step * options.dt:.6g} s: the gap-space problem stopped at a relative residual of "
        f"{residual:.2g}, limit {options.tolerance:.2g}; halve transient.dt, or lower the friction"
    )


def _history(
    system: System,
    model: ModalModel,
    track: Track,
    acc: Floats,
    options: TransientOptions,
    stats: dict[str, float],
) -> History:
    q, v = track.q, track.v
    traction = track.force.reshape(len(q), -1)
    rate = model.static + acc.T @ model.load + traction @ system.B - v * model.c - q * model.k
    return History(
        time=np.arange(len(q)) * (options.dt * options.stride),
        jump=track.jump,
        traction=track.force,
        state=track.state,
        disp=q @ system.observe.T,
        vel=v @ system.observe.T,
        acc=rate @ system.observe.T,
        q=q,
        v=v,
        energy=ledger(track.works, 0.5 * (v**2).sum(axis=1), 0.5 * (q**2) @ model.k, track.stored),
        peaks=named_peaks(track.peaks, options.dt),
        stats=stats,
    )


INTEGRATORS: dict[str, Callable[[System, Floats, TransientOptions, Progress], History]] = {
    "modal": modal,
    "generalized_alpha": generalized_alpha,
}
