"""Read every record file below folders of public repositories, and hold header peaks against what was read.

    python tests/benchmarks/public_records.py FOLDER...

prints a row for each file: its format, the largest value of its first channel in the file's unit, and the
peak that its header states, found here by other patterns; a peak is met within 1 % or its last printed digit.
The files are not part of this repository; `docs/public_records.md` has their sources and what came out.
"""

from __future__ import annotations

import re
import sys
import warnings
from pathlib import Path

import numpy as np

from romdam.core.errors import RomdamError
from romdam.records.formats.registry import read_channels

SKIPPED = {
    ".json",
    ".xml",
    ".md",
    ".yml",
    ".yaml",
    ".pkl",
    ".xlsx",
    ".h5",
    ".html",
    ".png",
    ".csv",
    ".py",
    ".zip",
}
NUMBER = r"([-+]?\d*\.?\d+(?:E[-+]?\d+)?)"
PEAKS = {  # of the first channel, in the unit of the data, or with a factor to it
    "CSMIP": [(rf"peak acceleration\s*=\s*{NUMBER}", 1.0), (rf"max\s*=\s*{NUMBER} ?g", 1.0)],
    "GEONET": [(rf"Acceleration:\s+peak\s+{NUMBER}", 1.0)],
    "ESM": [(rf"PGA_CM/S\^2: {NUMBER}", 1.0)],
    "KNET": [(rf"Max\.? Acc\. \(gal\)\s+{NUMBER}", 0.01)],
    "COSMOS": [(rf"max\s*=\s*{NUMBER}\s+(?:cm/sec2|counts)", 1.0)],
    "SMC": [(rf"pk(?:\s+acc)?\s*=\s*{NUMBER}", 1.0)],
}


def stated_peak(path: Path, kind: str) -> tuple[float, float]:
    """The peak of the header and its last digit; 0 where there is none."""
    head = path.read_bytes()[:6000].decode("latin-1")
    for pattern, factor in PEAKS.get(kind, []):
        if match := re.search(pattern, head, re.I):
            digits = len(match[1].partition(".")[2].partition("E")[0])
            return abs(float(match[1])) * factor, factor * 10.0**-digits
    return 0.0, 0.0


def row(path: Path) -> tuple[str, str]:
    """What came out of a file: "met", "read" (no peak is stated), "refused" or "NOT MET", and the figures."""
    try:
        channels = read_channels(path)
    except RomdamError as error:
        return "refused", " ".join(str(error).replace(str(path), "").split())[:150]
    first = channels[0]
    kind = str(first.meta.get("format"))
    data = first.data - (np.mean(first.data) if kind == "KNET" else 0.0)
    found = float(np.nanmax(np.abs(data)))
    stated, digit = stated_peak(path, kind)
    if first.unit == "0.1 g":
        stated, digit = 10.0 * stated, 10.0 * digit
    figures = f"{kind} {first.meta.get('level', '')}, {len(channels)} channels, {found:.6g} {first.unit}"
    if not stated:
        return "read", figures
    met = abs(stated - found) <= max(0.01 * stated, digit)
    return ("met" if met else "NOT MET"), f"{figures}, header {stated:.6g}"


def main() -> None:
    warnings.simplefilter("ignore")
    counts: dict[str, int] = {}
    for folder in map(Path, sys.argv[1:]):
        for path in sorted(p for p in folder.rglob("*") if p.is_file() and p.suffix.lower() not in SKIPPED):
            outcome, figures = row(path)
            counts[outcome] = counts.get(outcome, 0) + 1
            print(f"{outcome:8s} {path.relative_to(folder)}: {figures}", flush=True)
    print(counts)


if __name__ == "__main__":
    main()
