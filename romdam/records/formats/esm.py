"""ESM and ITACA ASCII: "KEY: value" lines, then one value a line.

64 lines are DYNA 1.2 (ESM), 55 lines DYNA 1.0 (ITACA 2), 43 lines ITACA 1.

References
----------
Luzi et al. (2016), Engineering Strong-Motion database, Seismol. Res. Lett. 87(4); DYNA convert format 1.2.
"""

from __future__ import annotations

import re
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from romdam.core.errors import RecordError
from romdam.records.channel import Channel, NoAccelerationError, parse_orientation
from romdam.records.formats.text import (
    NUMBER,
    PEAK_SHARE,
    TextFile,
    acceleration_unit,
    check_length,
    check_peak,
    read_text,
)

MOST_HEADER = 100  # lines
_KEY = re.compile(r"\s*([A-Z][A-Z0-9_/^]*)\s*:(.*)$")
_KIND = re.compile(r"(?:(?:UN)?(?:PROCESSED|CORRECTED)\s+)?ACCELERATION", re.IGNORECASE)
_ORDER = """
EVENT_NAME EVENT_ID EVENT_DATE_YYYYMMDD EVENT_TIME_HHMMSS EVENT_LATITUDE_DEGREE
EVENT_LONGITUDE_DEGREE EVENT_DEPTH_KM HYPOCENTER_REFERENCE MAGNITUDE_W MAGNITUDE_W_REFERENCE
MAGNITUDE_L MAGNITUDE_L_REFERENCE FOCAL_MECHANISM NETWORK STATION_CODE STATION_NAME
STATION_LATITUDE_DEGREE STATION_LONGITUDE_DEGREE STATION_ELEVATION_M LOCATION SENSOR_DEPTH_M
VS30_M/S SITE_CLASSIFICATION_EC8 MORPHOLOGIC_CLASSIFICATION EPICENTRAL_DISTANCE_KM
EARTHQUAKE_BACKAZIMUTH_DEGREE DATE_TIME_FIRST_SAMPLE_YYYYMMDD_HHMMSS
DATE_TIME_FIRST_SAMPLE_PRECISION SAMPLING_INTERVAL_S NDATA DURATION_S STREAM UNITS INSTRUMENT
INSTRUMENT_ANALOG/DIGITAL INSTRUMENTAL_FREQUENCY_HZ INSTRUMENTAL_DAMPING FULL_SCALE_G
N_BIT_DIGITAL_CONVERTER PGA_CM/S^2 TIME_PGA_S BASELINE_CORRECTION FILTER_TYPE FILTER_ORDER
LOW_CUT_FREQUENCY_HZ HIGH_CUT_FREQUENCY_HZ LATE/NORMAL_TRIGGERED DATABASE_VERSION HEADER_FORMAT
DATA_TYPE PROCESSING DATA_TIMESTAMP_YYYYMMDD_HHMMSS DATA_LICENSE DATA_CITATION DATA_CREATOR
ORIGINAL_DATA_MEDIATOR_CITATION ORIGINAL_DATA_MEDIATOR ORIGINAL_DATA_CREATOR_CITATION
ORIGINAL_DATA_CREATOR USER1 USER2 USER3 USER4 USER5
"""
KEYS = _ORDER.split()
_META = {
    "event": "EVENT_NAME",
    "event_id": "EVENT_ID",
    "magnitude": "MAGNITUDE_W",
    "network": "NETWORK",
    "station": "STATION_CODE",
    "station_name": "STATION_NAME",
    "hp_corner_hz": "LOW_CUT_FREQUENCY_HZ",
    "lp_corner_hz": "HIGH_CUT_FREQUENCY_HZ",
    "processing": "PROCESSING",
}
_START = re.compile(r"^(\d{4})(\d{2})(\d{2})_(\d{2})(\d{2})(\d{2}(?:\.\d+)?)$")


def is_esm(head: str) -> bool:
    """Tell whether the start of a file looks like ESM's."""
    lines = head.splitlines()
    return len(lines) > 1 and lines[0].startswith("EVENT_NAME:") and lines[1].startswith("EVENT_")


