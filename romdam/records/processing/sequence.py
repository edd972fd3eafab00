"""Records one after another: a mainshock, rest, and an aftershock, as one ground motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from romdam.core.errors import RecordError
from romdam.core.motion import MOST_SAMPLES, GroundMotion
from romdam.records.processing.resampling import resample_motion

SEQUENCE = "sequence"  # key of the provenance
_WHOLE = 1e-6  # of a ratio of two intervals, and of an interval, what it may be off a whole number


def in_sequence(first: GroundMotion, rest: float, second: GroundMotion) -> GroundMotion:
    """One motion, the first, rest, the second, under the name of the second.

    The motion with the longer interval is interpolated at the shorter one, as it says itself. The ground is
    without acceleration between the last sample of the first and the first sample of the second, which are
    `rest` apart, a whole number of intervals and at least one; a warning says where that is another time.

    Parameters
    ----------
    rest : between the two [s]

    Raises
    ------
    RecordError
        where one interval is no whole multiple of the other, the two are interpolated in different ways, or
        together have too many samples.
    """
    ways = [str(motion.provenance.get("resampling", "linear")) for motion in (first, second)]
    if ways[0] != ways[1]:
        raise RecordError(
            f"its `resampling` is {ways[1]} and that of {first.name} is {ways[0]}; give both the same"
        )
    dt = min(first.dt, second.dt)
    ratio = max(first.dt, second.dt) / dt
    if abs(ratio - round(ratio)) > _WHOLE * ratio:
        raise RecordError(
            f"its interval is {second.dt:g} s and that of {first.name} is {first.dt:g} s, neither a whole "
            "multiple of the other; give one of them at the interval of the other"
        )
    steps = max(1, round(rest / dt))
    count = sum(round(motion.duration / dt) + 1 for motion in (first, second)) + steps - 1
    if count > MOST_SAMPLES:
        raise RecordError(f"with {first.name} before it, it has {count} samples, limit {MOST_SAMPLES}")
    before, after = (
        motion.acc if motion.dt == dt else resample_motion(motion, dt) for motion in (first, second)
    )
    acc = np.hstack([before, np.zeros((len(before), steps - 1)), after])
    start = (before.shape[1] - 1 + steps) * dt
    members = [*members_of(first), {"record": second.name, "start": start, "provenance": second.provenance}]
    warnings = (*(f"{first.name}: {sentence}" for sentence in first.warnings), *second.warnings)
    if abs(steps * dt - rest) > _WHOLE * dt:
        warnings += (
            f"rest: {rest:.6g} s after {first.name} is taken as {steps * dt:.6g} s, {steps} intervals of "
            f"{dt:.6g} s",
        )
    provenance = second.provenance | {SEQUENCE: members}
    return replace(second, acc=acc, dt=dt, provenance=provenance, warnings=warnings)


def sequence_text(members: list[dict[str, object]]) -> str:
    """The records of a sequence and when they start; empty for a record of its own."""
    if len(members) < 2:
        return ""
    return ", ".join(f"{member['record']} at {float(str(member['start'])):.6g} s" for member in members)


def members_of(motion: GroundMotion) -> list[dict[str, object]]:
    """Record, start [s] and provenance of each record of a sequence, of itself where it is none."""
    members = motion.provenance.get(SEQUENCE)
    if isinstance(members, list):
        return members
    return [{"record": motion.name, "start": 0.0, "provenance": motion.provenance}]
