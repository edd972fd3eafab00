"""USGS SMC: 11 text lines, 48 integers (8I10), 50 reals (5E15.7), comments, data (8 of width 10), cm/s2.

V1 of digitized film has no rate: its data are pairs of a time and a value, at uneven steps.

References
----------
USGS National Strong-Motion Program, "SMC-format data files" (format version 2).
"""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from romdam.records.channel import Channel, Orientation
from romdam.records.formats.text import NUMBER, PEAK_SHARE, TextFile, check_peak, iso_time, read_text
from romdam.records.processing.resampling import even_series

Array = NDArray[np.float64]
TEXT_LINES, INTEGER_LINES, REAL_LINES = 11, 6, 10
KINDS = {"1 UNCORRECTED ACCELEROGRAM": "V1", "2 CORRECTED ACCELEROGRAM": "V2", "0 UNKNOWN": "unknown"}
OTHERS = ("3 VELOCITY", "4 DISPLACEMENT", "5 RESPONSE SPECTRA", "6 FOURIER AMPLITUDE SPECTRA")
NULL_INTEGER, NULL_REAL = -32768, 1.7e38
PEAKS = {29: np.argmax, 31: np.argmin}  # real headers 30 and 32, as Boore's SMCWrite fills them
PRECISE = 8  # integer header 47 of files with five values of width 14 in a row
MAX_RATE = 1e5  # samples/s; some files carry a null value where the rate should be
UNEVEN_DIGIT = 1e-3  # s; times of digitized film have five digits
HIGHPASS = 32  # real header 33, the corner of the low-cut filter [Hz]
_MAGNITUDE = re.compile(r"Moment Mag\s*=\s*(\d+(?:\.\d+)?)", re.IGNORECASE)
_TITLE = re.compile(r"station\s*=\s*(.*?)\s*component\s*=\s*(.*)$", re.IGNORECASE)


def is_smc(head: str) -> bool:
    """Tell whether the start of a file looks like SMC's."""
    first = head.split("\n", 1)[0].strip().upper()
    return first.startswith((*KINDS, *OTHERS))


