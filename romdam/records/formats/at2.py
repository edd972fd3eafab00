"""PEER AT2: a header that ends with NPTS and DT, then acceleration in g.

PEER's headers, the old database's and NGA-West2's, have four lines. Files of OpenSees' examples and others
have more lines of prose above "NPTS=..., DT=...".

References
----------
PEER Strong Motion Database (2000) and PEER NGA-West2 Database (Ancheta et al., PEER 2013/03), file headers.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from romdam.core.errors import RecordError
from romdam.records.channel import Channel, NoAccelerationError, Orientation, parse_orientation
from romdam.records.formats.header import Series, check_header
from romdam.records.formats.statements import unit_stated
from romdam.records.formats.text import TextFile, acceleration_unit, read_text

HEADER_LINES = 4
MOST_HEADER = 10  # lines, with prose above the last
_KEYED = re.compile(r"^\s*NPTS\s*=\s*([^,\s]+)\s*,?\s*DT\s*=\s*(.*)$", re.IGNORECASE)
_BARE = re.compile(r"^\s*(\S+)[\s,]+(\S+)\s+NPTS\s*,\s*DT[\s.,;]*$", re.IGNORECASE)
_TIME = re.compile(r"(\S*?[\d.])\s*([A-Za-z]*)[.]?\s*(?:[,;].*|-?\d+\s+POLES?\b.*)?", re.IGNORECASE)
_SECONDS = {"": 1.0, "S": 1.0, "SEC": 1.0, "SECS": 1.0, "SECONDS": 1.0, "MSEC": 1e-3, "MS": 1e-3}
_UNITS = re.compile(r"UNITS\s+OF\s+(.*?)(?:[.,;]\s+(FILTER\s+POINTS\b.*))?$", re.IGNORECASE)
_UNITS_ARE = re.compile(r"\bunits?\s+(?:are|is|[:=])\s*\(?\s*([^\s()]+)", re.IGNORECASE)
_ALL_NUMBERS = re.compile(r"[-+.\dEeDd\s,]*")
_FILTER = re.compile(r"\b(HP|LP)\s*=\s*([0-9.]+)", re.IGNORECASE)
_SERIES = re.compile(r"(ACCELERATION|VELOCITY|DISPLACEMENT)\s+TIME\s+(SERIES|HISTORY)", re.IGNORECASE)


def is_at2(head: str) -> bool:
    """Tell whether the start of a file looks like PEER's."""
    lines = head.splitlines()[:MOST_HEADER]
    if len(lines) < HEADER_LINES:
        return False
    if _SERIES.search(lines[2]) and (
        re.search(r"NPTS", lines[3], re.I) or lines[0].upper().startswith("PEER")
    ):
        return True
    last = next((index for index, line in enumerate(lines) if _KEYED.search(line)), 0)
    return last > 0 and not any(_ALL_NUMBERS.fullmatch(line) for line in lines[:last])


