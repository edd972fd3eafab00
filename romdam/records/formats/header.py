"""What the header of a file states, held against its data: nothing that contradicts them passes unsaid."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from romdam.core.errors import RecordError
from romdam.records.formats.statements import COUNT, INTERVAL, LENGTH, PEAK, RATE, Statement, statements
from romdam.records.formats.text import PEAK_SHARE, TextFile
from romdam.records.plausible import DOUBTED_UNIT

Array = NDArray[np.float64]
FEWEST = 16  # samples that a header counts; fewer count something else
DIGITS = 0.01  # of an interval, that its printed digits may lose
EXACT = 1e-3
LARGEST = 1e20  # in any unit; beyond it a sample is a mark of no value, or damage
MISTAKES = (9.80665, 100.0, 980.665, 1000.0)  # ratios of units of acceleration
LIKE_A_MISTAKE = 0.01  # of such a ratio
_BARE = re.compile(r"[-+.\deE,;\s]+")
_INTERVALS = (5e-4, 0.1)  # s, of a bare number that is taken for an interval


@dataclass(frozen=True)
class Series:
    """Values (n,) of a channel and their unit; "" where it is not known."""

    values: Array
    unit: str


def check_header(
    text: TextFile,
    lines: Sequence[tuple[int, str]],
    series: Sequence[Series],
    dt: float,
    unit: str,
    decimal_comma: bool = False,
) -> tuple[str, ...]:
    """Hold every statement of a header against the data; return what is said of those that differ.

    Parameters
    ----------
    lines : index from 0 and text of each line of the header
    series : channels of the file, of one length
    dt : [s]
    unit : of peaks that are stated without one

    Raises
    ------
    RecordError
        for an interval, a rate or a count that the data contradict, and a peak that another unit explains.
    """
    said: list[str] = []
    agreeing: set[str] = set()  # what of interval, rate and count another line states rightly
    wrong: list[tuple[str, RecordError]] = []
    for index, line in lines:
        if bare := _bare_doubt(text, index, line, series, dt):
            said.append(bare)
        stated = statements(line, decimal_comma=decimal_comma)
        for one in stated:
            what = COUNT if one.kind == COUNT else INTERVAL
            if (error := _wrong_time(text, index, one, series, dt)) is not None:
                wrong.append((what, error))
            elif one.kind in (COUNT, INTERVAL, RATE):
                agreeing.add(what)
            said += _length_doubt(index, one, series, dt)
        said += _peak_doubts(text, index, [one for one in stated if one.kind == PEAK], series, unit)
    for what, error in wrong:
        if what not in agreeing:  # else one of them is of the record before it was resampled or cut
            raise error
        said.append(str(error).removeprefix(f"{text.path}: "))
    return tuple(dict.fromkeys(said))


def _wrong_time(
    text: TextFile, index: int, stated: Statement, series: Sequence[Series], dt: float
) -> RecordError | None:
    """The error of an interval, a rate or a count that is not the data's."""
    count = series[0].values.size if series else 0
    if stated.kind in (INTERVAL, RATE):
        has = dt if stated.kind == INTERVAL else 1.0 / dt
        slack = max(EXACT * has, min(stated.slack, DIGITS * has))
        if abs(stated.value - has) > slack * (1.0 + 1e-9):
            interval = stated.value if stated.kind == INTERVAL else 1.0 / stated.value
            return text.fail(
                index, f"an interval of {interval:g} s is stated, `dt` or the times say {dt:g} s"
            )
    wrong_count = stated.kind == COUNT and int(stated.value) not in (count, count * len(series))
    if wrong_count and stated.value >= FEWEST and count:
        times = count / stated.value
        why = "it is cut short"
        if times in (2.0, 3.0):
            why = f"are {times:.0f} components one below another in it? Then cut it into {times:.0f} files"
        return text.fail(index, f"{stated.value:.0f} samples are stated, the file holds {count}; {why}")
    return None


def _length_doubt(index: int, stated: Statement, series: Sequence[Series], dt: float) -> list[str]:
    """Say where a length is not the data's; agencies count n or n - 1 steps, and round."""
    count = series[0].values.size if series else 0
    slack = dt + min(stated.slack, 0.5)
    if stated.kind != LENGTH or (count - 1) * dt - slack <= stated.value <= count * dt + slack:
        return []
    return [
        f"line {index + 1} states a length of {stated.value:g} s, the data are {count * dt:g} s long; is the "
        "file cut, or `dt` wrong?"
    ]


