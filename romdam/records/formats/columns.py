"""Plain text of numbers: columns, or one series that is wrapped several values a row.

Such a file says little of itself. What it does say (names with units, comments, a column of times) is held
against the data and against what the configuration declares. Names and rows are split by the same delimiter.
"""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from romdam.records.channel import Channel, NoAccelerationError, Orientation, parse_orientation
from romdam.records.formats.header import LARGEST, Series, check_header, unit_of_peak
from romdam.records.formats.statements import (
    COUNT,
    INTERVAL,
    RATE,
    SECONDS,
    plain_words,
    statements,
    unit_stated,
)
from romdam.records.formats.text import TextFile, acceleration_unit, read_text, split_words

Array = NDArray[np.float64]
COMMENTS = ("#", "%", "!", "//")
DELIMITERS = {"comma": ",", "semicolon": ";", "tab": "\t"}
MANY = 16  # rows; fewer may rise evenly by chance
COARSE = 10.0  # steps; times that are printed more coarsely say nothing of their interval
PLAUSIBLE = (5e-4, 0.1)  # s, of the step of a column that is named time without a unit
RESULTANT = 1e-3  # of the size of a vector, to which a column equals it
RUNS_ON = 1.25  # change along rows over change down columns, below which a table may be a wrapped series
NAMING = 3  # lines next to the rows that may name the columns: names, their units, a rule
MOST_HEADER = 200  # lines of text above columns that are looked through for the first row of numbers
_ROW = re.compile(r"^[\s,;\"]*[-+]?(\d|\.\d|nan\b)[-+.\deEdDnaN,;\s\"]*$")
_REAL = r"((?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
_CLOCK = r"\d{1,2}:\d{2}(?::\d{2}(?:[.,]\d+)?)?"
_DAY = r"\d{4}([-/.])\d{1,2}\1\d{1,2}|\d{1,2}([-/.])\d{1,2}\2\d{4}"
_DATE = re.compile(rf"\b(?:{_DAY})(?:[T ]+{_CLOCK})?(?:Z|[+-]\d\d:?\d\d)?|\b{_CLOCK}(?:Z|\b)")
_SPECTRA = {"psa", "sa", "sv", "sd", "psv", "spectral", "spectrum", "spectra", "fourier", "fas", "rotd"}
_ABSCISSAE = {"period", "periods", "frequency", "frequencies", "freq"}  # of spectra
_NUMERIC = re.compile(r"[-+.\d]|.*(?:\d\.\d|\.\d\d)|[^A-Za-z]*$")  # words that no name begins as
_WORDS = r"(?:(?:ground|base|horizontal|vertical|recorded|raw|corrected|uncorrected|absolute|input|time)\s+)*"
_VALUES = r"(?:accelerations?|accel|accs?|accelerograms?|data|values|samples|amplitudes?)"
_OF_DATA = rf"{_WORDS}{_VALUES}(?:\s+(?:time\s+)?(?:series|histor(?:y|ies)|values|data))?"
_UNIT_WORD = r"[A-Za-z%][A-Za-z%/^*\d.²-]*"
# A clause such as "units: g" or "acceleration units = cm/s2" states the unit of the data ...
_UNIT = re.compile(
    rf"(?:the\s+)?(?:{_OF_DATA}\s+)?units?(?:\s+of\s+(?:the\s+)?{_OF_DATA})?\s*(?:[=:]|\bare\b|\bis\b|\s)\s*"
    rf"((?:\d[\d.]*\s*\*?\s*)?{_UNIT_WORD})\s*[.]?",
    re.I,
)
# ... and so does "acceleration in g", alone in its clause. A unit that prose mentions otherwise does not.
_IN = re.compile(
    rf"(?:the\s+)?{_OF_DATA}\s*(?:\b(?:is|are)\s+)?(?:(?:given\s+)?\bin\s+(?:units?\s+of\s+)?|[\[(])\s*"
    rf"({_UNIT_WORD})\s*[\])]?\s*[.]?",
    re.I,
)
_BRACKETS = re.compile(r"[(\[]\s*([^)\]]*?)\s*[)\]]")
_LENGTH_UNIT = re.compile(r"(?:[mc]?m|in|ft)(?:/s(?:ec)?)?", re.I)
_OTHER_UNIT = re.compile(
    r"(?:[mc]?m|in|ft)(?:/s(?:ec)?)?|s|ms|sec|seconds?|hz|deg|rad|m?v|volts?|[^\s:=]*[A-Za-z][^\s:=]*[/^*][^\s:=]*",
    re.I,
)
_OTHER_NAME = re.compile(r"(?:vel|veloc|velocity|disp|displ|displacement)\b", re.I)
_SPACED_NAME = re.compile(r"\"[^\"]*\"|'[^']*'|[^\s,;()\[\]]+(?:\s*[(\[][^)\]]*[)\]])?")


