"""Read record files of public repositories by a parser of its own, and compare every sample with romdam's.

    python tests/reference/independent_records.py FOLDER...

prints how many files agree to 1e-12 of their peak and in their interval, how many were read but are of a form
that is not known here, and why others were refused. The parser has plain patterns and none of romdam's code:
PEER AT2, AFAD, JMA csv, CSMNC, K-NET and KiK-net. The files are not part of this repository;
`docs/public_records.md` has their sources and what came out.
"""

from __future__ import annotations

import re
import sys
import warnings
from collections import Counter
from pathlib import Path

import numpy as np

from romdam.core.errors import RomdamError
from romdam.records.formats.registry import read_channels

SUFFIXES = {
    ".at2", ".txt", ".dat", ".csv", ".g3", ".th", ".asc", ".ew", ".ns", ".ud", ".ew1", ".ns1", ".ud1", ".ew2",
    ".ns2", ".ud2",
}  # fmt: skip
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
Parsed = tuple[float, list[np.ndarray]]  # interval [s], samples in the file's unit


def _found(pattern: str, text: str) -> re.Match[str]:
    """The first match; a file of a known form has one."""
    match = re.search(pattern, text)
    if match is None:
        raise ValueError(f"no {pattern}")
    return match


def parsed(path: Path) -> Parsed | None:
    """Interval and samples of a file; None for a form that is not known here."""
    text = path.read_bytes().decode("latin-1").replace("\r", "")
    lines = text.split("\n")
    if path.suffix.lower() == ".at2":
        return _peer(lines)
    if "STRONG GROUND MOTION RECORDS OF TURK" in lines[0]:
        interval = float(_found(r"INTERVAL.*?:\s*([\d.]+)", text)[1])
        return interval, _columns([line.split() for line in lines[18:]])
    if lines[0].startswith("SITE CODE"):
        return 1.0 / float(_found(r"RATE=\s*(\d+)", text)[1]), _columns([x.split(",") for x in lines[7:]])
    if "EQUALLY SPACED INTERVALS" in text:
        interval = float(_found(r"INTERVALS OF:\s*([\d.]+)", text)[1])
        return interval, [_series(lines[lines.index("") :])]
    if lines[0].startswith("Origin Time"):
        gal, counts = _found(r"(\d+)\(gal\)/(\d+)", text).groups()
        rate = float(_found(r"Freq\(Hz\)\s*(\d+)", text)[1])
        return 1.0 / rate, [_series(lines[17:]) * float(gal) / float(counts) * 0.01]
    return None


def _peer(lines: list[str]) -> Parsed | None:
    for number, line in enumerate(lines[:12]):
        match = re.search(r"NPTS\s*=\s*(\d+)\s*,?\s*DT\s*=\s*([.\d]+)", line, re.I)
        match = match or re.match(r"\s*(\d+)\s+([.\d]+)\s+NPTS", line)
        if match:
            return float(match[2]), [_series(lines[number + 1 :])[: int(match[1])]]
    return None


def _series(lines: list[str]) -> np.ndarray:
    return np.array([float(word) for word in NUMBER.findall(" ".join(lines))])


def _columns(rows: list[list[str]]) -> list[np.ndarray]:
    return list(np.array([[float(word) for word in row] for row in rows if len(row) == 3]).T)


def outcome(path: Path) -> str:
    """What comes of one file."""
    try:
        own = parsed(path)
    except (ValueError, TypeError, IndexError):
        own = None
    try:
        channels = read_channels(path)
    except RomdamError as error:
        return "refused: " + re.sub(r"\d[\d.]*", "#", str(error).partition(": ")[2])[:90]
    if own is None:
        return "read, of a form that is not known here"
    interval, series = own
    agree = len(series) == len(channels) and all(
        abs(channel.dt - interval) <= 1e-9 * interval
        and channel.data.shape == values.shape
        and np.abs(channel.data - values).max() <= 1e-12 * np.abs(values).max()
        for channel, values in zip(channels, series, strict=True)
    )
    return "agrees" if agree else f"DIFFERS: {path}"


def main() -> int:
    warnings.simplefilter("ignore")
    found = Counter(
        outcome(path)
        for folder in sys.argv[1:]
        for path in sorted(Path(folder).rglob("*"))
        if path.is_file() and path.suffix.lower() in SUFFIXES
    )
    for text, count in found.most_common():
        print(f"{count:5d}  {text}")
    return int(any(text.startswith("DIFFERS") for text in found))


if __name__ == "__main__":
    sys.exit(main())
