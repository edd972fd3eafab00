"""What of a record's pads the ground still moves in."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from romdam.records.processing.integrate import displacement, velocity

REST = 1e-3  # of the peaks: the ground is at rest below
LONG = 2.0  # times the record's duration: what pads cost is said


def moving_samples(acc: NDArray[np.float64], dt: float, before: int, after: int) -> slice:
    """Find the samples that must be kept of a padded record, so that its histories stay.

    Pads are kept as far as the filter's transients reach: cutting them would bring back the drift (Boore
    2005). Further out nothing moves. A start that is cut away leaves out its velocity for the rest of the
    record and its displacement; together they stay below `REST` of the largest displacement. After the end,
    acceleration, velocity and displacement are below `REST` of their peaks.

    Parameters
    ----------
    acc : (k, nt) [m/s2]
    before, after : samples of padding

    Returns
    -------
    slice of the samples
    """
    count = acc.shape[-1]
    vel, disp = velocity(acc, dt), displacement(acc, dt)
    pga, pgv, pgd = (np.max(np.abs(rows)) for rows in (acc, vel, disp))
    left = dt * (count - np.arange(count))
    rests = np.all(np.abs(acc) <= REST * pga, axis=0) & np.all(np.abs(vel) <= REST * pgv, axis=0)
    starts = rests & np.all(np.abs(disp) + np.abs(vel) * left <= REST * pgd, axis=0)
    ends = rests & np.all(np.abs(disp) <= REST * pgd, axis=0)
    moves_first, moves_last = np.flatnonzero(~starts), np.flatnonzero(~ends)
    first = min(before, moves_first[0] - 1 if moves_first.size else before)
    last = max(count - after, moves_last[-1] + 2 if moves_last.size else count - after)
    return slice(max(0, int(first)), min(count, int(last)))


def doubt_pads(samples: int, before: int, after: int, dt: float) -> str:
    """Say what pads cost where they make a record of `samples`, pads included, much longer; else ""."""
    record = samples - before - after
    if samples <= LONG * record:
        return ""
    return (
        f"pads of {before * dt:.4g} s before and {after * dt:.4g} s after make {samples * dt:.4g} s of a "
        f"record of {record * dt:.4g} s, and a run takes {samples / record:.2g} times as long; they hold the "
        "transients of the filter, and a higher high-pass makes them shorter"
    )