@dataclass(frozen=True)
class Layout:
    """How the configuration says that a plain text is laid out; None and 0 where it does not.

    Attributes
    ----------
    layout : "columns", or "series" for one series that is wrapped several values a row
    header_lines : lines above the first row of numbers
    delimiter : "blank", "comma", "semicolon" or "tab"
    decimal : "point" or "comma"
    """

    layout: str | None = None
    header_lines: int = 0
    delimiter: str | None = None
    decimal: str = "point"


@dataclass(frozen=True)
class _Table:
    """Rows of numbers, the names above them, what comments say; lines of the first and last row, from 0.

    `values` is (rows, columns), or (values, 1) of a wrapped series. `named_apart` says that a delimiter other
    than blanks parts the names, which prose does not have.
    """

    values: Array
    names: dict[int, str]
    comments: tuple[tuple[int, str], ...]
    first: int
    last: int
    named_apart: bool
    warnings: tuple[str, ...]

    def times(self, number: int, text: TextFile) -> Array:
        """Times (rows,) of column `number`, from 1 [s]."""
        if number > self.values.shape[1]:
            raise text.fail(0, f"time_column is {number}, the file has {self.values.shape[1]} columns")
        name = self.names.get(number - 1, "")
        match = _BRACKETS.search(name)
        unit = match[1].lower().rstrip(".").replace("µ", "u").replace("μ", "u") if match else ""
        if match and unit not in SECONDS:
            if acceleration_unit(unit) or _OTHER_UNIT.fullmatch(unit):
                raise text.fail(0, f"time_column is {number}, which is named {name!r}: no times in s or ms")
            unit = ""
        elif not match:  # time_us
            last = re.split(r"[\s_.]+", name.lower().replace("µ", "u").replace("μ", "u"))[-1]
            unit = last if name.lower() != last and last in SECONDS else ""
        if np.all(np.isnan(self.values[:, number - 1])):
            raise text.fail(
                self.first,
                f"time_column is {number}, which holds dates or clock times, no seconds; give `dt`",
            )
        return (SECONDS[unit] if unit else 1.0) * self.values[:, number - 1]


def undated(line: str) -> str:
    """A row whose dates and clock times, which are no numbers, are NaN."""
    return _DATE.sub("nan", line) if ":" in line or "-" in line or "/" in line else line


def is_columns(head: str) -> bool:
    """Tell whether a file starts with rows of numbers, after comments and at most one line of names."""
    lines = [undated(line) for line in head.splitlines() if line.strip()]
    rows = [line for line in lines if not line.lstrip().startswith(COMMENTS)]
    whole = rows[:-1] or rows  # the last may be cut short
    return "\x00" not in head and any(_ROW.match(row) for row in whole[:2])


def first_row(head: str) -> int | None:
    """Index of the line from which on a text holds rows of numbers alone; None where there are none."""
    lines = [undated(line) for line in head.splitlines()[:-1]]
    if "\x00" in head or not lines:
        return None
    for index in range(min(len(lines), MOST_HEADER)):
        below = [line for line in lines[index : index + MANY] if line.strip()]
        if lines[index].strip() and len(below) >= MANY // 2 and all(_ROW.match(line) for line in below):
            return index
    return None


