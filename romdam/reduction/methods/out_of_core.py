"""Craig-Bampton reduction of a large block: the same basis as `reduce_block`, never whole in memory.

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

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Floats
from romdam.core.scene import Block, Bools
from romdam.fem.assembly import assemble
from romdam.linalg.eigen import modes_below
from romdam.linalg.multigrid import Motions
from romdam.linalg.solvers import Solver, make_solver
from romdam.reduction.interface import Interface
from romdam.reduction.methods.craig_bampton import (
    FREE_SHIFT,
    ModeChoice,
    Substructure,
    diagonalise,
    eigen_residual,
    independent,
    without_roundoff,
)
from romdam.reduction.storage.columns import Columns
from romdam.reduction.storage.model_file import BlockBasis, BlockStore
from romdam.scene.supports import rigid_motions

log = logging.getLogger(__name__)


LARGE = 200e6  # bytes of a basis from which on it goes through the disk
_NODES = 4096  # of the basis at a time


@dataclass(frozen=True)
class LargeBlock:
    """What is reduced: a block, its supports, the DOFs that joints retain.

    Attributes
    ----------
    fixed : (n, 3) components held by supports
    interface : retained DOFs and turned frames
    held : whether supports and retained DOFs, if held, stop every rigid motion
    """

    block: Block
    fixed: Bools
    interface: Interface
    held: bool


def is_large(interface: Interface, choice: ModeChoice) -> bool:
    """Whether a block's basis goes through the disk; all modes of a block need it in memory."""
    columns = int(interface.retained.sum()) + choice.columns // 4
    return 8.0 * len(interface.retained) * columns > LARGE and not choice.keeps_all


def reduce_large(given: LargeBlock, choice: ModeChoice, store: BlockStore, key: str) -> BlockBasis:
    """Reduce a block into its file of the store.

    Raises
    ------
    ReductionError
        where no solver does it.
    ResultError
        where the folder or the disk refuses the file.
    """
    place, shift = f"block {given.block.name!r}", 0.0 if given.held else -FREE_SHIFT
    ritz = _ritz_vectors(given, choice, (store.scratch(key), key), shift)
    T, boundary = ritz.T, int(ritz.outer.retained.sum())
    K_r, M_r = ritz.reduced or _reduced(T, ritz.outer, ritz.omega2 - shift)
    corrections = len(K_r) - boundary - len(ritz.omega2)
    low, V = diagonalise(K_r + shift * M_r, M_r, place)
    sub = Substructure(
        without_roundoff(low), np.zeros((0, 0)), boundary, len(ritz.omega2), *ritz.report, corrections
    )
    rows = _rows(given, T, V), ritz.outer.inertia
    basis = store.write_streamed(key, given.block, sub.omega2, rows, sub.report() | choice.report())
    T.remove()
    return basis


@dataclass(frozen=True)
class _Ritz:
    """Ritz vectors on disk, and what is needed afterwards; `reduced` is there where corrections needed it."""

    T: Columns
    outer: _Outer
    omega2: Floats
    report: tuple[float, float, float]
    reduced: tuple[Floats, Floats] | None = None


def _ritz_vectors(given: LargeBlock, choice: ModeChoice, file: tuple[Path, str], shift: float) -> _Ritz:
    """Constraint modes, fixed-interface modes and corrections; the solver goes when they are there."""
    place = f"block {given.block.name!r}"
    outer, interior = _split(given, shift)
    boundary = interior.coupling.shape[1]
    solver = make_solver(interior.K, interior.motions, boundary + choice.columns, choice.solving, place)
    T = Columns(*file, (len(outer.retained), boundary))
    T.fill(boundary, lambda first, last: _constraint_modes(outer.retained, interior, solver, first, last))
    log.info("%s: %d constraint modes; the modes are to come", place, boundary)
    omega2, Phi, report = _modes(interior, solver, choice, shift)
    T.widen(len(omega2))
    T.fill(T.shape[1], lambda first, last: _over(outer.retained, Phi[:, first - boundary : last - boundary]))
    if not choice.corrections:
        return _Ritz(T, outer, omega2, report)
    reduced = _reduced(T, outer, omega2 - shift)
    low, V = diagonalise(reduced[0] + shift * reduced[1], reduced[1], place)
    D = _corrections(T, (low[: choice.corrections] - shift, V), outer, interior, solver)
    return _Ritz(T, outer, omega2, report, _with_corrections(T, reduced, D, outer, interior))


