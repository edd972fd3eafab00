"""What a recorder adds to the motion: a constant offset, and drift."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from romdam.records.processing.integrate import velocity

Array = NDArray[np.float64]
WINDOW = 10.0  # s
OFFSET_SHARE = 5.0  # of the peak velocity, see `find_offset`
SHORTEST = 2.0  # s; a shorter series may be a pulse, and has no time to show what it moves about
DRIFT_SHARE = 0.1  # of the peak acceleration; the 100 components of FEMA P-695 stay below 0.053
COUNTED_AS_MOTION = "is no motion of the ground and counts in every measure"


def find_offset(acc: Array, dt: float) -> Array:
    """Find the recorder's constant offset of each component, 0 where there is none.

    The mean of a record is its last velocity over its duration. It is an offset where it alone would make
    more than `OFFSET_SHARE` times the largest velocity of the rest. A pulse of one sign makes at most 2
    times that, an acceleration that rises along a line 4 times, white noise 5 times in one of 1e5 records;
    the raw records of digital recorders have thousands, processed ones less than 0.1.

    Parameters
    ----------
    acc : (k, nt) [m/s2]
    dt : [s]

    Returns
    -------
    (k,) [m/s2]
    """
    duration = (acc.shape[-1] - 1) * dt
    if duration < SHORTEST:
        return np.zeros(acc.shape[0])
    mean = np.mean(acc, axis=-1)
    rest = np.max(np.abs(velocity(acc - mean[:, None], dt)), axis=-1)
    return np.where(np.abs(mean) * duration > OFFSET_SHARE * rest, mean, 0.0)


def moving_average(acc: Array, dt: float) -> Array:
    """Average over `WINDOW` seconds around each sample, fewer at the ends, (..., nt).

    The ground's own motion averages to its change of velocity over `WINDOW`, which is next to nothing; what
    remains is the recorder's.
    """
    count, half = acc.shape[-1], max(1, round(0.5 * WINDOW / dt))
    total = np.zeros((*acc.shape[:-1], count + 1))
    np.cumsum(acc, axis=-1, out=total[..., 1:])
    sample = np.arange(count)
    first, last = np.maximum(sample - half, 0), np.minimum(sample + half + 1, count)
    return (total[..., last] - total[..., first]) / (last - first)


def doubt_drift(acc: Array, dt: float) -> str:
    """Say where drift reaches more than `DRIFT_SHARE` of a component's peak; "" where it does not.

    Parameters
    ----------
    acc : (k, nt) [m/s2]; records shorter than `WINDOW` cannot be judged
    """
    if (acc.shape[-1] - 1) * dt < WINDOW:
        return ""
    drift, peak = (np.max(np.abs(rows), axis=-1) for rows in (moving_average(acc, dt), acc))
    share = drift / np.where(peak > 0.0, peak, 1.0)
    worst = int(np.argmax(share))
    if share[worst] <= DRIFT_SHARE:
        return ""
    return (
        f"the acceleration averages over {WINDOW:g} s to {drift[worst]:.3g} m/s2, {100 * share[worst]:.0f} % "
        f"of its peak (limit {100 * DRIFT_SHARE:g} %), which {COUNTED_AS_MOTION}; correct the record, for "
        "example `correction: peer`"
    )
