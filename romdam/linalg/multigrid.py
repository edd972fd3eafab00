"""Solve K x = f without a factorisation: conjugate gradients under algebraic multigrid, many columns at once.

Smoothed aggregation on 3 by 3 blocks, with the rigid motions as what the coarse spaces must hold (pyamg makes
the levels). Both the cycle and the iteration work on blocks of columns, so that the matrix is read once for
all of them: the smoother is Chebyshev's polynomial, which is made of products alone, since Gauss-Seidel takes
one vector at a time. Nodes stand in an order of small bandwidth, so that what a product reads is still in the
cache, and the cycle, which is only to be near, is in single precision (see `blocks.py`).

References
----------
Vanek, Mandel, Brezina, Computing 56 (1996) 179; Adams et al., J. Comput. Phys. 188 (2003) 593 (Chebyshev).
"""

from __future__ import annotations

from dataclasses import dataclass
from threading import Lock
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import pinvh
from scipy.sparse import bsr_matrix, csr_matrix, diags_array
from scipy.sparse.csgraph import reverse_cuthill_mckee

from romdam.core.arrays import Floats, Ints, Singles
from romdam.linalg.conjugate import WIDTH, conjugate_gradients

if TYPE_CHECKING:
    from romdam.linalg.blocks import Blocks


_STRENGTH = 0.08  # couplings weaker than that do not aggregate
_DEGREE = 2  # of the smoother
_RANGE = 10.0  # of the spectrum that it damps
_COARSEST = 150  # nodes of the level that is solved for directly
_POWER = 15  # iterations for the largest eigenvalue
_DRAWING = Lock()  # numpy's global generator is one for all threads


@dataclass(frozen=True)
class Motions:
    """Nodes and rigid motions of the rows of a matrix, which multigrid must know.

    Attributes
    ----------
    row : (n,) 3 * node + component, ascending; nodes may lack components
    rigid : (n, 6) rigid motions over the rows
    """

    row: Ints
    rigid: Floats

    def of(self, some: NDArray[np.bool_]) -> Motions:
        """Those of some of the rows."""
        return Motions(self.row[some], self.rigid[some])


@dataclass(frozen=True)
class _Level:
    """A matrix, the inverse of its diagonal, its largest eigenvalue relative to it, and the way down."""

    A: Blocks
    inverse: Singles
    largest: float
    P: Blocks
    R: Blocks

    @classmethod
    def of(cls, A: bsr_matrix, P: bsr_matrix) -> Self:
        """From a matrix and the prolongation to it from the next level."""
        from romdam.linalg.blocks import Blocks

        diagonal = A.diagonal()
        inverse = np.where(diagonal > 0.0, 1.0 / np.where(diagonal > 0.0, diagonal, 1.0), 0.0)[:, None]
        vector = np.random.default_rng(0).standard_normal((A.shape[0], 1))
        largest = 1.0
        for _ in range(_POWER):
            vector = inverse * (A @ vector)
            largest = float(np.linalg.norm(vector))
            vector /= largest
        A, P, R = (Blocks.of(matrix, np.float32) for matrix in (A, P, P.T))
        return cls(A, inverse.astype(np.float32), 1.1 * largest, P, R)

    def smooth(self, right: Singles, X: Singles | None) -> Singles:
        """Chebyshev's iteration on the upper part of the spectrum, from zero where X is None."""
        high, low = self.largest, self.largest / _RANGE
        centre, half = (high + low) / 2, (high - low) / 2  # Python's numbers: they leave the precision
        weight = half / centre
        change = (right if X is None else right - self.A @ X) * (self.inverse / centre)
        X = change.copy() if X is None else X + change
        for _ in range(_DEGREE - 1):
            after = 1.0 / (2.0 * centre / half - weight)
            change = after * weight * change + (right - self.A @ X) * (2.0 * after / half * self.inverse)
            X += change
            weight = after
        return X


