"""Reading numbers out of fixed-form text, so that every failure names its file and line."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from romdam.errors import RecordError

MAX_BYTES = 200_000_000  # 10 hours of three channels at 200 Hz as text; more is not one record


@dataclass(frozen=True)
class TextFile:
    """The lines of a text record.

    Attributes
    ----------
    path : the file
    lines : its lines without line ends; line numbers in messages count from 1
    """

    path: Path
    lines: list[str]

    def line(self, index: int) -> str:
        """Line `index` (from 0); its absence is an error."""
        if index >= len(self.lines):
            raise RecordError(
                f"{self.path}: line {len(self.lines)}: the file ends where line {index + 1} was expected; "
                "it is cut short, fetch it again"
            )
        return self.lines[index]

    def fail(self, index: int, message: str) -> RecordError:
        """Return an error that names line `index` (from 0)."""
        return RecordError(f"{self.path}: line {index + 1}: {message}")

    def integer(self, text: str, index: int, name: str) -> int:
        """Read one whole number of the header."""
        try:
            return int(_plain(text))
        except ValueError:
            raise self.fail(index, f"{name}: expected a whole number, got {text.strip()[:40]!r}") from None

    def real(self, text: str, index: int, name: str) -> float:
        """Read one finite number of the header."""
        try:
            value = float(_plain(text).replace("D", "E").replace("d", "e"))
        except ValueError:
            raise self.fail(index, f"{name}: expected a number, got {text.strip()[:40]!r}") from None
        if not math.isfinite(value):
            raise self.fail(index, f"{name}: expected a finite number, got {value}")
        return value

    def value(self, word: str, index: int) -> float:
        """Read one sample; "nan" is a gap."""
        try:
            return float(_plain(word))
        except ValueError:
            shown = self.lines[index].strip()[:60]
            raise self.fail(index, f"not a row of numbers: {shown!r}") from None

    def table(self, index: int, count: int, per_row: int, width: int) -> NDArray[np.float64]:
        """Read `count` finite numbers of a header table."""
        values = self.numbers(index, count, per_row, width)
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            raise self.fail(index + int(bad[0]) // per_row, f"header value {bad[0] + 1} is not finite")
        return values

    def numbers(self, index: int, count: int, per_row: int, width: int) -> NDArray[np.float64]:
        """Read `count` numbers from line `index` on.

        Parameters
        ----------
        index : first line, from 0
        count : how many numbers the header announces
        per_row, width : Fortran format (per_row x F width); only needed where numbers touch each other

        Raises
        ------
        RecordError
            for a line with too few or too many numbers, or one that is no number.
        """
        rows = -(-count // per_row)
        if index + rows > len(self.lines):
            held = max(0, len(self.lines) - index)
            raise RecordError(
                f"{self.path}: line {len(self.lines)}: the header announces {count} values on {rows} lines, "
                f"the file holds {held} lines of them; it is cut short, fetch it again"
            )
        values: list[float] = []
        for row in range(rows):
            expected = min(per_row, count - row * per_row)
            values.extend(self._row(index + row, expected, width))
        return np.array(values)

    def _row(self, index: int, expected: int, width: int) -> list[float]:
        line = self.lines[index]
        words = line.split()
        if len(words) != expected:
            words = [line[i : i + width].strip() for i in range(0, len(line.rstrip()), width)]
        if len(words) != expected:
            raise self.fail(index, f"expected {expected} numbers, got {len(words)}: {line.strip()[:60]!r}")
        return [self.value(word, index) for word in words]

    def free(self, index: int, stop: int | None = None) -> tuple[NDArray[np.float64], list[int]]:
        """Read all numbers from line `index` to `stop`; also the number of values before each line's end."""
        values: list[float] = []
        ends: list[int] = []
        for number in range(index, len(self.lines) if stop is None else stop):
            values.extend(self.value(word, number) for word in self.lines[number].split())
            ends.append(len(values))
        return np.array(values), ends


def iso_time(date: tuple[int, int, int], hour: float, minute: float, second: float) -> str:
    """ISO 8601 of a date and time, or "" where they are null values or out of range."""
    year, month, day = date
    clock = 0 <= hour <= 24 and 0 <= minute <= 60 and 0 <= second <= 61
    if not (clock and 1800 < year < 3000 and 1 <= month <= 12 and 1 <= day <= 366):
        return ""
    offset = timedelta(days=day - 1, hours=hour, minutes=minute, seconds=second)
    return (datetime(year, month, 1) + offset).isoformat()


def _plain(word: str) -> str:
    """Refuse what float() takes but no record means: 1_000, infinity, and letters beyond ASCII."""
    text = word.strip()
    if "_" in text or not text.isascii() or "inf" in text.lower():
        raise ValueError(text)
    return text


def read_text(path: Path) -> TextFile:
    """Read a text file; old agencies' files are Latin-1, so bytes beyond ASCII never stop it.

    Raises
    ------
    RecordError
        for a file that is missing, unreadable, empty, larger than 200 MB, or binary.
    """
    data = read_bytes(path)
    if b"\x00" in data[:4096]:
        raise RecordError(f"{path}: line 1: binary data where text was expected; not this format")
    return TextFile(path, data.decode("latin-1").splitlines())


def read_bytes(path: Path) -> bytes:
    """Read a whole file, with errors that name it."""
    try:
        if path.stat().st_size > MAX_BYTES:
            raise RecordError(f"{path}: {path.stat().st_size} bytes, more than the {MAX_BYTES} of any record")
        data = path.read_bytes()
    except OSError as error:
        raise RecordError(f"{path}: cannot be read ({error.strerror or error})") from None
    if not data.strip():
        raise RecordError(f"{path}: line 1: the file is empty; fetch it again")
    return data
