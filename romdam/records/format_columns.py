"""Plain columns of numbers: white space or commas, comment lines and one line of names allowed."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from romdam.errors import RecordError
from romdam.records.channel import Channel
from romdam.records.text import TextFile, read_text

COMMENTS = ("#", "%", "!", "//")
_ROW = re.compile(r"^[\s,;]*[-+]?(\d|\.\d|nan\b)[-+.\deEdDnaN,;\s]*$")


def is_columns(head: str) -> bool:
    """Whether a file starts with rows of numbers, after comments and at most one line of names."""
    lines = [line for line in head.splitlines() if line.strip()]
    rows = [line for line in lines if not line.lstrip().startswith(COMMENTS)]
    whole = rows[:-1] or rows  # the last may be cut short
    return "\x00" not in head and any(_ROW.match(row) for row in whole[:2])


def read_columns(path: Path, dt: float | None = None, time_column: int | None = None) -> list[Channel]:
    """Read a text file of numbers, one channel per column; columns count from 1.

    Parameters
    ----------
    path : the file
    dt : sampling interval [s]; a plain file does not say it
    time_column : column of sample times [s], which then gives dt and is no channel

    Raises
    ------
    RecordError
        naming file and line, for text that is not a number, rows of different length, uneven times.
    """
    text = read_text(path)
    names, table, first = _read_table(text)
    if time_column is not None:
        dt = _even_dt(_column(table, time_column, path), path, first)
    if dt is None:
        raise RecordError(f"{path}: line 1: plain text does not say its interval; give `dt` or `time_column`")
    columns = [i for i in range(table.shape[1]) if i + 1 != time_column]
    return [
        Channel(
            code=str(i + 1),
            data=table[:, i].copy(),
            dt=dt,
            meta={"format": "columns", "column": names.get(i, "")},
        )
        for i in columns
    ]


def _column(table: NDArray[np.float64], number: int, path: Path) -> NDArray[np.float64]:
    if number > table.shape[1]:
        raise RecordError(f"{path}: line 1: time_column is {number}, the file has {table.shape[1]} columns")
    return table[:, number - 1]


def _read_table(text: TextFile) -> tuple[dict[int, str], NDArray[np.float64], int]:
    names: dict[int, str] = {}
    rows: list[list[float]] = []
    first = 0
    for index, line in enumerate(text.lines):
        words = line.replace(",", " ").replace(";", " ").split()
        if not words or words[0].startswith(COMMENTS):
            continue
        if not rows and not names and not _ROW.match(line):
            names = dict(enumerate(words))
            continue
        first = first if rows else index
        rows.append([text.value(word, index) for word in words])
        if len(rows[-1]) != len(rows[0]):
            raise text.fail(index, f"{len(rows[-1])} numbers, the rows above have {len(rows[0])}")
    if not rows:
        raise text.fail(max(0, len(text.lines) - 1), "no row of numbers in it; empty, or of another format")
    return names, np.array(rows), first


def _even_dt(time: NDArray[np.float64], path: Path, first: int) -> float:
    """The interval of a time column; a tenth of a step may be lost in its printed digits."""
    steps = np.diff(time)
    if steps.size == 0 or not np.all(np.isfinite(steps)):
        raise RecordError(f"{path}: line {first + 1}: a time column needs two finite values or more")
    dt = float((time[-1] - time[0]) / steps.size)
    worst = int(np.argmax(np.abs(steps - dt)))
    if dt <= 0.0 or abs(steps[worst] - dt) > 0.1 * dt:
        raise RecordError(
            f"{path}: line {first + worst + 2}: uneven sampling: a step of {steps[worst]:g} s, on average "
            f"{dt:g} s; resample the record to an even interval first"
        )
    return dt
