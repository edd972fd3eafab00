"""Free-interface reduction of a part: blocks whose interfaces are merged.

A dam on flexible rock is one part with thousands of joint DOFs. Craig-Bampton would retain all of them on
both sides of every joint and diagonalise a dense matrix of that size. Here the basis is

    u = Phi q + A a,    A = K^-1 [B^T, M r, f],

Phi the open-joint modes below the cut-off (Lanczos on one factorisation) and A the static answers to a unit
force in every gap, to the inertia of the ground's acceleration r and to the static loads f, among them the
tractions of absorbing faces that move rigidly and the forces that hold rock in the free field's shapes, so
that rock alone moves as the mesh does whatever the number of modes. It answers every joint force statically
right, carries the mass of A, and A made orthogonal to Phi leaves Phi's frequencies those of the mesh; only
the small rest, one vector for each gap direction, is diagonalised densely. What floats answers what its rigid
acceleration leaves of a force (`inertia_relief`).

With as many vectors more modes do better than longer chains K^-1 M K^-1 B: on a dam of 1,796 unknowns 116
vectors up to 50 Hz leave 0.9 % of the openings in L2, 125 with modes to 8 Hz and a second link 0.9 %, and a
link of the chain costs as many solutions as there are gap directions.

References
----------
Rubin, AIAA Journal 13 (1975) 995; Hintz, AIAA Journal 13 (1975) 1007 (free modes with attachment modes).
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, diags_array, hstack

from romdam.core.arrays import Floats
from romdam.core.basis import BlockBasis
from romdam.core.fingerprint import fingerprint
from romdam.core.scene import Bools, Ints, Scene
from romdam.fem.parts import gather, part_matrices, part_operator
from romdam.fem.water.added_mass import WetMass
from romdam.linalg.condensed import CondensedSingle
from romdam.linalg.conjugate import WIDTH
from romdam.linalg.eigen import dense_modes, span_of_modes
from romdam.linalg.multifrontal import Multifrontal
from romdam.linalg.multigrid import Motions
from romdam.linalg.solvers import SMALL, Solver, make_solver
from romdam.linalg.symmetric import Symmetric
from romdam.reduction.methods.acting import Acting
from romdam.reduction.methods.attachment_modes import Pencil, beside, diagonalised
from romdam.reduction.methods.boundary_forces import boundary_tractions, free_field_forces
from romdam.reduction.methods.craig_bampton import (
    FINER_VECTORS,
    FREE_SHIFT,
    ModeChoice,
    Substructure,
    eigen_residual,
    without_roundoff,
)
from romdam.reduction.methods.inertia_relief import rigid_modes, unbalanced
from romdam.reduction.storage.keys import part_keys
from romdam.reduction.storage.model_file import BlockStore
from romdam.reduction.storage.out_of_core_matrix import OutOfCoreMatrix
from romdam.scene.supports import rigid_motions
from romdam.scene.ties import Part

log = logging.getLogger(__name__)

# times the highest frequency of the modes: so far go those of the basis that estimates compare with
BEYOND = 1.5
_NODES = 4096  # of a block's basis at a time
_TOGETHER, _READ = 64, 200e6  # modes looked at, and bytes of them: each time all of them are read


@dataclass(frozen=True)
class _MergedPart:
    """A part over its free DOFs.

    Attributes
    ----------
    K, M : (n, n), of K the upper triangle
    right : (n, a) sparse, of unit length: what the basis answers statically right
    held : whether supports stop every rigid motion
    motions : of the free DOFs
    rigid : (n, r) M-orthonormal rigid motions that supports leave
    row : (N,) number of every DOF of every block among the free ones, block after block; -1 where it is none
    slaves : those that follow free DOFs, and what they follow, (s, n) sparse; None without mortar ties
    inertia : block name -> (3 nodes, 3) M r of its own
    wet : added mass of water, None without any
    place : what to call the part in messages
    """

    K: Symmetric
    M: csr_matrix
    right: csc_matrix
    held: bool
    motions: Motions
    rigid: Floats
    row: Ints
    slaves: tuple[Ints, csr_matrix] | None
    inertia: dict[str, Floats]
    wet: WetMass | None
    place: str

    @property
    def shift(self) -> float:
        """K less it times M is positive definite."""
        return 0.0 if self.held else -FREE_SHIFT

    @property
    def inner(self) -> Bools:
        """(n,) where there is neither mass nor load: the inside of rock without mass."""
        return np.asarray((self.M.diagonal() == 0.0) & (np.diff(csr_matrix(self.right).indptr) == 0))

    @property
    def first(self) -> Ints:
        """(n,) where every free DOF stands among the blocks' for the first time."""
        found = np.empty(self.K.shape[0], dtype=np.int64)
        here = np.flatnonzero(self.row >= 0)[::-1]
        found[self.row[here]] = here
        return found


