"""Reading numbers out of fixed-form text, so that every failure names its file and line.

What a file says of its data, unit, peak and length, is held against them.
"""

from __future__ import annotations

import codecs
import difflib
import math
import os
import re
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from romdam.core.errors import RecordError
from romdam.core.files import check_file

MAX_BYTES = 200_000_000  # 10 hours of three channels at 200 Hz as text; more is not one record
WIDE = 400  # characters
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[EeDd][-+]?\d{1,4})?|[-+]?nan", re.ASCII | re.IGNORECASE)
END_MARK = re.compile(r"[^\d]*\b(?:end|eof|fin|ende|fine|stop)\b[^\d]*", re.I)
_TOUCHING = re.compile(r"(?<=[\d.])(?=[-+]\d*\.)")  # Fortran columns that are full: -.1234E-01-.5678E-01
_BOMS = {codecs.BOM_UTF8: "utf-8", codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}
_PLAINER = str.maketrans(dict.fromkeys("\x0c\x0b\xa0\u2007\u2009\u202f", " ") | {"\u2212": "-"})
_FOREIGN = {  # what files that are no records start with
    b"\x1f\x8b": "packed with gzip; unpack it",
    b"PK\x03\x04": "a ZIP archive or an office document; unpack it, or export the sheet as text",
    b"BZh": "packed with bzip2; unpack it",
    b"\xfd7zXZ": "packed with xz; unpack it",
    b"7z\xbc\xaf": "a 7-Zip archive; unpack it",
    b"Rar!": "a RAR archive; unpack it",
    b"\xd0\xcf\x11\xe0": "an office document; export the sheet as text",
    b"%PDF": "a PDF document; fetch the data file",
    b"\x89HDF": "an HDF5 or NetCDF file; export the record as text",
    b"CDF\x01": "a NetCDF file; export the record as text",
    b"\x89PNG": "a picture; fetch the data file",
    b"<": "an HTML or XML page, perhaps a server's error; fetch the data file again",
}
# accelerations as agencies write them, without spaces, carets and the "ec" of "sec"
_ACCELERATIONS = {
    "g": "g",
    "mg": "0.001 g",
    "%g": "0.01 g",
    "gal": "cm/s2",
    "gals": "cm/s2",
    "cm/s2": "cm/s2",
    "cms-2": "cm/s2",
    "m/s2": "m/s2",
    "ms-2": "m/s2",
    "mm/s2": "0.001 m/s2",
    "ms2": "m/s2",
    "mps2": "m/s2",
    "cms2": "cm/s2",
    "cmps2": "cm/s2",
    "cm/ss": "cm/s2",
    "m/ss": "m/s2",
    "mms2": "0.001 m/s2",
    "in/s2": "0.0254 m/s2",
    "ft/s2": "0.3048 m/s2",
}
PEAK_SHARE = 0.01  # of the peak; headers round it to three digits


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

    @property
    def end(self) -> int:
        """Number of lines without empty ones and marks such as "*** End Data ***" at the end."""
        end = len(self.lines)
        while end and (not self.lines[end - 1].strip() or END_MARK.fullmatch(self.head(end - 1))):
            end -= 1
        return end

    def head(self, index: int) -> str:
        """The part of line `index` that a header can fill; patterns need not search megabytes."""
        return self.line(index)[:WIDE]

    def fail(self, index: int, message: str, key: str = "") -> RecordError:
        """Return an error that names line `index` (from 0), and the key of the entry that is to be mended."""
        return RecordError(f"{self.path}: line {index + 1}: {message}", key)

    def integer(self, text: str, index: int, name: str) -> int:
        """Read one whole number of the header, without what else int() takes: 1_000, digits beyond ASCII."""
        word = text.strip()
        try:
            if "_" in word or not word.isascii():
                raise ValueError(word)
            return int(word)
        except ValueError:  # also more digits than Python turns into a number
            raise self.fail(index, f"{name}: expected a whole number, got {word[:40]!r}") from None

    def real(self, text: str, index: int, name: str) -> float:
        """Read one finite number of the header."""
        try:
            value = _number(text.strip())
        except ValueError:
            raise self.fail(index, f"{name}: expected a number, got {text.strip()[:40]!r}") from None
        if not math.isfinite(value):
            raise self.fail(index, f"{name}: expected a finite number, got {value}")
        return value

    def value(self, word: str, index: int) -> float:
        """Read one sample; "nan" is a gap."""
        try:
            return _number(word)
        except ValueError:
            line = self.lines[index].strip()[:60]
            raise self.fail(index, f"not a row of numbers: {line!r}; mend or remove it") from None

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
        words = split_words(line)
        if len(words) != expected:
            words = [line[i : i + width].strip() for i in range(0, len(line.rstrip()), width)]
        if len(words) != expected:
            raise self.fail(index, f"expected {expected} numbers, got {len(words)}: {line.strip()[:60]!r}")
        return [self.value(word, index) for word in words]

    def free(self, index: int, stop: int | None = None) -> tuple[NDArray[np.float64], list[int]]:
        """Read all numbers from line `index` to `stop`; also the number of values before each line's end."""
        values: list[float] = []
        ends: list[int] = []
        for number in range(index, self.end if stop is None else stop):
            values.extend(self.value(word, number) for word in split_words(self.lines[number]))
            ends.append(len(values))
        return np.array(values), ends