class Multigrid:
    """Solve with a symmetric positive definite matrix of elasticity.

    Parameters
    ----------
    matrix : (n, n) sparse
    motions : of its rows
    """

    def __init__(self, matrix: csr_matrix, motions: Motions) -> None:
        from romdam.linalg.blocks import Blocks

        self.size = matrix.shape[0]
        _, node = np.unique(motions.row // 3, return_inverse=True)
        row = 3 * node + motions.row % 3
        self._whole = 3 * (int(node[-1]) + 1)
        whole = matrix
        if self._whole != self.size:  # over whole nodes: components that are not there stand alone
            start = np.zeros(self._whole + 1, dtype=matrix.indptr.dtype)
            start[row + 1] = np.diff(matrix.indptr)
            columns = row.astype(matrix.indices.dtype)[matrix.indices]
            moved = csr_matrix(
                (matrix.data, columns, np.cumsum(start, dtype=start.dtype)), shape=(self._whole, self._whole)
            )
            alone = np.ones(self._whole)
            alone[row] = 0.0
            whole = csr_matrix(moved + diags_array(alone * float(matrix.diagonal().mean())))
        blocks = whole.tobsr((3, 3))
        del whole
        rigid = np.zeros((self._whole, 6))
        rigid[row] = motions.rigid
        # nodes in an order of small bandwidth (Cuthill and McKee)
        ones, nodes = np.ones(len(blocks.indices), dtype=np.int8), self._whole // 3
        graph = csr_matrix((ones, blocks.indices, blocks.indptr), shape=(nodes, nodes))
        order = np.asarray(reverse_cuthill_mckee(graph, symmetric_mode=True), dtype=np.int64)
        self._row = 3 * np.argsort(order)[node] + motions.row % 3
        prolongations, matrices = _aggregated(blocks, rigid)
        matrices[0] = blocks = _ordered(blocks, order, order)
        prolongations[:1] = [_ordered(P, order, None) for P in prolongations[:1]]
        self._matrix = Blocks.of(blocks, np.float64)
        self._coarsest = np.asarray(pinvh(matrices.pop().toarray()), dtype=np.float32)
        self._levels = [_Level.of(A, P) for A, P in zip(matrices, prolongations, strict=True)]

    def solve(self, right: Floats) -> Floats:
        """Solve for one (n,) or several (n, k) right-hand sides.

        Raises
        ------
        ReductionError
            where the residual does not fall to 1e-10 of the right-hand side.
        """
        columns = np.asarray(right, dtype=float).reshape(self.size, -1)
        solution = np.empty_like(columns, order="C")
        for first in range(0, columns.shape[1], WIDTH):
            some = slice(first, first + WIDTH)
            answer = conjugate_gradients(self._matrix, self._on(columns[:, some]), self._inverse, "multigrid")
            solution[:, some] = self._off(answer)
        return solution.reshape(np.shape(right))

    def precondition(self, right: Floats) -> Floats:
        """One cycle from zero, as an approximate inverse, for (n, k)."""
        answer = np.empty_like(right, order="C")
        for first in range(0, right.shape[1], WIDTH):
            some = slice(first, first + WIDTH)
            answer[:, some] = self._off(self._inverse(self._on(right[:, some])))
        return answer

    def _on(self, right: Floats) -> Floats:
        """Over whole nodes, in the solver's order."""
        whole = np.zeros((self._whole, right.shape[1]))
        whole[self._row] = right
        return whole

    def _off(self, vectors: Floats) -> Floats:
        return np.asarray(np.take(vectors, self._row, axis=0))

    def _inverse(self, right: Floats) -> Floats:
        """A cycle for columns of length one, which single precision holds."""
        size = np.sqrt(np.einsum("ij,ij->j", right, right))
        size[size == 0.0] = 1.0
        return np.asarray(self._cycle((right / size).astype(np.float32)) * size)

    def _cycle(self, right: Singles, depth: int = 0) -> Singles:
        """One V-cycle from zero, symmetric."""
        if depth == len(self._levels):
            return np.asarray(self._coarsest @ right)
        level = self._levels[depth]
        X = level.smooth(right, None)
        X += level.P @ self._cycle(level.R @ (right - level.A @ X), depth + 1)
        return level.smooth(right, X)


def _ordered(matrix: bsr_matrix, rows: Ints, columns: Ints | None) -> bsr_matrix:
    """The matrix with its rows (and columns) of blocks in another order."""
    size = matrix.blocksize
    shape = (matrix.shape[0] // size[0], matrix.shape[1] // size[1])
    which = csr_matrix((np.arange(len(matrix.indices)), matrix.indices, matrix.indptr), shape=shape)[rows]
    which = which if columns is None else which[:, columns]
    return bsr_matrix((matrix.data[which.data], which.indices, which.indptr), shape=matrix.shape)


def _aggregated(matrix: bsr_matrix, rigid: Floats) -> tuple[list[bsr_matrix], list[bsr_matrix]]:
    """The prolongations from level to level, and the levels' matrices, the given one in front.

    Nodes are aggregated in their own order: in one of small bandwidth aggregates are smaller, and a column of
    a tet10 block of 26,264 unknowns takes 27 iterations instead of 19.
    """
    from pyamg import smoothed_aggregation_solver  # here, not above: few jobs need it

    # pyamg draws from numpy's global generator: the same each time, in one thread at a time
    with _DRAWING:
        state = np.random.get_state()  # noqa: NPY002
        np.random.seed(0)  # noqa: NPY002
        try:
            levels = smoothed_aggregation_solver(
                matrix,
                B=rigid,
                strength=("symmetric", {"theta": _STRENGTH}),
                improve_candidates=None,
                presmoother=None,
                postsmoother=None,
                max_coarse=_COARSEST,
            ).levels
        finally:
            np.random.set_state(state)  # noqa: NPY002
    return [level.P for level in levels[:-1]], [matrix, *(level.A for level in levels[1:])]
