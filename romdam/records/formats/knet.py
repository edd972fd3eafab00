"""K-NET and KiK-net ASCII of NIED: 17 header lines, then counts, eight in a line; one component a file.

References
----------
NIED, "About K-NET ASCII format" (knetform_en.html); its list of questions: the maximum acceleration is of the
record without its mean. ObsPy's reader of the format checks neither length nor peak.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from romdam.core.errors import RecordError
from romdam.records.channel import Channel, parse_orientation
from romdam.records.formats.text import NUMBER, TextFile, check_peak, read_text

_LABELS = (
    r"Origin Time", r"Lat\.", r"Long?\.", r"Depth\. \(km\)", r"Mag\.", r"Station Code", r"Station Lat\.",
    r"Station Long?\.", r"Station Height\(m\)", r"Record Time", r"Sampling Freq\(Hz\)", r"Duration Time\(s\)",
    r"Dir\.", r"Scale Factor", r"Max\.? Acc\. \(gal\)", r"Last Correction", r"Memo\.?",
)  # fmt: skip
ORIGIN, MAGNITUDE, STATION, START, RATE, DURATION, DIRECTION, SCALE, PEAK = 0, 4, 5, 9, 10, 11, 12, 13, 14
_RATE = re.compile(r"(\d+(?:\.\d+)?)\s*Hz", re.IGNORECASE)
_SCALE = re.compile(r"(\d+(?:\.\d+)?)\s*\(gal\)\s*/\s*(\d+(?:\.\d+)?)", re.IGNORECASE)
_KIKNET = {"1": "NS1", "2": "EW1", "3": "UD1", "4": "NS2", "5": "EW2", "6": "UD2"}  # 1 in the hole, 2 above
BOREHOLE, SURFACE = "_borehole", "_surface"  # in the names of KiK-net's records
_SENSORS = {"": "", "1": BOREHOLE, "2": SURFACE}
_SUFFIX = re.compile(r"\.(?:EW|NS|UD)([12]?)", re.IGNORECASE)
JAPAN, DELAY = timedelta(hours=9), timedelta(seconds=15)  # the logger's clock; it stamps 15 s late
_DIGIT = 0.001  # gal, of the printed peak


def is_knet(head: str) -> bool:
    """Tell whether the start of a file looks like K-NET's."""
    return head.startswith("Origin Time")


def is_component(path: Path) -> bool:
    """Tell whether a file's suffix is that of one component of K-NET or KiK-net."""
    return _SUFFIX.fullmatch(path.suffix) is not None


def of_one_record(paths: Iterable[Path]) -> list[tuple[str, list[Path]]]:
    """Name of each record and its files: NAME.EW, .NS, .UD are one, KiK-net's .EW1 ... and .EW2 ... another.

    What has other suffixes is a record of its own.
    """
    records: dict[tuple[Path, str], list[Path]] = {}
    for path in paths:
        match = _SUFFIX.fullmatch(path.suffix)
        key = (path, path.stem) if match is None else (path.parent, path.stem + _SENSORS[match[1]])
        records.setdefault(key, []).append(path)
    return [(name, files) for (_, name), files in records.items()]


def missing_files(paths: list[Path]) -> list[str]:
    """Names of the components that the files of a record of K-NET or KiK-net lack."""
    if len(paths) > 2 or not is_component(paths[0]):
        return []
    sensor = paths[0].suffix[3:]
    known = {path.suffix.upper() for path in paths}
    wanted = [f".{direction}{sensor}" for direction in ("EW", "NS", "UD")]
    return [paths[0].stem + suffix for suffix in wanted if suffix not in known]


def read_knet(path: Path) -> list[Channel]:
    """Read one component, as m/s2 with the offset that it was recorded with.

    Raises
    ------
    RecordError
        for a header line that is not there, and a length or a peak that is not met.
    """
    text = read_text(path)
    header = []
    for index, label in enumerate(_LABELS):
        match = re.match(rf"{label}(.*)$", text.head(index))
        if match is None:
            expected, line = label.replace("\\", "").replace("?", ""), text.head(index)
            raise text.fail(index, f'expected "{expected} ...", got {line.strip()[:60]!r}')
        header.append(match[1].strip())
    rate = float(_match(text, RATE, _RATE, header, '"100Hz"')[1])
    if rate <= 0.0:
        raise text.fail(RATE, f"the sampling frequency must be positive, got {rate:g} Hz")
    scale = _match(text, SCALE, _SCALE, header, '"2000(gal)/8388608"')
    if float(scale[1]) <= 0.0 or float(scale[2]) <= 0.0:
        raise text.fail(SCALE, f"the scale factor must be positive, got {header[SCALE]!r}")
    gal = float(scale[1]) / float(scale[2])  # of one count
    counts, _ = text.free(len(_LABELS))
    if counts.size == 0 or not np.all(np.isfinite(counts) & (counts == np.round(counts))):
        raise RecordError(f"{path}: line {len(_LABELS) + 1}: expected whole numbers after the header")
    dt = 1.0 / rate
    duration = text.real(header[DURATION], DURATION, "Duration Time(s)")
    peak = text.real(header[PEAK], PEAK, "Max. Acc. (gal)")
    if round(duration / dt) != counts.size:  # the logger stores whole seconds
        raise text.fail(
            DURATION,
            f"{duration:g} s at {1.0 / dt:g} Hz are stated, the file holds {counts.size} samples; it is cut "
            "short or altered, fetch it again",
        )
    measured = float(np.max(np.abs(gal * (counts - np.mean(counts)))))
    check_peak(text, PEAK, peak, measured, _DIGIT)
    warnings: tuple[str, ...] = ()
    if abs(peak - measured) > 1.5 * _DIGIT:
        warnings = (f"the header states a peak of {peak:g} gal, the data's is {measured:.3f} gal",)
    direction = header[DIRECTION].replace("-", "")
    code = _KIKNET.get(direction, direction)
    meta: dict[str, object] = {
        "format": "KNET",
        "network": "BO",  # FDSN's code of NIED
        "station": header[STATION],
        "event": _utc(header[ORIGIN]),
        "header_pga_gal": peak,
    }
    if NUMBER.fullmatch(header[MAGNITUDE]):  # empty where the records come before the bulletin
        meta["magnitude"] = float(header[MAGNITUDE])
    start = _utc(header[START], DELAY)
    where = parse_orientation(code)
    return [Channel(code, 0.01 * gal * counts, dt, "m/s2", where, start, meta, warnings)]


def _match(
    text: TextFile, index: int, pattern: re.Pattern[str], header: list[str], example: str
) -> re.Match[str]:
    """Match the value of header line `index`, or raise with an example of what was expected."""
    match = pattern.fullmatch(header[index])
    if match is None:
        raise text.fail(index, f"expected a value such as {example}, got {header[index][:40]!r}")
    return match


def _utc(text: str, late: timedelta = timedelta(0)) -> str:
    """ISO 8601 of a Japanese time, "" for what is none."""
    try:
        return (datetime.strptime(text, "%Y/%m/%d %H:%M:%S") - JAPAN - late).isoformat()
    except (ValueError, OverflowError):
        return ""
