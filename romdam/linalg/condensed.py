"""Solve with a matrix of which most rows carry neither mass nor load: those are condensed onto their contact.

The rock below a dam is without mass and nothing acts inside it, so that all it does is to hold the dam by the
stiffness that is left of it where they meet,

    S = K_cc - K_ci K_ii^-1 K_ic,

dense and of a few thousand unknowns. Its factors in single precision give S to five or six digits, and with
it the rest (the dam) has factors in double that take seconds. Together they are the approximate inverse of
conjugate gradients on the whole: a force on the dam needs the rock's backward substitution alone in the first
iteration and all of it in the second, three halves where factors of the whole take four. Modes are looked for
on the dam, where a solution costs a hundredth. They need S to more digits, and only on themselves: it is
measured there (`CondensedSingle.sharpened`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular, svd
from scipy.sparse import coo_matrix, csr_matrix

from romdam.linalg.conjugate import WIDTH, conjugate_gradients
from romdam.linalg.pardiso import SINGLE_TOLERANCE, PardisoFactor, PardisoSchur

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

_MOST_CONTACT = 10_000  # unknowns of the dense matrix: 0.8 GB
_SEEN = 1e-3  # share of the strongest direction, below which a direction of the traces is left as it is


def is_condensable(matrix: csr_matrix, inner: Bools) -> bool:
    """Whether the inner rows are most, and meet the others in few enough."""
    return bool(2 * inner.sum() > len(inner)) and 0 < int(_contact(matrix, inner).sum()) <= _MOST_CONTACT


def _contact(matrix: csr_matrix, inner: Bools) -> Bools:
    """The other rows that are coupled with inner ones; the matrix is symmetric."""
    pattern = csr_matrix((np.ones(matrix.nnz, dtype=bool), matrix.indices, matrix.indptr), matrix.shape)
    return np.asarray(pattern @ inner, dtype=bool) & ~inner


class CondensedSingle:
    """Factors in single precision of the inner rows, in double of the others, under conjugate gradients.

    Parameters
    ----------
    matrix : (n, n) sparse, symmetric positive definite; kept, not copied
    inner : (n,) the rows to condense; any force there costs a third more
    memory : bytes that the factorisation may take, or None

    Attributes
    ----------
    outer : numbers of the other rows
    near : factors of the matrix condensed on those, to five digits or so

    Raises
    ------
    ReductionError
        as `PardisoSingle`.
    """

    def __init__(self, matrix: csr_matrix, inner: Bools, memory: float | None = None) -> None:
        self.size = matrix.shape[0]
        self.outer = np.flatnonzero(~inner)
        self._matrix = matrix
        contact = _contact(matrix, inner)
        self._contact = np.flatnonzero(contact)
        self._some = np.flatnonzero(inner | contact)
        self._apart = np.flatnonzero(contact[self._some])  # among some
        self._at = np.flatnonzero(contact[self.outer])  # among the outer
        self._inner = PardisoSchur(matrix, self._some, contact[self._some], memory)
        self.memory = self._inner.memory
        self.near = PardisoFactor(self._condensed(self._inner.schur))

    def _condensed(self, S: Floats) -> csr_matrix:
        """The upper triangle of the matrix over the outer rows, with S where they meet the inner ones."""
        own = csr_matrix(self._matrix[self.outer][:, self.outer]).tocoo()
        place = np.full(own.shape[0], -1, dtype=np.int32)
        place[self._at] = np.arange(len(self._at))
        keep = (own.row <= own.col) & ((place[own.row] < 0) | (place[own.col] < 0))
        row, column = np.triu_indices(len(S))
        parts = [(own.data, own.row, own.col, keep)]
        data = np.concatenate([a[k] for a, _, _, k in parts] + [S[row, column]])
        rows = np.concatenate([own.row[keep], self._at[row]])
        columns = np.concatenate([own.col[keep], self._at[column]])
        return csr_matrix(coo_matrix((data, (rows, columns)), shape=own.shape))

    def solve(self, right: Floats) -> Floats:
        """Solve for one (n,) or several (n, k) right-hand sides.

        Raises
        ------
        ReductionError
            where the residual does not fall to 1e-7 of the right-hand side.
        """
        columns = np.asarray(right, dtype=float).reshape(self.size, -1)
        found = np.empty_like(columns, order="C")
        for first in range(0, columns.shape[1], WIDTH):
            some = slice(first, first + WIDTH)
            found[:, some] = conjugate_gradients(
                self._matrix, columns[:, some], self.precondition, "pardiso_single", SINGLE_TOLERANCE
            )
        return found.reshape(np.shape(right))

    def precondition(self, right: Floats) -> Floats:
        """The factors' own answer, of five digits or so, for (n, k)."""
        outer = right[self.outer]
        carried = np.take(right, self._some, axis=0)  # a tenth of the time of right[some]
        carried[self._apart] = 0.0
        if carried.any():
            carried = self._inner.forward(carried)
            outer[self._at] += carried[self._apart]
        outer = self.near.solve(outer)
        carried[self._apart] = outer[self._at]
        found = np.empty_like(right, order="C")
        found[self._some] = self._inner.backward(carried)
        found[self.outer] = outer
        return found

    def sharpened(self, vectors: Floats) -> PardisoFactor:
        """Factors of the condensed matrix, S as good as in double on some vectors over the outer rows.

        The inner answer Y to the traces U leaves forces r_i, of 1e-4 or so; what those do at the contact,
        -K_ci K_ii^-1 r_i, is known to 1e-4 of itself, so that S U is known to 1e-8 or better. The smallest
        symmetric change (in the norm of S) gives S these values.

        Parameters
        ----------
        vectors : (m, k) over the outer rows

        References
        ----------
        Dennis, Schnabel, SIAM Review 21 (1979) 443 (least-change symmetric secant updates).
        """
        S = self._inner.schur
        U = vectors[self._at]
        change = np.empty_like(U)
        for first in range(0, U.shape[1], WIDTH):
            some = slice(first, first + WIDTH)
            change[:, some] = self._forces(U[:, some]) - S @ U[:, some]
        L = cholesky(S, lower=True)
        size = np.sqrt((U * (S @ U)).sum(axis=0))
        Q, strength, V = svd(L.T @ (U / size), full_matrices=False)
        keep = strength > _SEEN * strength[0]
        Z = solve_triangular(L, change / size, lower=True) @ (V[keep].T / strength[keep])
        Q = Q[:, keep]
        Q, Z = L @ Q, L @ Z  # back from the norm of S; Z Q^T + Q Z^T - Q (Q^T Z) Q^T with Q^T S^-1 Q = 1
        inner = solve_triangular(L, Q, lower=True).T @ solve_triangular(L, Z, lower=True)
        S = S + Z @ Q.T + Q @ Z.T - Q @ (0.5 * (inner + inner.T)) @ Q.T
        return PardisoFactor(self._condensed(0.5 * (S + S.T)))

    def _forces(self, U: Floats) -> Floats:
        """S U, to twice the digits of the factors."""
        carried = np.zeros((len(self._some), U.shape[1]))
        carried[self._apart] = U
        whole = np.zeros((self.size, U.shape[1]))
        whole[self._some] = self._inner.backward(carried)
        whole[self._contact] = U
        left = self._matrix @ whole
        carried = np.take(left, self._some, axis=0)
        carried[self._apart] = 0.0
        return np.asarray(left[self._contact] + self._inner.forward(carried)[self._apart])
