"""A tall matrix on disk, made block of columns by block of columns, where it stops and goes on.

The Ritz vectors of a large block are many times its matrices, and no step needs more than two blocks of them
at a time.
"""

from __future__ import annotations

import hashlib
import logging
import os
import weakref
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from copy import copy
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Self, TypeVar

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Floats, Ints
from romdam.core.errors import WriteError
from romdam.core.files import hold, locked_folder
from romdam.core.threads import side_by_side
from romdam.linalg.symmetric import Symmetric

log = logging.getLogger(__name__)
T = TypeVar("T")

WIDTH = 32  # columns made at a time
_HELD = 1e9  # bytes of some rows that are kept between products
_TOGETHER = 128  # columns of a product at a time: 400 MB at 400,000 unknowns


class OutOfCoreMatrix:
    """An (n, m) matrix in a scratch file, which stays until it is removed.

    Blocks of columns stand one behind the other, each row after row. A text file beside it, <name>.done, has
    the key and n in its first line, then a line for each block that is on disk: its last column's number, and
    its SHA-256. So a full disk, a machine that stops or a byte that changes costs the columns from there.

    Parameters
    ----------
    path : of the file; one that is there is gone on with where its key and rows are the same
    key : of what the matrix depends on
    shape : (n, m); `widen` adds columns
    """

    def __init__(self, path: Path, key: str, shape: tuple[int, int]) -> None:
        self.path, self.shape, self._private_folder = path, shape, None
        self._ends = [0]  # of the finished blocks
        with _writing(path):
            lock = hold(path)
            if lock is None:  # another process is at it
                self._private_folder, lock = locked_folder(path.parent)
                self.path = self._private_folder / path.name
                self.path.touch()
            self._release = weakref.finalize(self, os.close, lock)
            self._written = self.path.with_name(f"{self.path.name}.done")
            self._go_on(f"{key} {shape[0]}")

    @property
    def done(self) -> int:
        """Finished columns."""
        return self._ends[-1]

    def _go_on(self, head: str) -> None:
        """Find what is finished, up to the first block that is not what was written."""
        lines = (
            self._written.read_bytes().decode(errors="replace").split("\n") if self._written.is_file() else []
        )
        good = [head]
        for line in lines[1:] if lines[:1] == [head] else []:
            last, _, digest = line.partition(" ")
            if not (last.isdecimal() and self.done < int(last) <= self.shape[1]):
                break
            if hashlib.sha256(self._read(self.done, int(last)).data).hexdigest() != digest:
                log.warning("%s: damaged from column %d on; made again from there", self.path, self.done)
                break
            self._ends.append(int(last))
            good.append(line)
        self._written.write_text("".join(f"{line}\n" for line in good))
        if self.done:
            log.info("%s: going on after %d of %d columns", self.path, self.done, self.shape[1])

    def widen(self, columns: int) -> None:
        """Add columns."""
        self.shape = (self.shape[0], self.shape[1] + columns)

    def append(self, values: Floats) -> None:
        """Add columns (n, k) that are in memory; see `fill`."""
        before = self.shape[1]
        self.widen(values.shape[1])
        self.fill(self.shape[1], lambda first, last: values[:, first - before : last - before])

    def narrowed(self, columns: int) -> Self:
        """Its first columns."""
        few = copy(self)
        few.shape = (self.shape[0], columns)
        return few

    def fill(self, until: int, make: Callable[[int, int], Floats], width: int | None = None) -> None:
        """Make the columns from the last finished one to `until`; make(first, last) gives (n, last - first).

        Each block of columns is on disk before the next one is made; fewer than usual take less memory.

        Raises
        ------
        WriteError
            where the disk is full; what is finished stays.
        """
        width = width or WIDTH
        try:
            for first in range(self.done, until, width):
                last = min(first + width, until)
                values = np.ascontiguousarray(make(first, last), dtype=float)
                with _writing(self.path):
                    self._write(values, first, last)
        except BaseException:
            self._release()  # this process may come back to it
            raise

    def _write(self, values: Floats, first: int, last: int) -> None:
        with self.path.open("r+b") as file:
            file.seek(8 * self.shape[0] * first)
            file.write(values.data)
            file.flush()
            os.fsync(file.fileno())
        with self._written.open("a") as file:
            file.write(f"{last} {hashlib.sha256(values.data).hexdigest()}\n")
        self._ends.append(last)

    def remove(self) -> None:
        """Remove the file."""
        self._written.unlink(missing_ok=True)
        self.path.unlink(missing_ok=True)
        if self._private_folder is not None:
            self._private_folder.rmdir()
        self._release()

    def _read(self, first: int, last: int) -> Floats:
        """Rows that stand in the file of a block of columns, less where that ends early."""
        rows = self.shape[0]
        return np.fromfile(self.path, dtype=float, count=rows * (last - first), offset=8 * rows * first)

    def _columns(self, some: slice, rows: slice = slice(None)) -> Floats:
        """Rows of some columns, (rows, columns)."""
        low, high, _ = rows.indices(self.shape[0])
        values = np.empty((high - low, some.stop - some.start))
        for first, last in pairwise(self._ends):
            a, b = max(first, some.start), min(last, some.stop)
            if a < b:
                shape, start = (self.shape[0], last - first), 8 * self.shape[0] * first
                block = np.memmap(self.path, dtype=float, mode="r", offset=start, shape=shape)
                values[:, a - some.start : b - some.start] = block[low:high, a - first : b - first]
        return values

    def before(self, A: csr_matrix | Floats) -> Floats:
        """A @ T for a few rows A (b, n)."""
        total = np.empty((A.shape[0], self.shape[1]))
        for some in self._blocks():
            total[:, some] = A @ self._columns(some)
        return total

    def combined(self, V: Floats) -> Floats:
        """T @ V for a few columns V (m, k)."""
        total = np.zeros((self.shape[0], V.shape[1]))
        for some in self._blocks():
            if V[some].any():
                total += self._columns(some) @ V[some]
        return total

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
        total, columns = np.zeros((self.shape[1],) * 2), self._reader(M.shape[0], rows, less)
        for k, right in enumerate(self._blocks(first)):
            inertia, lefts = M @ columns(right), self._blocks(first)[: k + 1]
            forms = self.each(partial(_times, columns, left, [inertia]) for left in lefts)
            for left, (form,) in zip(lefts, forms, strict=True):
                total[left, right], total[right, left] = form, form.T
        return total[first:, first:]

    def against(
        self, A: csr_matrix | Symmetric, M: csr_matrix, rows: Ints, first: int, since: int
    ) -> list[Floats]:
        """T^T M T and T^T A T of all columns with those from `first` on; see `gram` for `rows`.

        Parameters
        ----------
        since : the column from which on T^T A T is asked for
        """
        columns = self._reader(M.shape[0], rows)
        totals = [np.zeros((self.shape[1], self.shape[1] - first)) for _ in (M, A)]
        for right in self._blocks(first):
            X, to = columns(right), slice(right.start - first, right.stop - first)
            both = [M @ X, A @ X]
            asked = [(left, both if left.stop > since else both[:1]) for left in self._blocks()]
            forms = self.each(partial(_times, columns, left, products) for left, products in asked)
            for (left, _), of_left in zip(asked, forms, strict=True):
                for total, form in zip(totals, of_left, strict=False):
                    total[left, to] = form
        return [totals[0], totals[1][since:]]

    def _reader(
        self, size: int, rows: Ints | None, less: tuple[Floats, Floats] | None = None
    ) -> Callable[[slice], Floats]:
        """Give what reads blocks of columns, `size` rows of each, kept where all are few. See `gram`."""
        held, few = dict[int, Floats](), 8 * size * self.shape[1] <= _HELD

        def columns(some: slice) -> Floats:
            if some.start in held:
                return held[some.start]
            X = self._columns(some)
            X = X if rows is None else X[rows]
            if less is not None:
                X -= less[0] @ less[1][:, some]
            if few:
                held[some.start] = X
            return X

        return columns

    def pieces(self, ends: list[int], first: int = 0) -> Iterator[Floats]:
        """The columns from `first` on, rows ends[k] to ends[k + 1] at a time."""
        for low, high in pairwise(ends):
            yield self._columns(slice(first, self.shape[1]), slice(low, high))

    def each(self, tasks: Iterable[Callable[[], T]]) -> list[T]:
        """Results of tasks that read it, side by side where what a second one holds is little."""
        small = 8 * self.shape[0] * self.shape[1] <= _HELD
        return list(side_by_side(tasks)) if small else [task() for task in tasks]

    def _blocks(self, first: int = 0) -> list[slice]:
        width = self.shape[1]
        return [slice(k, min(k + _TOGETHER, width)) for k in range(first, width, _TOGETHER)]


def _times(columns: Callable[[slice], Floats], left: slice, products: list[Floats]) -> list[Floats]:
    """X^T P of a block of columns X and of every P."""
    X = columns(left)
    return [X.T @ P for P in products]


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise WriteError(
            f"{path}: cannot be written ({error}); free the disk, what is finished is gone on with"
        ) from error
