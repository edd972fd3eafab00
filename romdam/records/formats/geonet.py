"""GeoNet V1A and V2A (GNS Science): 16 text lines, 4 lines of 10 integers, 6 of 10 reals, data of width 8.

A file holds three components. V1A is uncorrected acceleration; V2A has velocity and displacement behind the
acceleration, which are skipped.

References
----------
GeoNet, "Strong Motion Data: V1A, V2A file format": integers 34 to 36 count acceleration, velocity and
displacement, 28 is the azimuth, 9, 10, 19, 20, 39 and 40 are the time of the first sample; real 24 is the
length, 26 the interval of the data and 30 is g in their unit.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from romdam.records.channel import Channel, parse_orientation
from romdam.records.formats.text import (
    TextFile,
    acceleration_unit,
    check_length,
    check_peak,
    iso_time,
    read_text,
)

TEXT_LINES, INTEGER_LINES, REAL_LINES, PER_ROW, WIDTH = 16, 4, 6, 10, 8
STANDARD_GRAVITY = 9.80665  # m/s2
HEADER = TEXT_LINES + INTEGER_LINES + REAL_LINES
_FIRST = re.compile(r"(uncorrected|corrected) accelerogram\s+(\S+)\s.*\bGNS\b", re.I)
_SITE = re.compile(r"Site\s+(\S+)", re.I)
_COMPONENT = re.compile(r"Component\s+(\S+)", re.I)
_PEAK = re.compile(r"Acceleration:\s+peak\s+([-+]?\d+\.?\d*)\s+(\S+)\s+at", re.I)
_INTERVAL = re.compile(r"at (?:intervals of )?\s*(\d*\.\d+) s(?:ec intervals)?", re.I)
_NUMBER = re.compile(r"Number of points\s+(\d{1,9})\b", re.I)
_BAND = re.compile(r"transition bands are\s+([\d.]+)-\s*([\d.]+) Hz and\s+([\d.]+)-\s*([\d.]+) Hz", re.I)
_NAMES = ("acceleration", "velocity", "displacement")


def is_geonet(head: str) -> bool:
    """Tell whether the start of a file looks like GeoNet's V1A or V2A."""
    return _FIRST.match(head.split("\n", 1)[0].strip()) is not None


def read_geonet(path: Path) -> list[Channel]:
    """Read the components of a file.

    Raises
    ------
    RecordError
        for a count, a length, an interval or a peak that is not met.
    """
    text = read_text(path)
    channels: list[Channel] = []
    index = 0
    while index < len(text.lines):
        if not text.lines[index].strip():
            index += 1
            continue
        channel, index = _component(text, index)
        channels.append(channel)
    return channels


def _component(text: TextFile, first: int) -> tuple[Channel, int]:
    """Read the component that begins at line `first`; also the line behind it."""
    from romdam.config.sections.motions.records import unit_in_si

    lines = [text.head(first + i) for i in range(TEXT_LINES)]
    title = _FIRST.match(lines[0].strip())
    if title is None:
        raise text.fail(first, f"expected a component of GeoNet, got {lines[0].strip()[:60]!r}")
    integers = text.table(first + TEXT_LINES, PER_ROW * INTEGER_LINES, PER_ROW, WIDTH)
    reals = text.table(first + TEXT_LINES + INTEGER_LINES, PER_ROW * REAL_LINES, PER_ROW, WIDTH)
    index, counts = first + HEADER, [int(count) for count in integers[33:36]]
    if not (counts[0] >= 1 and min(counts) >= 0 and max(counts) < 10**8):
        raise text.fail(first + TEXT_LINES + 3, f"the numbers of values {counts} must be 1, 0 and 0 or more")
    series = []
    for count in counts:
        series.append(text.numbers(index, count, PER_ROW, WIDTH))
        index += -(-count // PER_ROW)
    values, dt = series[0], float(reals[25])
    stated = next((match for line in lines if (match := _INTERVAL.search(line))), None)
    if stated is None or abs(float(stated[1]) - dt) > 1e-6 or not 0.0 < dt < 10.0:
        word = stated[1] if stated else "none"
        raise text.fail(first + 10, f"an interval of {word} s is stated, {dt:g} s in the real header")
    slack = max(1.5 * dt, 0.01)  # lengths are printed to 0.01 s
    check_length(text, first + TEXT_LINES + INTEGER_LINES + 2, float(reals[23]), values.size, dt, slack)
    number = next((match for line in lines if (match := _NUMBER.match(line.strip()))), None)
    if number is not None and int(number[1]) != values.size:
        raise text.fail(first + 9, f"{number[1]} points are stated, the integer header says {values.size}")
    peak = next(((i, match) for i, line in enumerate(lines) if (match := _PEAK.match(line.strip()))), None)
    if peak is None:
        raise text.fail(first + 13, 'expected "Acceleration:  Peak ... mm/s/s at ..."')
    unit = acceleration_unit(peak[1][2])  # of the peak, which is that of the data
    if not unit:
        raise text.fail(first + peak[0], f"the peak's unit {peak[1][2]!r} is no acceleration")
    check_peak(text, first + peak[0], float(peak[1][1]), float(np.nanmax(np.abs(values))), 0.06)
    if abs(float(reals[29]) * unit_in_si(unit) / STANDARD_GRAVITY - 1.0) > 0.01:
        raise text.fail(
            first + 13,
            f"the peak is in {unit}, but g is {reals[29]:g} by real header 30; the file is altered",
        )
    component = next((match[1] for line in lines if (match := _COMPONENT.match(line.strip()))), "")
    where = parse_orientation(component)
    if where is not None and where.azimuth is not None and (integers[27] - where.azimuth) % 360.0:
        raise text.fail(
            first + 12, f"component {component} is stated, the integer header says {integers[27]:g} degrees"
        )
    site = _SITE.match(lines[1].strip())
    corrected = title[1].lower() == "corrected"
    meta: dict[str, object] = {
        "format": "GEONET",
        "level": "V2A" if corrected else "V1A",
        "network": "NZ",
        "station": site[1] if site else "",
        "station_name": lines[2].strip(),
        "event": lines[7].strip(),
        "processed": corrected,
    }
    if corrected and (band := next((m for line in lines if (m := _BAND.search(line))), None)):
        meta |= {"hp_corner_hz": float(band[2]), "lp_corner_hz": float(band[3])}
    year, month, day, hour, minute, milli = (int(integers[i]) for i in (8, 9, 18, 19, 38, 39))
    start = iso_time((year, month, day), hour, minute, 1e-3 * milli)
    return Channel(component or "1", values, dt, unit, where, start, meta), index