def merged_bases(
    part: Part,
    scene: Scene,
    acting: Acting,
    choices: list[ModeChoice],
    store: BlockStore | None = None,
) -> list[dict[str, BlockBasis]]:
    """The bases of a part's blocks, of the same coordinates: from the store, or made and kept there.

    Parameters
    ----------
    choices : one, and where there is a second the finer one beside it, of further modes as far as Lanczos has
        come to them

    Raises
    ------
    ReductionError
        where a factorisation or an eigenproblem fails.
    """
    operator, static, wet = _acting_on(part, acting)
    store = store or BlockStore.passing()
    keys = [part_keys(part, scene, operator, static, choice, wet) for choice in choices]
    kept = [{name: b for name, key in own.items() if (b := store.read(key)) is not None} for own in keys]
    if all(len(own) == len(part.blocks) for own in kept):
        return kept
    merged = _merged_part(part, scene, (operator, static, wet), gather(part, acting.carried))
    return _reduced(merged, scene, choices[0], store, keys)


def merged_keys(part: Part, scene: Scene, acting: Acting, choice: ModeChoice) -> dict[str, str]:
    """Block name -> what its basis is stored under; see `merged_bases`."""
    operator, static, wet = _acting_on(part, acting)
    return part_keys(part, scene, operator, static, choice, wet)


def _acting_on(part: Part, acting: Acting) -> tuple[csr_matrix, Floats, WetMass | None]:
    """The part's gap operator, its static forces, and the added mass of its water."""
    water, wet = acting.water, None
    if water is not None and set(water.coupling) & set(part.blocks):
        wet = WetMass(part_operator(part, water.coupling), water.flexibility)
    return part_operator(part, acting.operators), gather(part, acting.forces), wet


def _merged_part(
    part: Part, scene: Scene, on: tuple[csr_matrix, Floats, WetMass | None], carried: Floats
) -> _MergedPart:
    operator, static, wet = on
    fixed = part.fixed(scene.fixed)
    free = ~fixed.ravel()
    K, M, inertia = part_matrices(part, scene.blocks)
    K, M = csr_matrix(K[free][:, free]), csr_matrix(M[free][:, free])
    shaken = [name for name in part.blocks if name not in scene.radiating]
    heavy = [name for name in part.blocks if name not in scene.excluded_from_gravity]
    loads = [
        _sum(part, inertia, shaken),
        static[:, None],
        _sum(part, inertia, heavy)[:, : 3 if 0 < len(heavy) < len(part.blocks) else 0],
        boundary_tractions(part, scene),
        free_field_forces(part, scene),
        carried,
    ]
    mesh, held = part.mesh(scene.blocks), part.stands_free(scene)
    motions = Motions(np.flatnonzero(free), rigid_motions(mesh, np.arange(part.nodes)).reshape(-1, 6)[free])
    rigid = np.zeros((K.shape[0], 0)) if held or not M.diagonal().any() else rigid_modes(K, M, motions.rigid)
    right = _unit_columns([operator[:, free].T, *(load[free] for load in loads)])
    dofs = np.concatenate([(3 * part.number[name][:, None] + np.arange(3)).ravel() for name in part.blocks])
    row = np.full(3 * part.every_node, -1)
    row[np.flatnonzero(free)] = np.arange(K.shape[0])
    return _MergedPart(
        K=Symmetric(K),
        M=M,
        right=right[:, unbalanced(right, rigid, M)],
        held=held,
        motions=motions,
        rigid=rigid,
        row=row[dofs],
        slaves=_slaves(part, dofs, free),
        inertia=inertia,
        wet=None if wet is None else WetMass(wet.operator[:, free], wet.flexibility),
        place=f"part {part.name}",
    )


def _slaves(part: Part, dofs: Ints, free: Bools) -> tuple[Ints, csr_matrix] | None:
    """Which of the blocks' DOFs, of so many numbers in the part, follow free ones, and how."""
    if part.slaves is None:
        return None
    which = np.flatnonzero(dofs >= 3 * part.nodes)
    return which, part.slaves[dofs[which] - 3 * part.nodes][:, free]


