"""Craig-Bampton reduction of a large block out of core: the basis of `reduce_block`, never whole in memory.

Constraint modes are solved for in blocks of right-hand sides that go to disk as they come; a run that is
stopped goes on there. With T = [Psi, Phi; 1, 0] the reduced stiffness needs no product with T,

    T^T (K - s M) T = diag(S, omega^2 - s),    S = (K - s M)_bb + (K - s M)_bi Psi,

and M_r = T^T M T takes two blocks of columns at a time. The open-joint modes T V go straight to the block's
file, of which a reader maps the rows that it touches.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Floats
from romdam.core.basis import BlockBasis
from romdam.core.scene import Block, Bools
from romdam.effects.added_mass import WetMass
from romdam.fem.assembly import assemble, inertia
from romdam.linalg.dense import independent, without_roundoff
from romdam.linalg.multigrid import Motions
from romdam.linalg.solvers import Solver, make_solver
from romdam.reduction.interface import Interface
from romdam.reduction.methods.craig_bampton import (
    FREE_SHIFT,
    FixedInterfaceModes,
    ModeChoice,
    Substructure,
    diagonalise,
    fixed_interface_modes,
    over_interior,
)
from romdam.reduction.methods.residual_vectors import (
    FINER_VECTORS,
    ROUND_OFF,
    larger,
    lowest_with,
)
from romdam.reduction.storage.model_file import BlockStore
from romdam.reduction.storage.out_of_core_matrix import OutOfCoreMatrix
from romdam.scene.supports import rigid_motions

log = logging.getLogger(__name__)


LARGE = 200e6  # bytes of a basis from which on it goes through the disk
_NODES = 4096  # of the basis at a time


@dataclass(frozen=True)
class LargeBlock:
    """A block, its supports and the DOFs that joints retain.

    Attributes
    ----------
    fixed : (n, 3) components held by supports
    loads : (3 n, l) forces but those of inertia that the basis is to answer statically right
    interface : retained DOFs and turned frames
    held : whether supports and retained DOFs, if held, stop every rigid motion
    wet : added mass of water, which its finer basis knows of; None without any
    """

    block: Block
    fixed: Bools
    loads: Floats
    interface: Interface
    held: bool
    wet: WetMass | None = None

    @property
    def place(self) -> str:
        """Its name in messages."""
        return f"block {self.block.name!r}"

    @property
    def shift(self) -> float:
        """K_ii less it times M_ii is positive definite."""
        return 0.0 if self.held else -FREE_SHIFT


def is_large(interface: Interface, choice: ModeChoice) -> bool:
    """True where a block's basis goes through the disk; all modes of a block need it in memory."""
    columns = int(interface.retained.sum()) + choice.columns // 4
    return 8.0 * len(interface.retained) * columns > LARGE and not choice.keeps_all


def reduce_large(
    large: LargeBlock, choice: ModeChoice, store: BlockStore, keys: list[str]
) -> list[BlockBasis]:
    """Reduce a block into its file of the store, and where there is a second key with a finer basis too.

    Raises
    ------
    ReductionError
        where no solver does it.
    ResultError
        where the folder or the disk refuses the file.
    """
    ritz, bases = _ritz_vectors(large, choice, store.scratch(keys[0]), keys), []
    modes, boundary = ritz.modes, int(ritz.outer.retained.sum())
    for key, reduced in zip(keys, ritz.reduced, strict=True):
        low, V = reduced.diagonalised(large)
        sub = Substructure(
            omega2=without_roundoff(low),
            basis=np.zeros((0, 0)),
            more=np.zeros((0, 0)),
            mix=np.zeros((0, 0)),
            retained=boundary,
            fixed_interface=modes.modes,
            static=len(modes.omega2) - modes.modes,
            highest=modes.highest,
            orthonormality=modes.orthonormality,
            residual=modes.residual,
            residual_vectors=len(V) - boundary - len(modes.omega2),
        )
        rows, report = _rows(large, ritz.T.narrowed(len(V)), V), sub.report() | choice.report()
        bases.append(store.write_streamed(key, large.block, sub.omega2, rows, ritz.outer.inertia, report))
    ritz.T.remove()
    return bases