def read_columns(
    path: Path,
    dt: float | None = None,
    time_column: int | None = None,
    unit: str | None = None,
    layout: Layout | None = None,
) -> list[Channel]:
    """Read a text file of numbers, one channel per column; columns count from 1.

    Parameters
    ----------
    path : the file
    dt : sampling interval [s]; a plain file does not say it
    time_column : column of sample times [s], which then gives dt and is no channel
    unit : declared unit of the values; it counts where prose in a comment says another
    layout : how the numbers stand in the file

    Raises
    ------
    RecordError
        naming file and line, for text that is not a number, rows of different length, uneven times,
        comments or columns that contradict the data or `dt`, and rows that may be one wrapped series.
    """
    text, layout = read_text(path), layout or Layout()
    table = _read_table(text, layout)
    _refuse_spectrum(text, table)
    count, width = table.values.shape
    if time_column is not None:
        times = table.times(time_column, text)
        dt = _even_dt(times, text, table.first)
    taken: tuple[str, ...] = ()
    if dt is None:
        dt, taken = _stated_interval(text, table, layout)
    if dt is None:
        remedy = "give `dt` or `time_column`"
        for i in range(width if count >= MANY else 0):
            if step := _rises(table.values[:, i]):
                remedy = f"column {i + 1} rises evenly by {step:g}: give `time_column: {i + 1}`, or `dt`"
                break
        raise text.fail(0, f"plain text does not say its interval; {remedy}", "dt")
    left, warnings = _not_channels(text, table, dt, time_column)
    warnings = (*taken, *warnings)
    if layout.layout is None and time_column is None and not left:
        _refuse_wrapped(text, table)
    warnings = (*table.warnings, *warnings)
    if amid := [index + 1 for index, _ in table.comments if table.first < index < table.last]:
        warnings = (*warnings, f"line {amid[0]} is a comment amid the rows: two records in one file?")
    if time_column is not None and abs(times[0]) > 1.1 * dt:
        warnings = (*warnings, f"the times begin at {times[0]:g} s, not at 0; is the start cut off?")
    stated, said = _check_comments(text, table, dt, unit)
    columns = [i for i in range(width) if i not in left]
    units = {i: _unit_of_name(table.names.get(i, "")) or stated for i in columns}
    if unit is None and not any(units.values()):  # AFAD says it of its peaks alone
        shown, says = unit_of_peak(table.comments, [table.values[:, i] for i in columns])
        units, said = (dict.fromkeys(columns, shown), (*said, says)) if shown else (units, said)
    fallback = unit or stated or next((units[i] for i in columns if acceleration_unit(units[i])), "")
    series = [Series(table.values[:, i], unit or units[i]) for i in columns]
    said = (*said, *check_header(text, table.comments, series, dt, fallback, layout.decimal == "comma"))
    for i in columns:
        if stated and acceleration_unit(units[i]) and not _same_unit(stated, units[i]):
            said = (*said, f"comments state {stated}, column {i + 1} is named in {units[i]}, which counts")
    where = _directions(table, columns)
    return [
        Channel(
            code=str(i + 1),
            data=table.values[:, i].copy(),
            dt=dt,
            unit=units[i],
            orientation=where.get(i),
            meta={"format": "columns", "column": table.names.get(i, "")},
            warnings=(*warnings, *said),
        )
        for i in columns
    ]


