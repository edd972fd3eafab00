"""Plain columns of numbers: white space or commas, comment lines and one line of names allowed.

Such a file says little of itself; what it does say (names with units, comments, a column of times) is held
against the data and against what the configuration declares.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from romdam.core.errors import RecordError
from romdam.records.channel import Channel
from romdam.records.formats.stated import acceleration_unit
from romdam.records.formats.text import TextFile, read_text, split_words

COMMENTS = ("#", "%", "!", "//")
MANY = 16  # rows; fewer may rise evenly by chance
_ROW = re.compile(r"^[\s,;]*[-+]?(\d|\.\d|nan\b)[-+.\deEdDnaN,;\s]*$")
_REAL = r"((?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
_DT = re.compile(rf"\b(?:dt|delta[ _]?t|time[ _]?step|sampling[ _]interval)\s*[=:]\s*{_REAL}\s*(ms)?", re.I)
_RATE = re.compile(rf"\b(?:fs|sampl(?:ing|e)[ _](?:rate|freq\w*))[^=:\d]*[=:]\s*{_REAL}", re.I)
_COUNT = re.compile(r"\b(?:npts|ndata|(?:number of )?(?:points|samples))\s*[=:]\s*(\d{1,9})\b", re.I)
_NUMERIC = re.compile(r"[-+.\d]|.*(?:\d\.\d|\.\d\d)|[^A-Za-z]*$")  # words that no name begins as
_UNIT = re.compile(r"\bunits?(?:\s+of(?:\s+acceleration)?)?\s*[=:]?\s+([^\s,;]+)", re.I)
_IN = re.compile(r"\bin\s+(?:units\s+of\s+)?([a-zA-Z/^*\d]+)", re.I)
_BRACKETS = re.compile(r"[(\[]\s*([^)\]]*?)\s*[)\]]|_([a-zA-Z]+[/\d^s]*)$")
_NAME = re.compile(r"[^\s,;()\[\]]+(?:\s*[(\[][^)\]]*[)\]])?")


@dataclass(frozen=True)
class _Table:
    """Rows of numbers, the names above them, what comments say; lines of the first and last row, from 0."""

    values: NDArray[np.float64]
    names: dict[int, str]
    comments: tuple[tuple[int, str], ...]
    first: int
    last: int


def is_columns(head: str) -> bool:
    """Tell whether a file starts with rows of numbers, after comments and at most one line of names."""
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
        naming file and line, for text that is not a number, rows of different length, uneven times, and
        comments or columns that contradict the data or `dt`.
    """
    text = read_text(path)
    table = _read_table(text)
    if time_column is not None:
        dt = _even_dt(_column(table, time_column, path), path, table.first)
    if dt is None:
        raise RecordError(f"{path}: line 1: plain text does not say its interval; give `dt` or `time_column`")
    left, warnings = _not_channels(text, table, dt, time_column)
    if amid := [index + 1 for index, _ in table.comments if table.first < index < table.last]:
        warnings = (*warnings, f"line {amid[0]} is a comment amid the rows: two records in one file?")
    if time_column is not None and abs(begin := _column(table, time_column, path)[0]) > 1.1 * dt:
        warnings = (*warnings, f"the times begin at {begin:g} s, not at 0; is the start cut off?")
    unit = _check_comments(text, table, dt)
    columns = [i for i in range(table.values.shape[1]) if i not in left]
    return [
        Channel(
            code=str(i + 1),
            data=table.values[:, i].copy(),
            dt=dt,
            unit=_bracketed(table.names.get(i, "")) or unit,
            meta={"format": "columns", "column": table.names.get(i, "")},
            warnings=warnings,
        )
        for i in columns
    ]


def _column(table: _Table, number: int, path: Path) -> NDArray[np.float64]:
    """The times of a column [s]."""
    if number > table.values.shape[1]:
        raise RecordError(
            f"{path}: line 1: time_column is {number}, the file has {table.values.shape[1]} columns"
        )
    scale = 1e-3 if _bracketed(table.names.get(number - 1, "")).lower() in ("ms", "msec") else 1.0
    return scale * table.values[:, number - 1]


def _read_table(text: TextFile) -> _Table:
    names: dict[int, str] = {}
    comments: list[tuple[int, str]] = []
    rows: list[list[float]] = []
    first = last = 0
    _refuse_decimal_commas(text)
    for index, line in enumerate(text.lines):
        words = _words(line)
        if not words:
            continue
        if words[0].startswith(COMMENTS):
            comments.append((index, text.head(index)))
            continue
        if not rows and not names and not _ROW.match(line):
            names = _names(text, index)
            continue
        first, last = first if rows else index, index
        rows.append([text.value(word, index) for word in words])
        if len(rows[-1]) != len(rows[0]):
            raise text.fail(index, f"{len(rows[-1])} numbers, the rows above have {len(rows[0])}")
    if not rows:
        raise text.fail(max(0, len(text.lines) - 1), "no row of numbers in it; empty, or of another format")
    _refuse_count(text, rows, first)
    return _Table(np.array(rows), names, tuple(comments), first, last)


def _words(line: str) -> list[str]:
    return split_words(line.replace(",", " ").replace(";", " "))


