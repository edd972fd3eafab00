"""CSMIP V1 and V2, CGS's and CDMG's format before COSMOS.

V1 has uncorrected accelerations, V2 corrected ones and their velocities and displacements, which are not
read. A file is a sequence of channels: a header, then numbers in the columns of a Fortran format, then
perhaps a mark "end of data for channel". Header lengths differ between vintages, so the reader looks for the
line that announces the data:
"  2800 points of accel data equally spaced at  .020 sec, in cm/sec2.  (8f10.3)" or, in V1,
" 13200 Accelerogram points at 200 pts/sec in units of g .      Format: (8f9.6)". V1 of digitized film
announces nothing: pairs of a time and a value in g/10 follow the 100 integers and 50 reals of its header.
RENADIC (Chile) writes that too.

What a header says of count, length and peak is held against the numbers. Numbers behind the announced count,
and lines behind the last channel that announce no data, are refused: the count is wrong or the file altered.

References
----------
Shakal and Huang (1985), Standard tape format for CSMIP strong-motion data tapes, CDMG OSMS 85-03.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from romdam.core.errors import RecordError
from romdam.records.channel import Channel, Orientation, parse_orientation
from romdam.records.formats.text import WIDE, TextFile, acceleration_unit, check_length, check_peak, read_text
from romdam.records.processing.resampling import even_series

_DATA = re.compile(
    r"^\s*(\d+)\s+points of (accel|veloc|displ)\w* data equally spaced at\s*([\d.]+)\s*sec(.*)$", re.I
)
_POINTS = re.compile(r"^\s*(\d+)\s+accelerogram points at\s*([\d.]+)\s*pts/sec\s+(in units of\s.*)$", re.I)
_FIRST = re.compile(r"\s*(un)?corrected accelerogram", re.I)
_PAIRS = re.compile(r"units of uncor acc\w* are sec and\s+([^\s.]+)", re.I)
_COUNT = re.compile(r"no\. of points\s*=\s*(\d+)\s+record length\s*=\s*([\d.]+)\s*sec", re.I)
_MAX = re.compile(r"\bmax\s*=\s*([-+]?\d*\.\d+)\s*g\b", re.I)
TEXT_LINES, INTEGER_LINES, REAL_LINES = 13, 7, 7  # of the header of V1
TIME_DIGIT = 1e-3  # s, as printed
_ALMOST = re.compile(r"\d\s+points of (accel|veloc|displ)\w* data\b", re.I)  # announced in other words
_END = re.compile(r"end of data for (?:station )?chan", re.I)
_RULED_END = re.compile(r"(-{3,})\s*" + _END.pattern, re.I)  # closed by as many dashes
# "in cm/sec2.  (8f10.3)", "(units = g)"
_UNIT = re.compile(r"[.,\s]*\(?(?:in|units?\s*[=:])\s+(.*?)\s*\)?[\s.]*(?:\(.*)?", re.I)
_PEAK = re.compile(r"^\s*Peak\s+acceleration\s*=\s*([-+]?\d*\.?\d+)\s*([A-Za-z/^*\d]+)", re.I)
_FORTRAN = re.compile(r"\(\s*(\d*)[FEG](\d+)", re.I)
_CHANNEL = re.compile(r"Chan\s*(\d+)\s*:?\s*(.*)$", re.I)
_DIRECTION = re.compile(r"\b(?:Up|Down|\d{1,3}\s?Deg)\b")
_BAND = re.compile(r"3 dB pts at\s+(\d*\.\d+)\s+and\s+(\d*\.\d+)", re.I)


@dataclass(frozen=True)
class _Header:
    """What the lines above a channel's data say of it; `number` is the channel's, as printed."""

    number: str
    orientation: Orientation | None
    meta: dict[str, object]


def is_csmip(head: str) -> bool:
    """Tell whether the start of a file looks like CSMIP's V1 or V2."""
    lines = head.splitlines()
    return (
        bool(lines)
        and _FIRST.match(lines[0]) is not None
        and any(_DATA.match(line) or _POINTS.match(line) or _PAIRS.search(line) for line in lines)
    )


