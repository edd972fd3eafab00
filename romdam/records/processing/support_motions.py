"""Motions of supports against the base: acceleration, and by integrating it velocity and displacement.

A record is a line between samples, so that velocity and displacement are exact at every step; both begin at
zero. A record that ends with a velocity has a displacement that drifts, and two of its copies, one later or
larger, drift apart: with them the structure between.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from romdam.core.errors import RecordError
from romdam.core.motion import GroundMotion, SupportMotion
from romdam.records.processing.integrate import displacement, velocity
from romdam.records.processing.resampling import cut_or_extended, resample_motion

_LATE = 0.01  # of the Arias intensity, that reaches the last support after the end of a run
_DRIFT = 0.1  # of the peak velocity, at the end: a record that is corrected has 0.01


def add_support_rows(
    acc: NDArray[np.float64],
    dt: float,
    motions: Sequence[SupportMotion],
    at_stations: Sequence[NDArray[np.float64]] | None = None,
) -> NDArray[np.float64]:
    """Add to a ground acceleration what supports move against it.

    Parameters
    ----------
    acc : (3, nt) of the base [m/s2]
    at_stations : (3, nt) for each motion, what it delays and multiplies; that of the base if not given [m/s2]

    Returns
    -------
    (3 + 9 k, nt) that of the base, then acceleration, velocity and displacement of k supports, x, y, z each
    """
    if not motions:
        return acc
    time = np.arange(acc.shape[1]) * dt
    relative = []  # acceleration of each support against the base, (3, nt) [m/s2]
    for k, motion in enumerate(motions):
        if motion.record is not None:
            support_acc = cut_or_extended(resample_motion(motion.record, dt), acc.shape[1])
        else:
            rows = acc if at_stations is None else at_stations[k]
            delayed = [np.interp(time - motion.delay, time, row, left=0.0) for row in rows]
            support_acc = np.reshape(motion.factor, (-1, 1)) * np.stack(delayed)
        relative.append(support_acc - acc)
    against = np.concatenate(relative)
    return np.concatenate([acc, against, velocity(against, dt), displacement(against, dt)])


def late_warnings(motions: Sequence[SupportMotion], motion: GroundMotion, end: float) -> list[str]:
    """Warn where a run ends before the record has passed its last support.

    Parameters
    ----------
    end : of the run [s]
    """
    last = max(motions, key=lambda one: one.delay)
    squared, time = (motion.acc**2).sum(axis=0), np.arange(motion.acc.shape[1]) * motion.dt
    late = squared[(time > end - last.delay) & (time <= end)].sum() / max(float(squared.sum()), 1e-300)
    if not late > _LATE:
        return []
    return [
        f"{last.name} moves {last.delay:.4g} s behind the record, and {late:.2g} of its Arias intensity "
        f"comes there after the end of the run at {end:.4g} s; set transient.duration to "
        f"{end + last.delay:.4g} s"
    ]


def refuse_drift(motion: GroundMotion, location: str) -> None:
    """Raise where a record's displacement drifts.

    Parameters
    ----------
    location : file and key, for messages

    Raises
    ------
    RecordError
    """
    speed = np.abs(velocity(motion.acc, motion.dt))
    peak, end = float(speed.max(initial=0.0)), float(speed[:, -1].max(initial=0.0))
    if end > _DRIFT * peak:
        raise RecordError(
            f"{location}: record {motion.name} ends with a velocity of {end:.3g} m/s, {end / peak:.0%} of "
            f"its peak, limit {_DRIFT:.0%}: its displacement, which supports of their own motion take, "
            "drifts; correct its baseline, as `correction: peer` does"
        )