@dataclass(frozen=True)
class _Ritz:
    """Ritz vectors T on disk, and what is needed afterwards; `reduced` for each basis, of the first of T."""

    T: OutOfCoreMatrix
    outer: _Outer
    modes: FixedInterfaceModes
    reduced: list[_Reduced]


class _Reduced(NamedTuple):
    """T^T (K - s M) T and T^T M T."""

    K: Floats
    M: Floats

    def diagonalised(self, large: LargeBlock) -> tuple[Floats, Floats]:
        """omega^2, and the modes in terms of T."""
        return diagonalise(self.K + large.shift * self.M, self.M, large.place)


def _ritz_vectors(large: LargeBlock, choice: ModeChoice, path: Path, keys: list[str]) -> _Ritz:
    """Constraint modes, fixed-interface modes and residual vectors; the solver goes when they are there."""
    place, shift = large.place, large.shift
    outer, interior = _split(large, shift)
    boundary = interior.coupling.shape[1]
    columns = boundary + choice.columns + interior.loads.shape[1]
    solver = make_solver(interior.K, interior.motions, columns, choice.solving, place)
    T = OutOfCoreMatrix(path, keys[-1], (len(outer.retained), boundary))
    T.fill(boundary, lambda first, last: _constraint_modes(outer.retained, interior, solver, first, last))
    log.info("%s: %d constraint modes; the modes are to come", place, boundary)
    K = interior.K + shift * interior.M if shift else interior.K
    modes = fixed_interface_modes(K, interior.M, interior.loads, choice, solver, shift)
    T.widen(len(modes.omega2))
    T.fill(T.shape[1], lambda a, b: over_interior(outer.retained, modes.Phi[:, a - boundary : b - boundary]))
    reduced, bases = _reduced(T, outer, modes.omega2 - shift), []
    vectors = (choice.residual_vectors, 0.0, None), (FINER_VECTORS, ROUND_OFF, outer.wet)
    for (count, least, wet), _ in zip(vectors, keys, strict=False):
        if count:
            low, V = reduced.diagonalised(large)
            added = None if wet is None else wet.of(T.before(wet.operator) @ V)
            lowest, some = lowest_with(added, low, V, count)
            unbalanced = _unbalanced(T, lowest - shift, some, outer, interior)
            if wet is not None:
                unbalanced -= wet.inertia(T.combined(some) * lowest)[~outer.retained]
            D = over_interior(outer.retained, solver.solve(unbalanced))
            D = independent(larger(_apart(T, V, D, outer.M), outer.M, lowest, least), outer.M)
            D = independent(_apart(T, V, D, outer.M), outer.M)
            reduced = _with_residual_vectors(T, reduced, D, outer, interior)
        bases.append(reduced)
    return _Ritz(T, outer, modes, bases)


def _reduced(T: OutOfCoreMatrix, outer: _Outer, lifted: Floats) -> _Reduced:
    """Reduced matrices of constraint and fixed-interface modes; `lifted` is omega^2 - s."""
    K_r, boundary = np.zeros((T.shape[1],) * 2), T.shape[1] - len(lifted)
    K_r[:boundary, :boundary] = T.before(outer.K_b)[:, :boundary]
    K_r[np.arange(boundary, len(K_r)), np.arange(boundary, len(K_r))] = lifted
    return _Reduced(K_r, T.gram(outer.M))


def _unbalanced(T: OutOfCoreMatrix, lifted: Floats, V: Floats, outer: _Outer, interior: _Interior) -> Floats:
    """Force on the interior that the lowest open-joint modes leave; `lifted` is their omega^2 - s."""
    low, inside = T.combined(V[:, : len(lifted)]), ~outer.retained
    left = interior.K @ low[inside] + interior.coupling @ low[outer.retained]
    left -= (outer.M @ (low * lifted))[inside]
    return left


def _apart(T: OutOfCoreMatrix, V: Floats, D: Floats, M: csr_matrix) -> Floats:
    """Part of vectors D that is M-orthogonal to T, whose modes are T V."""
    return np.asarray(D - T.combined(V @ (V.T @ T.before((M @ D).T).T)))


