"""Tables in CSV files: one way to read them, whoever has written them.

A first line of names, then rows of as many cells. Commas separate, points are decimal, lines that begin with
`#` are comments. What a spreadsheet leaves behind is taken: a mark of the byte order, blank lines, and empty
cells at the end of all lines.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.errors import ConfigError, RomdamError, quote
from romdam.core.files import check_file, file_text

_LARGEST = 100e6  # bytes
_PLAIN = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_REMEDY = "separate columns by commas, and write numbers with a decimal point"


@dataclass(frozen=True)
class Table:
    """Rows of a CSV file.

    Attributes
    ----------
    where : key and file, for messages
    names : of the columns, each once; empty for a file without rows
    rows : cells without space around them, as many as there are names
    lines : numbers of the lines on which the rows begin
    error : what is raised
    """

    where: str
    names: tuple[str, ...]
    rows: list[list[str]]
    lines: list[int]
    error: type[RomdamError] = ConfigError

    def at(self, row: int) -> str:
        """Return file and line of a row, for messages."""
        return f"{self.where}: line {self.lines[row]}"

    def texts(self, column: str) -> list[str]:
        """Return the cells of a column."""
        k = self.names.index(column)
        return [row[k] for row in self.rows]

    def numbers(self, column: str, empty: float | None = None) -> Floats:
        """Return the numbers of a column (rows,), all finite.

        Parameters
        ----------
        empty : stands for a cell that is empty or nan; such a cell is refused without it

        Raises
        ------
        RomdamError
            for another text than a plain number, with its line.
        """
        values = np.empty(len(self.rows))
        for k, text in enumerate(self.texts(column)):
            value = plain_number(text)
            if not text or (empty is not None and text.lower() == "nan"):
                value = empty
            if value is None:
                raise self.error(
                    f"{self.at(k)}: {column} must be a finite number such as -1.5e3, got {quote(text)}"
                )
            values[k] = value
        return values

    def columns(self, names: Sequence[str], row: str, optional: str = "") -> dict[str, Floats]:
        """Return numbers of several columns; others in the file are passed over.

        Parameters
        ----------
        names : columns that must be there
        row : what a line holds and in which unit, such as "one point per line in m", for messages
        optional : name of a column that is read where it is there

        Raises
        ------
        RomdamError
            for a missing column, no rows, and texts that are no plain numbers.
        """
        missing = [name for name in names if name not in self.names]
        if missing or not self.rows:
            what = f"lacks column {', '.join(missing)}" if missing and self.names else "has no rows"
            raise self.error(
                f"{self.where} {what}; its first line must be {','.join(names)}, then {row}; {_REMEDY}"
            )
        read = [*names, optional] if optional in self.names else names
        return {name: self.numbers(name) for name in read}


def plain_number(text: str) -> float | None:
    """Return the finite number that a text is: digits, a point, an exponent, and nothing else; else None."""
    value = float(text) if _PLAIN.fullmatch(text) else np.inf
    return value if np.isfinite(value) else None


def read_table(
    path: Path,
    error: type[RomdamError] = ConfigError,
    *,
    location: str = "",
    most: float = _LARGEST,
) -> Table:
    """Read a CSV file.

    Parameters
    ----------
    error : what is raised
    location : file and key that name the table, for messages
    most : bytes

    Raises
    ------
    RomdamError
        for a file that cannot be read, names that are empty or there twice, and rows of other widths.
    """
    where = f"{location}: {path}" if location else str(path)
    lines = read_cells(path, error, location=location, most=most)
    if not lines:
        return Table(where, (), [], [], error)
    (line, head), *rows = lines
    for name in head:
        if not name or head.count(name) > 1:
            what = f"{head.count(name)} columns are {quote(name)}" if name else "a column has no name"
            raise error(f"{where}: line {line}: {what}, limit 1; name every column, each differently")
    width, cells = len(head), list[list[str]]()
    for line, row in rows:
        if len(row) < width or any(row[width:]):
            raise error(
                f"{where}: line {line}: has {len(row)} values for {width} columns "
                f"({quote(','.join(row))}); is a decimal comma among them? {_REMEDY.capitalize()}"
            )
        cells.append(row[:width])
    return Table(where, tuple(head), cells, [line for line, _ in rows], error)


def read_cells(
    path: Path, error: type[RomdamError] = ConfigError, *, location: str = "", most: float = _LARGEST
) -> list[tuple[int, list[str]]]:
    """Number and cells of every line that is neither blank nor a comment; the first one without empty ends.

    Raises
    ------
    RomdamError
        for a file that cannot be read as CSV, in UTF-8 or Latin-1.
    """
    where = f"{location}: {path}" if location else str(path)
    try:
        check_file(path, most, error)
    except RomdamError as problem:
        raise error(f"{where} cannot be read ({str(problem).removeprefix(f'{path}: ')})") from None
    lines, before = list[tuple[int, list[str]]](), 0
    try:
        texts = ("" if line.lstrip().startswith("#") else line for line in file_text(path).split("\n"))
        reader = csv.reader(texts, skipinitialspace=True, strict=True)
        for row in reader:
            cells = [cell.strip() for cell in row]
            if any(cells):
                while not lines and not cells[-1]:
                    cells.pop()
                lines.append((before + 1, cells))
            before = reader.line_num
    except (OSError, csv.Error) as problem:
        raise error(f"{where} cannot be read as CSV ({problem}); save it as CSV in UTF-8") from None
    return lines