def _peak_doubts(
    text: TextFile, index: int, stated: Sequence[Statement], series: Sequence[Series], unit: str
) -> list[str]:
    """Say where a stated peak is no channel's extreme.

    Raises
    ------
    RecordError
        where a mistake of units explains it.
    """
    extremes = _extremes(series)
    said: list[str] = []
    for one in stated:
        peak = one.value * _in_si(one.unit or unit)
        if not (peak > 0.0 and extremes.size):
            continue
        slack = max(PEAK_SHARE, one.slack / one.value)
        ratios = extremes / peak
        if np.any(np.abs(ratios - 1.0) <= 1.01 * slack):
            continue
        peaks = ratios.reshape(-1, 4)[:, :2].max(axis=1)  # of each channel
        nearest = float(peaks[np.argmin(np.abs(np.log(np.maximum(peaks, 1e-300))))])
        what, name = f"{one.value:g} {one.unit or unit}", one.unit or unit
        has = f"{nearest * one.value:.4g} {name}"
        close = max(LIKE_A_MISTAKE, slack)
        mistaken = [r for r in ratios for f in MISTAKES if min(abs(r / f - 1.0), abs(r * f - 1.0)) <= close]
        if mistaken:
            raise text.fail(
                index,
                f"a peak of {what} is stated, the data's is {mistaken[0] * one.value:.4g} {name}, "
                f"{mistaken[0]:.4g} times as much, as where one unit is taken for another; correct `unit`",
                "unit",
            )
        doubt = f"; {DOUBTED_UNIT}" if not 0.5 < nearest < 2.0 else ""
        said.append(f"line {index + 1} states a peak of {what}, the data's is {has}{doubt}")
    return said


def unit_of_peak(lines: Sequence[tuple[int, str]], columns: Sequence[Array]) -> tuple[str, str]:
    """The unit in which values have a peak that the header states, and what is said of that; "" for none."""
    finite = [values[np.abs(values) < LARGEST] for values in columns]
    sizes = np.array([np.max(np.abs(values)) for values in finite if values.size])
    for index, line in lines:
        for one in statements(line):
            if one.kind != PEAK or not one.unit or not one.value > 0.0:
                continue
            if np.any(np.abs(sizes / one.value - 1.0) <= max(1e-4, min(one.slack / one.value, PEAK_SHARE))):
                return one.unit, (
                    f"the unit {one.unit} is that of the peak of {one.value:g} in line {index + 1}, which "
                    "the data have"
                )
    return "", ""


def _extremes(series: Sequence[Series]) -> Array:
    """Largest and least values of the channels, with and without their mean [m/s2]; none where unknown."""
    found: list[float] = []
    for channel in series:
        factor = _in_si(channel.unit)
        finite = channel.values[np.abs(channel.values) < LARGEST]
        if factor <= 0.0 or not finite.size:
            return np.zeros(0)
        for values in (finite, finite - np.mean(finite)):
            found += [abs(factor * float(np.max(values))), abs(factor * float(np.min(values)))]
    return np.array(found)


def _in_si(unit: str) -> float:
    """One unit in m/s2; 0 for what is no acceleration."""
    from romdam.config.sections.motions.records import unit_in_si

    try:
        return unit_in_si(unit) if unit else 0.0
    except ValueError:
        return 0.0


def _bare_doubt(text: TextFile, index: int, line: str, series: Sequence[Series], dt: float) -> str:
    """What is said of a line of a few numbers without words, a count and an interval.

    Raises
    ------
    RecordError
        where one of them is the data's and the other is not.
    """
    line = re.sub(r"\(\s*\d*[FEGIfegi]\d[^)]*\)", " ", line).lstrip("#%!/ \t")  # a form of Fortran's
    words = line.replace(",", " ").replace(";", " ").split()
    count = series[0].values.size if series else 0
    if not (_BARE.fullmatch(line) and 1 <= len(words) <= 4):
        return ""
    counts = [int(word) for word in words if word.isdigit() and FEWEST <= int(word) < 10**9]
    steps = [float(word) for word in words if re.fullmatch(r"\d*\.\d+(?:[eE]-?\d+)?|[1-9]\d*[eE]-\d+", word)]
    steps = [step for step in steps if _INTERVALS[0] <= step <= _INTERVALS[1]]
    right_count = any(value in (count, count * len(series)) for value in counts)
    right_step = any(abs(step - dt) <= EXACT * dt for step in steps)
    if counts and steps and right_count != right_step:
        raise text.fail(
            index,
            f"{line.strip()[:40]!r} looks like a count and an interval, the data have {count} samples at "
            f"{dt:g} s",
        )
    wrong = (steps and not right_step) or (counts and steps and not right_count)
    if wrong:
        return (
            f"line {index + 1}, {line.strip()[:40]!r}, looks like a count or an interval, the data have "
            f"{count} samples at {dt:g} s"
        )
    return ""
