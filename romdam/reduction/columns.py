"""A tall matrix on disk, made block of columns by block of columns, where it stops and goes on.

The Ritz vectors of a large block are many times its matrices, and no step needs more than two blocks of them
at a time.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from romdam.linalg.symmetric import Symmetric

log = logging.getLogger(__name__)

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

WIDTH = 32  # columns made at a time
_ROWS = 8192  # of a chunk of the file: 2 MB
_HELD = 1e9  # bytes of some rows that are kept between products
_TOGETHER = 128  # columns of a product at a time: 400 MB at 400,000 unknowns


class Columns:
    """An (n, m) matrix in a scratch file, which stays until it is removed.

    Parameters
    ----------
    path : of the file; one that is there is gone on with where its key and rows are the same
    key : of what the matrix depends on
    shape : (n, m); `widen` adds columns
    """

    def __init__(self, path: Path, key: str, shape: tuple[int, int]) -> None:
        self.path, self.shape = path, shape
        try:
            self.done = self._found(key)
        except OSError as error:  # damaged, or another process is at it
            log.warning("%s: cannot be gone on with (%s)", path, error)
            self.path, self.done = path.with_name(f"{path.name}.{os.getpid()}"), 0
        if not self.done:
            self._begin(key)

    def _found(self, key: str) -> int:
        """Finished columns of the file that is there."""
        if not self.path.is_file():
            return 0
        with h5py.File(self.path, "r+") as file:
            if file.attrs.get("key") != key or len(file["columns"]) != self.shape[0]:
                return 0
            log.info("%s: going on after %d of %d columns", self.path, file.attrs["done"], self.shape[1])
            return min(int(file.attrs["done"]), self.shape[1])

    def _begin(self, key: str) -> None:
        chunks = (max(1, min(_ROWS, self.shape[0])), max(1, min(WIDTH, self.shape[1])))
        with h5py.File(self.path, "w") as file:
            data = {"shape": self.shape, "maxshape": (self.shape[0], None), "chunks": chunks}
            file.create_dataset("columns", dtype="f8", **data)
            file.attrs.update(key=key, done=0)

    def widen(self, columns: int) -> None:
        """Add columns."""
        self.shape = (self.shape[0], self.shape[1] + columns)
        with h5py.File(self.path, "r+") as file:
            file["columns"].resize(self.shape)

    def fill(self, until: int, make: Callable[[int, int], Floats], width: int | None = None) -> None:
        """Make the columns from the last finished one to `until`; make(first, last) gives (n, last - first).

        Each block of columns is on disk before the next one is made; fewer than usual take less memory.
        """
        width = width or WIDTH
        for first in range(self.done, until, width):
            last = min(first + width, until)
            values = make(first, last)
            with h5py.File(self.path, "r+") as file:
                file["columns"][:, first:last] = values
                file.flush()
                file.attrs["done"] = self.done = last

    def remove(self) -> None:
        """Remove the file."""
        self.path.unlink(missing_ok=True)

    def before(self, A: csr_matrix | Floats) -> Floats:
        """A @ T for a few rows A (b, n)."""
        found = np.empty((A.shape[0], self.shape[1]))
        with h5py.File(self.path, "r") as file:
            for some in self._blocks():
                found[:, some] = A @ file["columns"][:, some]
        return found

    def combined(self, V: Floats) -> Floats:
        """T @ V for a few columns V (m, k)."""
        found = np.zeros((self.shape[0], V.shape[1]))
        with h5py.File(self.path, "r") as file:
            for some in self._blocks():
                if V[some].any():
                    found += file["columns"][:, some] @ V[some]
        return found

    def gram(
        self,
        M: csr_matrix | Symmetric,
        rows: Ints | None = None,
        first: int = 0,
        less: tuple[Floats, Floats] | None = None,
    ) -> Floats:
        """T^T M T, M symmetric, of the columns from `first` on.

        Parameters
        ----------
        rows : of T that M is of, None for all
        less : (rows, k) and (k, m) whose product T is first made less by, there
        """
        total, held = np.zeros((self.shape[1],) * 2), dict[int, Floats]()
        few = 8 * M.shape[0] * self.shape[1] <= _HELD
        with h5py.File(self.path, "r") as file:

            def columns(some: slice) -> Floats:
                if some.start in held:
                    return held[some.start]
                X = file["columns"][:, some]
                X = X if rows is None else X[rows]
                if less is not None:
                    X -= less[0] @ less[1][:, some]
                if few:
                    held[some.start] = X
                return np.asarray(X)

            for k, right in enumerate(self._blocks(first)):
                product = M @ columns(right)
                for left in self._blocks(first)[: k + 1]:
                    total[left, right] = columns(left).T @ product
                    total[right, left] = total[left, right].T
        return total[first:, first:]

    def times(self, V: Floats, ends: list[int]) -> Iterator[Floats]:
        """T @ V, rows ends[k] to ends[k + 1] at a time."""
        with h5py.File(self.path, "r") as file:
            for first, last in pairwise(ends):
                yield file["columns"][first:last] @ V

    def _blocks(self, first: int = 0) -> list[slice]:
        width = self.shape[1]
        return [slice(k, min(k + _TOGETHER, width)) for k in range(first, width, _TOGETHER)]