def read_at2(path: Path) -> list[Channel]:
    """Read one component.

    Raises
    ------
    RecordError
        for velocity or displacement files, a count that is not met, or text that is no number.
    """
    text = read_text(path)
    possible = range(HEADER_LINES - 1, min(MOST_HEADER, len(text.lines)))
    last = next((index for index in possible if _KEYED.search(text.head(index))), HEADER_LINES - 1)
    for index in range(last):
        series = _SERIES.search(text.head(index))
        if series is not None and series[1].upper() != "ACCELERATION":
            raise NoAccelerationError(
                f"{path}: line {index + 1}: expected an acceleration time series; take the .AT2 file, not "
                ".VT2 or .DT2"
            )
    peers = _SERIES.search(text.head(2)) is not None
    if last == HEADER_LINES - 1 and not peers and _KEYED.search(text.head(3)) is None:
        raise text.fail(2, "expected an acceleration time series; take the .AT2 file, not .VT2 or .DT2")
    count, dt = _count_and_dt(text, last)
    values, ends = text.free(last + 1)
    warnings: tuple[str, ...] = ()
    if values.size > count and not np.any(values[count:]):  # also False for a NaN
        warnings = (
            f"{values.size - count} zeros behind the {count} values that the header announces are cut off",
        )
        values = values[:count]
    if values.size != count:
        line = last + 1 + (len(ends) if values.size < count else 1 + sum(end < count for end in ends))
        raise RecordError(
            f"{path}: line {line}: the header announces NPTS = {count}, the file holds {values.size} values; "
            "it is cut short or joined with another, fetch it again"
        )
    unit = ""
    for index in range(last):  # "IN UNITS OF G", "The units are (g)", "ACCELERATION IN G"
        if match := _UNITS.search(text.head(index)) or _UNITS_ARE.search(text.head(index)):
            unit = acceleration_unit(match[1].rstrip(" .,;"))
            if not unit:
                word = match[1].strip()[:40]
                raise text.fail(index, f"the unit {word!r} is no acceleration that is known, such as G")
            break
        if unit := unit_stated(text.head(index))[0]:
            break
    lines = [(index, text.head(index)) for index in range(last)]
    warnings += check_header(text, lines, [Series(values, unit)], dt, unit)
    if not peers:
        meta: dict[str, object] = {"format": "AT2", "event": text.head(0).strip(), "station": ""}
        return [Channel(path.stem, values, dt, unit, None, "", meta, warnings)]
    event, station, component = text.head(1).strip(), "", ""
    title = [word.strip() for word in text.head(1).split(",")]
    if len(title) == 3:  # event, station, component
        event, station, component = title
    elif len(title) > 3:  # event, date, station, component
        event, station, component = ", ".join(title[:2]), ", ".join(title[2:-1]), title[-1]
    meta = {"format": "AT2", "event": event, "station": station, "component": component}
    for name, corner in _FILTER.findall(text.head(2)):
        if corner.count(".") <= 1 and corner.strip("."):
            meta[f"{name.lower()}_corner_hz"] = float(corner)
    code = (component.split() or [path.stem])[0]  # "090 (CUE)" names the network behind the azimuth
    return [Channel(code, values, dt, unit, parse_orientation(code), "", meta, warnings)]


def _count_and_dt(text: TextFile, last: int) -> tuple[int, float]:
    """Number of values and interval [s] of the header's last line."""
    line = text.head(last)
    match = _KEYED.search(line) or _BARE.search(line)
    if match is None:
        raise text.fail(last, f'expected "NPTS= ..., DT= ...", got {line.strip()[:60]!r}')
    count = text.integer(match[1], last, "NPTS")
    time = _TIME.fullmatch(match[2])
    dt = text.real(time[1] if time else match[2].split(" ")[0], last, "DT")
    if time is None or time[2].upper() not in _SECONDS:
        raise text.fail(last, f"DT: expected a number of seconds, got {match[2].strip()[:40]!r}")
    dt *= _SECONDS[time[2].upper()]
    if count < 1 or dt <= 0.0:
        raise text.fail(last, f"NPTS and DT must be positive, got {count} and {dt:g} s")
    return count, dt


def write_at2(channel: Channel, path: Path) -> None:
    """Write one component with NGA-West2's header; values in g with seven digits."""
    from romdam.config.sections.motions.records import unit_in_si

    values = channel.data * (unit_in_si(channel.unit) / unit_in_si("g"))
    meta = channel.meta
    title = (
        f"{meta.get('event') or 'unknown, 0/0/0'}, {meta.get('station') or 'unknown'}, {component(channel)}"
    )
    lines = [
        "PEER NGA STRONG MOTION DATABASE RECORD",
        title,
        "ACCELERATION TIME SERIES IN UNITS OF G",
        f"NPTS= {values.size:6d}, DT= {channel.dt:9.7g} SEC,",
    ]
    for row in range(0, values.size, 5):
        lines.append("".join(f"{v:15.7E}" for v in values[row : row + 5]))
    path.write_text("\n".join(lines) + "\n", encoding="ascii", errors="replace")


def component(channel: Channel) -> str:
    """PEER's name of a component: the azimuth in degrees, UP or DWN."""
    where: Orientation | None = channel.orientation
    if where is None:
        return channel.code
    if where.azimuth is None:
        return "UP" if where.vertical > 0 else "DWN"
    return f"{where.azimuth:03.0f}" if np.isclose(where.azimuth % 1.0, 0.0) else f"{where.azimuth:g}"