def _sum(part: Part, inertia: dict[str, Floats], blocks: list[str]) -> Floats:
    """M r of some of the blocks, (3 nodes, 3)."""
    some = {name: values if name in blocks else np.zeros_like(values) for name, values in inertia.items()}
    return gather(part, some)


def _reduced(
    merged: _MergedPart, scene: Scene, choice: ModeChoice, store: BlockStore, keys: list[dict[str, str]]
) -> list[dict[str, BlockBasis]]:
    """Reduce a part in free-interface form, its bases in the store from the first column on.

    Raises
    ------
    ReductionError
        where a factorisation or an eigenproblem fails.
    """
    key = fingerprint(keys[-1])
    size, path = merged.K.shape[0], store.scratch(key)
    every = choice.keeps_all or (choice.count is not None and choice.count >= size)
    if every and (merged.M.diagonal() > 0.0).all():
        omega2, Phi = dense_modes(merged.K.whole(), merged.M)
        whole = OutOfCoreMatrix(path, key, (len(merged.row), size))
        whole.fill(size, lambda first, last: _over_blocks(merged, Phi[:, first:last]))
        complete = _Level(whole, size, without_roundoff(omega2), np.eye(size))
        levels = [complete._replace(residual=_residual(merged, complete))] * len(keys)
    else:
        choice, beyond = replace(choice, count=size if every else choice.count), BEYOND if keys[1:] else 1.0
        whole, counts = _ritz_vectors(merged, choice, beyond, path, key)
        static = whole.shape[1] - counts[-1]
        some = [whole.narrowed(static + count) for count in counts[: len(keys)]]
        pencil = Pencil(merged.K, merged.M, merged.shift, merged.first)
        numbered = zip(some, counts, strict=False)
        levels = whole.each(partial(_level, merged, pencil, *one, counts[0]) for one in numbered)
    # the finer basis has the same modes
    reports = [_report(merged, level, levels[0].residual) | choice.report() for level in levels]
    to = [(store, own, report) for own, report in zip(keys, reports, strict=True)]
    kept = whole.each(partial(_stored, merged, scene, *one) for one in zip(levels, to, strict=True))
    whole.remove()
    return kept


class _Level(NamedTuple):
    """Ritz vectors T, of which the last `modes` span modes; omega^2 and V of the basis T V, `_residual`."""

    T: OutOfCoreMatrix
    modes: int
    omega2: Floats
    V: Floats
    residual: float = 0.0


def _level(merged: _MergedPart, pencil: Pencil, T: OutOfCoreMatrix, modes: int, low: int) -> _Level:
    """The basis of Ritz vectors of which the last `modes` span modes, the first `low` of these themselves."""
    made = _Level(T, modes, *diagonalised(T, modes, pencil, _work(merged, T), modes - low))
    return made if modes > low else made._replace(residual=_residual(merged, made))


def _stored(
    merged: _MergedPart,
    scene: Scene,
    level: _Level,
    to: tuple[BlockStore, dict[str, str], dict[str, object]],
) -> dict[str, BlockBasis]:
    """Keep the blocks' rows of a basis under their keys."""
    (T, modes, omega2, V, _), (store, keys, report) = level, to
    log.info("%s: %d modes, %d attachment modes", merged.place, modes, len(omega2) - modes)
    kept, first = {}, 0
    for name, key in keys.items():
        last = first + 3 * len(scene.blocks[name].points)
        ends = [*range(first, last, 3 * _NODES), last]
        rows, block = T.times(V, ends), scene.blocks[name]
        kept[name] = store.write_streamed(key, block, omega2, rows, merged.inertia[name], report)
        first = last
    return kept


def _ritz_vectors(
    merged: _MergedPart, choice: ModeChoice, beyond: float, path: Path, key: str
) -> tuple[OutOfCoreMatrix, tuple[int, int]]:
    """Static answers and, after them, vectors that span the modes, and some beyond; how many.

    The solver goes with the end.
    """
    right = merged.right
    shifted = Symmetric(merged.K.upper - merged.shift * merged.M) if merged.shift else merged.K
    columns = right.shape[1] + choice.columns
    solver = make_solver(shifted, merged.motions, columns, choice.solving, merged.place, merged.inner)
    T = OutOfCoreMatrix(path, key, (len(merged.row), right.shape[1]))
    width = solver.width if isinstance(solver, CondensedSingle | Multifrontal) else WIDTH
    T.fill(
        T.shape[1], lambda a, b: _over_blocks(merged, _static(merged, solver, right[:, a:b].toarray())), width
    )
    log.info("%s: %d static answers; the modes are to come", merged.place, T.shape[1])
    K = merged.K if merged.K.shape[0] > SMALL else merged.K.whole()
    which, static = (choice.count, choice.cutoff), T.shape[1]
    counts, make = span_of_modes(K, merged.M, which, solver, merged.shift, beyond)
    T.widen(counts[1])
    for count in counts:
        T.fill(static + count, lambda a, b: _over_blocks(merged, make(a - static, b - static)), width)
    if beyond > 1.0 and merged.wet is not None:
        D = _water_answers(merged, solver, T, static)
        last = T.shape[1]
        T.widen(D.shape[1])
        T.fill(T.shape[1], lambda a, b: _over_blocks(merged, D[:, a - last : b - last]))
    return T, (counts[0], T.shape[1] - static)


