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
    """Doubts of the samples, and of what the channels' codes say that they are."""
    remarks = []
    for channel in channels:
        doubts = []
        data = channel.data
        if why := clipping(data):
            doubts.append(f"looks clipped: {why} [{channel.unit or 'raw units'}]")
        if np.all(data == data[0]):
            doubts.append(f"does not move: every sample is {data[0]:g}")

        around = np.abs(data - np.median(data))
        largest = int(np.argmax(around))
        others = np.delete(around, slice(max(0, largest - 1), largest + 2))
        if others.size >= DROPOUT and around[largest] > SPIKE * np.max(others) > 0.0:
            doubts.append(
                f"has one sample of {data[largest]:g}, {SPIKE:g} times all others, at "
                f"t = {largest * channel.dt:g} s"
            )
        strong = np.flatnonzero(around > STRONG * np.max(around))
        if strong.size:
            amid = data[strong[0] : strong[-1] + 1]
            run = 1 + longest_run(np.diff(amid) == 0.0)
            if run >= DROPOUT:
                doubts.append(
                    f"rests for {run} samples in a row amid strong shaking (limit {DROPOUT - 1}); a gap?"
                )

        low, high = USUAL_DT
        if not low <= channel.dt <= high:
            doubts.append(f"has dt = {channel.dt:g} s, recorders have {low:g} to {high:g} s; is it right?")
        code = channel.code
        if not channel.unit and len(code) == 3 and code.isalpha() and code[1] in VELOCITY_CODES:
            doubts.append(
                f"is by its code ({code[1]}) of a seismometer, whose counts are velocity; give its `response`"
            )
        remarks += [f"channel {code} {doubt}" for doubt in doubts]
    for first, other in itertools.combinations(channels, 2):
        if first.data.shape == other.data.shape and np.array_equal(first.data, other.data):
            remarks.append(f"channels {first.code} and {other.code} hold the same samples")
    return tuple(remarks)


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
