"""Which modes are states of the march, which answer as a flexibility; the arrays the hot loop needs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from romdam.contact.problem import GapMemory, GapProblem, Limits, Strength, gap_memory
from romdam.core.arrays import Floats
from romdam.core.errors import ConfigError
from romdam.core.system import Alike, System
from romdam.timestepping.equilibrium import system_gap_problem
from romdam.timestepping.modal.arrays import Levels, ModalModel, Track
from romdam.timestepping.modal.propagator import Propagator, modal_propagator, stacked
from romdam.timestepping.options import TransientOptions

_FEW = 30  # modes up to which all may be states of the conserving scheme
_BONDED = 4.0  # largest bonded angular frequency times step: the scheme is stable at any, but not accurate
_SLOW = 50.0  # [Hz] a strongly damped mode below this moves with the ground and stays a state


@dataclass(frozen=True)
class StateSplit:
    """Modes that are states, and the rest that relaxes.

    Attributes
    ----------
    states, rest : mode numbers
    G, G_rest : (N, states), (N, rest) jumps of the modes
    taper : (states,) share with which each state moves the gaps; what it leaves answers as a flexibility.
        G has it already
    """

    states: NDArray[np.int64]
    rest: NDArray[np.int64]
    G: Floats
    G_rest: Floats
    taper: Floats


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
    whole = np.ones(len(states))
    return StateSplit(
        states, rest, np.ascontiguousarray(G[:, states]), np.ascontiguousarray(G[:, rest]), whole
    )


def split_conserving(system: System, dt: float) -> StateSplit:
    """Split the modes so that the gaps' boundary is massless: joint forces follow from displacements.

    States are the lowest modes whose bonded frequency (every gap closed, the rest a static flexibility)
    the step resolves, and of many modes only the lower third, which the mesh resolves. The coupling of
    the states to the gaps is tapered by Lanczos' sigma factors, what it leaves is added to the static
    flexibility: a sharp cut rings (70 % of the pressure on a bouncing bar, 0.04 % with the taper).

    References
    ----------
    Monjaraz-Tec, Gross, Krack, Comput. Struct. 260 (2022) 106698: massless boundaries.

    Raises
    ------
    ConfigError
        where no split is possible: rigid gaps on a boundary that keeps its mass.
    """
    k = system.K.diagonal()
    order = np.argsort(k, kind="stable")
    G = system.B.toarray()
    compliance = system_gap_problem(system, np.zeros((len(G), len(G)))).compliance
    ends = np.flatnonzero(np.diff(k[order], append=np.inf) > 1e-9 * k[order]) + 1
    low, high = 0, len(ends) if len(k) <= _FEW else int(np.searchsorted(ends, len(k) / 3.0))
    while low < high:  # bisect for the largest number of states
        middle = (low + high + 1) // 2
        bonded = _bonded_frequency(k, G, compliance, order[: ends[middle - 1]])
        low, high = (middle, high) if bonded * dt <= _BONDED else (low, middle - 1)
    if low == 0:
        raise ConfigError(
            f"without damping and with transient.finest_step {dt:g} s no joint force keeps the energy: "
            "the gaps are rigid or too stiff for the step, and the model has no higher modes to give their "
            "boundary a flexibility; keep more modes, lower the step, give a finite normal_stiffness, or "
            "damping"
        )
    states, rest = np.sort(order[: ends[low - 1]]), np.sort(order[ends[low - 1] :])
    taper = np.sinc(np.sqrt(k[states] / k[rest].min())) if len(rest) else np.ones(len(states))
    return StateSplit(
        states, rest, np.ascontiguousarray(G[:, states] * taper), np.ascontiguousarray(G[:, rest]), taper
    )


def _bonded_frequency(k: Floats, G: Floats, compliance: Floats, states: NDArray[np.int64]) -> float:
    """Highest angular frequency of the states with every gap closed; inf if their boundary has mass."""
    rest = np.setdiff1d(np.arange(len(k)), states)
    if (k[rest] <= 0.0).any():
        return np.inf
    flexibility = (G[:, rest] / k[rest]) @ G[:, rest].T + np.diag(compliance)
    size, vectors = np.linalg.eigh(flexibility)
    if len(size) and size[0] <= 1e-10 * size[-1]:
        return np.inf
    seen = (vectors.T @ G[:, states]) / np.sqrt(size)[:, None]
    return float(np.sqrt(np.linalg.eigvalsh(np.diag(k[states]) + seen.T @ seen)[-1]))


def modal_model(
    system: System,
    split: StateSplit,
    active: NDArray[np.int64],
    conserving: bool,
    shift: Floats | None = None,
) -> ModalModel:
    """Arrays of a diagonal system for the hot loop.

    Parameters
    ----------
    active : the shaken components
    conserving : whether the joint force acts with its mean over a step
    shift : (nt, N) added to the jumps at every base step [m]
    """
    k = system.K.diagonal()
    tiles, values = _tiles(system, split)
    R = (split.G_rest / k[split.rest]) @ split.G_rest.T if len(split.rest) else np.zeros((0, 0))
    tapered = np.flatnonzero(split.taper < 1.0)
    if len(tapered):
        left = (1.0 / split.taper[tapered] ** 2 - 1.0) / k[split.states[tapered]]
        R = R + (split.G[:, tapered] * left) @ split.G[:, tapered].T
    return ModalModel(
        static=np.ascontiguousarray(system.force[split.states]),
        load=np.ascontiguousarray(-system.load[np.ix_(split.states, active)].T),
        tiles=tiles,
        values=values,
        R=np.ascontiguousarray(R),
        conserving=True if conserving else None,
        shift=np.zeros((0, 0)) if shift is None else np.ascontiguousarray(shift),
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


def _relaxation_time(system: System, split: StateSplit) -> float:
    """Mean of c/k weighted by what each mode adds to the gaps' flexibility; 0 without such modes."""
    k, c = system.K.diagonal()[split.rest], system.C.diagonal()[split.rest]
    if len(k) == 0:
        return 0.0
    weight = (split.G_rest**2).sum(axis=0) / k
    return float((weight * c / k).sum() / weight.sum()) if weight.sum() > 0.0 else 0.0


