"""Integrate a system with gaps under ground acceleration.

To add an integrator, write one function with the signature of `adaptive` and name it in INTEGRATORS.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from romdam.dynamics.arrays import Control, Levels, ModalModel, ModalState, Track
from romdam.dynamics.energy import ledger
from romdam.dynamics.full_order import generalized_alpha
from romdam.dynamics.march import march, record_row
from romdam.dynamics.options import TransientOptions
from romdam.dynamics.peaks import first_peaks, named_peaks
from romdam.dynamics.states import (
    StateSplit,
    modal_model,
    split_conserving,
    split_states,
    step_levels,
    whole_motion,
)
from romdam.dynamics.static import GapState, resumed, static_equilibrium, take_over, undeformed
from romdam.dynamics.system import GapLaw, History, System
from romdam.errors import ConfigError, ConvergenceError

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
    """Exact modal propagation at a fixed step, every mode a state: the baseline.

    Raises
    ------
    ConfigError
        for a system that is not diagonal.
    """
    fixed = replace(options, levels=0, flexible_ratio=math.inf)
    return adaptive(system, ground, fixed, progress)


def adaptive(system: System, ground: Floats, options: TransientOptions, progress: Progress) -> History:
    """Exact modal propagation with steps cut where contact changes, damped high modes as a flexibility.

    Raises
    ------
    ConfigError
        for a system that is not diagonal.
    """
    return _march_modes(system, ground, options, progress, split_states(system, options.flexible_ratio))


def conserving(system: System, ground: Floats, options: TransientOptions, progress: Progress) -> History:
    """Massless boundary and joint force linear over a fixed step: for scenes without damping.

    A joint force constant over the step takes almost all energy out of impacts that nothing damps
    (94 to 99 % in 10 s on the two-cantilever model, at any step); this scheme keeps it, within a drift
    that the ledger reports as `contact`.

    Raises
    ------
    ConfigError
        for a system that is not diagonal, and for a step beyond the stability limit.
    """
    fixed = replace(options, levels=0)
    _refuse_sparse(system, options)
    if system.law.laws:
        raise ConfigError(
            f"transient.integrator: conserving knows no {', '.join(sorted(system.law.laws))}; "
            "use adaptive, or leave these keys out of the joints"
        )
    return _march_modes(
        system, ground, fixed, progress, split_conserving(system, options.dt), conserving=True
    )


def _refuse_sparse(system: System, options: TransientOptions) -> None:
    if not system.diagonal:
        raise ConfigError(
            f"transient.integrator: {options.integrator} needs a reduced model; use generalized_alpha, "
            "or model.order: reduced"
        )


def _march_modes(
    system: System,
    ground: Floats,
    options: TransientOptions,
    progress: Progress,
    split: StateSplit,
    conserving: bool = False,
) -> History:
    _refuse_sparse(system, options)
    start = time.process_time()
    active = np.flatnonzero(np.abs(ground).max(axis=1) > 0.0)
    acc = np.ascontiguousarray(ground[active])
    model = modal_model(system, split, active, conserving, options.shift)
    levels = step_levels(system, model, split, options)
    q, v, gaps = _initial(system, options)
    state = _modal_state((model, split.G), (q[split.states], v[split.states]), gaps, acc)
    take_over(levels.memory, gaps)
    track = _track(state, options.stride, ground.shape[1])
    # no step: a first start compiles here, not in the timed loop
    march(model, levels, Control(options.tolerance, math.inf), state, (acc, 0, 0), track)
    setup, loop = time.process_time() - start, time.process_time()
    _march_in_chunks((model, levels, system.law), state, acc, track, options, progress)
    stats = {
        "base_steps": float(ground.shape[1] - 1),
        "finest_step": float(levels.step.dt[-1]),
        "steps": state.counts[0],
        "refused_steps": state.counts[1],
        "solver_iterations": float(levels.memory.counts[..., 2].sum()),
        "largest_iterations": float(levels.memory.counts[..., 3].max(initial=0)),
        "largest_residual": state.counts[2],
        "state_modes": float(len(model.k)),
        "flexible_modes": float(len(split.rest)),
        "setup_cpu_seconds": setup,
        "loop_cpu_seconds": time.process_time() - loop,
    }
    return _history(system, (model, split), track, acc[:, :: options.stride], options, stats)


def _initial(system: System, options: TransientOptions) -> tuple[Floats, Floats, GapState]:
    if options.start is not None:
        return options.start.q, options.start.v, resumed(system, options.start)
    static = options.initial_state == "static"
    q, gaps = static_equilibrium(system, options.tolerance) if static else undeformed(system)
    return q, np.zeros_like(q), gaps


def _modal_state(
    arrays: tuple[ModalModel, Floats], motion: tuple[Floats, Floats], gaps: GapState, acc: Floats
) -> ModalState:
    (model, G), (q, v) = arrays, motion
    p = gaps.force.ravel()
    relaxed = len(model.R) > 0
    return ModalState(
        q=q.copy(),
        v=v.copy(),
        f=model.static + model.load.T @ acc[:, 0],
        s=p.copy() if relaxed else np.zeros(0),
        u_r=model.R @ p if relaxed else np.zeros(0),
        jump=gaps.jump.copy(),
        force=gaps.force.copy(),
        mean=p.copy(),
        w=G @ q,
        state=gaps.state.copy(),
        closed=gaps.state > 0,
        impulse=np.zeros_like(gaps.force),
        works=np.zeros(4),
        stored=np.array([gaps.stored]),
        level=np.zeros(1, dtype=np.int64),
        counts=np.zeros(3),
    )


def _track(state: ModalState, stride: int, samples: int) -> Track:
    rows = (samples - 1) // stride + 1
    track = Track(
        stride=stride,
        q=np.zeros((rows, len(state.q))),
        v=np.zeros((rows, len(state.q))),
        s=np.zeros((rows, len(state.s))),
        jump=np.zeros((rows, *state.jump.shape)),
        force=np.zeros((rows, *state.force.shape)),
        impulse=np.zeros((rows, *state.force.shape)),
        state=np.zeros((rows, len(state.state)), dtype=np.uint8),
        works=np.zeros((rows, 4)),
        stored=np.zeros(rows),
        peaks=first_peaks(state.jump, state.force),
    )
    record_row(track, state, 0)
    return track


def _march_in_chunks(
    arrays: tuple[ModalModel, Levels, GapLaw],
    state: ModalState,
    acc: Floats,
    track: Track,
    options: TransientOptions,
    progress: Progress,
) -> None:
    model, levels, law = arrays
    control = Control(options.tolerance, _impulse_limit(acc, options))
    last = acc.shape[1] - 1
    for first in range(0, last, _CHUNK):
        until = min(first + _CHUNK, last)
        reached = march(model, levels, control, state, (acc, first, until), track)
        if reached < until:
            raise ConvergenceError(
                not_converged(reached + 1, options, state.counts[2], law.place(int(levels.memory.worst[0])))
            )
        progress(until, last)


def _impulse_limit(acc: Floats, options: TransientOptions) -> float:
    """Gap velocity that the change of a joint force over a step may stand for [m/s].

    Impacts happen at about the peak ground velocity. On the two-cantilever model anything below 3 % of it no
    longer changes the error; without that limit it stays above 1 % at any step.
    """
    velocity = np.cumsum(acc, axis=1) * options.dt
    peak = float(np.abs(velocity).max(initial=0.0))
    return options.force_change * peak if peak > 0.0 else math.inf


def not_converged(step: int, options: TransientOptions, residual: float, place: str) -> str:
    """Message for a step whose gap-space problem did not converge."""
    return (
        f"step {step}, t = {step * options.dt:.6g} s: the gap-space problem stopped at a relative residual "
        f"of {residual:.2g}, limit {options.tolerance:.2g}, farthest at {place}; halve transient.dt, or "
        "lower the friction"
    )


def _history(
    system: System,
    arrays: tuple[ModalModel, StateSplit],
    track: Track,
    acc: Floats,
    options: TransientOptions,
    stats: dict[str, float],
) -> History:
    model, split = arrays
    q, v = whole_motion(system, split, track)
    traction = track.force.reshape(len(q), -1)
    rate = np.zeros_like(q)
    rate[:, split.states] = (
        model.static + acc.T @ model.load + traction @ split.G - track.v * model.c - track.q * model.k
    )
    strain = 0.5 * (track.q**2) @ model.k
    if len(model.R):
        strain += 0.5 * np.einsum("ti,ij,tj->t", track.s, model.R, track.s, optimize=True)
    return History(
        time=np.arange(len(q), dtype=np.float64) * (options.dt * options.stride),
        jump=track.jump,
        traction=track.force,
        mean_traction=track.impulse / (options.dt * options.stride),
        state=track.state,
        disp=q @ system.observe.T,
        vel=v @ system.observe.T,
        acc=rate @ system.observe.T,
        q=q,
        v=v,
        energy=ledger(track.works, 0.5 * (track.v**2).sum(axis=1), strain, track.stored),
        peaks=named_peaks(track.peaks),
        stats=stats,
        integrator=options.integrator,
    )


INTEGRATORS: dict[str, Callable[[System, Floats, TransientOptions, Progress], History]] = {
    "adaptive": adaptive,
    "conserving": conserving,
    "modal": modal,
    "generalized_alpha": generalized_alpha,
}