def read_csmip(path: Path) -> list[Channel]:
    """Read every acceleration channel of the file.

    Raises
    ------
    RecordError
        for a count that is not met or a unit that is not stated.
    """
    text = read_text(path)
    channels: list[Channel] = []
    header = index = 0  # first line of the present header, and the line to look at
    length = 0.0  # of the channel's acceleration, which its velocity and displacement share [s]
    while index < len(text.lines):
        line = text.head(index)
        points, pairs = _POINTS.match(line), _PAIRS.search(line)
        if pairs and (pairs[1].lower() != "g/10" or index - header >= TEXT_LINES):
            raise text.fail(index, f"pairs of times and values in {pairs[1]}: expected g/10, in each header")
        if points or pairs:
            channel, index = (
                _read_points(text, header, index, points) if points else _read_pairs(text, header)
            )
            channels.append(channel)
            # behind a channel of V1 come its end mark, and the first line of another header or nothing
            while index < len(text.lines) and (
                not text.lines[index].strip() or _END.search(text.head(index))
            ):
                index += 1
            if index < len(text.lines) and _FIRST.match(text.head(index)) is None:
                line = text.head(index).strip()[:60]
                raise text.fail(index, f"expected the next channel, got {line!r}; count not met")
            header = index
            continue
        match = _DATA.match(line)
        if match is None:  # a line of a header
            if _ALMOST.search(text.head(index)):
                raise text.fail(index, f"not as CSMIP announces data: {text.lines[index].strip()[:60]!r}")
            index += 1
            continue
        seconds = text.integer(match[1], index, "points") * text.real(match[3], index, "interval")
        if match[2].lower() == "accel":
            length = seconds
        elif length and abs(seconds - length) > 0.01 * length:
            lengths = f"{seconds:g} s of {match[2].lower()} beside {length:g} s of accel"
            raise text.fail(index, f"{lengths}; a count or an interval is wrong")
        block, index = _read_block(text, header, index, match)
        channels += [] if block is None else [block]
        header = index
    if not channels:
        raise RecordError(f'{path}: line 1: no "points of accel data" in it; the file is cut short')
    # behind the last channel there are end marks only, and as many of them as channels or none
    for i in range(header, len(text.lines)):
        if text.lines[i].strip() and not _END.search(text.head(i)):
            raise text.fail(i, "lines behind the last channel that announce no data; the file is altered")
    last = max(i for i, line in enumerate(text.lines) if line.strip())
    rule = _RULED_END.search(text.head(last))
    cut = rule is not None and not text.head(last).rstrip().endswith(rule[1])
    if cut or (channels[0].meta["level"] == "V1" and _END.search(text.head(last)) is None):
        raise text.fail(last, "the end of the last channel is missing; the file is cut short")
    ends = sum(_END.search(line[:WIDE]) is not None for line in text.lines)
    if ends not in (0, len(channels)):
        raise RecordError(
            f"{path}: line {len(text.lines)}: {ends} ends of channels, but {len(channels)} channels with "
            "acceleration; the file is cut short or altered"
        )
    return _without_doubles(channels)


def _without_doubles(channels: list[Channel]) -> list[Channel]:
    """The channels of a file, each once; a warning says where a file has them twice."""
    kept: list[Channel] = []
    for channel in channels:
        if not any(other.code == channel.code and np.array_equal(other.data, channel.data) for other in kept):
            kept.append(channel)
    if len(kept) == len(channels):
        return channels
    said = f"{len(channels) - len(kept)} of {len(channels)} channels are in the file twice: left out"
    return [replace(kept[0], warnings=(*kept[0].warnings, said)), *kept[1:]]