def step_levels(
    variants: Sequence[System], model: ModalModel, split: StateSplit, options: TransientOptions
) -> tuple[Levels, NDArray[np.int64]]:
    """Propagators and gap-space problems of the base step and those below it.

    Parameters
    ----------
    variants : systems that differ in damping and in their joints' parameters at most

    Returns
    -------
    (levels, damping) : damping (variants,) says which of the levels' step coefficients each variant has;
        the gap-space problems are in the order of the variants
    """
    dampings = [variant.C.diagonal().tobytes() for variant in variants]
    distinct = list(dict.fromkeys(dampings))
    index = np.array([distinct.index(key) for key in dampings], dtype=np.int64)
    motions = [_motion(variants[dampings.index(key)], model, split, options) for key in distinct]
    most_lag = 1.0 if options.midpoint and not model.conserving else 0.0
    problems = [
        [
            _offset_problem(system, split, (H, dt, own), most_lag)
            for H, dt, own in zip(motions[i].H, motions[i].step.dt, motions[i].own, strict=True)
        ]
        for system, i in zip(variants, index, strict=True)
    ]
    halves = [motion.half for motion in motions if model.conserving]
    levels = Levels(
        size=np.array([math.prod(options.cuts[level:]) for level in range(len(options.cuts) + 1)]),
        step=stacked([motion.step for motion in motions]),
        problem=_stacked_problems(problems),
        decay=np.stack([motion.decay for motion in motions]),
        half=np.stack(halves) if halves else np.zeros((len(motions), 1, 0, 0)),
    )
    return levels, index


@dataclass(frozen=True)
class _Motion:
    """Step coefficients of one damping, and the flexibility of the gaps over a step, for every level.

    Attributes
    ----------
    own : (levels, N) flexibility of a single gap, per force of all that it stands for
    """

    step: Propagator
    decay: Floats
    H: Floats
    own: Floats
    half: Floats


def _motion(system: System, model: ModalModel, split: StateSplit, options: TransientOptions) -> _Motion:
    k, c = system.K.diagonal(), system.C.diagonal()
    sizes = [options.dt / math.prod(options.cuts[:level]) for level in range(len(options.cuts) + 1)]
    whole = system if system.alike is None else system.alike.whole
    all_ = split if system.alike is None else split_states(whole, options.flexible_ratio)
    tau = _relaxation_time(whole, all_)
    decay = np.array([np.exp(-dt / tau) if tau > 0.0 else 0.0 for dt in sizes])
    step = stacked([modal_propagator(k[split.states], c[split.states], dt) for dt in sizes])
    half = 0.5 * np.stack([(split.G * q_p) @ split.G.T for q_p in step.q_p])
    H = half if model.conserving else 2.0 * half
    if len(model.R):
        H = H + (1.0 - decay)[:, None, None] * model.R
    own = H.diagonal(axis1=1, axis2=2)
    if system.alike is not None:
        own = _single(system.alike, all_, sizes, decay)
    return _Motion(step, decay, H, own, half)


def _single(alike: Alike, split: StateSplit, sizes: Sequence[float], decay: Floats) -> Floats:
    """Flexibility of one gap of every group over a step of each size, per force of the group."""
    k, c = alike.whole.K.diagonal(), alike.whole.C.diagonal()
    d = alike.signs.shape[1]
    rows = (d * np.unique(alike.gaps, return_index=True)[1][:, None] + np.arange(d)).ravel()
    q_p = np.stack([modal_propagator(k[split.states], c[split.states], dt).q_p for dt in sizes])
    relaxed = split.G_rest[rows] ** 2 @ (1.0 / k[split.rest])
    own = q_p @ split.G[rows].T ** 2 + (1.0 - decay)[:, None] * relaxed
    return np.asarray(own / np.repeat(alike.count, d))


def _offset_problem(
    system: System, split: StateSplit, step: tuple[Floats, float, Floats], most_lag: float
) -> GapProblem:
    """The gap-space problem of a step, its gaps as the static load leaves the modes that are no states."""
    offset = split.G_rest @ (system.force[split.rest] / system.K.diagonal()[split.rest])
    problem = system_gap_problem(system, step[0], float(step[1]), most_lag, step[2])
    return problem._replace(gap=problem.gap + offset[:: system.law.directions])


