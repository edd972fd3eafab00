"""A sparse symmetric matrix of which only the upper triangle is kept, in half the memory.

The stiffness of a dam on rock with a million unknowns takes 1 GB, and stays while its factors, that need all
the rest, solve: what they leave is measured with it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags_array, triu

from romdam.linalg.conjugate import WIDTH

Reals = NDArray[Any]


class Symmetric:
    """A symmetric matrix as far as it is multiplied with (n,) or (n, k).

    Parameters
    ----------
    matrix : (n, n) sparse; what stands below its diagonal is not looked at

    Attributes
    ----------
    upper : (n, n), the diagonal and what stands above
    """

    def __init__(self, matrix: csr_matrix) -> None:
        self.upper = csr_matrix(triu(matrix, format="csr"))
        self.shape = self.upper.shape
        self._diagonal = self.upper.diagonal()

    def __matmul__(self, right: Reals) -> Reals:
        columns = right.reshape(len(right), -1)
        result = np.empty((self.shape[0], columns.shape[1]))
        for first in range(0, columns.shape[1], WIDTH):
            some = slice(first, first + WIDTH)
            piece = np.ascontiguousarray(columns[:, some])
            product = self.upper @ piece
            product += self.upper.T @ piece
            product -= self._diagonal[:, None] * piece
            result[:, some] = product
        return result.reshape(right.shape)

    def whole(self) -> csr_matrix:
        """Both triangles."""
        return csr_matrix(self.upper + self.upper.T - diags_array(self._diagonal))


def whole(matrix: csr_matrix | Symmetric) -> csr_matrix:
    """The matrix with both triangles."""
    return matrix.whole() if isinstance(matrix, Symmetric) else matrix


def upper(matrix: csr_matrix | Symmetric) -> csr_matrix:
    """The matrix, or its upper triangle where that is what is there."""
    return matrix.upper if isinstance(matrix, Symmetric) else matrix
