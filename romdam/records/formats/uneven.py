"""Digitized film has a time with every value, at uneven steps: straight lines make a series of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from romdam.core.errors import RecordError

Array = NDArray[np.float64]
INTERVAL = 0.005  # s; agencies bring digitized film to 200 samples a second for their Volume 2 ...
FINER = 1.02  # ... and it is halved until it is at most so many mean steps, so that no motion is folded back
LONGEST_GAP = 0.5  # s between two points; more is a gap, not a step of digitizing


def even_series(
    times: Array, values: Array, digit: float, location: str
) -> tuple[Array, float, tuple[str, ...]]:
    """Values at an even interval, that interval [s], and what is said of it.

    Parameters
    ----------
    times, values : (n,) as printed, times in s
    digit : last printed digit of the times [s]
    location : names the channel in errors

    Raises
    ------
    RecordError
        for times that fall, or leave a gap.
    """
    if times.size < 2 or not np.all(np.isfinite(times)):
        raise RecordError(f"{location}: fewer than two times, or one that is no number; the file is damaged")
    steps = np.diff(times)
    worst = int(np.argmin(steps))
    if steps[worst] < 0.0:
        raise RecordError(
            f"{location}: the times fall from {times[worst]:g} to {times[worst + 1]:g} s; the file is damaged"
        )
    if (longest := float(np.max(steps))) > LONGEST_GAP:
        raise RecordError(
            f"{location}: {longest:g} s without a value from {times[np.argmax(steps)]:g} s on (limit "
            f"{LONGEST_GAP:g} s); the file is damaged"
        )
    dt = float((times[-1] - times[0]) / steps.size)
    if dt > 0.0 and np.max(np.abs(times - times[0] - dt * np.arange(times.size))) <= 0.6 * digit:
        return values, dt, ()
    interval = INTERVAL
    while interval > FINER * dt > 0.0:
        interval *= 0.5
    grid = times[0] + interval * np.arange(int((times[-1] - times[0]) / interval + 1e-6) + 1)
    even = np.interp(grid, times, values)
    kept = float(np.max(np.abs(even))) / max(float(np.max(np.abs(values))), 1e-300)
    said = (
        f"the times are uneven ({np.mean(steps):.4g} s on average): read at {interval:g} s by straight "
        f"lines, which keep {100.0 * kept:.4g} % of the peak"
    )
    return even, interval, (said,)