def _stacked_problems(problems: list[list[GapProblem]]) -> GapProblem:
    """Problems of every variant and level in one; the dual is left out where one of them has none."""
    firsts = [levels[0] for levels in problems]
    with_dual = len({problem.Z.shape for levels in problems for problem in levels}) == 1
    empty = np.zeros((len(problems), len(problems[0]), 0, 0))

    def by_level(name: str) -> Floats:
        return np.stack([np.stack([getattr(p, name) for p in levels]) for levels in problems])

    dash = np.stack([np.stack([p.strength.dash for p in levels]) for levels in problems])
    strengths = zip(*(problem.strength._replace(dash=np.zeros(0)) for problem in firsts), strict=True)
    return GapProblem(
        W=by_level("W"),
        Z=by_level("Z") if with_dual else empty,
        lift=by_level("lift"),
        tension=np.stack([problem.tension for problem in firsts]),
        compliance=by_level("compliance"),
        lag=by_level("lag"),
        own=by_level("own"),
        mu=np.stack([problem.mu for problem in firsts]),
        gap=np.stack([problem.gap for problem in firsts]),
        strength=Strength(*(np.stack(values) for values in strengths))._replace(dash=dash),
        frictional=firsts[0].frictional,
    )


def run_memory(problem: GapProblem, variant: NDArray[np.int64]) -> GapMemory:
    """Memory of every run for stacked problems, every gap open and unloaded.

    Parameters
    ----------
    variant : (runs,) the variant of each
    """
    levels, runs = problem.W.shape[1], len(variant)
    firsts = [gap_memory(_first_level(problem, i)) for i in range(len(problem.gap))]
    memories = [firsts[i] for i in variant]

    def by_level(array: NDArray[Any]) -> NDArray[Any]:
        return np.broadcast_to(array, (runs, levels, *array.shape)).copy()

    def by_run(name: str) -> NDArray[Any]:
        return np.stack([getattr(memory, name) for memory in memories])

    limits = zip(*(memory.limits for memory in memories), strict=True)
    first = firsts[0]
    return GapMemory(
        force=by_run("force"),
        anchor=by_run("anchor"),
        active=by_level(first.active),
        inverse=np.zeros((runs, levels, *first.inverse.shape)),  # memory comes as it is written to
        order=by_level(first.order),
        counts=by_level(first.counts),
        known=by_level(first.known),
        work=first.work,
        limits=Limits(*(np.stack(values) for values in limits)),
        weak=by_run("weak"),
        trial=by_run("trial"),
        spring=by_run("spring"),
        worst=by_run("worst"),
    )


def _first_level(problem: GapProblem, variant: int) -> GapProblem:
    """The base step's problem of one variant."""
    strength = Strength(*(values[variant] for values in problem.strength))
    parts = {name: getattr(problem, name)[variant] for name in ("tension", "mu", "gap")}
    arrays = {
        name: getattr(problem, name)[variant, 0] for name in ("W", "Z", "lift", "compliance", "lag", "own")
    }
    strength = strength._replace(dash=strength.dash[0])
    return GapProblem(**arrays, **parts, strength=strength, frictional=problem.frictional)


def whole_motion(system: System, split: StateSplit, track: Track) -> tuple[Floats, Floats]:
    """All modes' displacements and velocities from the states and the relaxed joint forces."""
    q, v = np.zeros((len(track.q), system.size)), np.zeros((len(track.q), system.size))
    q[:, split.states], v[:, split.states] = track.q * split.taper, track.v * split.taper
    tapered = np.flatnonzero(split.taper < 1.0)
    if len(tapered):
        k = system.K.diagonal()[split.states[tapered]]
        left = (1.0 / split.taper[tapered] - split.taper[tapered]) / k
        q[:, split.states[tapered]] += track.s @ (split.G[:, tapered] * left)
    if len(split.rest):
        k = system.K.diagonal()[split.rest]
        q[:, split.rest] = (track.s @ split.G_rest + system.force[split.rest]) / k
    return q, v


def observed_motion(system: System, split: StateSplit, track: Track) -> tuple[Floats, Floats]:
    """Displacements and velocities of the observed nodes, (nt, 3 * probes), as `whole_motion` has them."""
    seen, k = system.observe, system.K.diagonal()
    flexible = seen[:, split.rest].toarray().T / k[split.rest, None]
    relaxed, states = split.G_rest @ flexible, seen[:, split.states]
    tapered = np.flatnonzero(split.taper < 1.0)
    if len(tapered):
        left = (1.0 / split.taper[tapered] - split.taper[tapered]) / k[split.states[tapered]]
        relaxed += (split.G[:, tapered] * left) @ states[:, tapered].toarray().T
    disp = (track.q * split.taper) @ states.T + system.force[split.rest] @ flexible
    if relaxed.any():
        disp += track.s @ relaxed
    return disp, (track.v * split.taper) @ states.T
