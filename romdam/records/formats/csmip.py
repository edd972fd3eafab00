"""CSMIP V2, CGS's and CDMG's format before COSMOS: acceleration, velocity, displacement per channel.

Header lengths differ between vintages, so the reader looks for the line that announces the data:
"  2800 points of accel data equally spaced at  .020 sec, in cm/sec2.  (8f10.3)".

References
----------
Shakal and Huang (1985), Standard tape format for CSMIP strong-motion data tapes, CDMG OSMS 85-03.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from romdam.core.errors import RecordError
from romdam.records.channel import Channel, Orientation, parse_orientation
from romdam.records.formats.stated import acceleration_unit, check_peak
from romdam.records.formats.text import WIDE, TextFile, read_text

_DATA = re.compile(
    r"^\s*(\d+)\s+points of (accel|veloc|displ)\w* data equally spaced at\s*([\d.]+)\s*sec(.*)$", re.I
)
_ALMOST = re.compile(r"\d\s+points of (accel|veloc|displ)\w* data\b", re.I)
_END = re.compile(r"end of data for chan", re.I)
_UNIT = re.compile(r"[.,\s]*\(?(?:in|units?\s*[=:])\s+(.*?)\s*\)?[\s.]*(?:\(.*)?", re.I)
_PEAK = re.compile(r"^\s*Peak\s+acceleration\s*=\s*([-+]?\d*\.?\d+)\s*([A-Za-z/^*\d]+)", re.I)
_FORTRAN = re.compile(r"\(\s*(\d*)[FEG](\d+)", re.I)
_CHANNEL = re.compile(r"Chan\s*(\d+)\s*:?\s*(.*)$", re.I)


_BAND = re.compile(r"3 dB pts at\s+(\d*\.\d+)\s+and\s+(\d*\.\d+)", re.I)


@dataclass(frozen=True)
class _About:
    number: str
    orientation: Orientation | None
    meta: dict[str, object]


def is_csmip(head: str) -> bool:
    """Tell whether the start of a file looks like CSMIP's V2."""
    lines = head.splitlines()
    return any(_DATA.match(line) for line in lines) and re.match(r"\s*corrected", lines[0], re.I) is not None


def read_csmip(path: Path) -> list[Channel]:
    """Read every acceleration channel of the file.

    Raises
    ------
    RecordError
        for a count that is not met or a unit that is not stated.
    """
    text = read_text(path)
    channels: list[Channel] = []
    header = index = 0
    length = 0.0  # of the channel's acceleration, which its velocity and displacement share [s]
    while index < len(text.lines):
        match = _DATA.match(text.head(index))
        if match is None:
            if _ALMOST.search(text.head(index)):
                raise text.fail(index, f"not as CSMIP announces data: {text.lines[index].strip()[:60]!r}")
            index += 1
            continue
        about = _about([text.head(i) for i in range(header, index)])
        length = _check_length(text, index, match, length)
        channel, index = _read_block(text, index, match, about)
        if channel is not None:
            _check_peak(text, header, channel)
            channels.append(channel)
        header = index
    if not channels:
        raise RecordError(f'{path}: line 1: no "points of accel data" in it; the file is cut short')
    ends = sum(_END.search(line[:WIDE]) is not None for line in text.lines)
    if ends not in (0, len(channels)):
        raise RecordError(
            f"{path}: line {len(text.lines)}: {ends} ends of channels, but {len(channels)} channels with "
            "acceleration; the file is cut short or altered"
        )
    return channels


def _read_block(
    text: TextFile, index: int, match: re.Match[str], about: _About
) -> tuple[Channel | None, int]:
    count, dt = text.integer(match[1], index, "points"), text.real(match[3], index, "interval")
    form = _FORTRAN.search(match[4])
    per_row, width = (int(form[1] or 1), int(form[2])) if form else (8, 10)
    if not (count >= 1 and 0.0 < dt < 10.0 and 1 <= per_row <= 100 and 1 <= width <= 40):
        raise text.fail(index, f"{count} points at {dt:g} s in rows of {per_row}: not a CSMIP record")
    values = text.numbers(index + 1, count, per_row, width)
    end = index + 1 - (-count // per_row)
    _check_end(text, end)
    if match[2].lower() != "accel":
        return None, end
    meta = {"format": "CSMIP", "level": "V2", "processed": True, **about.meta}
    unit = _unit(text, index, match[4])
    return Channel(about.number, values, dt, unit, about.orientation, "", meta), end


def _check_length(text: TextFile, index: int, match: re.Match[str], length: float) -> float:
    """The length that the line announces, for acceleration; else it must be that of the acceleration."""
    found = text.integer(match[1], index, "points") * text.real(match[3], index, "interval")
    if match[2].lower() == "accel":
        return found
    if length and abs(found - length) > 0.01 * length:
        lengths = f"{found:g} s of {match[2].lower()} beside {length:g} s of accel"
        raise text.fail(index, f"{lengths}; a count or an interval is wrong")
    return length


def _check_peak(text: TextFile, header: int, channel: Channel) -> None:
    """Hold "Peak acceleration = ..." of the lines from `header` on against the data behind them."""
    from romdam.config.sections.motions.records import unit_in_si

    for index in range(header, len(text.lines)):
        if _DATA.match(text.head(index)):
            return
        if match := _PEAK.match(text.head(index)):
            unit = acceleration_unit(match[2])
            if not unit:
                raise text.fail(index, f"the peak's unit {match[2]!r} is no acceleration")
            stated = text.real(match[1], index, "peak") * unit_in_si(unit) / unit_in_si(channel.unit)
            check_peak(text, index, stated, float(np.nanmax(np.abs(channel.data), initial=0.0)), 1e-3)


def _check_end(text: TextFile, index: int) -> None:
    """A row of numbers where the next block or the end mark should be means a wrong count."""
    if index < len(text.lines) and re.fullmatch(r"[-+\d\s]*\.[-+.\d\s]*", text.lines[index]):
        raise text.fail(index, "data after the announced number of points; altered file")


def _unit(text: TextFile, index: int, rest: str) -> str:
    match = _UNIT.fullmatch(rest)
    unit = acceleration_unit(match[1]) if match else ""
    if not unit:
        raise text.fail(index, f"no unit of acceleration that is known in {rest.strip()[:40]!r}")
    return unit


def _about(header: list[str]) -> _About:
    """Read the lines above a channel's data: "58667-L2866-14236.52  Concord   Chan  1: 90 Deg"."""
    titles = [line for line in header if _CHANNEL.search(line)]
    match = _CHANNEL.search(titles[-1]) if titles else None
    if match is None:
        return _About("1", None, {})
    number, _, name = titles[-1][: match.start()].strip().partition(" ")
    meta: dict[str, object] = {"station": number.partition("-")[0], "station_name": name.strip()}
    for line in header:
        if band := _BAND.search(line):
            meta |= {"hp_corner_hz": float(band[1]), "lp_corner_hz": float(band[2])}
    word = re.sub(r"\s*deg\w*", "", match[2].strip(), flags=re.I).split("  ")[0]
    return _About(match[1], parse_orientation(word), meta)