def read_esm(path: Path) -> list[Channel]:
    """Read one component.

    Raises
    ------
    RecordError
        for a missing key, a velocity or displacement file, a count or a peak that is not met.
    """
    text = read_text(path)
    header: dict[str, tuple[str, int]] = {}  # value and line of each key
    first = 0  # line of the data
    while (match := _KEY.match(text.line(first))) and first < MOST_HEADER:
        if match[1] in header:
            raise text.fail(first, f"the key {match[1][:40]} stands there twice; two files joined?")
        header[match[1]] = (match[2].strip(), first)
        first += 1
    if NUMBER.fullmatch((text.line(first).split() or [""])[0]) is None:
        raise text.fail(first, f'expected "KEY: value", got {text.line(first).strip()[:60]!r}')
    kind = header.get("DATA_TYPE", ("ACCELERATION", 0))
    if _KIND.fullmatch(kind[0]) is None:
        raise NoAccelerationError(
            f"{path}: line {kind[1] + 1}: DATA_TYPE is {kind[0]!r}; take the acceleration file"
        )
    count = text.integer(*_need(text, header, "NDATA"), "NDATA")
    dt = text.real(*_need(text, header, "SAMPLING_INTERVAL_S"), "SAMPLING_INTERVAL_S")
    values, _ = text.free(first)
    if count != values.size or dt <= 0.0:
        raise RecordError(
            f"{path}: line {header['NDATA'][1] + 1}: NDATA = {count} at dt = {dt:g} s announced, "
            f"{values.size} values found; the file is cut short or altered"
        )
    stream = _need(text, header, "STREAM" if "STREAM" in header else "COMPONENT")[0]
    meta: dict[str, object] = {"format": "ESM"}
    for name, key in _META.items():
        if word := header.get(key, ("",))[0]:
            meta[name] = word
            with suppress(ValueError):
                meta[name] = float(word)
    time = _START.match(header.get("DATE_TIME_FIRST_SAMPLE_YYYYMMDD_HHMMSS", ("", 0))[0])
    start = "" if time is None else "{}-{}-{}T{}:{}:{}".format(*time.groups())
    word, index = _need(text, header, "UNITS")
    unit = acceleration_unit(word)
    if not unit:
        raise text.fail(index, f"UNITS is {word[:40]!r}, no acceleration; take the acceleration file")
    said = _check_data(text, header, values, dt, unit)
    return [Channel(stream, values, dt, unit, parse_orientation(stream), start, meta, said)]


def _need(text: TextFile, header: dict[str, tuple[str, int]], key: str) -> tuple[str, int]:
    """Value and line of a key that must be there."""
    if not header.get(key, ("",))[0]:
        raise text.fail(len(header) - 1, f"the header has no {key}")
    return header[key]


def _check_data(
    text: TextFile,
    header: dict[str, tuple[str, int]],
    values: NDArray[np.float64],
    dt: float,
    unit: str,
) -> tuple[str, ...]:
    """Hold DURATION_S and PGA_CM/S^2 against the data; say where TIME_PGA_S is another."""
    from romdam.config.sections.motions.records import unit_in_si

    cm = unit_in_si(unit) / 0.01
    word, index = header.get("DURATION_S", ("", 0))
    if word:
        check_length(text, index, text.real(word, index, "DURATION_S"), values.size, dt, 0.5 * dt)
    word, index = header.get("PGA_CM/S^2", ("", 0))
    peak = cm * float(np.max(np.abs(values), initial=0.0))
    if word and np.isfinite(peak):
        check_peak(text, index, text.real(word, index, "PGA_CM/S^2"), peak, 1e-6)
    word, index = header.get("TIME_PGA_S", ("", 0))
    at = round(text.real(word, index, "TIME_PGA_S") / dt) if word else int(np.argmax(np.abs(values)))
    if 0 <= at < values.size and cm * abs(values[at]) >= (1.0 - PEAK_SHARE) * peak:
        return ()
    return (f"the peak is stated at {word} s, the data's is at {np.argmax(np.abs(values)) * dt:g} s",)


def write_esm(channel: Channel, path: Path) -> None:
    """Write one component; unknown keys stay empty, values in cm/s2 with six decimals."""
    from romdam.config.sections.motions.records import unit_in_si

    values = channel.data * (unit_in_si(channel.unit) / 0.01)
    peak = int(np.argmax(np.abs(values)))
    start = channel.start.replace("-", "").replace(":", "").replace("T", "_")
    known: dict[str, object] = {key: channel.meta.get(name, "") for name, key in _META.items()}
    known |= {
        "DATE_TIME_FIRST_SAMPLE_YYYYMMDD_HHMMSS": start,
        "SAMPLING_INTERVAL_S": f"{channel.dt:.6f}",
        "NDATA": values.size,
        "DURATION_S": f"{(values.size - 1) * channel.dt:.6f}",
        "STREAM": channel.code,
        "UNITS": "cm/s^2",
        "PGA_CM/S^2": f"{values[peak]:.6f}",
        "TIME_PGA_S": f"{peak * channel.dt:.6f}",
        "HEADER_FORMAT": "DYNA 1.2",
        "DATA_TYPE": "ACCELERATION",
    }
    lines = [f"{key}: {known.get(key, '')}".rstrip() for key in KEYS]
    path.write_text(
        "\n".join([*lines, *(f"{v:.6f}" for v in values)]) + "\n", encoding="latin-1", errors="replace"
    )
