"""Solve with a matrix most of whose rows have neither mass nor load, by static condensation of these rows.

The rock below a dam is massless and unloaded. It affects the dam only by its stiffness at their interface,

    S = K_cc - K_ci K_ii^-1 K_ic,

a dense matrix of a few thousand unknowns, with the inner rows i (rock) and the interface rows c. K_ii is
factored in single precision, which gives S to five or six digits. The matrix over the outer rows (dam and
interface), with S at the interface, is factored in double precision. Both together are an approximate inverse
of four digits, and iterative refinement in double precision removes its error. A force on the outer rows
needs only the backward substitution of the inner factors in the first iteration, and both substitutions in
the second: three substitutions, where single-precision factors of the whole matrix need four.

Natural modes are computed on the outer rows, where a solution costs a hundredth. They need S to more digits,
but only in the space that they span at the interface; `CondensedSingle.sharpen` corrects S there.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import cholesky, solve_triangular, svd
from scipy.sparse import coo_matrix, csr_matrix

from romdam.core.arrays import Bools, Floats, Singles
from romdam.linalg.conjugate import WIDTH, conjugate_gradients, dots
from romdam.linalg.pardiso import SINGLE_TOLERANCE, PardisoFactor, PardisoSchur, Upper
from romdam.linalg.symmetric import Symmetric, upper

_MOST_REFINEMENTS = 6  # two are usual
_WIDE = (
    600_000  # unknowns from which on half as many columns are solved at a time: 16 of a million take 0.6 GB
)
_ROWS = 65_536  # rows that are copied at a time
_MOST_INTERFACE = 10_000  # unknowns of the dense S: 0.8 GB
_WEAK = 1e-3  # of the strongest direction of the traces: a weaker one is not corrected


def is_condensable(matrix: csr_matrix | Symmetric, inner: Bools) -> bool:
    """Tell whether the inner rows (n,) are the majority, and coupled with few enough other rows."""
    is_majority = bool(2 * inner.sum() > len(inner))
    return is_majority and 0 < int(_interface_rows(matrix, inner).sum()) <= _MOST_INTERFACE


def _interface_rows(matrix: csr_matrix | Symmetric, inner: Bools) -> Bools:
    """Find the rows (n,) that are not inner but coupled with inner ones; the matrix is symmetric."""
    triangle = upper(matrix)
    pattern = csr_matrix(
        (np.ones(triangle.nnz, dtype=bool), triangle.indices, triangle.indptr), triangle.shape
    )
    return np.asarray(pattern @ inner | pattern.T @ inner, dtype=bool) & ~inner


class CondensedSingle:
    """Single-precision factors of the inner rows, double-precision ones of the others; refined solutions.

    Parameters
    ----------
    matrix : (n, n) sparse or symmetric, positive definite; kept, not copied
    inner : (n,) the rows to condense; a force on these makes a solution a third more expensive
    memory : bytes that the factorisation may take, or None

    Attributes
    ----------
    outer : (m,) numbers of the other rows
    width : number of columns that are solved at a time
    near : factors of the condensed matrix (m, m) over the outer rows, to about five digits

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
        interface = _interface_rows(matrix, inner)
        self._interface = np.flatnonzero(interface)
        self._factored = np.flatnonzero(inner | interface)  # inner and interface rows
        self._interface_in_factored = np.flatnonzero(interface[self._factored])
        self._interface_in_outer = np.flatnonzero(interface[self.outer])
        self._inner = PardisoSchur(upper(matrix), self._factored, interface[self._factored], memory)
        self.memory = self._inner.memory
        self.near = PardisoFactor(self._condensed(self._inner.schur))

    def _condensed(self, S: Floats | Singles) -> Upper:
        """Assemble the upper triangle of the matrix over the outer rows, with S at the interface."""
        outer = csr_matrix(upper(self._matrix)[self.outer][:, self.outer]).tocoo()
        number = np.full(outer.shape[0], -1, dtype=np.int32)  # of an outer row in the interface
        number[self._interface_in_outer] = np.arange(len(self._interface_in_outer))
        keep = (outer.row <= outer.col) & ((number[outer.row] < 0) | (number[outer.col] < 0))
        at, count = self._interface_in_outer.astype(np.int32), np.arange(len(S), 0, -1)
        data = np.concatenate([outer.data[keep], *(row[k:] for k, row in enumerate(S))])
        rows = np.concatenate([outer.row[keep], np.repeat(at, count)])
        columns = np.concatenate([outer.col[keep], *(at[k:] for k in range(len(at)))])
        return Upper.of(
            csr_matrix(coo_matrix((data, (rows, columns)), shape=outer.shape)), np.dtype(np.float64)
        )

    def solve(self, right: Floats) -> Floats:
        """Solve for one (n,) or several (n, k) right-hand sides.

        Raises
        ------
        ReductionError
            if the residual does not fall to 1e-7 of the right-hand side.
        """
        columns = np.asarray(right, dtype=float).reshape(self.size, -1)
        slices = [slice(k, k + self.width) for k in range(0, columns.shape[1], self.width)]
        solutions = [self._refined(columns[:, s]) for s in slices]
        solution = solutions[0] if len(solutions) == 1 else np.hstack([columns[:, :0], *solutions])
        return solution.reshape(np.shape(right))

    def _refined(self, right: Floats) -> Floats:
        """Solve for (n, k) by iterative refinement.

        It holds three arrays (n, k) in double precision, conjugate gradients six. These follow if refinement
        does not converge (with factors of two digits or fewer).
        """
        limit = SINGLE_TOLERANCE * np.sqrt(dots(right, right))
        solution, residual = np.zeros(right.shape), right
        for _ in range(_MOST_REFINEMENTS):
            outer, inner, size = self._scaled_parts(residual)
            del residual  # before the product allocates another one
            self._add_solution(outer, inner, size, solution)
            residual = self._matrix @ solution
            np.subtract(right, residual, out=residual)
            open_ = np.sqrt(dots(residual, residual)) > limit
            if not open_.any():
                return solution
        unsolved = right[:, open_]
        solution[:, open_] = conjugate_gradients(
            self._matrix, unsolved, self.precondition, "pardiso_single", SINGLE_TOLERANCE
        )
        return solution

    def precondition(self, right: Floats) -> Floats:
        """Apply the factors to (n, k) without refinement, to about four digits."""
        solution = np.zeros(right.shape)
        self._add_solution(*self._scaled_parts(right), solution)
        return solution

    def _scaled_parts(self, right: Floats) -> tuple[Floats, Singles, Floats]:
        """Divide outer and inner rows of (n, k) by the norms of the columns; return them and the norms."""
        size = _column_norms(right)
        return right[self.outer] / size, self._scaled_inner(right, size), size

    def _add_solution(self, outer: Floats, inner: Singles, size: Floats, solution: Floats) -> None:
        """Add the solution by the factors to `solution` (n, k); arguments from `_scaled_parts`."""
        if inner.any():
            inner = self._inner.forward(inner)
            outer[self._interface_in_outer] += inner[self._interface_in_factored]
        outer = self.near.solve(outer)
        inner[self._interface_in_factored] = outer[self._interface_in_outer]
        inner = self._inner.backward(inner)
        inner[self._interface_in_factored] = 0.0
        self._add_rows(inner, size, solution)
        solution[self.outer] += outer * size

    def _scaled_inner(self, right: Floats, size: Floats) -> Singles:
        """Divide the inner rows of (n, k) by the norms of the columns; zeros at the interface rows."""
        inner = np.empty((len(self._factored), right.shape[1]), dtype=np.float32, order="F")
        for first in range(0, len(inner), _ROWS):
            rows = slice(first, first + _ROWS)
            inner[rows] = np.take(right, self._factored[rows], axis=0) / size  # faster than right[rows]
        inner[self._interface_in_factored] = 0.0
        return inner

    def _add_rows(self, inner: Singles, size: Floats, solution: Floats) -> None:
        """Add inner rows times the norms of the columns to `solution` (n, k)."""
        for first in range(0, len(inner), _ROWS):
            rows = self._factored[first : first + _ROWS]
            solution[rows] = np.take(solution, rows, axis=0) + inner[first : first + _ROWS] * size

    def sharpen(self, vectors: Floats) -> None:
        """Correct S, and with it `near`, to double precision for the traces of some vectors at the interface.

        For traces U the inner solution leaves residual forces r_i of a relative size of 1e-4. Their effect at
        the interface, -K_ci K_ii^-1 r_i, is computed with a relative error of 1e-4, so that S U is known to
        1e-8. S gets these values by the smallest symmetric change in the norm of S.

        Parameters
        ----------
        vectors : (m, k) over the outer rows

        References
        ----------
        Dennis, Schnabel, SIAM Review 21 (1979) 443 (least-change symmetric secant updates).
        """
        S = self._inner.schur.astype(float)
        U = vectors[self._interface_in_outer]
        change = np.empty_like(U)
        for first in range(0, U.shape[1], self.width):
            columns = slice(first, first + self.width)
            change[:, columns] = self._schur_product(U[:, columns]) - S @ U[:, columns]
        size = np.sqrt((U * (S @ U)).sum(axis=0))
        L = cholesky(S, lower=True)
        Q, strength, V = svd(L.T @ (U / size), full_matrices=False)
        keep = strength > _WEAK * strength[0]
        Q = Q[:, keep]
        Z = solve_triangular(L, change / size, lower=True) @ (V[keep].T / strength[keep])
        QZ = Q.T @ Z
        Z = L @ (Z - 0.25 * Q @ (QZ + QZ.T))
        Q = L @ Q  # back from the norm of S
        del L
        S += Z @ Q.T
        S += Q @ Z.T
        del self.near, Q, Z  # frees memory for the new factors
        matrix = self._condensed(S)
        del S
        self.near = PardisoFactor(matrix)

    def _schur_product(self, U: Floats) -> Floats:
        """Compute S U (c, k) to twice the digits of the factors."""
        inner = np.zeros((len(self._factored), U.shape[1]), dtype=np.float32, order="F")
        size = _column_norms(U)
        inner[self._interface_in_factored] = U / size
        displacement = np.zeros((self.size, U.shape[1]))
        self._add_rows(self._inner.backward(inner), size, displacement)
        displacement[self._interface] = U
        force = self._matrix @ displacement
        size = _column_norms(force)
        correction = self._inner.forward(self._scaled_inner(force, size))[self._interface_in_factored]
        return np.asarray(force[self._interface] + correction * size)


def _column_norms(columns: Floats) -> Floats:
    """Norms (k,) by which columns are divided to stay within single precision, 1e-38 to 1e38; 1 for 0."""
    size = np.sqrt(dots(columns, columns))
    size[size == 0.0] = 1.0
    return size
