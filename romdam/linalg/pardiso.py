"""Factors by PARDISO of the Intel MKL, where pypardiso is installed: in double or in single precision.

pypardiso finds the library. Its own calls copy the matrix's pattern every time and take float64 alone, so
that the library is called directly here.
"""

from __future__ import annotations

import ctypes
import weakref
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, spmatrix, triu

from romdam.core.arrays import Bools, Floats, Ints, Singles
from romdam.core.errors import ReductionError
from romdam.core.threads import PARDISO, threads_for
from romdam.linalg.conjugate import WIDTH, conjugate_gradients
from romdam.linalg.symmetric import Symmetric, upper

_POSITIVE_DEFINITE, _SYMMETRIC = 2, -2  # kinds of matrix
_ANALYSE, _FACTOR, _SOLVE, _FORWARD, _BACKWARD, _RELEASE = 11, 22, 33, 331, 333, -1  # phases
# of iparm, from 1
_OWN, _ORDERING, _PERTURBED, _PEAK, _PERMANENT, _FACTORS = 1, 2, 14, 15, 16, 17
_NEGATIVE, _SINGLE, _FROM_ZERO, _SCHUR, _WITH_FACTORS = 23, 28, 35, 36, 2
_NESTED_DISSECTION = 2
SINGLE_TOLERANCE = 1e-7  # of a residual, relative to its right-hand side: two iterations as a rule
# the same of what a stiffness is made of: with 1e-7 an open-joint omega^2 of a tet10 block of 77,976 unknowns
# was 7e-5 off, the stiffness of its retained DOFs being small beside that of the mesh
_TOLERANCE = 1e-10
_WIDTH = 32  # right-hand sides at a time: PARDISO wants them in another order, which is a copy


class PardisoFactor:
    """L D L^T factors of a symmetric matrix, held once.

    On one thread a repeat gives the same bits; on two, other factors differ by 5e-16.

    Parameters
    ----------
    matrix : (n, n) sparse, symmetric; or its upper triangle alone, which is not copied
    memory : bytes that the factorisation may take, or None

    Raises
    ------
    ReductionError
        where pypardiso is missing, the factors do not fit in `memory`, or the matrix is singular.
    """

    def __init__(self, matrix: spmatrix | Upper, memory: float | None = None) -> None:
        triangle = matrix if isinstance(matrix, Upper) else Upper.of(matrix, np.dtype(np.float64))
        self.size = len(triangle.start) - 1
        self._factors = _Factors(triangle, _SYMMETRIC, memory)
        self.memory = self._factors.memory

    def solve(self, right: Floats) -> Floats:
        """Solve for one (n,) or several (n, k) right-hand sides."""
        columns = np.asarray(right, dtype=float).reshape(self.size, -1)
        return self._factors.solve(columns).reshape(np.shape(right))

    def negative(self) -> int:
        """Number of negative eigenvalues, from the inertia of D."""
        return self._factors.statistic(_NEGATIVE)


class PardisoSingle:
    """L L^T factors in single precision, half as large, under conjugate gradients in double.

    Each iteration leaves 1e-4 of the residual or less. On an arch dam with rock of 295,442 unknowns two of
    them leave 8e-9 of the forces and the answer is right to 1.5e-8.

    Parameters
    ----------
    matrix : (n, n) sparse or symmetric, positive definite; kept, not copied
    memory : bytes that the factorisation may take, or None

    Raises
    ------
    ReductionError
        where pypardiso is missing, the factors do not fit in `memory`, or the matrix is not positive definite
        in single precision.
    """

    def __init__(self, matrix: csr_matrix | Symmetric, memory: float | None = None) -> None:
        self.size = matrix.shape[0]
        self._matrix = matrix
        self._factors = _Factors(Upper.of(upper(matrix), np.dtype(np.float32)), _POSITIVE_DEFINITE, memory)
        self.memory = self._factors.memory

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
            solution[:, some] = conjugate_gradients(
                self._matrix, columns[:, some], self.precondition, "pardiso_single", _TOLERANCE
            )
        return solution.reshape(np.shape(right))

    def precondition(self, right: Floats) -> Floats:
        """The factors' own answer, of five digits or so, for (n, k)."""
        return self._factors.solve(right)


class PardisoSchur:
    """Factors in single precision of some rows alone, and what is left of the matrix at the others.

    Parameters
    ----------
    matrix : sparse, symmetric positive definite; its upper triangle is enough
    some : numbers of its rows that count, ascending
    apart : (n,) True for those of them that are left
    memory : bytes that the factorisation may take, or None

    Attributes
    ----------
    schur : (m, m) single, S = K_cc - K_ci K_ii^-1 K_ic, the rows apart in their order

    Raises
    ------
    ReductionError
        as `PardisoSingle`.
    """

    def __init__(self, matrix: csr_matrix, some: Ints, apart: Bools, memory: float | None = None) -> None:
        triangle = Upper.of(matrix[some][:, some], np.dtype(np.float32))
        self._factors = _Factors(triangle, _POSITIVE_DEFINITE, memory, apart)
        self.memory = self._factors.memory
        self.schur = self._factors.schur

    def forward(self, right: Singles) -> Singles:
        """L^-1 f_i, and f_c - K_ci K_ii^-1 f_i at the rows apart, for (n, k) in Fortran's order."""
        return self._factors.substituted(_FORWARD, right)

    def backward(self, right: Singles) -> Singles:
        """u_i from `forward`'s answer with u_c put at the rows apart, for (n, k) in Fortran's order."""
        return self._factors.substituted(_BACKWARD, right)


