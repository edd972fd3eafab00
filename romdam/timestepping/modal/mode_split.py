"""Split the unknowns of a system into dynamic modes and a flexibility, and prepare both for the time loop.

A mode with mass is a state of the time loop. An unknown without mass has no dynamics of its own: it follows
the joint force as a flexibility, at once or with a relaxation time (`ModeSplit`, `split_by_mass`). Some
integrators also take the stiffest modes partly as a flexibility, with a taper between the two.

From the split follow the arrays that stay constant during a run: the blocks of G, the flexibility R and the
loads (`modal_model`), and for each step size the exact propagator of the modes and the gap-space problem
(`step_levels`). That problem needs the jump per unit joint force over the step,

    H = G diag(q_p) G^T + (1 - decay) R,

where q_p is the displacement of each mode per unit force that is constant over the step.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from romdam.contact.components import NORMAL
from romdam.contact.problem import GapMemory, GapProblem, blocks_of_gaps, gap_memory, self_flexibility
from romdam.core.arrays import Bools, Floats, Ints, at, stacked, together
from romdam.core.system import System
from romdam.timestepping.equilibrium import system_gap_problem
from romdam.timestepping.modal.arrays import BASE, ModalModel, StepHierarchy
from romdam.timestepping.modal.propagator import Propagator, modal_propagator, response_to_force
from romdam.timestepping.modal.symmetry import Symmetry
from romdam.timestepping.prepared import Prepared
from romdam.timestepping.steps import Steps

T = TypeVar("T")

_ALIKE = 1e-9  # relative difference of relaxation times that count as one


@dataclass(frozen=True)
class ModeSplit:
    """Dynamic modes, and unknowns that answer a joint force as one flexibility, which may relax.

    Attributes
    ----------
    dynamic, quasi_static : mode numbers
    G, G_quasi : (N, dynamic), (N, quasi-static) jumps of the modes
    taper : (dynamic,) share with which each dynamic mode moves the gaps; what it leaves answers as a
        flexibility. G has it already
    """

    dynamic: Ints
    quasi_static: Ints
    G: Floats
    G_quasi: Floats
    taper: Floats

    @property
    def follows_ground(self) -> bool:
        """Whether the quasi-static unknowns follow the ground; those of a massless boundary do not."""
        return not (self.taper < 1.0).any()

    def ground_answer(self, system: System) -> Floats:
        """Displacement of the quasi-static unknowns per unit ground acceleration, (quasi-static, loads) [s2].

        What they carry without a mass of their own, such as water, is a static load to them.
        """
        if not self.follows_ground:
            return np.zeros((len(self.quasi_static), system.load.shape[1]))
        k = system.K.diagonal()[self.quasi_static]
        return np.asarray(-system.load[self.quasi_static] / k[:, None])

    @property
    def key(self) -> tuple[bytes, bytes]:
        """Key that tells it from others of the same system."""
        return self.dynamic.tobytes(), self.taper.tobytes()


class ModalScheme(Protocol):
    """What the arrays of a run follow from beside its system: options of `ModalIntegrator`."""

    midpoint: bool
    force_change: float
    shear_change: float
    conserving: bool

    def split(self, prepared: Prepared, step: float) -> ModeSplit:
        """Choose the dynamic modes for a base step [s]."""
        ...


def make_split(system: System, dynamic: Ints, quasi_static: Ints, taper: Floats) -> ModeSplit:
    """Split the modes of a diagonal system by their numbers."""
    G = system.B.toarray()
    tapered, rest = G.take(dynamic, axis=1) * taper, G.take(quasi_static, axis=1)  # each row after row
    return ModeSplit(dynamic, quasi_static, tapered, rest, taper)


def split_by_mass(system: System) -> ModeSplit:
    """Split the unknowns of a diagonal system: every one with mass is dynamic, however strongly it is damped.

    Unknowns without mass follow k q + c q' = f. Those without damping follow at once, and those that relax
    with one time constant c / k follow together: they are quasi-static, one flexibility for all of them. If
    there are several time constants (parts without mass and of different damping), the flexibility takes
    those that follow at once, or else the most frequent time constant, and the rest are dynamic: the
    propagator knows unknowns without mass.
    """
    massless = np.flatnonzero(system.M.diagonal() == 0.0)
    tau = system.C.diagonal()[massless] / system.K.diagonal()[massless]
    order = np.argsort(tau, kind="stable")
    group = np.empty(len(tau), dtype=np.int64)
    group[order] = np.cumsum(np.diff(tau[order], prepend=0.0) > _ALIKE * tau[order])
    at_once = tau == 0.0
    together = at_once if at_once.any() else group == np.bincount(group, minlength=1).argmax()
    quasi_static = massless[together]
    dynamic = np.setdiff1d(np.arange(system.size), quasi_static)
    return make_split(system, dynamic, quasi_static, np.ones(len(dynamic)))


def modal_model(
    system: System,
    split: ModeSplit,
    active: Ints,
    conserving: bool,
    shift: Floats | None = None,
) -> ModalModel:
    """Arrays of a diagonal system for the hot loop.

    Parameters
    ----------
    active : the shaken components
    conserving : whether the mean joint force over a step does the work that the gaps store
    shift : (nt, N) added to the jumps at every base step [m]
    """
    ground_jump = split.G_quasi @ split.ground_answer(system)[:, active]
    k = system.K.diagonal()
    tiles, values = _tiles(system, split)
    R = np.zeros((0, 0))
    if len(split.quasi_static):
        scaled = split.G_quasi / np.sqrt(k[split.quasi_static])
        R = scaled @ scaled.T  # BLAS forms one triangle of it
    tapered = np.flatnonzero(split.taper < 1.0)
    if len(tapered):
        left = (1.0 / split.taper[tapered] ** 2 - 1.0) / k[split.dynamic[tapered]]
        R = R + (split.G[:, tapered] * left) @ split.G[:, tapered].T
    return ModalModel(
        static=np.ascontiguousarray(system.force[split.dynamic]),
        load=np.ascontiguousarray(-system.load[np.ix_(split.dynamic, active)].T),
        tiles=tiles,
        values=values,
        R=np.ascontiguousarray(R),
        conserving=True if conserving else None,
        shift=np.zeros((0, 0)) if shift is None else np.ascontiguousarray(shift),
        ground_jump=np.ascontiguousarray(ground_jump.T) if ground_jump.any() else np.zeros((0, 0)),
        carried=np.ascontiguousarray(
            np.zeros((0, 0)) if system.pseudo_static is None else system.pseudo_static.jump
        ),
    )


class _Block(NamedTuple):
    """Some rows and columns of a matrix."""

    rows: slice
    columns: slice

    def with_next(self, other: _Block) -> _Block | None:
        """Both as one, where the other begins, along rows or along columns, as this one ends."""
        if self.rows == other.rows and self.columns.stop == other.columns.start:
            return _Block(self.rows, slice(self.columns.start, other.columns.stop))
        if self.columns == other.columns and self.rows.stop == other.rows.start:
            return _Block(slice(self.rows.start, other.rows.stop), self.columns)
        return None


def _tiles(system: System, split: ModeSplit) -> tuple[NDArray[np.int64], Floats]:
    """Non-zero blocks of G, one per joint and block of the scene; those side by side are one.

    Few long rows are quicker than many short ones: each run of six takes 286 ns for 60 rows of 90, 358 ns for
    60 rows of 48 and of 42, and transposed 303 and 407 ns.
    """
    d, dynamic = system.law.directions, split.dynamic
    columns = [slice(*np.searchsorted(dynamic, (part.start, part.stop))) for part in system.parts.values()]
    rows = [slice(d * gaps.start, d * gaps.stop) for gaps in system.law.joints.values()]
    blocks: list[_Block] = []
    for block in (_Block(r, c) for r in rows for c in columns if split.G[r, c].any()):
        while blocks and (both := blocks[-1].with_next(block)) is not None:
            blocks.pop()
            block = both
        blocks.append(block)
    values = [split.G[block.rows, block.columns].ravel() for block in blocks]
    offsets = np.cumsum([0, *map(len, values)])
    tiles = [
        (rows.start, rows.stop, columns.start, columns.stop, offset)
        for (rows, columns), offset in zip(blocks, offsets, strict=False)
    ]
    return np.array(tiles, dtype=np.int64).reshape(-1, 5), np.concatenate([np.zeros(0), *values])


def step_levels(
    variants: Sequence[Prepared],
    integrator: ModalScheme,
    model: ModalModel,
    split: ModeSplit,
    steps: Steps,
) -> tuple[StepHierarchy, Ints]:
    """Propagators and gap-space problems of the base step and those below it.

    Parameters
    ----------
    variants : differ in damping and in their joints' parameters at most

    Returns
    -------
    (levels, damping) : damping (variants,) says which of the levels' step coefficients each variant has;
        the gap-space problems are in the order of the variants
    """
    dampings = [variant.system.C.diagonal().tobytes() for variant in variants]
    distinct = list(dict.fromkeys(dampings))
    index = np.array([distinct.index(key) for key in dampings], dtype=np.int64)
    firsts = [variants[dampings.index(key)] for key in distinct]
    motions = [_Motion.of(variant, integrator, model, split, steps) for variant in firsts]
    most_ratio = 1.0 if integrator.midpoint else 0.0
    problems: list[list[GapProblem]] = []
    for variant, i in zip(variants, index, strict=True):
        motion, of_levels = motions[i], list[GapProblem]()
        for H, dt, single in zip(motion.H, motion.step.dt, motion.single, strict=True):
            key = ("problem", *split.key, dt, single.tobytes())
            compute = partial(_offset_problem, variant.system, split, H, float(dt), single, most_ratio)
            of_levels.append(variant.cache.get_or_compute(key, compute))
        problems.append(of_levels)
    if len({problem.Z.shape for of_levels in problems for problem in of_levels}) > 1:
        no_dual = np.zeros((0, 0))  # left out where one of them has none
        problems = [[problem._replace(Z=no_dual) for problem in of_levels] for of_levels in problems]
    halves = [motion.half for motion in motions if model.conserving]
    levels = StepHierarchy(
        size=np.array([math.prod(steps.cuts[level:]) for level in range(len(steps.cuts) + 1)]),
        step=together([motion.step for motion in motions]),
        problem=together([stacked(of_levels) for of_levels in problems]),
        decay=np.stack([motion.decay for motion in motions]),
        half=together(halves) if halves else np.zeros((len(motions), 1, 0, 0)),
    )
    return levels, index


@dataclass(frozen=True)
class _Motion:
    """Step coefficients of one damping, and the flexibility of the gaps over a step, for every level.

    Attributes
    ----------
    step : stacked over the levels
    decay : (levels,) exp(-step / tau) of the residual flexibility
    H : (levels, N, N) jump per joint force over the step [m/N]
    single : (levels, N) flexibility of a single gap, per force of all that it stands for [m/N]
    half : (levels, N, N) half the states' flexibility over the step [m/N]
    """

    step: Propagator
    decay: Floats
    H: Floats
    single: Floats
    half: Floats

    @classmethod
    def of(
        cls,
        prepared: Prepared,
        integrator: ModalScheme,
        model: ModalModel,
        split: ModeSplit,
        steps: Steps,
    ) -> Self:
        """Make them for one system."""
        k, c = prepared.system.K.diagonal(), prepared.system.C.diagonal()
        massless = prepared.system.M.diagonal()[split.dynamic] == 0.0
        sizes, whole, symmetry = steps.sizes, prepared.whole or prepared, prepared.symmetry
        of_whole = split if symmetry is None else integrator.split(whole, steps.base)
        rests = of_whole.quasi_static
        times = whole.system.C.diagonal()[rests] / whole.system.K.diagonal()[rests]
        tau = float(times.mean()) if len(rests) else 0.0  # all are equal
        decay = np.array([np.exp(-dt / tau) if tau > 0.0 else 0.0 for dt in sizes])

        def level(dt: float) -> tuple[Propagator, Floats]:
            """Propagator of the dynamic modes, and half their flexibility over the step."""
            modes = k[split.dynamic], c[split.dynamic], dt, massless
            step = _of_modes(prepared, modal_propagator, *modes)
            return step, 0.5 * ((split.G * step.q_p) @ split.G.T)

        levels = [
            prepared.cache.get_or_compute(("level", *split.key, dt), partial(level, dt)) for dt in sizes
        ]
        step, half = stacked([step for step, _ in levels]), np.stack([half for _, half in levels])
        H = half if model.conserving else 2.0 * half
        if len(model.R):
            H = H + (1.0 - decay)[:, None, None] * model.R
        if symmetry is not None:
            single = _single_flexibility(whole, symmetry, of_whole, sizes, decay)
        else:
            n = len(prepared.system.law)
            single = np.stack([self_flexibility(blocks_of_gaps(each, n)).ravel() for each in H])
        return cls(step, decay, H, single, half)


def _of_modes(
    prepared: Prepared,
    compute: Callable[[Floats, Floats, float, Bools], T],
    k: Floats,
    c: Floats,
    dt: float,
    massless: Bools,
) -> T:
    """What is computed of modes over a step, once for all systems that have these modes."""
    key = (compute.__name__, k.tobytes(), c.tobytes(), dt, massless.tobytes())
    return prepared.propagators.get_or_compute(key, partial(compute, k, c, dt, massless))


def _single_flexibility(
    whole: Prepared, symmetry: Symmetry, split: ModeSplit, sizes: Sequence[float], decay: Floats
) -> Floats:
    """Flexibility of one gap of every group over a step of each size, per force of the group."""
    k, c = whole.system.K.diagonal(), whole.system.C.diagonal()
    d = symmetry.signs.shape[1]
    rows = (d * np.unique(symmetry.gaps, return_index=True)[1][:, None] + np.arange(d)).ravel()
    k_dynamic, c_dynamic = k[split.dynamic], c[split.dynamic]
    massless = whole.system.M.diagonal()[split.dynamic] == 0.0
    responses = [_of_modes(whole, response_to_force, k_dynamic, c_dynamic, dt, massless) for dt in sizes]
    G, G_quasi = (each[rows].reshape(len(rows) // d, d, each.shape[1]) for each in (split.G, split.G_quasi))
    relaxed = (G_quasi / k[split.quasi_static]) @ G_quasi.transpose(0, 2, 1)
    blocks = [
        (G * moved) @ G.transpose(0, 2, 1) + (1.0 - left) * relaxed
        for moved, left in zip(responses, decay, strict=True)
    ]
    single = self_flexibility(np.stack(blocks)) / symmetry.count[:, None]
    return np.asarray(single.reshape(len(sizes), -1))


def _offset_problem(
    system: System, split: ModeSplit, H: Floats, dt: float, single: Floats, most_ratio: float
) -> GapProblem:
    """The gap-space problem of a step, its gaps as the static load leaves the quasi-static modes."""
    offset = split.G_quasi @ (system.force[split.quasi_static] / system.K.diagonal()[split.quasi_static])
    problem = system_gap_problem(system, H, dt, most_ratio, single)
    jumps = offset.reshape(-1, system.law.directions)
    return problem._replace(
        gap=problem.gap + jumps[:, NORMAL], slip=problem.slip + jumps[: len(problem.slip), 1:]
    )


def run_memory(problem: GapProblem, variant: Ints) -> GapMemory:
    """Memory of every run for stacked problems, every gap open and unloaded, without the solver's part.

    Parameters
    ----------
    variant : (runs,) the variant of each
    """
    fresh = [gap_memory(at(problem, (i, BASE)))._replace(solver=None) for i in range(len(problem.gap))]
    return stacked([fresh[i] for i in variant])