def _read_table(text: TextFile, layout: Layout) -> _Table:
    """Rows as they stand, split by one delimiter; lines that are skipped count as comments."""
    skipped = layout.header_lines
    if skipped >= len(text.lines):
        raise text.fail(
            len(text.lines) - 1, f"`header_lines` is {skipped}, the file has {len(text.lines)} lines"
        )
    comments = [(index, text.head(index)) for index in range(skipped) if text.lines[index].strip()]
    header: int | None = None
    lines: list[tuple[int, str]] = []
    for index in range(skipped, text.end):
        line = undated(text.lines[index])
        if line.lstrip().startswith(COMMENTS):
            comments.append((index, text.head(index)))
        elif line.strip() and not lines and header is None and not _ROW.match(line):
            if statements(line):  # "Time Step: 0.005" names no column
                comments.append((index, text.head(index)))
            else:
                header = index
        elif line.strip():
            lines.append((index, line))
    if not lines:
        raise text.fail(max(0, len(text.lines) - 1), "no row of numbers in it; empty, or of another format")

    # what parts the numbers of the first row: a tab, a semicolon, a comma, or blanks
    marks = ("\t", ";") if layout.decimal == "comma" else ("\t", ";", ",")
    delimiter = next((mark for mark in marks if mark in lines[0][1].strip()), " ")
    if layout.delimiter is not None:
        delimiter = DELIMITERS.get(layout.delimiter, " ")
    if layout.decimal == "point" and layout.delimiter is None:
        # refuse commas for points: no number has a point, and each has one comma within
        numeric = [(index, line) for index, line in lines if _ROW.match(line)]
        marked = [index for index, line in numeric if "," in line]
        words: list[str] = []
        if marked and not any("." in line for _, line in numeric):
            words = [word for _, line in numeric for word in re.split(r"[;\s]+|\",\"", line) if "," in word]
        if words and all(re.search(r"^\"?[^,]*\d,\d[^,]*\"?$", word) for word in words):
            other = "" if delimiter in ";\t" else ", or `delimiter: comma` if it parts two columns"
            raise text.fail(
                marked[0], f"is the comma of {words[0]!r} a decimal one? Then declare `decimal: comma`{other}"
            )
    rows: list[tuple[int, list[float]]] = []
    for index, line in lines:
        cells = _split(line, delimiter)
        if layout.decimal == "comma":
            if any("." in cell for cell in cells):
                raise text.fail(index, f"a point in {line.strip()[:60]!r}, but `decimal: comma` is set")
            cells = [cell.replace(",", ".") for cell in cells]
        rows.append((index, [text.value(cell, index) if cell else np.nan for cell in cells]))
    first, last = rows[0][0], rows[-1][0]

    # the number of values above them is no sample
    word = split_words(text.lines[first].replace(",", " ").replace(";", " "))[0]
    behind = [text.lines[index].split()[0] for index, _ in rows[1:4]]
    alone = word.isdigit() and int(word[:9]) >= 10 and bool(behind)
    held = sum(len(row) for _, row in rows[1:])
    if alone and (all("." in other for other in behind) or rows[0][1][0] in (len(rows) - 1, held)):
        raise text.fail(
            first,
            f"{word[:40]} looks like the number of values that follow ({held} in {len(rows) - 1} rows), not "
            f"like a sample; skip it by `header_lines: {first + 1}`, delete it or make it a comment",
        )

    warnings: tuple[str, ...] = ()
    width, held = len(rows[0][1]), sum(len(row) for _, row in rows)
    series = layout.layout == "series"
    counts = {
        int(stated.value)
        for _, line in comments
        for stated in statements(line, decimal_comma=layout.decimal == "comma")
        if stated.kind == COUNT
    }
    if layout.layout is None and len(rows) < held and held in counts:
        series = True
        warnings = (f"{held} values are stated: read as one series of {width} in a row",)
    for index, row in rows[1:]:
        if len(row) == width or (series and len(row) < width and index == last):
            continue
        if series:
            raise text.fail(
                index,
                f"{len(row)} numbers, the rows of the series above have {width}; a number is lost or added",
            )
        if layout.layout is None and index == last and width > 2 and len(row) < width:
            raise text.fail(
                index,
                f"{len(row)} numbers, all rows above have {width}: one series written {width} in a row? Then "
                "declare `layout: series`; else the file is cut short",
            )
        numbers = "1 number" if len(row) == 1 else f"{len(row)} numbers"
        raise text.fail(index, f"{numbers}, the rows above have {width}; mend or remove the row")
    if series:
        values = np.array([value for _, row in rows for value in row])[:, None]
        return _Table(values, {}, tuple(comments), first, last, False, warnings)
    above = [(index, line) for index, line in comments if index < first]
    names, warnings = _column_names(text, header, above, skipped, delimiter, width)
    if header is not None and not names and not _BRACKETS.search(text.head(header)):  # a title, no names
        comments.append((header, text.head(header)))
    values = np.array([row for _, row in rows])
    return _Table(values, names, tuple(comments), first, last, delimiter != " ", warnings)


