"""Plain columns of numbers: white space or commas, comment lines allowed, no metadata."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from romdam.errors import RecordError
from romdam.records.channel import Channel

COMMENTS = ("#", "%", "!", "//")


def read_columns(
    path: Path, unit: str = "", dt: float | None = None, time_column: int | None = None
) -> list[Channel]:
    """Read a text file of numbers, one channel per column; columns count from 1.

    Parameters
    ----------
    path : the file
    unit, dt : as declared; a plain file says neither
    time_column : column of sample times [s], which then gives dt and is no channel

    Raises
    ------
    RecordError
        naming file and line, for text that is not a number, rows of different length, uneven times.
    """
    names, table = _read_table(path)
    if time_column is not None:
        dt = _even_dt(_column(table, time_column, path), path)
    if dt is None:
        raise RecordError(
            f"{path}: plain text does not say its sampling interval; give `dt` or `time_column`"
        )
    columns = [i for i in range(table.shape[1]) if i + 1 != time_column]
    return [
        Channel(code=str(i + 1), data=table[:, i].copy(), dt=dt, unit=unit, meta={"column": names.get(i, "")})
        for i in columns
    ]


def _column(table: NDArray[np.float64], number: int, path: Path) -> NDArray[np.float64]:
    if number > table.shape[1]:
        raise RecordError(f"{path}: time_column {number}, but the file has {table.shape[1]} columns")
    return table[:, number - 1]


def _read_table(path: Path) -> tuple[dict[int, str], NDArray[np.float64]]:
    names: dict[int, str] = {}
    rows: list[list[float]] = []
    for number, line in enumerate(_lines(path), start=1):
        words = line.replace(",", " ").split()
        if not words or words[0].startswith(COMMENTS):
            continue
        try:
            row = [float(word) for word in words]
        except ValueError:
            if rows or names:
                raise RecordError(
                    f"{path}: line {number}: not a row of numbers: {line.strip()[:60]!r}"
                ) from None
            names = dict(enumerate(words))
            continue
        if rows and len(row) != len(rows[0]):
            raise RecordError(
                f"{path}: line {number}: {len(row)} numbers, the rows above have {len(rows[0])}"
            )
        rows.append(row)
    if not rows:
        raise RecordError(f"{path}: no row of numbers in it; the file is empty or of another format")
    return names, np.array(rows)


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="utf-8").splitlines()
    except UnicodeDecodeError:
        raise RecordError(f"{path}: not text, and no known record format") from None
    except OSError as error:
        raise RecordError(f"{path}: cannot be read ({error.strerror or error})") from None


def _even_dt(time: NDArray[np.float64], path: Path) -> float:
    steps = np.diff(time)
    if steps.size == 0 or not np.all(np.isfinite(steps)):
        raise RecordError(f"{path}: the time column needs at least two finite values")
    dt = float((time[-1] - time[0]) / steps.size)
    worst = int(np.argmax(np.abs(steps - dt)))
    # times are printed with few digits: half of the last one may be lost on each side of a step
    if dt <= 0.0 or abs(steps[worst] - dt) > 0.1 * dt:
        raise RecordError(
            f"{path}: uneven sampling: step {worst + 1} is {steps[worst]:g} s, the mean step {dt:g} s; "
            "resample the record to an even interval first"
        )
    return dt
