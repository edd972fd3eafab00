"""Hold what a file says of its data against them: unit, peak, length."""

from __future__ import annotations

import re

from romdam.records.formats.text import TextFile

# accelerations as agencies write them, without spaces, carets and the "ec" of "sec"
_ACCELERATIONS = {
    "g": "g",
    "mg": "0.001 g",
    "%g": "0.01 g",
    "gal": "cm/s2",
    "gals": "cm/s2",
    "cm/s2": "cm/s2",
    "cms-2": "cm/s2",
    "m/s2": "m/s2",
    "ms-2": "m/s2",
    "mm/s2": "0.001 m/s2",
    "in/s2": "0.0254 m/s2",
    "ft/s2": "0.3048 m/s2",
}
PEAK_SHARE = 0.01  # of the peak; headers round it to three digits


def acceleration_unit(word: str) -> str:
    """A file's unit in romdam's spelling; "" for anything else, however much of it looks like a unit."""
    text = re.sub(r"\s|\^|\*\*|·", "", word.lower()).strip(".").replace("²", "2").replace("⁻", "-")
    return _ACCELERATIONS.get(text.replace("sec", "s").replace("/s/s", "/s2"), "")


def check_peak(text: TextFile, index: int, stated: float, measured: float, digit: float = 0.0) -> None:
    """Refuse data whose peak is not the one that line `index` states.

    Parameters
    ----------
    stated, measured : in one unit, of any sign
    digit : the last one printed

    Raises
    ------
    RecordError
        naming both.
    """
    most = max(abs(stated), abs(measured))
    if abs(abs(stated) - abs(measured)) > PEAK_SHARE * most + digit:
        raise text.fail(
            index,
            f"a peak of {abs(stated):g} is stated, the data's is {abs(measured):g}; the file is altered or "
            "the "
            "unit wrong, fetch it again",
        )


def check_length(text: TextFile, index: int, stated: float, count: int, dt: float, slack: float) -> None:
    """Refuse data whose length is not the one that line `index` states.

    Parameters
    ----------
    stated : length [s]; agencies count n or n - 1 steps
    count : samples in the file
    dt : [s]
    slack : what rounding explains [s]

    Raises
    ------
    RecordError
        naming both.
    """
    if not (count - 1) * dt - slack <= stated <= count * dt + slack:
        raise text.fail(
            index,
            f"a length of {stated:g} s is stated, but {count} samples at dt = {dt:g} s are {count * dt:g} s; "
            "the file is cut short or altered, fetch it again",
        )
