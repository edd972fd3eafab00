"""COSMOS V1, V1c, V2, V2c (format 1.20): one or many channels in a file, CGS's and USGS's habits.

A channel is 13 text lines, 100 integers, 100 reals, comments and data, each block announced by a line
that gives its length and Fortran format, and a line "End-of-data for Chan ...". CGS puts velocity and
displacement channels behind the acceleration (they are skipped), USGS writes one value a line.

References
----------
COSMOS Strong Motion Programs Board (2001), COSMOS Strong Motion Data Format, version 1.20, tables 1-11.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from romdam.core.errors import RecordError
from romdam.records.channel import Channel, Orientation
from romdam.records.formats.text import (
    TextFile,
    acceleration_unit,
    check_length,
    check_peak,
    iso_time,
    read_text,
)

TEXT_LINES = 13
MAX_VALUES = 50_000_000
ACCELERATION = 1  # table 1
UNITS = {  # table 2, accelerations
    2: "g",
    4: "cm/s2",
    7: "0.0254 m/s2",
    10: "cm/s2",
    11: "0.001 g",
    12: "0.000001 g",
}
COUNTS = 50
VERTICAL = {400: 1, 401: -1, 402: 1}  # table 11; 402: vertical, sense not indicated
NETWORKS = {2: "NP", 3: "RE", 4: "A_", 5: "CE", 6: "CI", 7: "BK", 8: "NC", 10: "AZ", 14: "NN", 15: "UW"}
_FIRST = re.compile(r"(RAW|UNCORRECTED|CORRECTED)\s+(ACCELERATION|VELOCITY|DISPLACEMENT).*\(FORMAT\s+V", re.I)
_BLOCK = re.compile(r"^\s*(\d+)\s+(integer|real)-?\s?header\s+values\s+follow\s+on\s+(\d+)\s+lines", re.I)
_COMMENTS = re.compile(r"^\s*(\d+)\s+comment\s+line", re.I)
_DATA = re.compile(
    r"^\s*(\d+)\s+(?:raw\s+)?(\w+)\.?\s+(?:pts|points|counts)\b.*?units?\s*=\s*([^,(]*)(?:\(\s*(\d+)\s*\))?",
    re.I,
)
_APPROX = re.compile(r"approx\s+(\d+)\s+secs", re.I)
_LINE_AZIMUTH = re.compile(r"Chan\s*\d+\s*:\s*(\d+)\s*deg", re.I)
_FORTRAN = re.compile(r"format\s*=\s*\(\s*(\d*)\s*(?:P?\d*P)?[IFEG](\d+)", re.I)
_CODE = re.compile(r"Code:\s*(\w+)-(\S+)")
_SCNL = re.compile(r"<SCNL>\s*(\S+)")


def is_cosmos(head: str) -> bool:
    """Tell whether the start of a file looks like COSMOS."""
    return _FIRST.match(head.split("\n", 1)[0].strip()) is not None


def read_cosmos(path: Path) -> list[Channel]:
    """Read every acceleration channel of the file.

    Raises
    ------
    RecordError
        for a count that is not met, headers that contradict each other, or no acceleration in physical units.
    """
    text = read_text(path)
    channels: list[Channel] = []
    index = 0
    while index < len(text.lines):
        if text.lines[index].strip():
            channel, index = _read_channel(text, index)
            channels += [] if channel is None else [channel]
        else:
            index += 1
    if not channels:
        raise RecordError(f"{path}: line 1: no acceleration channel in it; take the acceleration file")
    return channels


@dataclass(frozen=True)
class _Header:
    """Headers of a channel that begins at line `first`: integers and reals (100,), and its comments."""

    first: int
    integers: NDArray[np.float64]
    reals: NDArray[np.float64]
    comments: list[str]


@dataclass(frozen=True)
class _Announcement:
    """What the line before the data says of their unit.

    Attributes
    ----------
    unit : in words
    code : of COSMOS table 2; None or empty where there is none
    index : of the line
    """

    unit: str
    code: str | None
    index: int


def _read_channel(text: TextFile, first: int) -> tuple[Channel | None, int]:
    """Read the channel that begins at line `first`, None for no acceleration; also the line behind it."""
    title = _FIRST.match(text.head(first).strip())
    if title is None:
        raise text.fail(first, f"expected a COSMOS channel, got {text.head(first).strip()[:60]!r}")
    index = first + TEXT_LINES
    tables = []
    for kind in ("integer", "real"):
        match = _BLOCK.match(text.head(index))
        if match is None or match[2].lower() != kind:
            raise text.fail(index, f"expected the {kind} header, got {text.head(index).strip()[:60]!r}")
        count, per_row, width = _layout(text, match[1], index)
        if count < 65:
            raise text.fail(index, f"the {kind} header holds {count} values, at least 65 are needed")
        tables.append(text.table(index + 1, count, per_row, width))
        index += 1 - (-count // per_row)
    match = _COMMENTS.match(text.head(index))
    if match is None:
        raise text.fail(index, f"expected the comments' announcement, got {text.head(index).strip()[:60]!r}")
    count = text.integer(match[1], index, "comment lines")
    comments = [text.head(i) for i in range(index + 1, min(index + 1 + count, len(text.lines) + 1))]
    for offset, line in enumerate(comments, start=1):
        if not line.lstrip(" ").startswith("|"):
            raise text.fail(index + offset, f'expected comment {offset} of {count}, starting with "|"')
    index += 1 + count
    match = _DATA.match(text.head(index))
    if match is None:
        raise text.fail(index, f"expected the data's announcement, got {text.head(index).strip()[:60]!r}")
    count, per_row, width = _layout(text, match[1], index)
    values = text.numbers(index + 1, count, per_row, width)
    end = index + 1 - (-count // per_row)
    while end < len(text.lines) and text.lines[end].strip():
        if re.match(r"\s*(/&|end.?of.?data)", text.lines[end], re.I):
            end += 1
            break
        other = _DATA.match(text.head(end))  # old files hold velocity and displacement before the end mark
        if other is None:
            line = text.lines[end].strip()[:60]
            raise text.fail(end, f'expected "End-of-data", got {line!r}; count not met')
        count, per_row, width = _layout(text, other[1], end)
        text.numbers(end + 1, count, per_row, width)
        end += 1 - (-count // per_row)
    quantity = match[2].lower()[:3]
    if title[2].lower()[:3] != quantity:
        raise text.fail(index, f"{match[2]} announced, but {title[2]} in line {first + 1}")
    if quantity != "acc":
        return None, end
    announced = _Announcement(match[3].strip(), match[4], index)
    header = _Header(first, tables[0], tables[1], comments)
    return _channel(text, header, values, announced), end


def _layout(text: TextFile, word: str, index: int) -> tuple[int, int, int]:
    """Number of values that line `index` announces by a word, how many stand in a row, and their width."""
    match = _FORTRAN.search(text.head(index))
    if match is None:
        raise text.fail(index, f'no "Format=(...)" in {text.head(index).strip()[:60]!r}')
    per_row, width = int(match[1] or 1), int(match[2])
    if not (1 <= per_row <= 100 and 1 <= width <= 40):
        raise text.fail(index, f"format of {per_row} values of width {width} is none of COSMOS'")
    count = text.integer(word, index, "count")
    if not 1 <= count <= MAX_VALUES:
        raise text.fail(index, f"the number of values must lie in [1, {MAX_VALUES}], got {count}")
    return count, per_row, width


def _channel(
    text: TextFile, header: _Header, values: NDArray[np.float64], announced: _Announcement
) -> Channel:
    """Make an acceleration channel of its values (nt,) and headers, which are held against each other.

    Comments count the headers from 1, as the format's description does.
    """
    integers, reals = header.integers, header.reals
    unit = _unit(text, header, announced)
    # real 62 [ms], or 34 [s] where unknown; 63 is the length, count * dt or (count - 1) * dt
    dt = float(reals[61]) * 1e-3 if reals[61] > 0.0 else float(reals[33])
    real_line = header.first + TEXT_LINES + 1
    if not 0.0 < dt < 10.0:
        raise text.fail(
            real_line, f"sampling interval must lie in (0, 10) s, got {dt:g} s (real headers 62 and 34)"
        )
    stated_length, length = float(reals[62]), values.size * dt
    if stated_length > 0.0:
        slack = max(1.5 * dt, 0.01 * stated_length)
        check_length(text, real_line, stated_length, values.size, dt, slack)
    if approx := _APPROX.search(text.head(announced.index)):
        seconds = float(approx[1])
        check_length(text, announced.index, seconds, values.size, dt, max(2.0, 0.02 * seconds))

    # integer 54 is the azimuth, or the sense of a vertical channel; 20 and 55 add up to an azimuth
    azimuth, reference, relative = int(integers[53]), int(integers[19]), int(integers[54])
    where: Orientation | None = None
    if azimuth in VERTICAL:
        where = Orientation(None, VERTICAL[azimuth])
    elif 0 < azimuth <= 360:
        where = Orientation(float(azimuth % 360))
    elif 0 < reference <= 360 and 0 < relative <= 360:
        where = Orientation(float((reference + relative) % 360))
    lines = [text.head(header.first + i) for i in range(TEXT_LINES)]
    match = _LINE_AZIMUTH.search(lines[8])  # the ninth line may repeat the azimuth: "Chan   1: 90 deg"
    if match and where and where.azimuth is not None and (int(match[1]) - where.azimuth) % 360.0:
        stated = f"{match[1]} deg is stated, the integer header says {where.azimuth:g}"
        raise text.fail(header.first + 8, f"{stated}; the file is altered")

    station = _CODE.search(lines[4])
    network = NETWORKS.get(int(integers[10]), "")
    meta: dict[str, object] = {
        "format": "COSMOS",
        "level": f"V{max(0, int(integers[0]))}" if integers[0] >= 0 else "",
        "event": lines[1].strip()[:80],
        "station_name": lines[4][40:].strip(),
        "processed": bool(integers[0] >= 2),
        "network": (station[1] if station else "") or network,
        "station": station[2] if station else "",
    }
    for name, corner in (("hp_corner_hz", float(reals[53])), ("lp_corner_hz", float(reals[56]))):
        if corner > 0.0:
            meta[name] = corner

    stated_peak, peak = float(reals[63]), float(np.max(np.abs(values), initial=0.0))
    if stated_peak not in (-999.0, 0.0) and np.isfinite(peak):
        check_peak(text, header.first + TEXT_LINES + 12, stated_peak, peak, 1e-3)  # F10.3 at the worst
    said = []
    if stated_length > 0.0 and abs(stated_length - length) > 1.5 * dt:  # agencies round it, but seldom to 1 %
        said.append(f"the real header's length is {stated_length:g} s, the data's {length:g} s")
    microvolts, sensitivity = float(reals[21]), float(reals[41])  # of a count [1e-6 V], of the sensor [V/g]
    if not unit and microvolts > 0.0 and sensitivity > 0.0:
        said.append(f"the values are counts; by the header one is {1e-6 * microvolts / sensitivity:.6g} g")

    code = ""
    for comment in header.comments:
        if scnl := _SCNL.search(comment):  # station, channel, network, location
            code = code or (*scnl[1].split("."), "")[1]
    if not code:
        number = re.search(r"Chan\s*(\d+)\s*:", lines[8], re.I)
        code = number[1] if number else str(int(integers[49]))
        if where is not None:
            code += "-Z" if where.azimuth is None else f"-{where.azimuth:03.0f}"
    year, month, day, hour, minute = (int(integers[i]) for i in (39, 41, 42, 43, 44))
    start = iso_time((year, month, day), hour, minute, max(0.0, float(reals[29])))
    return Channel(code, values, dt, unit, where, start, meta, tuple(said))


def _unit(text: TextFile, header: _Header, announced: _Announcement) -> str:
    """The unit that the announcement's word and code and the integer header agree on."""
    word, code, index = announced.unit, announced.code, announced.index
    codes = [int(code)] if code else []
    codes += [number] if (number := int(header.integers[2])) in (*UNITS, COUNTS) else []
    counts = [number == COUNTS for number in codes] + (["count" in word.lower()] if word else [])
    if any(counts):
        if not all(counts):
            raise text.fail(index, f"unit {word!r} contradicts the codes {codes}; {COUNTS} is counts")
        return ""  # V0: instrument counts; the configuration says what one count is
    if word and not acceleration_unit(word):
        raise text.fail(index, f"unit {word!r} is no acceleration that is known")
    units = [acceleration_unit(word)] if word else []
    for number in codes:
        if number not in UNITS:
            raise text.fail(index, f"unit {word!r} (code {number}) is no acceleration of COSMOS table 2")
        units.append(UNITS[number])
    if not units:
        raise text.fail(index, "no unit, in word or code")
    if len(set(units)) > 1:
        integer = int(header.integers[2])
        stated = f"unit {word!r} (code {int(code or integer)})"
        raise text.fail(index, f"{stated} contradicts the integer header's code {integer}")
    return units[0]


