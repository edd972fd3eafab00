"""Doubts that a careful reader has of a record that reads well; they are said, nothing is changed."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from romdam.config.sections.motions.records import RecordConfig
from romdam.core.errors import RecordError
from romdam.records.channel import Channel
from romdam.records.clipping import clipping, longest_run

STANDARD_GRAVITY = 9.80665  # m/s2
STRONGEST = 5.0  # g; no instrument has recorded more than about 4 g (Iwate-Miyagi 2008)
IMPOSSIBLE = 1e4  # g; even gal taken for g make less
DOUBTED_UNIT = "is the unit right?"
SPIKE = 5.0  # times all other samples but its neighbours
DROPOUT = 20  # samples in a row of one value, between strong ones
STRONG = 0.2  # of the peak
USUAL_DT = (0.0005, 0.1)  # s; of digital recorders and digitized film
VELOCITY_CODES = "HLP"  # second letter of SEED's codes: seismometers, geophones
SQUARE = 5.0  # degrees that horizontal components may miss 90 by


def said_of_channels(channels: list[Channel]) -> tuple[str, ...]:
    """Doubts of the samples."""
    remarks = []
    for channel in channels:
        for doubt in (_clipped, _still, _spike, _dropout, _odd_dt, _velocity):
            if text := doubt(channel):
                remarks.append(f"channel {channel.code} {text}")
    for first, other in itertools.combinations(channels, 2):
        if first.data.shape == other.data.shape and np.array_equal(first.data, other.data):
            remarks.append(f"channels {first.code} and {other.code} hold the same samples")
    return tuple(remarks)


def _clipped(channel: Channel) -> str:
    why = clipping(channel.data)
    return f"looks clipped: {why} [{channel.unit or 'raw units'}]" if why else ""


def _still(channel: Channel) -> str:
    same = bool(np.all(channel.data == channel.data[0]))
    return f"does not move: every sample is {channel.data[0]:g}" if same else ""


def _spike(channel: Channel) -> str:
    around = np.abs(channel.data - np.median(channel.data))
    at = int(np.argmax(around))
    rest = np.delete(around, slice(max(0, at - 1), at + 2))
    if rest.size < DROPOUT or around[at] <= SPIKE * np.max(rest) or np.max(rest) <= 0.0:
        return ""
    return f"has one sample of {channel.data[at]:g}, {SPIKE:g} times all others, at t = {at * channel.dt:g} s"


def _dropout(channel: Channel) -> str:
    around = np.abs(channel.data - np.median(channel.data))
    strong = np.flatnonzero(around > STRONG * np.max(around))
    if strong.size == 0:
        return ""
    samples = channel.data[strong[0] : strong[-1] + 1]
    run = 1 + longest_run(np.diff(samples) == 0.0)
    if run < DROPOUT:
        return ""
    return f"rests for {run} samples in a row amid strong shaking (limit {DROPOUT - 1}); a gap?"


def _odd_dt(channel: Channel) -> str:
    low, high = USUAL_DT
    if low <= channel.dt <= high:
        return ""
    return f"has dt = {channel.dt:g} s, recorders have {low:g} to {high:g} s; is it right?"


def _velocity(channel: Channel) -> str:
    """Counts of a seismometer are a velocity."""
    code = channel.code
    if channel.unit or len(code) != 3 or not code.isalpha() or code[1] not in VELOCITY_CODES:
        return ""
    return f"is by its code ({code[1]}) of a seismometer, whose counts are velocity; give its `response`"


def said_of_axes(axes: dict[str, Channel], config: RecordConfig) -> tuple[str, ...]:
    """Doubts of which channel shakes which axis, where `components` names them and the files know better."""
    where = {
        axis: channel.orientation
        for axis, channel in axes.items()
        if channel.orientation and axis in config.components and config.components[axis].channel != "each"
    }
    remarks = [
        f"axis {axis} is {'vertical' if axis == 'z' else 'horizontal'}, the file says that channel "
        f"{axes[axis].code} is {'horizontal' if axis == 'z' else 'vertical'}"
        for axis, known in where.items()
        if (axis == "z") != (known.azimuth is None)
    ]
    level = [known.azimuth for axis, known in where.items() if axis != "z" and known.azimuth is not None]
    if len(level) == 2 and abs((level[0] - level[1]) % 180.0 - 90.0) > SQUARE:
        remarks.append(f"x and y are shaken by channels at {level[0]:g} and {level[1]:g} degrees, not square")
    return tuple(remarks)


def too_strong(recorded: NDArray[np.float64], location: str) -> tuple[str, ...]:
    """Doubt the unit of what no instrument has recorded.

    Raises
    ------
    RecordError
        where no mistake of units explains it.
    """
    around = recorded - np.mean(recorded, axis=-1, keepdims=True)  # raw records carry offsets
    peak = float(np.max(np.abs(around))) / STANDARD_GRAVITY
    if not peak <= IMPOSSIBLE:
        raise RecordError(f"{location}: the peak acceleration is {peak:.3g} g; {DOUBTED_UNIT}")
    if peak <= STRONGEST:
        return ()
    limit = f"more than any record (limit {STRONGEST:g} g)"
    return (f"the peak acceleration is {peak:.3g} g, {limit}: {DOUBTED_UNIT}",)
