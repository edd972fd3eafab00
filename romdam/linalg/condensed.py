"""Solve with a matrix of which most rows carry neither mass nor load: those are condensed onto their contact.

The rock below a dam is without mass and nothing acts inside it, so that all it does is to hold the dam by the
stiffness that is left of it where they meet,

    S = K_cc - K_ci K_ii^-1 K_ic,

dense and of a few thousand unknowns. Its factors in single precision give S to five or six digits, and with
it the rest (the dam) has factors in double that take seconds. Together they answer to four digits, and what
they leave is refined in double: a force on the dam needs the rock's backward substitution alone the first
time and all of it the second, three halves where factors of the whole take four. Modes are looked for
on the dam, where a solution costs a hundredth. They need S to more digits, and only on themselves: it is
measured there (`CondensedSingle.sharpen`).
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import cholesky, solve_triangular, svd
from scipy.sparse import coo_matrix, csr_matrix

from romdam.core.arrays import Bools, Floats, Singles
from romdam.linalg.conjugate import WIDTH, conjugate_gradients
from romdam.linalg.pardiso import SINGLE_TOLERANCE, PardisoFactor, PardisoSchur, Upper
from romdam.linalg.symmetric import Symmetric, upper

_MOST = 6  # refinements; two are usual
_WIDE = 600_000  # unknowns from which on half as many columns are solved for at a time
_ROWS = 65_536
_MOST_CONTACT = 10_000  # unknowns of the dense matrix: 0.8 GB
_SEEN = 1e-3  # share of the strongest direction, below which a direction of the traces is left as it is


def is_condensable(matrix: csr_matrix | Symmetric, inner: Bools) -> bool:
    """True where the inner rows are most, and meet the others in few enough."""
    return bool(2 * inner.sum() > len(inner)) and 0 < int(_contact(matrix, inner).sum()) <= _MOST_CONTACT


def _contact(matrix: csr_matrix | Symmetric, inner: Bools) -> Bools:
    """The other rows that are coupled with inner ones; the matrix is symmetric."""
    given = upper(matrix)
    pattern = csr_matrix((np.ones(given.nnz, dtype=bool), given.indices, given.indptr), given.shape)
    return np.asarray(pattern @ inner | pattern.T @ inner, dtype=bool) & ~inner


class CondensedSingle:
    """Factors in single precision of the inner rows, in double of the others; answers refined in double.

    Parameters
    ----------
    matrix : (n, n) sparse or symmetric, positive definite; kept, not copied
    inner : (n,) the rows to condense; any force there costs a third more
    memory : bytes that the factorisation may take, or None

    Attributes
    ----------
    outer : numbers of the other rows
    width : columns it solves for at a time; what they take is 0.6 GB at a million unknowns and 16, and with 8
        a column takes a fifth longer
    near : factors of the matrix condensed on those, to five digits or so

    Raises
    ------
    ReductionError
        as `PardisoSingle`.
    """

    def __init__(self, matrix: csr_matrix | Symmetric, inner: Bools, memory: float | None = None) -> None:
        self.size = matrix.shape[0]
        self.width = WIDTH if self.size < _WIDE else WIDTH // 2
        self.outer = np.flatnonzero(~inner)
        self._matrix = matrix
        contact = _contact(matrix, inner)
        self._contact = np.flatnonzero(contact)
        self._some = np.flatnonzero(inner | contact)
        self._apart = np.flatnonzero(contact[self._some])  # among some
        self._at = np.flatnonzero(contact[self.outer])  # among the outer
        self._inner = PardisoSchur(upper(matrix), self._some, contact[self._some], memory)
        self.memory = self._inner.memory
        self.near = PardisoFactor(self._condensed(self._inner.schur))

    def _condensed(self, S: Floats | Singles) -> Upper:
        """The upper triangle of the matrix over the outer rows, with S where they meet the inner ones."""
        own = csr_matrix(upper(self._matrix)[self.outer][:, self.outer]).tocoo()
        place = np.full(own.shape[0], -1, dtype=np.int32)
        place[self._at] = np.arange(len(self._at))
        keep = (own.row <= own.col) & ((place[own.row] < 0) | (place[own.col] < 0))
        at, count = self._at.astype(np.int32), np.arange(len(S), 0, -1)
        data = np.concatenate([own.data[keep], *(row[k:] for k, row in enumerate(S))])
        rows = np.concatenate([own.row[keep], np.repeat(at, count)])
        columns = np.concatenate([own.col[keep], *(at[k:] for k in range(len(at)))])
        return Upper.of(
            csr_matrix(coo_matrix((data, (rows, columns)), shape=own.shape)), np.dtype(np.float64)
        )

    def solve(self, right: Floats) -> Floats:
        """Solve for one (n,) or several (n, k) right-hand sides.

        Raises
        ------
        ReductionError
            where the residual does not fall to 1e-7 of the right-hand side.
        """
        columns = np.asarray(right, dtype=float).reshape(self.size, -1)
        some = [slice(k, k + self.width) for k in range(0, columns.shape[1], self.width)]
        found = [self._refined(columns[:, s]) for s in some]
        whole = found[0] if len(found) == 1 else np.hstack([columns[:, :0], *found])
        return whole.reshape(np.shape(right))

    def _refined(self, right: Floats) -> Floats:
        """Iterative refinement: three blocks of columns in double where conjugate gradients hold six.

        Where it does not do (with factors of two digits or fewer) those do it after all.
        """
        limit = SINGLE_TOLERANCE * np.sqrt(_squares(right))
        found, left = np.zeros(right.shape), right
        for _ in range(_MOST):
            outer, carried, size = self._parts(left)
            del left  # before the product makes another
            self._answer(outer, carried, size, found)
            left = self._matrix @ found
            np.subtract(right, left, out=left)
            open_ = np.sqrt(_squares(left)) > limit
            if not open_.any():
                return found
        some = right[:, open_]
        found[:, open_] = conjugate_gradients(
            self._matrix, some, self.precondition, "pardiso_single", SINGLE_TOLERANCE
        )
        return found

    def precondition(self, right: Floats) -> Floats:
        """The factors' own answer, of five digits or so, for (n, k)."""
        found = np.zeros(right.shape)
        self._answer(*self._parts(right), found)
        return found

    def _parts(self, right: Floats) -> tuple[Floats, Singles, Floats]:
        """Outer and inner rows divided by the columns' sizes, and those."""
        size = _lengths(right)
        return right[self.outer] / size, self._onto_inner(right, size), size

    def _answer(self, outer: Floats, carried: Singles, size: Floats, found: Floats) -> None:
        """Add the factors' answer to `found` (n, k), from what `_parts` makes of the right-hand side."""
        if carried.any():
            carried = self._inner.forward(carried)
            outer[self._at] += carried[self._apart]
        outer = self.near.solve(outer)
        carried[self._apart] = outer[self._at]
        carried = self._inner.backward(carried)
        carried[self._apart] = 0.0
        self._add(carried, size, found)
        found[self.outer] += outer * size

    def _onto_inner(self, right: Floats, size: Floats) -> Singles:
        """The inner rows divided by the columns' sizes, zero at the contact."""
        carried = np.empty((len(self._some), right.shape[1]), dtype=np.float32, order="F")
        for first in range(0, len(carried), _ROWS):
            rows = slice(first, first + _ROWS)
            carried[rows] = np.take(right, self._some[rows], axis=0) / size  # a tenth of right[rows]'s time
        carried[self._apart] = 0.0
        return carried

    def _add(self, inner: Singles, size: Floats, found: Floats) -> None:
        """Add inner rows times the columns' sizes to (n, k)."""
        for first in range(0, len(inner), _ROWS):
            rows = self._some[first : first + _ROWS]
            found[rows] = np.take(found, rows, axis=0) + inner[first : first + _ROWS] * size

    def sharpen(self, vectors: Floats) -> None:
        """Make S as good as in double on some vectors over the outer rows, and `near` with it.

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
        S = self._inner.schur.astype(float)
        U = vectors[self._at]
        change = np.empty_like(U)
        for first in range(0, U.shape[1], self.width):
            some = slice(first, first + self.width)
            change[:, some] = self._forces(U[:, some]) - S @ U[:, some]
        size = np.sqrt((U * (S @ U)).sum(axis=0))
        L = cholesky(S, lower=True)
        Q, strength, V = svd(L.T @ (U / size), full_matrices=False)
        keep = strength > _SEEN * strength[0]
        Q = Q[:, keep]
        Z = solve_triangular(L, change / size, lower=True) @ (V[keep].T / strength[keep])
        inner = Q.T @ Z
        Z = L @ (Z - 0.25 * Q @ (inner + inner.T))
        Q = L @ Q  # back from the norm of S
        del L
        S += Z @ Q.T
        S += Q @ Z.T
        del self.near, Q, Z  # nothing that is done with, while new factors grow
        matrix = self._condensed(S)
        del S
        self.near = PardisoFactor(matrix)

    def _forces(self, U: Floats) -> Floats:
        """S U, to twice the digits of the factors."""
        carried = np.zeros((len(self._some), U.shape[1]), dtype=np.float32, order="F")
        size = _lengths(U)
        carried[self._apart] = U / size
        whole = np.zeros((self.size, U.shape[1]))
        self._add(self._inner.backward(carried), size, whole)
        whole[self._contact] = U
        left = self._matrix @ whole
        size = _lengths(left)
        moved = self._inner.forward(self._onto_inner(left, size))[self._apart]
        return np.asarray(left[self._contact] + moved * size)


def _squares(columns: Floats) -> Floats:
    return np.asarray(np.einsum("ij,ij->j", columns, columns))


def _lengths(columns: Floats) -> Floats:
    """Divisors of columns, so that single precision holds them: it ends at 1e-38 and 1e38."""
    size = np.sqrt(_squares(columns))
    size[size == 0.0] = 1.0
    return size
