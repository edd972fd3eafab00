"""Sparse matrices of small dense blocks times several columns, compiled.

SciPy's product reads one number and one row of the columns at a time; with 3 by 3 blocks three rows serve
nine numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_matrix

from romdam.core.jit import VIEWS, njit
from romdam.linalg.conjugate import WIDTH

Reals = NDArray[Any]


@dataclass(frozen=True)
class Blocks:
    """A sparse matrix of blocks, each of 3 or 6 rows and columns, in double or single precision.

    Attributes
    ----------
    start, column : of the rows of blocks, and which block of columns each one stands in
    data : (blocks, rows, columns)
    shape : of the whole matrix
    """

    start: NDArray[np.int32]
    column: NDArray[np.int32]
    data: Reals
    shape: tuple[int, int]

    @classmethod
    def of(cls, matrix: bsr_matrix, real: type) -> Blocks:
        """From SciPy's own."""
        return cls(matrix.indptr, matrix.indices, np.ascontiguousarray(matrix.data, dtype=real), matrix.shape)

    def __matmul__(self, right: Reals) -> Reals:
        """The product with (n, k), in the matrix' precision."""
        if right.shape[1] == WIDTH:
            return self._sixteen(right)
        product = np.empty((self.shape[0], right.shape[1]), dtype=self.data.dtype)
        for first in range(0, right.shape[1], WIDTH):
            some = slice(first, min(first + WIDTH, right.shape[1]))
            product[:, some] = self._sixteen(right[:, some])[:, : some.stop - first]
        return product

    def _sixteen(self, right: Reals) -> Reals:
        if right.shape[1] < WIDTH:
            right = np.pad(right, ((0, 0), (0, WIDTH - right.shape[1])))
        product = np.zeros((self.shape[0], WIDTH), dtype=self.data.dtype)
        _multiply(self.start, self.column, self.data, np.ascontiguousarray(right, self.data.dtype), product)
        return product


@njit(**VIEWS, fastmath=True)  # sums may be taken in another order
def _multiply(start: Any, column: Any, data: Any, right: Any, product: Any) -> None:
    rows, columns = data.shape[1], data.shape[2]
    for i in range(len(start) - 1):
        for r in range(0, rows, 3):
            to0, to1, to2 = product[rows * i + r], product[rows * i + r + 1], product[rows * i + r + 2]
            for k in range(start[i], start[i + 1]):
                for s in range(0, columns, 3):
                    at = columns * column[k] + s
                    x, y, z = right[at], right[at + 1], right[at + 2]
                    a, b, c = data[k, r, s], data[k, r, s + 1], data[k, r, s + 2]
                    d, e, f = data[k, r + 1, s], data[k, r + 1, s + 1], data[k, r + 1, s + 2]
                    g, h, j = data[k, r + 2, s], data[k, r + 2, s + 1], data[k, r + 2, s + 2]
                    for m in range(WIDTH):  # a number that is known when it is compiled
                        to0[m] += a * x[m] + b * y[m] + c * z[m]
                        to1[m] += d * x[m] + e * y[m] + f * z[m]
                        to2[m] += g * x[m] + h * y[m] + j * z[m]