def _read_block(text: TextFile, header: int, index: int, match: re.Match[str]) -> tuple[Channel | None, int]:
    """Read the "points of accel data" that line `index` announces, None for velocity and displacement.

    The lines from `header` on describe them; "Peak acceleration = ..." among these is held against the data.

    Returns
    -------
    the channel, and the line behind its data
    """
    from romdam.config.sections.motions.records import unit_in_si

    about = _read_header([text.head(i) for i in range(header, index)])
    count, dt = text.integer(match[1], index, "points"), text.real(match[3], index, "interval")
    form = _FORTRAN.search(match[4])
    per_row, width = (int(form[1] or 1), int(form[2])) if form else (8, 10)
    if not (count >= 1 and 0.0 < dt < 10.0 and 1 <= per_row <= 100 and 1 <= width <= 40):
        raise text.fail(index, f"{count} points at {dt:g} s in rows of {per_row}: not a CSMIP record")
    values = text.numbers(index + 1, count, per_row, width)
    end = index + 1 - (-count // per_row)  # rows are rounded up
    # a row of numbers where the next block or the end mark should be means a wrong count
    if end < len(text.lines) and re.fullmatch(r"[-+\d\s]*\.[-+.\d\s]*", text.lines[end]):
        raise text.fail(end, "data after the announced number of points; altered file")
    if match[2].lower() != "accel":
        return None, end
    corrected = re.match(r"\s*uncorrected", text.head(0), re.I) is None
    unit = _unit(text, index, match[4])
    for number in range(header, index):
        if stated := _PEAK.match(text.head(number)):
            peak_unit = acceleration_unit(stated[2])
            if not peak_unit:
                raise text.fail(number, f"the peak's unit {stated[2]!r} is no acceleration")
            stated_peak = text.real(stated[1], number, "peak") * unit_in_si(peak_unit) / unit_in_si(unit)
            check_peak(text, number, stated_peak, float(np.nanmax(np.abs(values), initial=0.0)), 1e-3)
    meta = {"format": "CSMIP", "level": "V2" if corrected else "V1", "processed": corrected, **about.meta}
    return Channel(about.number, values, dt, unit, about.orientation, "", meta), end


def _read_points(text: TextFile, header: int, index: int, match: re.Match[str]) -> tuple[Channel, int]:
    """Read the even samples of V1 that line `index` announces.

    Returns
    -------
    the channel, and the line behind its data
    """
    count, rate = text.integer(match[1], index, "points"), text.real(match[2], index, "points a second")
    form = _FORTRAN.search(match[3])
    per_row, width = (int(form[1] or 1), int(form[2])) if form else (8, 9)
    if not (count >= 1 and 0.1 < rate < 1e5 and 1 <= per_row <= 100 and 1 <= width <= 40):
        raise text.fail(index, f"{count} points at {rate:g} pts/sec in rows of {per_row}: not a CSMIP record")
    values = text.numbers(index + 1, count, per_row, width)
    word = match[3].partition("of")[2].partition("(")[0].partition("Format")[0].strip()
    unit = _unit(text, index, f"in {word}")
    return _v1_channel(text, header, values, 1.0 / rate, unit), index + 1 - (-count // per_row)


def _read_pairs(text: TextFile, header: int) -> tuple[Channel, int]:
    """Read times and values of digitized film, five pairs a line, and interpolate them at an even interval.

    Returns
    -------
    the channel, and the line behind its data
    """
    for index in range(header, header + TEXT_LINES):
        if stated := _COUNT.search(text.head(index)):
            break
    else:
        raise text.fail(header, 'expected "No. of points = ..." among the lines of the header')
    count = text.integer(stated[1], index, "points")
    first = header + TEXT_LINES + INTEGER_LINES + REAL_LINES
    if not 1 <= count < 10**8:
        raise text.fail(index, f"the number of points must be 1 or more, got {count}")
    numbers = text.numbers(first, 2 * count, 10, 7)
    times, points = numbers[::2], numbers[1::2]
    peak = float(np.nanmax(np.abs(points)))
    values, dt, said = even_series(times, points, TIME_DIGIT, f"{text.path}: line {first + 1}")
    length = text.real(stated[2], index, "record length")
    if abs(length - times[-1]) > 1.5 * dt + 2.0 * TIME_DIGIT:
        raise text.fail(index, f"a length of {length:g} s is stated, the times end at {times[-1]:g} s")
    channel = _v1_channel(text, header, values, dt, "0.1 g", peak)
    return replace(channel, warnings=(*channel.warnings, *said)), first - (-2 * count // 10)


def _v1_channel(
    text: TextFile, header: int, values: NDArray[np.float64], dt: float, unit: str, peak: float | None = None
) -> Channel:
    """Make a channel of V1, and hold its header against it.

    Parameters
    ----------
    values : at an even interval
    peak : largest value of the file's points, of which `values` are interpolated; None where they are these
    """
    from romdam.config.sections.motions.records import unit_in_si

    lines = [text.head(header + i) for i in range(TEXT_LINES)]
    measured = float(np.nanmax(np.abs(values))) if peak is None else peak
    for offset, line in enumerate(lines):
        if match := _MAX.search(line):
            stated = text.real(match[1], header + offset, "max")
            check_peak(text, header + offset, stated, measured * unit_in_si(unit) / unit_in_si("g"), 6e-4)
        if (match := _COUNT.search(line)) and peak is None:
            if int(match[1]) != values.size:
                raise text.fail(header + offset, f"{match[1]} points are stated, {values.size} follow")
            check_length(text, header + offset, float(match[2]), values.size, dt, 1.5 * dt)
    about = _read_header(lines)
    meta = {"format": "CSMIP", "level": "V1", "processed": False, **about.meta}
    return Channel(about.number, values, dt, unit, about.orientation, "", meta)


def _unit(text: TextFile, index: int, rest: str) -> str:
    """The unit of acceleration in the rest of line `index`: "in cm/sec2", "(units = g)"."""
    match = _UNIT.fullmatch(rest)
    unit = acceleration_unit(match[1]) if match else ""
    if not unit:
        raise text.fail(index, f"no unit of acceleration that is known in {rest.strip()[:40]!r}")
    return unit


def _read_header(header: list[str]) -> _Header:
    """Read the lines above a channel's data: "58667-L2866-14236.52  Concord   Chan  1: 90 Deg".

    That title has the station, its name, the number of the channel and its direction.
    """
    titles = [line for line in header if _CHANNEL.search(line)]
    match = _CHANNEL.search(titles[-1]) if titles else None
    if match is None:
        return _Header("1", None, {})
    number, _, name = titles[-1][: match.start()].strip().partition(" ")
    meta: dict[str, object] = {"station": number.partition("-")[0], "station_name": name.strip()}
    for line in header:
        if band := _BAND.search(line):
            meta |= {"hp_corner_hz": float(band[1]), "lp_corner_hz": float(band[2])}
    word = re.split(r"\s{2,}", match[2].strip())[0]
    where = parse_orientation(word)
    if where is None:  # a title that is cut at its last column: another line may tell it
        others = {other[0] for line in header for other in _DIRECTION.finditer(line)}
        where = parse_orientation(others.pop()) if len(others) == 1 else None
    return _Header(match[1], where, meta)