def _reduced(T: Columns, outer: _Outer, lifted: Floats) -> tuple[Floats, Floats]:
    """T^T (K - s M) T and T^T M T of constraint and fixed-interface modes; `lifted` is omega^2 - s."""
    K_r, boundary = np.zeros((T.shape[1],) * 2), T.shape[1] - len(lifted)
    K_r[:boundary, :boundary] = T.before(outer.K_b)[:, :boundary]
    K_r[np.arange(boundary, len(K_r)), np.arange(boundary, len(K_r))] = lifted
    return K_r, T.gram(outer.M)


def _corrections(
    T: Columns, modes: tuple[Floats, Floats], outer: _Outer, interior: _Interior, solver: Solver
) -> Floats:
    """The interior's answer to what the lowest open-joint modes leave, M-orthogonal to T."""
    (lifted, V), inside = modes, ~outer.retained
    low = T.combined(V[:, : len(lifted)])
    left = interior.K @ low[inside] + interior.coupling @ low[outer.retained]
    left -= (outer.M @ (low * lifted))[inside]
    D = independent(_over(outer.retained, solver.solve(left)), outer.M)
    for _ in range(2):
        D = independent(D - T.combined(V @ (V.T @ T.before((outer.M @ D).T).T)), outer.M)
    return D


def _with_corrections(
    T: Columns, reduced: tuple[Floats, Floats], D: Floats, outer: _Outer, interior: _Interior
) -> tuple[Floats, Floats]:
    """Put the corrections beside T; the reduced matrices with them."""
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
    return found[0], found[1]


@dataclass
class _Outer:
    """Over the free DOFs in turned frames: which are retained, the rows of K - s M there, M; M r over all."""

    retained: Bools
    K_b: csr_matrix
    M: csr_matrix
    inertia: Floats


@dataclass
class _Interior:
    """Over the interior DOFs: K - s M, M, the columns of K - s M at the retained DOFs, rigid motions."""

    K: csr_matrix
    M: csr_matrix
    coupling: csr_matrix
    motions: Motions


def _split(given: LargeBlock, shift: float) -> tuple[_Outer, _Interior]:
    turn, free = given.interface.turn, ~given.fixed.ravel()
    stiffness, mass = assemble(given.block)
    inertia = mass @ np.tile(np.eye(3), (len(given.block.points), 1))
    mass = turned(mass, turn)[free][:, free]
    stiffness = turned(stiffness, turn)[free][:, free]
    if shift:
        stiffness = stiffness - shift * mass
    retained = given.interface.retained[free]
    K_b, K_i = csr_matrix(stiffness[retained]), stiffness[~retained]
    del stiffness
    rigid = (turn @ rigid_motions(given.block).reshape(-1, 6))[free]
    interior = _Interior(
        K=K_i[:, ~retained],
        M=mass[~retained][:, ~retained],
        coupling=csr_matrix(K_i[:, retained]),
        motions=Motions(np.flatnonzero(free), rigid).of(~retained),
    )
    return _Outer(retained, K_b, mass, inertia), interior


def _modes(
    interior: _Interior, solver: Solver, choice: ModeChoice, shift: float
) -> tuple[Floats, Floats, tuple[float, float, float]]:
    """Fixed-interface modes; highest frequency, orthonormality and residual of them."""
    K = interior.K + shift * interior.M if shift else interior.K
    omega2, Phi = modes_below(K, interior.M, choice.count, choice.cutoff, solver, shift)
    gram = Phi.T @ (interior.M @ Phi)
    highest = float(np.sqrt(max(omega2[-1], 0.0)) / (2.0 * np.pi)) if len(omega2) else 0.0
    off = float(np.abs(gram - np.eye(len(gram))).max(initial=0.0))
    return omega2, Phi, (highest, off, eigen_residual(K, interior.M, omega2, Phi))


def _constraint_modes(retained: Bools, interior: _Interior, solver: Solver, first: int, last: int) -> Floats:
    T = _over(retained, -solver.solve(interior.coupling[:, first:last].toarray()))
    T[np.flatnonzero(retained)[first:last], np.arange(last - first)] = 1.0
    return T


def _over(retained: Bools, inside: Floats) -> Floats:
    """Over the free DOFs, zero at retained ones."""
    T = np.zeros((len(retained), inside.shape[1]))
    T[~retained] = inside
    return T


def _rows(given: LargeBlock, T: Columns, V: Floats) -> Iterator[Floats]:
    """Open-joint modes over all DOFs in global axes, some nodes at a time: (3 nodes, m)."""
    free, turn = ~given.fixed.ravel(), given.interface.turn
    nodes = [*range(0, len(given.block.points), _NODES), len(given.block.points)]
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