def split_words(line: str) -> list[str]:
    """Split at white space, and where one number runs into the next."""
    return _TOUCHING.sub(" ", line).split()


def iso_time(date: tuple[int, int, int], hour: float, minute: float, second: float) -> str:
    """ISO 8601 of a date (day 1 to 366 of month 1, or of the month) and time; "" for what is no date."""
    year, month, day = date
    clock = 0 <= hour <= 24 and 0 <= minute <= 60 and 0 <= second <= 61
    if not (clock and 1800 < year < 3000 and 1 <= month <= 12 and 1 <= day <= 366):
        return ""
    start = datetime(year, month, 1) + timedelta(days=day - 1)
    if month > 1 and start.month != month:
        return ""  # 31 February
    return (start + timedelta(hours=hour, minutes=minute, seconds=second)).isoformat()


def _number(word: str) -> float:
    """Read a number with Fortran's exponents, but nothing else that float() takes: 1_000, infinity."""
    if NUMBER.fullmatch(word) is None:
        raise ValueError(word)
    return float(word.upper().replace("D", "E"))


def read_text(path: Path, padded: bool = False) -> TextFile:
    """Read a text file; `padded` says that NUL may fill its end, as old tapes left it.

    Raises
    ------
    RecordError
        for a file that is missing, unreadable, empty, larger than 200 MB, binary, or of no known kind.
    """
    content = decode(read_bytes(path)).rstrip("\x1a")  # DOS ended texts with Ctrl-Z
    lines = (content.rstrip("\x00\n") + "\n" if padded else content).split("\n")
    for number, line in enumerate(lines, start=1):
        if "\x00" in line:
            raise RecordError(f"{path}: line {number}: binary data where text was expected; not this format")
    return TextFile(path, lines if lines[-1] else lines[:-1])


def decode(data: bytes) -> str:
    """Text of a file or its start: as its byte-order mark says, else UTF-8, else the Latin-1 of old agencies.

    Line ends of every system, and spaces and minus signs of word processors, become plain ones.
    """
    mark = next((mark for mark in _BOMS if data.startswith(mark)), b"")
    coding = _BOMS.get(mark, "utf-8")
    try:  # the last character may be cut
        text = codecs.getincrementaldecoder(coding)().decode(data[len(mark) :])
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    for end in ("\r\r\n", "\r\n", "\r"):
        text = text.replace(end, "\n")
    return text.translate(_PLAINER)


def read_bytes(path: Path, most: int = -1) -> bytes:
    """Read a whole file, or its first `most` bytes, with errors that name it.

    Raises
    ------
    RecordError
        for what is no ordinary file, larger than 200 MB, empty, packed, or an office document.
    """
    if not os.path.exists(path):  # false also for names that no file can have
        location, near, folder = str(path).replace("\0", "\\0"), list[str](), path.parent
        with suppress(OSError, ValueError):
            near = difflib.get_close_matches(
                path.name, [file.name for file in folder.iterdir()], n=3, cutoff=0.5
            )
        remedy = f"; near it is {', '.join(near)}" if near else "; check the path"
        raise RecordError(f"{location}: cannot be read (No such file or directory){remedy}")
    check_file(path, MAX_BYTES, RecordError)
    try:
        with path.open("rb") as file:
            data = file.read(most)
    except OSError as error:
        raise RecordError(f"{path}: cannot be read ({error.strerror or error})") from None
    if not data.strip():
        raise RecordError(f"{path}: line 1: the file is empty; fetch it again")
    for start, what in _FOREIGN.items():
        if data.lstrip(b"\xef\xbb\xbf \t\r\n" if start == b"<" else b"").startswith(start):
            raise RecordError(f"{path}: line 1: the file is {what}")
    return data


def acceleration_unit(word: str) -> str:
    """A file's unit in romdam's spelling; "" for anything else, however much of it looks like a unit."""
    text = re.sub(r"\s|\^|\*\*|·", "", word.lower()).strip(".").replace("²", "2").replace("⁻", "-")
    text = text.replace("sec", "s").replace("/s/s", "/s2").replace("s*s", "s2")
    return _ACCELERATIONS.get(text, "")


def check_peak(text: TextFile, index: int, stated: float, measured: float, digit: float = 0.0) -> None:
    """Refuse data whose peak is not the one that line `index` states.

    Parameters
    ----------
    stated, measured : in one unit, of any sign
    digit : the last one printed

    Raises
    ------
    RecordError
        naming both.
    """
    most = max(abs(stated), abs(measured))
    if abs(abs(stated) - abs(measured)) > PEAK_SHARE * most + digit:
        raise text.fail(
            index,
            f"a peak of {abs(stated):g} is stated, the data's is {abs(measured):g}; the file is altered or "
            "the unit wrong, fetch it again",
        )


def check_length(text: TextFile, index: int, stated: float, count: int, dt: float, slack: float) -> None:
    """Refuse data whose length is not the one that line `index` states.

    Parameters
    ----------
    stated : length [s]; agencies count n or n - 1 steps
    count : samples in the file
    dt : [s]
    slack : what rounding explains [s]

    Raises
    ------
    RecordError
        naming both.
    """
    if not (count - 1) * dt - slack <= stated <= count * dt + slack:
        raise text.fail(
            index,
            f"a length of {stated:g} s is stated, but {count} samples at dt = {dt:g} s are {count * dt:g} s; "
            "the file is cut short or altered, fetch it again",
        )