def _names(text: TextFile, index: int) -> dict[int, str]:
    """Names of columns; a first row with a damaged number is none."""
    if any(_NUMERIC.match(word) for word in _words(text.lines[index])):
        raise text.fail(index, f"not a row of numbers, nor one of names: {text.lines[index].strip()[:60]!r}")
    return dict(enumerate(_NAME.findall(text.head(index))))


def _refuse_decimal_commas(text: TextFile) -> None:
    """Refuse commas for points: no number has a point, and each has one comma within."""
    rows = [(i, line) for i, line in enumerate(text.lines) if _ROW.match(line)]
    marked = [i for i, line in rows if "," in line]
    if not marked or any("." in line for _, line in rows):
        return
    words = [word for _, line in rows for word in line.replace(";", " ").split() if "," in word]
    if all(re.search(r"^[^,]*\d,\d[^,]*$", word) for word in words):
        raise text.fail(
            marked[0],
            f"is the comma of {words[0]!r} a decimal one? Write a point; or put a space behind a comma that "
            "parts two columns",
        )


def _refuse_count(text: TextFile, rows: list[list[float]], first: int) -> None:
    """The number of values above them is no sample."""
    word = _words(text.lines[first])[0]
    behind = [_words(line)[0] for line in text.lines[first + 1 : first + 4] if _words(line)]
    alone = word.isdigit() and int(word[:9]) >= 10 and bool(behind)
    if alone and (all("." in other for other in behind) or rows[0][0] == len(rows) - 1):
        raise text.fail(
            first,
            f"{word[:40]} looks like the number of values that follow ({len(rows) - 1} rows), not like a "
            "sample; delete it or make it a comment",
        )


def _bracketed(name: str) -> str:
    """The unit in a column's name: "acc (cm/s2)", "a[g]", "acc_g"; "" where there is none."""
    match = _BRACKETS.search(name)
    if match is None:
        return ""
    if match[1] is None:
        return acceleration_unit(match[2])
    return "" if match[1].lower() in ("", "counts", "count", "-") else acceleration_unit(match[1]) or match[1]


def _not_channels(
    text: TextFile, table: _Table, dt: float, time_column: int | None
) -> tuple[set[int], tuple[str, ...]]:
    """Columns that hold times or row numbers, and what is said of it and of the table's shape."""
    if time_column is not None:
        return {time_column - 1}, ()
    count, width = table.values.shape
    if count < MANY:
        return set(), ()
    if width == 1:
        same = table.values[0, 0] == dt
        return set(), ("the first value equals `dt`; is it a header's?",) if same else ()
    left, said = set(), []
    for i in range(width):
        steps = np.diff(table.values[:, i])
        step = float(np.mean(steps))
        if not (step > 0.0 and np.max(np.abs(steps - step)) <= 0.1 * step):
            continue
        if step != 1.0 and abs(step - dt) > 1e-3 * dt:
            raise text.fail(
                table.first,
                f"column {i + 1} rises by {step:g} from row to row as times do, `dt` is {dt:g} s; give "
                "`time_column` in place of `dt`, or take the column out",
            )
        left.add(i)
        said.append(f"column {i + 1} rises evenly by {step:g}: taken for times or numbers, not for a motion")
    if not left and _looks_wrapped(table.values):
        said.append(f"{width} columns run on from row to row: is this one series written {width} in a row?")
    return left, tuple(said)


def _looks_wrapped(values: NDArray[np.float64]) -> bool:
    """A series in rows is smoother from number to number than from row to row."""
    along, down = np.mean(np.abs(np.diff(values.ravel()))), np.mean(np.abs(np.diff(values, axis=0)))
    return values.shape[1] > 2 and bool(along < 0.8 * down)


def _check_comments(text: TextFile, table: _Table, dt: float) -> str:
    """Hold comments such as "dt = 0.01 s", "NPTS: 3000" against the data; return the unit that they state."""
    unit = ""
    for index, line in table.comments:
        if match := _IN.search(line):
            unit = acceleration_unit(match[1]) or unit
        if match := _DT.search(line):
            _check_dt(text, index, float(match[1]) * (1e-3 if match[2] else 1.0), dt)
        if (match := _RATE.search(line)) and float(match[1]) > 0.0:
            _check_dt(text, index, 1.0 / float(match[1]), dt)
        if (match := _COUNT.search(line)) and int(match[1]) != len(table.values):
            held = len(table.values)
            raise text.fail(index, f"{match[1]} samples are stated, the file holds {held}; it is cut short")
        if match := _UNIT.search(line):
            unit = acceleration_unit(match[1]) or (match[1] if re.search(r"[\d/*]", match[1]) else unit)
    return unit


def _check_dt(text: TextFile, index: int, stated: float, dt: float) -> None:
    if abs(stated - dt) > 1e-3 * dt:
        raise text.fail(index, f"an interval of {stated:g} s is stated, `dt` or the times say {dt:g} s")


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
    away = time - time[0] - dt * np.arange(time.size)
    worst = int(np.argmax(np.abs(away)))
    if abs(away[worst]) > 0.1 * dt:
        raise RecordError(
            f"{path}: line {first + worst + 1}: uneven sampling: {time[worst]:g} s is {away[worst] / dt:.2g} "
            f"of a step off an even interval of {dt:g} s; resample the record to an even interval first"
        )
    return dt
