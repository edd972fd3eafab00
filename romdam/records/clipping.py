"""Signs that a recorder or its sensor was driven beyond its range.

References
----------
Kleckner, J. K. et al. (2022). Automated detection of clipping in broadband earthquake records. SRL 93(2A),
880-896: the tests `std_dev`, `jerk` and `ping` of gmprocess (USGS, public domain), with limits of ours.
Ringler, A. T. et al. (2012). Data quality of seismic records from the Tohoku, Japan, earthquake. SRL 83(3).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SAME = 6  # samples in a row at the extreme; real peaks of digital records repeat two or three times
FINE = 100  # values; with fewer the extreme is often met by chance
STRONG = 0.05  # of the peak, to both sides of which the motion is not looked at
NEIGHBOURS = 12  # samples
TOP = 0.85  # of the largest and the least value
FLAT = 1e-3  # of the peak, standard deviation of the neighbours
MOST_FLAT = (5, 0.1)  # flat neighbourhoods: their number, and their share of what lies near the extremes
CONTENT, NEEDED = 0.99, 0.005  # of the power; cycles a sample, that its highest frequency may have
JUMP = 0.8  # of the range, between two samples; the components of FEMA P-695 have up to 0.69
JERK = 100.0  # times the median of the second differences
STRAIGHT, MOST_PARTS = 1e-4, 100  # of the peak, that digits leave; samples on one line
MOST_JERKS = 35  # the 100 components have up to 25, those of gmprocess' test set that saw jumps 45 and more


def clipping(data: Array) -> str:
    """Say why samples (nt,) look clipped; "" where they do not.

    Samples far closer than the motion needs, as of records at a higher rate than they were recorded at, are
    thinned out first: the tops of a smooth motion are flat from sample to sample.
    """
    thinned = _thinned(data)
    for extreme in (
        np.max(thinned),
        np.min(thinned),
    ):  # many samples at the largest or the least value exactly
        if abs(extreme) < 0.5 * np.max(np.abs(thinned)) or extreme == 0.0:
            continue
        run, times = longest_run(thinned == extreme), np.count_nonzero(thinned == extreme)
        if run >= SAME:
            return f"{run} samples in a row at {extreme:g} (limit {SAME - 1})"
        if times >= 2 * SAME and np.unique(thinned).size > FINE:
            return f"{times} samples are at {extreme:g} and none beyond"

    around_median = data - np.median(data)
    strong = np.flatnonzero(np.abs(around_median) >= STRONG * np.max(np.abs(around_median)))
    motion = around_median[strong[0] : strong[-1] + 1]

    # neighbourhoods that hardly move near the extremes, as those of a sensor at its stop (`std_dev`)
    every = max(1, round(data.size / thinned.size))
    centred = motion[::every] - np.mean(motion)
    peak = np.max(np.abs(centred))
    if centred.size > NEIGHBOURS and peak > 0.0:
        around = np.lib.stride_tricks.sliding_window_view(centred / peak, NEIGHBOURS)
        near = (around[:, 0] >= TOP * np.max(around)) | (around[:, 0] <= TOP * np.min(around))
        tops = around[near]
        flat = int(np.count_nonzero(np.std(tops, axis=1) < FLAT))
        if flat > max(MOST_FLAT[0], MOST_FLAT[1] * len(tops)):
            return (
                f"{flat} of the {len(tops)} samples beyond {100 * TOP:g} % of the extremes hardly move "
                f"(limit {100 * MOST_FLAT[1]:g} %)"
            )

    # steps across most of the range (`ping`), and bends far beyond the usual (`jerk`)
    if motion.size <= FINE or np.unique(motion).size <= FINE:
        return ""
    step = float(np.max(np.abs(np.diff(motion))) / np.ptp(motion))
    if step > JUMP:
        return f"it jumps by {100 * step:.0f} % of its range between two samples (limit {100 * JUMP:g} %)"
    bend = np.abs(np.gradient(np.gradient(motion)))
    jerks = int(np.count_nonzero(bend >= JERK * np.median(bend))) if np.median(bend) > 0.0 else 0
    if jerks > MOST_JERKS and not _is_interpolated(data):
        return f"it bends {JERK:g} times more than usual at {jerks} samples (limit {MOST_JERKS})"
    return ""


def _thinned(data: Array) -> Array:
    """Every n-th sample (nt / n,), where n = 1 unless nearly all power lies far below Nyquist's frequency."""
    power = np.abs(np.fft.rfft(data - np.mean(data))) ** 2
    below = np.cumsum(power)
    if data.size < FINE or not below[-1] > 0.0:
        return data
    share = (int(np.searchsorted(below, CONTENT * below[-1])) + 1) / data.size  # cycles a sample
    return np.asarray(data[:: max(1, int(NEEDED / share))])


def _is_interpolated(data: Array) -> bool:
    """Whether straight lines between every n-th sample make all others; they bend at these alone."""
    index, slack = np.arange(data.size), STRAIGHT * np.max(np.abs(data))
    for parts in range(2, min(MOST_PARTS, data.size // 2) + 1):
        whole = index[: (data.size - 1) // parts * parts + 1]
        if np.max(np.abs(np.interp(whole, whole[::parts], data[whole[::parts]]) - data[whole])) <= slack:
            return True
    return False


def longest_run(flags: NDArray[np.bool_]) -> int:
    """Length of the longest row of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return int(np.max(edges[1::2] - edges[::2], initial=0))
