"""Channels of one record on a common time base, and turned from their azimuths to the model's axes.

The model's z is up; its x points to `x_azimuth` (degrees clockwise from north) and y is 90 degrees to the
left of x seen from above, that is to `x_azimuth` - 90. With x_azimuth = 90, x is east and y is north.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from romdam.core.errors import RecordError
from romdam.records.channel import MIN_SAMPLES, Channel, Orientation

STAMPS = 0.1  # of a step, which the digits of time stamps may lose
HALF_WIDTH, KAISER = 16, 6.0  # of the interpolation: steps, and shape of its window
SMALLEST_ANGLE = 30.0  # degrees between two horizontal channels; less, and their noise decides the motion


def align(channels: Sequence[Channel], policy: str, location: str) -> NDArray[np.float64]:
    """Cut channels to their common time span.

    Those that start a fraction of a step off the first channel's samples are interpolated to its times.

    Parameters
    ----------
    channels : of one dt; start times count where all have one, else the first samples are simultaneous
    policy : "overlap" cuts to the common part, "error" refuses to cut
    location : names the record in errors

    Returns
    -------
    (k, nt) samples, each row in its channel's unit

    Raises
    ------
    RecordError
        for different dt, no common part, or a cut when refused.
    """
    dts = [channel.dt for channel in channels]
    if not np.allclose(dts, dts[0], rtol=1e-6, atol=0.0):
        intervals = ", ".join(f"{c.code}: {c.dt:g} s" for c in channels)
        raise RecordError(
            f"{location}: components of different dt ({intervals}); resample them to one dt first"
        )
    shifts, lags = _shifts(channels)
    begin = max(shifts)
    end = min(shift + channel.data.size for shift, channel in zip(shifts, channels, strict=True))
    if end - begin < MIN_SAMPLES:
        raise RecordError(
            f"{location}: components share {max(0, end - begin)} samples; they are of different times"
        )
    sizes = [channel.data.size for channel in channels]
    if policy == "error" and (len(set(shifts)) > 1 or len(set(sizes)) > 1):
        raise RecordError(
            f"{location}: components start {shifts} samples apart and have {sizes} samples; "
            "set `align: overlap` to cut them to their common part"
        )
    rows = zip(shifts, lags, channels, strict=True)
    return np.array([delay(c.data, lag)[begin - s : end - s] for s, lag, c in rows])


def said_of_starts(channels: Sequence[Channel]) -> tuple[str, ...]:
    """Say where channels start a fraction of a step apart, and `align` interpolates them."""
    _, lags = _shifts(channels)
    return tuple(
        f"channel {channel.code} starts {lag:.2g} of a step off the others' samples: interpolated there"
        for channel, lag in zip(channels, lags, strict=True)
        if lag
    )


def delay(data: NDArray[np.float64], lag: float) -> NDArray[np.float64]:
    """Samples (nt,) of the same motion, taken `lag` of a step earlier than the data's; |lag| at most 0.5.

    By a windowed sinc, which keeps what lies below nine tenths of Nyquist's frequency; the first and last
    value go on beyond the ends.
    """
    if lag == 0.0:
        return data
    offsets = np.arange(-HALF_WIDTH, HALF_WIDTH + 1)
    kernel = np.sinc(offsets - lag) * np.kaiser(2 * HALF_WIDTH + 1, KAISER)
    padded = np.pad(data, HALF_WIDTH, mode="edge")
    return np.convolve(padded, kernel / np.sum(kernel), mode="valid")


def _shifts(channels: Sequence[Channel]) -> tuple[list[int], list[float]]:
    """Steps between each channel's first sample and the earliest one, and what is left of a step.

    A tenth of a step or less is rounding of the time stamps.
    """
    if not all(channel.start for channel in channels):
        return [0] * len(channels), [0.0] * len(channels)
    starts = [datetime.fromisoformat(channel.start.rstrip("Z")) for channel in channels]
    exact = [(start - starts[0]).total_seconds() / channels[0].dt for start in starts]
    rounded = [round(value) for value in exact]
    lags = [value - shift for value, shift in zip(exact, rounded, strict=True)]
    shifts = [shift - min(rounded) for shift in rounded]
    return shifts, [lag if abs(lag) > STAMPS else 0.0 for lag in lags]


def rotation(where: Sequence[Orientation], x_azimuth: float, location: str) -> NDArray[np.float64]:
    """Matrix (3, k) that turns k recorded channels into motion along x, y, z.

    Parameters
    ----------
    where : orientation of each channel; two horizontal, or one vertical, or all three
    x_azimuth : azimuth of the model's x [degrees]
    location : names the record in errors

    Raises
    ------
    RecordError
        for one horizontal channel alone, more than two, two that are almost parallel, or two verticals.
    """
    level = [i for i, w in enumerate(where) if w.azimuth is not None]
    upright = [i for i, w in enumerate(where) if w.azimuth is None]
    if len(level) not in (0, 2) or len(upright) > 1 or not where:
        raise RecordError(
            f"{location}: rotation to x_azimuth needs two horizontal channels, one vertical at most; "
            f"it has {len(level)} and {len(upright)}; name them under `components`"
        )
    matrix = np.zeros((3, len(where)))
    for i in upright:
        matrix[2, i] = where[i].vertical
    if level:
        azimuths = [float(where[i].azimuth or 0.0) for i in level]
        angle = np.radians(x_azimuth - np.array(azimuths))  # counterclockwise from x to the channel
        directions = np.column_stack([np.cos(angle), np.sin(angle)])  # recorded = directions @ motion in x, y
        if abs(np.linalg.det(directions)) < np.sin(np.radians(SMALLEST_ANGLE)):
            raise RecordError(
                f"{location}: channels at {azimuths[0]:g} and {azimuths[1]:g} degrees are within "
                f"{SMALLEST_ANGLE:g} degrees of parallel; they do not give two directions of motion"
            )
        inverse = np.linalg.inv(directions)
        matrix[:2, level] = np.where(np.abs(inverse) < 1e-15, 0.0, inverse)
    return matrix