def _column_names(
    text: TextFile,
    header: int | None,
    above: list[tuple[int, str]],
    skipped: int,
    delimiter: str,
    width: int,
) -> tuple[dict[int, str], tuple[str, ...]]:
    """Names of `width` columns, and what is said where a line of names does not name every one.

    Parameters
    ----------
    header : line of text between comments and rows; a first row with a damaged number is no line of names
    above : comments and skipped lines above the rows; a comment names columns only where it states units
    skipped : number of lines that the configuration skips
    """
    if header is not None:
        line = text.head(header)
        if any(_NUMERIC.match(word) for k, word in enumerate(_split(line, delimiter)) if word or k):
            raise text.fail(
                header, f"not a row of numbers, nor one of names: {line.strip()[:60]!r}; mend or remove it"
            )
        names = _parse_names(line, delimiter, width)
        if width == 1 and not names:  # "acc in g"
            names = {0: line.strip()}
        if names or not _BRACKETS.search(line):
            return names, ()
        counted = f"{width} column{'s' * (width > 1)}"
        return {}, (f"line {header + 1} does not name {counted}: none of its names counts",)
    best: dict[int, str] = {}
    for index, line in reversed(above[-NAMING:]):
        names = _parse_names(line.lstrip(" \t#%!/"), delimiter, width)
        if any(_BRACKETS.search(name) for name in names.values()):
            return names, ()
        if index < skipped and not best:
            best = names
        if index >= skipped:
            break  # only the comment next to the rows
    return best, ()


def _split(line: str, delimiter: str) -> list[str]:
    """The cells of a line, quotes taken off; a delimiter at the end closes the last one."""
    if delimiter == " ":
        return [word.strip("\"'") for word in split_words(line)]
    line = line.strip(" ")
    try:
        read = csv.reader([line], delimiter=delimiter, skipinitialspace=True)
        cells = [cell.strip() for cell in (next(read) if '"' in line else line.split(delimiter))]
    except csv.Error:
        return [line]
    return cells[:-1] if len(cells) > 1 and not cells[-1] else cells


def _parse_names(line: str, delimiter: str, width: int) -> dict[int, str]:
    """Names split by the rows' delimiter; none where they are not as many as the columns, or numbers.

    Where blanks part the rows, two blanks or more part the names if there are any; else each name is one
    word, which its unit may follow in brackets. "Raw acc (g)" may then be two names: each must have a unit.
    """
    names = _split(line, delimiter)
    if delimiter == " ":
        names = re.split(r"\s{2,}|\t", line.strip())
        if len(names) == 1:
            names = _SPACED_NAME.findall(line)
            apart = [" " in name and bool(_BRACKETS.search(name)) for name in names]
            if any(apart) and not all(_BRACKETS.search(name) for name in names):
                return {}
        names = [name.strip("\"'") for name in names]
    if len(names) != width or any(_NUMERIC.match(name) for k, name in enumerate(names) if name or k):
        return {}
    if width > 1 and all(
        acceleration_unit(name) or name.lower() in ("", *SECONDS) or _LENGTH_UNIT.fullmatch(name)
        for name in names
    ):  # a line of units below the names
        names = [f"({name})" for name in names]
    return dict(enumerate(names))