def write_cosmos(channels: list[Channel], path: Path) -> None:
    """Write channels one after another as processed acceleration (V2), cm/s2 in 1PE15.6 as USGS does."""
    lines: list[str] = []
    for number, channel in enumerate(channels, start=1):
        lines += _channel_lines(channel, number, len(channels))
    path.write_text("\n".join(lines) + "\n", encoding="ascii", errors="replace")


def _channel_lines(channel: Channel, number: int, total: int) -> list[str]:
    """Lines of channel `number` of `total`, counted from 1."""
    from romdam.config.sections.motions.records import unit_in_si

    values = channel.data * (unit_in_si(channel.unit) / 0.01)
    integers, reals = [-999] * 100, np.full(100, -999.0)
    integers[0:4] = [2, ACCELERATION, 4, 120]
    integers[22], integers[49] = total, number
    where = channel.orientation
    if where is not None:
        vertical = 400 if where.vertical > 0 else 401
        integers[53] = vertical if where.azimuth is None else round(where.azimuth) or 360
    if channel.start:
        start = datetime.fromisoformat(channel.start.rstrip("Z"))
        date = [start.year, start.timetuple().tm_yday, start.month, start.day]
        integers[39:45] = [*date, start.hour, start.minute]
        reals[29] = start.second + 1e-6 * start.microsecond
    peak = int(np.argmax(np.abs(values)))
    reals[33] = channel.dt
    reals[61:65] = [1e3 * channel.dt, values.size * channel.dt, values[peak], peak * channel.dt]
    meta = channel.meta
    code = f"{meta.get('network') or '--'}-{meta.get('station') or '0'}"
    seconds = round(values.size * channel.dt)
    return [
        "Corrected acceleration    (Format v01.20 with 13 text lines)",
        str(meta.get("event", ""))[:80],
        "Hypocenter: unknown",
        "Origin: unknown",
        f"Statn No: 00-    0  Code:{code}".ljust(40) + str(meta.get("station_name", "")),
        "Coords: unknown",
        f"Recorder:        s/n:     ({total:3d} Chns of {total:2d} at Sta) Sensor:",
        f"Rcrd start time: {channel.start}",
        f"Sta Chan {number:3d}: (Rcrdr Chan{number:3d}) Location:",
        "Raw record length = unknown",
        "Processed:",
        "Record filtered below        Hz",
        "Values used when parameter or data value is unknown/unspecified:   -999, -999.0",
        " 100 Integer-header values follow on  10 lines, Format= (10I8)",
        *("".join(f"{v:8d}" for v in integers[i : i + 10]) for i in range(0, 100, 10)),
        " 100 Real-header values follow on  20 lines, Format= (5F15.6)",
        *("".join(f"{v:15.6f}" for v in reals[i : i + 5]) for i in range(0, 100, 5)),
        '   1 Comment line(s) follow, each starting with a "|":',
        f"|<SCNL>{meta.get('station', '')}.{channel.code}.{meta.get('network', '')}.--",
        f"{values.size:8d} acceleration pts, approx {seconds:4d} secs, units=cm/sec2(04),Format=(5E15.6)",
        *("".join(f"{v:15.6E}" for v in values[i : i + 5]) for i in range(0, values.size, 5)),
        f"End-of-data for Chan {number:3d} acceleration",
    ]