def _with_residual_vectors(
    T: OutOfCoreMatrix, reduced: _Reduced, D: Floats, outer: _Outer, interior: _Interior
) -> _Reduced:
    """Put residual vectors D beside T; the reduced matrices with them."""
    first, inside = T.shape[1], ~outer.retained
    KD = np.empty_like(D)
    KD[outer.retained] = outer.K_b @ D
    KD[inside] = interior.K @ D[inside] + interior.coupling @ D[outer.retained]
    T.widen(D.shape[1])
    T.fill(T.shape[1], lambda a, b: D[:, a - first : b - first])
    found = []
    for old, AD in zip(reduced, (KD, outer.M @ D), strict=True):
        whole = np.empty((T.shape[1],) * 2)
        whole[:first, :first] = old
        whole[first:] = T.before(AD.T)
        whole[:, first:] = whole[first:].T
        found.append(whole)
    return _Reduced(*found)


@dataclass
class _Outer:
    """Over the free DOFs in turned frames: which are retained, the rows of K - s M there, M, its water.

    `inertia` is M r over all DOFs.
    """

    retained: Bools
    K_b: csr_matrix
    M: csr_matrix
    inertia: Floats
    wet: WetMass | None


@dataclass
class _Interior:
    """Over the interior DOFs: K - s M, M, columns of K - s M at the retained DOFs, loads, rigid motions."""

    K: csr_matrix
    M: csr_matrix
    coupling: csr_matrix
    loads: Floats
    motions: Motions


def _split(large: LargeBlock, shift: float) -> tuple[_Outer, _Interior]:
    turn, free = large.interface.turn, ~large.fixed.ravel()
    stiffness, mass = assemble(large.block)
    carried = inertia(large.block, mass)
    mass = turned(mass, turn)[free][:, free]
    stiffness = turned(stiffness, turn)[free][:, free]
    if shift:
        stiffness = stiffness - shift * mass
    retained = large.interface.retained[free]
    K_b, K_i = csr_matrix(stiffness[retained]), stiffness[~retained]
    del stiffness
    rigid = (turn @ rigid_motions(large.block).reshape(-1, 6))[free]
    interior = _Interior(
        K=K_i[:, ~retained],
        M=mass[~retained][:, ~retained],
        coupling=csr_matrix(K_i[:, retained]),
        loads=(turn @ np.hstack([carried, large.loads]))[free][~retained],
        motions=Motions(np.flatnonzero(free), rigid).of(~retained),
    )
    wet = None if large.wet is None else large.wet.over(turn.T[:, free])
    return _Outer(retained, K_b, mass, carried, wet), interior


def _constraint_modes(retained: Bools, interior: _Interior, solver: Solver, first: int, last: int) -> Floats:
    T = over_interior(retained, -solver.solve(interior.coupling[:, first:last].toarray()))
    T[np.flatnonzero(retained)[first:last], np.arange(last - first)] = 1.0
    return T


def _rows(large: LargeBlock, T: OutOfCoreMatrix, V: Floats) -> Iterator[Floats]:
    """Open-joint modes over all DOFs in global axes, some nodes at a time: (3 nodes, m)."""
    free, turn = ~large.fixed.ravel(), large.interface.turn
    nodes = [*range(0, len(large.block.points), _NODES), len(large.block.points)]
    ends = np.concatenate([[0], np.cumsum(free)])
    some = T.times(V, [int(ends[3 * node]) for node in nodes])
    for (first, last), rows in zip(pairwise(nodes), some, strict=True):
        own = slice(3 * first, 3 * last)
        whole = np.zeros((3 * (last - first), V.shape[1]))
        whole[free[own]] = rows
        yield turn[own][:, own].T @ whole


def turned(matrix: csr_matrix, turn: csr_matrix) -> csr_matrix:
    """turn @ matrix @ turn^T; where nothing turns, the matrix itself and not two copies."""
    if turn.nnz == turn.shape[0] and (turn.diagonal() == 1.0).all():
        return matrix
    return csr_matrix(turn @ matrix @ turn.T)