@dataclass(frozen=True)
class _Held:
    """Memory of the library for a matrix, and the options it was made with."""

    library: ctypes.CDLL
    handle: NDArray[np.int64]
    iparm: NDArray[np.int32]
    kind: int
    size: int
    marks: NDArray[np.int32]

    def call(
        self, phase: int, matrix: tuple[NDArray[Any], ...], right: NDArray[Any], answer: NDArray[Any]
    ) -> int:
        """The library's error number, 0 for none; right and answer are (n, k) in Fortran's order."""
        numbers = (1, self.kind, phase, self.size, right.shape[1], 0, 0)
        unit, kind, at, size, columns, quiet, error = (np.array([n], dtype=np.int32) for n in numbers)
        values, start, column = matrix
        self.library.pardiso(
            *(
                ctypes.c_void_p(array.ctypes.data)
                for array in (
                    self.handle, unit, unit, kind, at, size, values, start, column, self.marks, columns,
                    self.iparm, quiet, right, answer, error,
                )
            )
        )  # fmt: skip
        return int(error[0])


class Upper(NamedTuple):
    """The upper triangle of a symmetric matrix as the library reads it."""

    values: NDArray[Any]
    start: NDArray[np.int32]
    column: NDArray[np.int32]

    @classmethod
    def of(cls, matrix: spmatrix, real: np.dtype[Any]) -> Upper:
        """That of a matrix, which is not kept: half a gigabyte at a million unknowns, while factors grow."""
        triangle = csr_matrix(triu(matrix, format="csr"))
        triangle.sort_indices()
        start, column = (a.astype(np.int32, copy=False) for a in (triangle.indptr, triangle.indices))
        return cls(triangle.data.astype(real, copy=False), start, column)


class _Factors:
    """A matrix and its factors in the library, which Python does not own.

    With some rows kept apart the others alone are eliminated: `schur` is what is left of the matrix there.
    """

    def __init__(self, matrix: Upper, kind: int, memory: float | None, apart: Bools | None = None) -> None:
        size, real = len(matrix.start) - 1, matrix.values.dtype
        self._matrix: tuple[NDArray[Any], ...] = matrix
        self._real = real
        marks = np.ones(1, np.int32) if apart is None else apart.astype(np.int32)
        self._held = _Held(_library(), np.zeros(64, np.int64), np.zeros(64, np.int32), kind, size, marks)
        for key, value in (
            (_OWN, 1), (_ORDERING, _NESTED_DISSECTION), (_SINGLE, int(real.itemsize == 4)), (_FROM_ZERO, 1),
            (_SCHUR, 0 if apart is None else _WITH_FACTORS),
        ):  # fmt: skip
            self._held.iparm[key - 1] = value
        nothing = np.zeros((1, 1), dtype=real)
        weakref.finalize(self, self._held.call, _RELEASE, (nothing,) * 3, nothing, nothing)
        self._run(_ANALYSE, nothing, nothing)
        self.memory = 1024.0 * max(
            self.statistic(_PEAK), self.statistic(_PERMANENT) + self.statistic(_FACTORS)
        )
        if memory is not None and self.memory > memory:
            raise ReductionError(
                f"pardiso: the factors of {size} unknowns need {self.memory / 1e9:.1f} GB, "
                f"{memory / 1e9:.1f} GB are allowed"
            )
        self.schur = np.zeros((1 if apart is None else int(apart.sum()),) * 2, dtype=real)
        self._run(_FACTOR, nothing, self.schur)
        if kind == _POSITIVE_DEFINITE or not self.statistic(_PERTURBED):  # no solve looks at the matrix again
            self._matrix = (nothing,) * 3

    def solve(self, right: Floats) -> Floats:
        """Solve for several (n, k) right-hand sides, in the precision of the factors."""
        solution = np.empty_like(right, order="C")
        for first in range(0, right.shape[1], _WIDTH):
            some = slice(first, first + _WIDTH)
            size = np.linalg.norm(right[:, some], axis=0)  # float32 ends at 1e-38 and 1e38
            size[size == 0.0] = 1.0
            columns = np.empty((len(right), len(size)), dtype=self._real, order="F")
            np.divide(right[:, some], size, out=columns, casting="same_kind")
            np.multiply(self.substituted(_SOLVE, columns), size, out=solution[:, some])
        return solution

    def substituted(self, phase: int, columns: NDArray[Any]) -> NDArray[Any]:
        """Result of a phase of the solution for (n, k) in the library's precision and order."""
        answer = np.empty_like(columns)
        self._run(phase, columns, answer)
        return answer

    def statistic(self, key: int) -> int:
        """A number that the library has put into iparm."""
        return int(self._held.iparm[key - 1])

    def _run(self, phase: int, right: NDArray[Any], answer: NDArray[Any]) -> None:
        with threads_for(self._held.size, PARDISO):
            error = self._held.call(phase, self._matrix, right, answer)
        if error:
            raise ReductionError(
                f"a stiffness matrix of {self._held.size} unknowns cannot be factored by PARDISO (its error "
                f"number is {error}, and -4 where it is singular)"
            )


@cache  # it is looked for among all files of the environment
def _library() -> ctypes.CDLL:
    try:
        from pypardiso import PyPardisoSolver
    except ImportError as error:
        raise ReductionError(
            f"pardiso: pypardiso is not installed ({error}); pip install 'romdam[large]'"
        ) from error
    library = PyPardisoSolver().libmkl
    library.pardiso.argtypes, library.pardiso.restype = None, None
    return library
