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
JUMP = 0.8  # of the range, between two samples; the components of FEMA P-695 have up to 0.69
JERK = 100.0  # times the median of the second differences
MOST_JERKS = 35  # the 100 components have up to 25, those of gmprocess' test set that saw jumps 45 and more


def clipping(data: Array) -> str:
    """Say why samples (nt,) look clipped; "" where they do not."""
    for extreme in (np.max(data), np.min(data)):  # many samples at the largest or the least value exactly
        if abs(extreme) < 0.5 * np.max(np.abs(data)) or extreme == 0.0:
            continue
        run, times = longest_run(data == extreme), np.count_nonzero(data == extreme)
        if run >= SAME:
            return f"{run} samples in a row at {extreme:g} (limit {SAME - 1})"
        if times >= 2 * SAME and np.unique(data).size > FINE:
            return f"{times} samples are at {extreme:g} and none beyond"

    around_median = data - np.median(data)
    strong = np.flatnonzero(np.abs(around_median) >= STRONG * np.max(np.abs(around_median)))
    motion = around_median[strong[0] : strong[-1] + 1]

    # neighbourhoods that hardly move near the extremes, as those of a sensor at its stop (`std_dev`)
    centred = motion - np.mean(motion)
    peak = np.max(np.abs(centred))
    if motion.size > NEIGHBOURS and peak > 0.0:
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
    if jerks > MOST_JERKS:
        return f"it bends {JERK:g} times more than usual at {jerks} samples (limit {MOST_JERKS})"
    return ""


def longest_run(flags: NDArray[np.bool_]) -> int:
    """Length of the longest row of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return int(np.max(edges[1::2] - edges[::2], initial=0))