def read_smc(path: Path) -> list[Channel]:
    """Read one component.

    Raises
    ------
    RecordError
        for velocity, displacement or spectra files, a problem flag, a count that is not met.
    """
    text = read_text(path, padded=True)
    title = text.head(0).strip().upper()
    kind = next((level for start, level in KINDS.items() if title.startswith(start)), None)
    if kind is None:
        raise text.fail(0, f"{text.head(0).strip()[:60]!r} is not an accelerogram; take the V1 or V2 file")
    integers = text.table(TEXT_LINES, 8 * INTEGER_LINES, 8, 10)
    reals = text.table(TEXT_LINES + INTEGER_LINES, 5 * REAL_LINES, 5, 15)
    uneven = kind == "V1" and abs(reals[1]) >= 0.9 * NULL_REAL
    comments, count, flag = int(integers[15]), int(integers[16]), int(integers[17])
    rate = 1.0 if uneven else float(reals[1])  # samples/s
    if not 1 <= count < 10**9:
        raise text.fail(TEXT_LINES + 2, f"the number of samples must be positive, got {count}")
    if flag == 1:
        raise text.fail(
            TEXT_LINES + 2, "the agency's problem flag is set; read the comments, mend the record"
        )
    if not 0.0 < rate < MAX_RATE:
        raise text.fail(TEXT_LINES + INTEGER_LINES, f"samples per second must lie in (0, 1e5), got {rate:g}")
    if not 0 <= comments < len(text.lines):
        raise text.fail(TEXT_LINES + 1, f"the number of comment lines must be 0 or more, got {comments}")
    header = TEXT_LINES + INTEGER_LINES + REAL_LINES
    first = header + comments
    for index in range(header, first):
        words = text.line(index).split()  # Boore's programs leave out the bar
        if not text.line(index).startswith("|") and words and all(map(NUMBER.fullmatch, words)):
            raise text.fail(index, f'expected comment {index - header + 1} of {comments}, starting with "|"')
    precise = integers[46] == PRECISE or (count >= 8 and len(text.line(first).rstrip()) == 70)
    per_row, width = (5, 14) if precise else (8, 10)
    values = text.numbers(first, count, per_row, width)
    end = first - (-count // per_row)
    left = [i for i in range(end, len(text.lines)) if text.lines[i].strip()]
    behind: tuple[str, ...] = ()
    if kind == "unknown":
        behind = ("the first line names no kind of series: taken for acceleration in cm/s2",)
    if uneven and len(left) == 1:  # the agency's files of CRA-1 film end so; its times do not go on
        text.free(left[0])
        extra = f"line {left[0] + 1}, behind the {count} values that are announced, is left out"
        behind, left = (*behind, extra), []
    if left:
        raise text.fail(left[0], f"data after the {count} values that the header announces; altered file")
    if uneven:
        if count % 2:
            raise text.fail(
                TEXT_LINES + 2, f"{count} values are no pairs of a time and a value; altered file"
            )
        times, points = values[::2], values[1::2]
        for number, extreme in PEAKS.items():  # of the points, which are printed with five digits
            stated = float(reals[number])
            if 0.0 < abs(stated) < 0.9 * NULL_REAL and stated != reals[0]:
                line = TEXT_LINES + INTEGER_LINES + number // 5
                check_peak(text, line, stated, float(points[extreme(points)]))
        values, dt, said = even_series(times, points, UNEVEN_DIGIT, f"{path}: line {first + 1}")
    else:
        dt = 1.0 / rate
        said = _check_peaks(text, values, dt, reals)
    channel = _channel(text, kind, values, dt, integers, reals)
    return [replace(channel, warnings=(*behind, *said))]


def _check_peaks(text: TextFile, values: Array, dt: float, reals: Array) -> tuple[str, ...]:
    """Hold both extremes against the data; say where they stand at other times."""
    said = []
    for number, at in PEAKS.items():
        stated, time, extreme = float(reals[number]), float(reals[number - 1]), values[at(values)]
        if not 0.0 < abs(stated) < 0.9 * NULL_REAL or stated == reals[0] or not np.isfinite(extreme):
            continue
        check_peak(text, TEXT_LINES + INTEGER_LINES + number // 5, stated, float(extreme))
        index = round(time / dt) if 0.0 <= time < values.size * dt else -1
        if abs(values[index] - extreme) > PEAK_SHARE * abs(extreme):
            said.append(
                f"the header has an extreme at {time:g} s, the data at {at(values) * dt:g} s; is dt right?"
            )
    return tuple(said)


def _channel(text: TextFile, kind: str, values: Array, dt: float, integers: Array, reals: Array) -> Channel:
    """Make the channel of its values (nt,) [cm/s2], the text above them and both headers."""
    title = _TITLE.search(text.head(5))
    station, component = (title[1], title[2].strip()) if title else (text.head(5).strip(), "")
    null, vertical, azimuth = integers[0], integers[12], integers[13]
    orientation: Orientation | None = None
    if vertical in (0, 180):
        orientation = Orientation(None, 1 if vertical == 0 else -1)
    elif azimuth != null and 0 <= azimuth <= 360:
        orientation = Orientation(float(azimuth) % 360.0)
    start = ""
    year, day, hour, minute = (int(value) for value in integers[1:5])
    if null not in (year, day, hour, minute):
        second, milli = (0.0 if value == null else float(value) for value in integers[5:7])
        start = iso_time((year, 1, day), hour, minute, second + 1e-3 * milli)
    meta: dict[str, object] = {
        "format": "SMC",
        "level": kind,
        "station": text.line(2)[:4].strip(),
        "station_name": station,
        "event": " ".join(text.line(3).split()).strip("* "),
        "processed": kind == "V2",
    }
    if magnitude := _MAGNITUDE.search(text.head(4)):
        meta["magnitude"] = float(magnitude[1])
    if kind == "V2" and 0.0 < reals[HIGHPASS] < 50.0:
        meta["hp_corner_hz"] = float(reals[HIGHPASS])
    code = component or text.path.stem
    return Channel(code, values, dt, "cm/s2", orientation, start, meta)


def write_smc(channel: Channel, path: Path) -> None:
    """Write one component as a corrected accelerogram; values in cm/s2 with SMC's five digits."""
    from romdam.config.sections.motions.records import unit_in_si

    values = channel.data * (unit_in_si(channel.unit) / 0.01)
    meta = channel.meta
    text = [
        "2 CORRECTED ACCELEROGRAM",
        "*",
        str(meta.get("station", ""))[:4],
        str(meta.get("event", "")),
        f"Moment Mag= {meta.get('magnitude', '')}     Ms=          Ml=",
        f"station ={meta.get('station_name', '')} component={channel.code}",
        *["*"] * 5,
    ]
    integers, reals = [NULL_INTEGER] * 48, np.full(50, NULL_REAL)
    if channel.start:
        start = datetime.fromisoformat(channel.start.rstrip("Z"))
        date = [start.year, start.timetuple().tm_yday]
        integers[1:7] = [*date, start.hour, start.minute, start.second, start.microsecond // 1000]
    where = channel.orientation
    if where is not None and where.azimuth is not None:
        integers[12:14] = [90, round(where.azimuth)]
    elif where is not None:
        integers[12] = 0 if where.vertical > 0 else 180
    integers[15:18] = [0, channel.data.size, 0]
    reals[1] = 1.0 / channel.dt
    for number, at in ((28, int(np.argmax(values))), (30, int(np.argmin(values)))):
        reals[number : number + 2] = at * channel.dt, values[at]
    lines = text + [
        "".join(f"{v:10d}" for v in integers[8 * row : 8 * row + 8]) for row in range(INTEGER_LINES)
    ]
    lines += ["".join(f"{v:15.7E}" for v in reals[5 * row : 5 * row + 5]) for row in range(REAL_LINES)]
    lines += ["".join(short_real(v) for v in values[i : i + 8]) for i in range(0, values.size, 8)]
    path.write_text("\n".join(lines) + "\n", encoding="ascii", errors="replace")


def short_real(value: float) -> str:
    """Format as Fortran's 1PE10.4E1: one exponent digit, which SMC's width of ten leaves room for."""
    mantissa, exponent = f"{value:.4E}".split("E")
    power = int(exponent)
    if power < -9:
        mantissa, power = "0.0000", 0
    return f"{mantissa}E{power:+d}".rjust(10)
