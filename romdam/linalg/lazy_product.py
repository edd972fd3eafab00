"""A tall matrix times a small one, of which only the rows that are asked for are made."""

from __future__ import annotations

from typing import Any

import numpy as np

from romdam.core.arrays import Floats


class Product:
    """left @ right as far as its users take it for an array: its shape, its rows, and products with it.

    A basis of a million unknowns is a file that is mapped, and turned into other coordinates it would have to
    stand in memory, 8 bytes for every unknown and coordinate.

    Parameters
    ----------
    left : (n, k), for example mapped from a file
    right : (k, m)
    """

    __array_ufunc__ = None  # so that an array in front leaves the product to `__rmatmul__`

    def __init__(self, left: Floats, right: Floats) -> None:
        self._left, self._right = left, right
        self.shape = (left.shape[0], right.shape[1])
        self.nbytes = 8 * self.shape[0] * self.shape[1]

    @property
    def T(self) -> Product:
        """Its transpose."""
        return Product(self._right.T, self._left.T)

    def __getitem__(self, rows: Any) -> Floats:
        return np.asarray(self._left[rows] @ self._right)

    def __matmul__(self, other: Any) -> Floats:
        return np.asarray(self._left @ (self._right @ other))

    def __rmatmul__(self, other: Any) -> Floats:
        return np.asarray((other @ self._left) @ self._right)
