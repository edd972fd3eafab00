"""Components of one record on a common time base."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from romdam.core.errors import RecordError
from romdam.records.channel import MIN_SAMPLES, Channel


def align(channels: Sequence[Channel], policy: str, place: str) -> NDArray[np.float64]:
    """Cut channels to their common time span.

    Parameters
    ----------
    channels : of one dt; start times count where all have one, else the first samples are simultaneous
    policy : "overlap" cuts to the common part, "error" refuses to cut
    place : names the record in errors

    Returns
    -------
    (k, nt) samples, each row in its channel's unit

    Raises
    ------
    RecordError
        for different dt, starts that differ by a fraction of a step, no common part, or a cut when refused.
    """
    dts = [channel.dt for channel in channels]
    if not np.allclose(dts, dts[0], rtol=1e-6, atol=0.0):
        shown = ", ".join(f"{c.code}: {c.dt:g} s" for c in channels)
        raise RecordError(f"{place}: components of different dt ({shown}); resample them to one dt first")
    shifts = _shifts(channels, place)
    begin = max(shifts)
    end = min(shift + channel.data.size for shift, channel in zip(shifts, channels, strict=True))
    if end - begin < MIN_SAMPLES:
        raise RecordError(
            f"{place}: components share {max(0, end - begin)} samples; they are of different times"
        )
    sizes = [channel.data.size for channel in channels]
    if policy == "error" and (len(set(shifts)) > 1 or len(set(sizes)) > 1):
        raise RecordError(
            f"{place}: components start {shifts} samples apart and have {sizes} samples; "
            "set `align: overlap` to cut them to their common part"
        )
    return np.array([c.data[begin - s : end - s] for s, c in zip(shifts, channels, strict=True)])


def _shifts(channels: Sequence[Channel], place: str) -> list[int]:
    if not all(channel.start for channel in channels):
        return [0] * len(channels)
    starts = [datetime.fromisoformat(channel.start.rstrip("Z")) for channel in channels]
    exact = [(start - min(starts)).total_seconds() / channels[0].dt for start in starts]
    shifts = [round(value) for value in exact]
    worst = max(abs(value - shift) for value, shift in zip(exact, shifts, strict=True))
    if worst > 0.1:
        raise RecordError(
            f"{place}: components start {worst:.2g} of a sample apart; resample them to one time base"
        )
    return shifts
