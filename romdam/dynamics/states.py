"""Which modes are states of the march, which answer as a flexibility; the arrays the hot loop needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from romdam.dynamics.arrays import RATIO, Levels, ModalModel, Track
from romdam.dynamics.options import TransientOptions
from romdam.dynamics.propagator import modal_propagator, stacked
from romdam.dynamics.static import system_gap_problem
from romdam.dynamics.system import System
from romdam.joints.problem import GapMemory, gap_memory

Floats = NDArray[np.float64]

_SLOW = 50.0  # [Hz] a strongly damped mode below this moves with the ground and stays a state


@dataclass(frozen=True)
class StateSplit:
    """Modes that are states, and the rest that relaxes.

    Attributes
    ----------
    states, rest : mode numbers
    G, G_rest : (N, states), (N, rest) jumps of the modes
    """

    states: NDArray[np.int64]
    rest: NDArray[np.int64]
    G: Floats
    G_rest: Floats


def split_states(system: System, flexible_ratio: float) -> StateSplit:
    """Split the modes of a diagonal system by their damping ratio.

    A mode with xi = c / (2 omega) of 0.7 or more answers a force by relaxing to it, without overshoot
    worth a state. With stiffness-proportional damping these are the high modes: on the two-cantilever
    model half of all, at no visible cost in error; lightly damped modes always are states.
    """
    k, c = system.K.diagonal(), system.C.diagonal()
    elastic = k > (2.0 * np.pi * _SLOW) ** 2
    rests = elastic.copy()
    rests[elastic] = c[elastic] > 2.0 * flexible_ratio * np.sqrt(k[elastic])
    states, rest = np.flatnonzero(~rests), np.flatnonzero(rests)
    G = system.B.toarray()
    return StateSplit(states, rest, np.ascontiguousarray(G[:, states]), np.ascontiguousarray(G[:, rest]))


def modal_model(system: System, split: StateSplit, active: NDArray[np.int64]) -> ModalModel:
    """Arrays of a diagonal system for the hot loop; `active` are the shaken components."""
    k, c = system.K.diagonal(), system.C.diagonal()
    tiles, values = _tiles(system, split)
    R = (split.G_rest / k[split.rest]) @ split.G_rest.T if len(split.rest) else np.zeros((0, 0))
    return ModalModel(
        k=k[split.states],
        c=c[split.states],
        static=np.ascontiguousarray(system.force[split.states]),
        load=np.ascontiguousarray(-system.load[np.ix_(split.states, active)].T),
        tiles=tiles,
        values=values,
        R=np.ascontiguousarray(R),
        tau=_relaxation_time(k[split.rest], c[split.rest], split.G_rest),
    )


def _tiles(system: System, split: StateSplit) -> tuple[NDArray[np.int64], Floats]:
    """Non-zero blocks of G, one per joint and block of the scene."""
    d, offset = system.law.directions, 0
    tiles: list[tuple[int, int, int, int, int]] = []
    values: list[Floats] = []
    for part in system.parts.values():
        c0, c1 = np.searchsorted(split.states, (part.start, part.stop))
        for gaps in system.law.joints.values():
            block = split.G[d * gaps.start : d * gaps.stop, c0:c1]
            if block.any():
                tiles.append((d * gaps.start, d * gaps.stop, int(c0), int(c1), offset))
                values.append(block.ravel())
                offset += block.size
    return np.array(tiles, dtype=np.int64).reshape(-1, 5), np.concatenate([np.zeros(0), *values])


def _relaxation_time(k: Floats, c: Floats, G: Floats) -> float:
    """Mean of c/k weighted by what each mode adds to the gaps' flexibility; 0 without such modes."""
    if len(k) == 0:
        return 0.0
    weight = (G**2).sum(axis=0) / k
    return float((weight * c / k).sum() / weight.sum()) if weight.sum() > 0.0 else 0.0


def step_levels(system: System, model: ModalModel, split: StateSplit, options: TransientOptions) -> Levels:
    """Propagators and gap-space problems of the base step and its halves."""
    sizes = [options.dt / float(RATIO) ** level for level in range(options.levels + 1)]
    steps = [modal_propagator(model.k, model.c, dt) for dt in sizes]
    decay = np.array([np.exp(-dt / model.tau) if model.tau > 0.0 else 0.0 for dt in sizes])
    offset = split.G_rest @ (system.force[split.rest] / system.K.diagonal()[split.rest])
    problems = []
    for step, e in zip(steps, decay, strict=True):
        H = (split.G * step.q_p) @ split.G.T
        if len(model.R):
            H = H + (1.0 - e) * model.R
        problems.append(system_gap_problem(system, H))
    first = problems[0]._replace(gap=system.law.gap + offset[:: system.law.directions])
    memories = [gap_memory(problem) for problem in problems]
    duals = [p.Z for p in problems]
    if any(Z.shape != duals[0].shape for Z in duals):
        duals = [np.zeros((0, 0)) for _ in duals]
    return Levels(
        step=stacked(steps),
        problem=first._replace(
            W=np.stack([p.W for p in problems]), Z=np.stack(duals), lift=np.stack([p.lift for p in problems])
        ),
        memory=_stacked_memory(memories),
        decay=decay,
    )


def _stacked_memory(memories: list[GapMemory]) -> GapMemory:
    return memories[0]._replace(
        active=np.stack([m.active for m in memories]),
        inverse=np.stack([m.inverse for m in memories]),
        order=np.stack([m.order for m in memories]),
        counts=np.stack([m.counts for m in memories]),
    )


def whole_motion(system: System, split: StateSplit, track: Track) -> tuple[Floats, Floats]:
    """All modes' displacements and velocities from the states and the relaxed joint forces."""
    q, v = np.zeros((len(track.q), system.size)), np.zeros((len(track.q), system.size))
    q[:, split.states], v[:, split.states] = track.q, track.v
    if len(split.rest):
        k = system.K.diagonal()[split.rest]
        q[:, split.rest] = (track.s @ split.G_rest + system.force[split.rest]) / k
    return q, v