def _unit_of_name(name: str) -> str:
    """The unit in a column's name: "acc (cm/s2)", "a[g]", "acc_g"; "" where there is none."""
    words = [word for word in _BRACKETS.findall(name) if word]
    pieces = re.split(r"[\s_.,:;()\[\]-]+|\bin\b", re.sub(r"[(\[].*", "", name).strip())
    pieces = [piece for piece in pieces if piece]
    titled = " " in name.strip() and not re.search(r"\b(?:a|acc|acel)", name, re.I)  # "Record of Dam G"
    if len(pieces) > 1 and not titled:  # acc_g, acc in g, acc_ms2, acc_m_s2
        words += [tail for tail in (pieces[-1], "/".join(pieces[-2:])) if acceleration_unit(tail)][:1]
    units = list(dict.fromkeys(filter(None, map(acceleration_unit, words))))
    if len(units) == 1:
        return units[0]
    if units:
        return " or ".join(units)  # no unit: the record is refused
    others = [word for word in words if _OTHER_UNIT.fullmatch(word)]
    others += ["velocity or displacement"] if _OTHER_NAME.match(name) else []
    return others[0] if others else ""


def _rises(column: Array) -> float:
    """The step of a column that rises evenly, as far as its printed digits tell; 0 where it does not."""
    steps = np.diff(column)
    step = float((column[-1] - column[0]) / steps.size)
    if not (step > 0.0 and np.min(steps) >= 0.0):
        return 0.0
    away = np.abs(column - column[0] - step * np.arange(column.size))
    if np.max(np.abs(steps - step)) <= 0.1 * step:  # evenly, and no drift that is not of its digits
        return step
    printed = float(np.min(steps[steps > 0.0]))
    return step if printed <= COARSE * step and np.max(away) <= 1.01 * printed else 0.0


def _stated_interval(text: TextFile, table: _Table, layout: Layout) -> tuple[float | None, tuple[str, ...]]:
    """The interval that the header states, or a column that is named as times in s; what is said of it."""
    for index, line in table.comments:
        for stated in statements(line, decimal_comma=layout.decimal == "comma"):
            if stated.kind in (INTERVAL, RATE) and stated.value > 0.0:
                dt = stated.value if stated.kind == INTERVAL else 1.0 / stated.value
                return dt, (f"dt = {dt:g} s is taken from line {index + 1}: {stated.text}",)
    for i, name in table.names.items():
        unit, named = _BRACKETS.search(name), plain_words(name)
        step = _rises(table.values[:, i]) if len(table.values) >= MANY else 0.0
        timed = unit is not None and unit[1].lower().rstrip(".") in SECONDS
        bare = unit is None and named in (["time"], ["t"]) and PLAUSIBLE[0] <= step <= PLAUSIBLE[1]
        if step and (timed or bare):
            dt = _even_dt(table.times(i + 1, text), text, table.first)
            return dt, (f"dt = {dt:g} s is that of column {i + 1}, which is named {name!r}",)
    return None, ()


def _directions(table: _Table, columns: list[int]) -> dict[int, Orientation]:
    """Directions of columns: of their names, or of a line above the rows that has as many as there are."""
    found = {}
    for i in columns:
        if (name := table.names.get(i, "")) and (where := _direction_of(name)):
            found[i] = where
    if found:
        return found
    near = [line for index, line in table.comments if index < table.first][-NAMING:]
    labelled = [line for _, line in table.comments if re.search(r"\b(?:comp|direction|chan)", line, re.I)]
    for line in (*reversed(near), *labelled):
        words = re.findall(r"(?<![\w-])[A-Za-z]+(?:-[A-Za-z])?(?=\(\+\)|[\s,;:()/]|$)", line)
        places = [where for where in map(_direction_of_word, words) if where]
        if len(places) == len(columns):
            return dict(zip(columns, places, strict=True))
    return {}


def _direction_of(name: str) -> Orientation | None:
    """The direction that a column's name states: "UD(gal)", "acc EW", "N-S"."""
    plain = re.sub(r"[(\[].*", "", name).strip(" :=_")
    words = [plain, *re.split(r"[\s_.]+", plain)] if plain else []
    return next((where for where in map(_direction_of_word, words) if where), None)


def _direction_of_word(word: str) -> Orientation | None:
    """A direction in letters; D, S, V and W alone are displacement, spectrum, velocity and many more."""
    if not word.replace("-", "").isalpha() or word.upper() in ("D", "S", "V", "W", "U-", "VER", "SA"):
        return None
    if word.lower() == word and len(word) < 2:  # a sentence's letters
        return None
    return parse_orientation(word)


