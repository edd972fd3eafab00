"""Matrices as text: Matrix Market, CalculiX's and Abaqus' lists of entries; unknowns and nodes as text."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
from scipy.sparse import coo_array

from romdam.core.arrays import Floats, Ints
from romdam.core.csv_table import Table, read_table
from romdam.core.errors import MeshError, quote
from romdam.core.files import file_text
from romdam.geometry.matrices.data import DIRECTIONS, INTERNAL, Entries, MatrixUnknowns, motion_of

_MARK = b"%%MatrixMarket"
_COMMENTS = ("*", "%", "#")
_WHOLE = 2.0**53
_MOST = 4e9  # bytes of a table


def is_matrix_market(path: Path) -> bool:
    """Tell Matrix Market from Abaqus' files, which have the same ending."""
    with path.open("rb") as file:
        return file.read(len(_MARK)).lower() == _MARK.lower()


def read_text(path: Path, key: str, location: str) -> Entries:
    """Read Matrix Market, or lines of row, column, value, or of node, direction (twice) and value.

    Rows of the latter kind are counted from 0 or 1; CalculiX and Abaqus store one triangle.

    Raises
    ------
    MeshError
    """
    if is_matrix_market(path):
        matrix = coo_array(_market(path, location))
        if matrix.shape[0] != matrix.shape[1]:
            raise MeshError(f"{location}: is not square, {matrix.shape[0]} by {matrix.shape[1]}")
        return Entries(matrix.row, matrix.col, matrix.data.astype(float), matrix.shape[0])
    lines = [line.replace(",", " ").split() for line in file_text(path).split("\n")]
    lines = [words for words in lines if words and not words[0].startswith(_COMMENTS)]
    widths = {len(words) for words in lines}
    if len(widths) != 1 or not widths <= {3, 5}:
        raise MeshError(
            f"{location}: has lines of {', '.join(map(str, sorted(widths))) or 'no'} numbers, expected 3 "
            "(row, column, value) or 5 (node and direction twice, value) on every line, or %%MatrixMarket "
            "in the first"
        )
    try:
        table = np.array([word for words in lines for word in words], dtype=float).reshape(len(lines), -1)
    except ValueError as error:
        raise MeshError(f"{location}: holds what is no number ({quote(str(error))}); write it anew") from None
    if table.shape[1] == 3:
        row, column = _whole(table[:, :2], location).T
        return Entries(row, column, table[:, 2])
    ends = _whole(table[:, :4], location).reshape(-1, 2)
    motion = np.where(ends[:, 0] < 0, INTERNAL, motion_of(np.where(ends[:, 0] < 0, 0, ends[:, 1]), location))
    ends[:, 1] = np.where(ends[:, 0] < 0, INTERNAL, motion)
    labels, number = np.unique(ends, axis=0, return_inverse=True)
    row, column = number.reshape(-1, 2).T
    return Entries(row, column, table[:, 4], labels=labels)


def _market(path: Path, location: str) -> object:
    """Matrix as SciPy reads it, once the sizes that the head states are those of the file."""
    from scipy.io import mminfo, mmread  # here: what reads MATLAB's files comes with it

    try:
        rows, columns, entries, layout, field, _ = mminfo(path)
        stated = rows * columns if layout == "array" else max(entries, rows, columns) // 2
        if stated > path.stat().st_size or field not in ("real", "integer"):
            raise ValueError(f"{rows} by {columns} with {entries} entries, {layout} {field}")
        return mmread(path)
    except (ValueError, OverflowError, TypeError, StopIteration) as error:
        raise MeshError(
            f"{location}: is no sound Matrix Market file of real numbers ({quote(str(error))}); write it anew"
        ) from None


def read_columns(path: Path, location: str) -> Floats:
    """Read columns of numbers (n, k) from a dense Matrix Market file."""
    if not is_matrix_market(path):
        raise MeshError(
            f"{location}: vectors are read from Matrix Market (array) and HDF5; write it as one of them"
        )
    read = _market(path, location)
    return np.asarray(read if isinstance(read, np.ndarray) else coo_array(read).toarray(), dtype=float)


def _whole(numbers: Floats, location: str) -> Ints:
    wrong = ~((np.abs(numbers) < _WHOLE) & (numbers == np.rint(numbers)))
    if wrong.any():
        raise MeshError(
            f"{location}: {int(wrong.sum())} numbers of rows or nodes are not whole, such as "
            f"{numbers[wrong][0]:g}; write the file anew"
        )
    return numbers.astype(np.int64)


def read_dof(path: Path, location: str) -> MatrixUnknowns:
    """Read CalculiX's JOB.dof: `node.direction`, a line for each row."""
    words = file_text(path).split()
    pairs = [word.split(".") for word in words]
    if not pairs or not all(len(pair) == 2 and pair[0].isdecimal() and pair[1].isdecimal() for pair in pairs):
        wrong = next(
            (w for w, p in zip(words, pairs, strict=True) if len(p) != 2 or not "".join(p).isdecimal()), ""
        )
        raise MeshError(f"{location}: expected node.direction such as 12.3 on every line, got {quote(wrong)}")
    numbers = np.array(pairs, dtype=float).astype(np.int64)
    return MatrixUnknowns(
        numbers[:, 0], motion_of(numbers[:, 1], location), np.full((len(numbers), 3), np.nan)
    )


def read_csv(path: Path, location: str) -> MatrixUnknowns:
    """Read node, direction and, where they are there, x, y, z; named in the first line."""
    table = _Table.read(path, ("node", "direction"), location)
    named = {name: k for k, name in enumerate(DIRECTIONS)} | {str(k + 1): k for k in range(6)}
    words = [word.lower() for word in table.table.texts(table.columns["direction"])]
    wrong = [word for word in words if word not in named]
    if wrong:
        raise MeshError(
            f"{location}: {len(wrong)} directions such as {quote(wrong[0])} are none of "
            f"{', '.join(DIRECTIONS)}"
        )
    motion = np.array([named[word] for word in words], dtype=np.int64)
    return MatrixUnknowns(table.nodes(), motion, table.positions())


def read_nodes(path: Path, location: str) -> tuple[Ints, Floats]:
    """Read node, x, y, z; named in the first line."""
    table = _Table.read(path, ("node", "x", "y", "z"), location)
    return table.nodes(), table.positions()


@dataclass(frozen=True)
class _Table:
    """A table by the columns' names in small letters; `location` is file and key, for messages."""

    table: Table
    columns: dict[str, str]
    location: str

    @classmethod
    def read(cls, path: Path, needed: tuple[str, ...], location: str) -> Self:
        """Read a table that has the needed columns."""
        table = read_table(path, MeshError, location=location.removesuffix(f": {path}"), most=_MOST)
        columns = {name.lower(): name for name in table.names}
        lost = [name for name in needed if not table.rows or name not in columns]
        if lost:
            raise MeshError(
                f"{location}: has no rows with a column {lost[0]!r}; its first line must name "
                f"{', '.join(needed)}"
            )
        if len(columns) < len(table.names):
            raise MeshError(f"{location}: has a column twice, in capitals and small letters; leave one")
        return cls(table, columns, location)

    def nodes(self) -> Ints:
        """Numbers of nodes (n,)."""
        return _whole(self.table.numbers(self.columns["node"]), self.location)

    def positions(self) -> Floats:
        """Coordinates (n, 3) as the file has them; NaN where it has none."""
        if not all(name in self.columns for name in "xyz"):
            return np.full((len(self.table.rows), 3), np.nan)
        return np.stack([self.table.numbers(self.columns[name], empty=np.nan) for name in "xyz"], axis=1)
