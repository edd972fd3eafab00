"""PEER AT2: four header lines, acceleration in g; the old database's and NGA-West2's headers.

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
from romdam.records.formats.stated import acceleration_unit
from romdam.records.formats.text import TextFile, read_text

HEADER_LINES = 4
_KEYED = re.compile(r"^\s*NPTS\s*=\s*([^,\s]+)\s*,?\s*DT\s*=\s*(.*)$", re.IGNORECASE)
_BARE = re.compile(r"^\s*(\S+)[\s,]+(\S+)\s+NPTS\s*,\s*DT[\s.,;]*$", re.IGNORECASE)
_TIME = re.compile(r"(\S*?[\d.])\s*([A-Za-z]*)[\s.,;]*")
_SECONDS = {"": 1.0, "S": 1.0, "SEC": 1.0, "SECS": 1.0, "SECONDS": 1.0, "MSEC": 1e-3, "MS": 1e-3}
_UNITS = re.compile(r"UNITS\s+OF\s+(.*?)(?:[.,;]\s+(FILTER\s+POINTS\b.*))?$", re.IGNORECASE)
_FILTER = re.compile(r"\b(HP|LP)\s*=\s*([0-9.]+)", re.IGNORECASE)
_SERIES = re.compile(r"(ACCELERATION|VELOCITY|DISPLACEMENT)\s+TIME\s+(SERIES|HISTORY)", re.IGNORECASE)


def is_at2(head: str) -> bool:
    """Tell whether the start of a file looks like PEER's."""
    lines = head.splitlines()[:HEADER_LINES]
    return (
        len(lines) == HEADER_LINES
        and _SERIES.search(lines[2]) is not None
        and (re.search(r"NPTS", lines[3], re.IGNORECASE) is not None or lines[0].upper().startswith("PEER"))
    )


def read_at2(path: Path) -> list[Channel]:
    """Read one component.

    Raises
    ------
    RecordError
        for velocity or displacement files, a count that is not met, or text that is no number.
    """
    text = read_text(path)
    series = _SERIES.search(text.head(2))
    if series is None or series[1].upper() != "ACCELERATION":
        raise NoAccelerationError(
            f"{path}: line 3: expected an acceleration time series; take the .AT2 file, not .VT2 or .DT2"
        )
    count, dt = _count_and_dt(text)
    values, ends = text.free(HEADER_LINES)
    if values.size != count:
        line = HEADER_LINES + (len(ends) if values.size < count else 1 + sum(end < count for end in ends))
        raise RecordError(
            f"{path}: line {line}: the header announces NPTS = {count}, the file holds {values.size} values; "
            "it is cut short or joined with another, fetch it again"
        )
    event, station, component = _title(text.head(1))
    meta: dict[str, object] = {"format": "AT2", "event": event, "station": station, "component": component}
    meta |= {f"{k.lower()}_corner_hz": float(v) for k, v in _FILTER.findall(text.head(2)) if _is_number(v)}
    code = (component.split() or [path.stem])[0]  # "090 (CUE)" names the network behind the azimuth
    return [Channel(code, values, dt, _unit(text), parse_orientation(code), "", meta)]


def _is_number(word: str) -> bool:
    return word.count(".") <= 1 and word.strip(".") != ""


def _unit(text: TextFile) -> str:
    match = _UNITS.search(text.head(2))
    if match is None:
        return ""
    unit = acceleration_unit(match[1].rstrip(" .,;"))
    if not unit:
        raise text.fail(
            2, f"the unit {match[1].strip()[:40]!r} is no acceleration that is known, such as G or CM/S/S"
        )
    return unit


def _count_and_dt(text: TextFile) -> tuple[int, float]:
    line = text.head(3)
    match = _KEYED.search(line) or _BARE.search(line)
    if match is None:
        raise text.fail(3, f'expected "NPTS= ..., DT= ...", got {line.strip()[:60]!r}')
    count = text.integer(match[1], 3, "NPTS")
    time = _TIME.fullmatch(match[2])
    dt = text.real(time[1] if time else match[2].split(" ")[0], 3, "DT")
    if time is None or time[2].upper() not in _SECONDS:
        raise text.fail(3, f"DT: expected a number of seconds, got {match[2].strip()[:40]!r}")
    dt *= _SECONDS[time[2].upper()]
    if count < 1 or dt <= 0.0:
        raise text.fail(3, f"NPTS and DT must be positive, got {count} and {dt:g} s")
    return count, dt


def _title(line: str) -> tuple[str, str, str]:
    """Split "event, [date,] station, component"."""
    parts = [part.strip() for part in line.split(",")]
    if len(parts) < 3:
        return line.strip(), "", ""
    event = ", ".join(parts[:2]) if len(parts) > 3 else parts[0]
    return event, ", ".join(parts[2:-1]) if len(parts) > 3 else parts[1], parts[-1]


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