def _not_channels(
    text: TextFile, table: _Table, dt: float, time_column: int | None
) -> tuple[set[int], tuple[str, ...]]:
    """Columns that hold times, row numbers or sums, and what is said of it: what never falls is no motion."""
    count, width = table.values.shape
    left = set() if time_column is None else {time_column - 1}
    said: list[str] = []
    if _DATE.search(text.lines[table.first]):
        for i in np.flatnonzero(np.all(np.isnan(table.values), axis=0)).tolist():
            left.add(i)
            said.append(f"column {i + 1} holds dates or clock times: left out")
    if count < MANY:
        return left, tuple(said)
    if width == 1 and table.values[0, 0] == dt:
        said.append("the first value equals `dt`; is it a header's?")
    for i in range(width):
        column = table.values[:, i]
        if i in left or not np.all(np.diff(column) >= 0.0) or column[-1] == column[0]:
            continue
        step = _rises(column)
        if width == 1 and step:
            raise text.fail(table.first, f"the only column rises evenly by {step:g}: times, not a motion")
        if width == 1:
            said.append("the only column never falls: times or a sum, not a motion?")
            continue
        if step and step != 1.0 and abs(step - dt) > 2e-3 * dt and time_column is None:
            raise text.fail(
                table.first,
                f"column {i + 1} rises by {step:g} from row to row as times do, `dt` is {dt:g} s; give "
                f"`dt: {step:g} s`, or `time_column: {i + 1}` in its place, or take the column out",
            )
        left.add(i)
        how = f"rises evenly by {step:g}" if step else "never falls"
        said.append(f"column {i + 1} {how}: taken for times or numbers, not for a motion")
    rest = [i for i in range(width) if i not in left]
    sound = len(rest) >= 3 and bool(np.all(np.abs(table.values[:, rest]) < LARGEST))
    for i in rest if sound else ():
        others = table.values[:, [k for k in rest if k != i]]
        total = np.sqrt(np.sum(others**2, axis=1))
        if np.all(table.values[:, i] >= 0.0) and np.allclose(
            table.values[:, i], total, rtol=RESULTANT, atol=RESULTANT * float(np.nanmax(total))
        ):
            left.add(i)
            said.append(f"column {i + 1} is the size of the other columns' vector: left out")
    if len(left) == width:
        raise text.fail(table.first, "every column rises as times do; none is a motion")
    return left, tuple(said)


def _refuse_spectrum(text: TextFile, table: _Table) -> None:
    """Refuse columns that are named as those of a spectrum.

    Raises
    ------
    NoAccelerationError
    """
    names = {i: set(plain_words(re.sub(r"(?<=[a-zA-Z])\d+", "", name))) for i, name in table.names.items()}
    first = names.get(0, set())
    spectral = [i for i, words in names.items() if words & _SPECTRA]
    if spectral or (first & _ABSCISSAE and len(names) > 1):
        name = table.names[spectral[0] if spectral else 0]
        raise NoAccelerationError(
            f"{text.path}: line {table.first}: column {name!r} is of a spectrum, no motion; take the record"
        )


def _refuse_wrapped(text: TextFile, table: _Table) -> None:
    """Refuse columns that may be one series: they run on from number to number as from row to row.

    Raises
    ------
    RecordError
        unless names, parted by more than blanks, say that they are columns.
    """
    count, width = table.values.shape
    if width == 1 or not np.all(np.isfinite(table.values)):
        return
    along, down = (
        np.mean(np.abs(np.diff(table.values.ravel()))),
        np.mean(np.abs(np.diff(table.values, axis=0))),
    )
    if (count >= MANY and along >= RUNS_ON * down) or (table.names and table.named_apart):
        return
    if table.names and along >= down:
        return
    raise text.fail(
        table.first,
        f"is this one series written {width} in a row, or {width} columns? They change by {along:.3g} along "
        f"a row and by {down:.3g} down a column; declare `layout: series` or `layout: columns`",
    )