def _water_answers(merged: _MergedPart, solver: Solver, T: OutOfCoreMatrix, static: int) -> Floats:
    """Static answers (n, k) to the water's inertia in the lowest modes, as far as T's modes lack them."""
    assert merged.wet is not None
    low = T.combined(np.eye(T.shape[1])[:, static : static + FINER_VECTORS])[merged.first]
    answers = _static(merged, solver, merged.wet.inertia(low))
    return beside(T, static, answers, Pencil(merged.K, merged.M, merged.shift, merged.first))


def _static(merged: _MergedPart, solver: Solver, force: Floats) -> Floats:
    """Answers to static forces, of what floats to what its rigid acceleration leaves of them."""
    rigid = merged.rigid
    if not rigid.shape[1]:
        return solver.solve(force)
    inertia = merged.M @ rigid
    answer = solver.solve(force - inertia @ (rigid.T @ force))
    return np.asarray(answer - rigid @ (inertia.T @ answer))


def _work(merged: _MergedPart, T: OutOfCoreMatrix) -> Floats:
    """Work of the loads that A answers on [A, Phi], (a, m)."""
    rows, rigid = merged.first, merged.rigid
    over = T.before(_spread(merged.right, rows, T.shape[0]))
    if rigid.shape[1]:
        inertia = _spread(csc_matrix(merged.M @ rigid), rows, T.shape[0])
        over -= (merged.right.T @ rigid) @ T.before(inertia)
    return over


def _over_blocks(merged: _MergedPart, values: Floats) -> Floats:
    """Values of the free DOFs over those of every block, zero where held."""
    found = np.take(values, merged.row, axis=0, mode="wrap")  # quicker than values[row]
    found[merged.row < 0] = 0.0
    if merged.slaves is not None:
        which, follow = merged.slaves
        found[which] = follow @ values
    return found


def _spread(right: csc_matrix, rows: Ints, size: int) -> csr_matrix:
    """R^T over the DOFs of every block, each free DOF counted once."""
    across = csr_matrix(right.T)
    return csr_matrix((across.data, rows[across.indices], across.indptr), shape=(right.shape[1], size))


def _residual(merged: _MergedPart, level: _Level) -> float:
    """Largest relative eigenvalue residual of the modes."""
    together = max(_TOGETHER, int(_READ / (8 * len(merged.row))))
    found = 0.0
    for first in range(0, level.modes, together):
        some = slice(first, min(first + together, level.modes))
        Phi = level.T.combined(level.V[:, some])[merged.first]
        found = max(found, eigen_residual(merged.K, merged.M @ Phi, level.omega2[some], Phi))
    return found


def _report(merged: _MergedPart, level: _Level, residual: float) -> dict[str, object]:
    """The numbers on the reduction, as plain values."""
    low = level.omega2[: level.modes]
    sub = Substructure(
        omega2=level.omega2,
        basis=np.zeros((0, 0)),
        more=np.zeros((0, 0)),
        mix=np.zeros((0, 0)),
        retained=len(level.omega2) - level.modes,
        fixed_interface=level.modes,
        highest=float(np.sqrt(max(low[-1], 0.0)) / (2.0 * np.pi)) if level.modes else 0.0,
        orthonormality=0.0,
        residual=residual,
    )
    return sub.report() | {"part": merged.place.removeprefix("part ")}


def _unit_columns(loads: list[csr_matrix | Floats]) -> csc_matrix:
    """The loads that are not zero, each of unit length."""
    right = csc_matrix(hstack([csc_matrix(load) for load in loads]))
    length = np.sqrt(np.asarray(right.multiply(right).sum(axis=0)).ravel())
    some = np.flatnonzero(length > 0.0)
    return csc_matrix(right[:, some] @ diags_array(1.0 / length[some]))