def _check_comments(
    text: TextFile, table: _Table, dt: float, declared: str | None
) -> tuple[str, tuple[str, ...]]:
    """Return the unit that comments state, and what is said of it.

    A keyed statement ("units: g") stands against the configuration; prose ("acceleration in g") gives way to
    it, with a warning.
    """
    units: dict[str, int] = {}
    mentioned: dict[str, int] = {}
    keyed = ""
    for index, line in table.comments:
        matched = False
        for clause in re.split(r"[,;]|\.\s", line.strip().lstrip("#%!/ \t")):
            if match := _UNIT.fullmatch(clause.strip()):
                unit = acceleration_unit(match[1])
                if not unit and match[1].lower() not in ("", *SECONDS, "hz"):
                    odd = _OTHER_UNIT.fullmatch(match[1]) or re.search(r"\d", match[1])
                    unit = match[1] if odd else ""
                keyed = unit or keyed
            elif match := _IN.fullmatch(clause.strip()):
                unit = acceleration_unit(match[1])
            else:
                continue
            if unit:
                matched = True
                units.setdefault(unit, index)
        if not matched:
            unit, is_keyed = unit_stated(line)
            if unit and is_keyed:
                keyed = unit
                units.setdefault(unit, index)
            elif unit:
                mentioned.setdefault(unit, index)
    if len(units) > 1:
        lines = ", ".join(f"{unit} in line {index + 1}" for unit, index in units.items())
        if declared is None:
            raise text.fail(table.first, f"comments state two units, {lines}; give `unit`")
        return "", (f"comments state two units, {lines}; `unit` {declared} counts",)
    unit = next(iter(units), "")
    if unit and not keyed and declared is not None and not _same_unit(unit, declared):
        return "", (f"line {units[unit] + 1} says {unit}, `unit` {declared} counts",)
    counts = declared or unit
    said = tuple(
        f"line {index + 1} mentions {other}, the unit {counts} counts"
        for other, index in mentioned.items()
        if counts and not _same_unit(other, counts)
    )
    return unit, said


def _same_unit(unit: str, declared: str) -> bool:
    from romdam.config.sections.motions.records import unit_in_si

    try:
        return abs(unit_in_si(unit) / unit_in_si(declared) - 1.0) < 0.005
    except ValueError:
        return False


def _even_dt(time: Array, text: TextFile, first: int) -> float:
    """The interval of a time column; a tenth of a step may be lost in its printed digits."""
    steps = np.diff(time)
    if steps.size == 0 or not np.all(np.isfinite(steps)):
        raise text.fail(first, "a time column needs two finite values or more")
    dt = float((time[-1] - time[0]) / steps.size)
    worst = int(np.argmax(np.abs(steps - dt)))
    rising = steps[steps > 0.0]
    printed = float(np.min(rising)) if rising.size else 1.0
    rounded = np.allclose(time, printed * np.round(time / printed), rtol=0.0, atol=1e-3 * printed)
    if time.size >= MANY and rounded and abs(steps[worst] - dt) > 0.1 * dt and _rises(time):
        raise text.fail(
            first,
            f"the times are printed to {printed:g} s, too coarse for their interval of {dt:g} s on average; "
            f"give `dt: {dt:g} s` in place of `time_column`",
        )
    if dt <= 0.0 or abs(steps[worst] - dt) > 0.1 * dt:
        raise text.fail(
            first + worst + 1,
            f"uneven sampling: a step of {steps[worst]:g} s, on average {dt:g} s; resample the record to an "
            "even interval first",
        )
    away = time - time[0] - dt * np.arange(time.size)
    worst = int(np.argmax(np.abs(away)))
    if abs(away[worst]) > 0.1 * dt:
        raise text.fail(
            first + worst,
            f"uneven sampling: {time[worst]:g} s is {away[worst] / dt:.2g} of a step off an even interval of "
            f"{dt:g} s; resample the record to an even interval first",
        )
    return dt
