"""Motions of supports against the base: acceleration, velocity and displacement of the same straight lines.

A record is a line between samples. Velocity and displacement follow exactly at any time, so that a support
that moves later, at a time between samples or on another grid, has u(t - delay) - u(t) and comes back with
the record. Steps see only the values at their ends: where a record begins with an acceleration, the late
support's jumps within a step, and its values there are those of least moments, which leave the impulse of the
jump and its displacement.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.errors import RecordError
from romdam.core.motion import GroundMotion, SupportMotion
from romdam.records.processing.integrate import displacement, velocity
from romdam.records.processing.resampling import resample_motion

_LATE = 0.01  # of the Arias intensity, that reaches the last support after the end of a run
VELOCITY, DISPLACEMENT = 0.01, 0.1  # of the peak, at the end of what is at rest; that of any record
_SAID = 0.01  # of the peak displacement, at the end
_SAME = 1e-9  # of a step


@dataclass(frozen=True)
class StraightLines:
    """Acceleration that is straight between samples and zero before and after them, from rest.

    Attributes
    ----------
    acc : (k, nt) [m/s2]
    dt : [s]
    """

    acc: Floats
    dt: float

    @cached_property
    def vel(self) -> Floats:
        """(k, nt) [m/s]."""
        return velocity(self.acc, self.dt)

    @cached_property
    def disp(self) -> Floats:
        """(k, nt) [m]."""
        return displacement(self.acc, self.dt)

    def at(self, time: Floats, start: Floats) -> tuple[Floats, Floats, Floats]:
        """Acceleration, velocity and displacement (k, n) at some times.

        Parameters
        ----------
        time : (n,) from the first sample; what is before it is at rest [s]
        start : (n,) share of the first sample's value that the acceleration has begun with
        """
        last = self.acc.shape[1] - 1
        index = np.clip((time / self.dt).astype(np.int64), 0, max(0, last - 1))
        s = np.clip(time - index * self.dt, 0.0, self.dt)
        first, slope = self.acc[:, index], np.diff(self.acc, axis=1)[:, index] / self.dt
        vel = self.vel[:, index] + s * (first + 0.5 * s * slope)
        disp = self.disp[:, index] + s * (self.vel[:, index] + s * (0.5 * first + s / 6.0 * slope))
        disp += vel * np.maximum(time - last * self.dt, 0.0)
        moves = time > 0.0
        ends = time > last * self.dt + _SAME * self.dt
        acc = np.where(moves, first + s * slope - self.acc[:, :1], 0.0) + start * self.acc[:, :1]
        return np.where(ends, 0.0, acc), np.where(moves, vel, 0.0), np.where(moves, disp, 0.0)


def lines_of(motion: GroundMotion, dt: float, *, band_limited: bool = False) -> StraightLines:
    """The straight lines that steps of `dt` take from a record: its own, or those that it is resampled to."""
    linear = not band_limited and motion.provenance.get("resampling") != "fourier"
    if linear and dt <= motion.dt * (1.0 + _SAME):
        return StraightLines(motion.acc, motion.dt)
    return StraightLines(resample_motion(motion, dt, band_limited=band_limited), dt)


def begun(time: Floats, delay: float) -> Floats:
    """Values (n,) at steps for an acceleration that jumps from 0 to 1 at `delay`.

    Between steps it is straight; the values are the averages of the jump under the hat of each step, so that
    the integral and the first moment are those of the jump.

    Parameters
    ----------
    time : (n,) of the steps, even and from 0 [s]
    """
    if delay == 0.0 or len(time) < 2:
        return np.where(time >= delay, 1.0, 0.0)
    x = np.clip((time - delay) / (time[1] - time[0]), -1.0, 1.0)
    values = np.where(x < 0.0, 0.5 * (1.0 + x) ** 2, 1.0 - 0.5 * (1.0 - x) ** 2)
    if x[0] > -1.0:
        values[0] = (1.0 + x[0]) ** 2  # half a hat
    return np.asarray(values)


def add_support_rows(
    acc: Floats,
    dt: float,
    motions: Sequence[SupportMotion],
    base: StraightLines | None = None,
    at_stations: Sequence[StraightLines] | None = None,
) -> Floats:
    """Add to a ground acceleration what supports move against it.

    Parameters
    ----------
    acc : (3, nt) of the base at steps [m/s2]
    base : lines of the base, where the steps pass by its samples; those of `acc` if not given
    at_stations : lines for each motion, what it delays and multiplies; those of the base if not given

    Returns
    -------
    (3 + 9 k, nt) that of the base, then acceleration, velocity and displacement of k supports, x, y, z each
    """
    if not motions:
        return acc
    base = StraightLines(acc, dt) if base is None else base
    time: Floats = np.arange(acc.shape[1], dtype=np.float64) * dt
    still = begun(time, 0.0)
    _, base_vel, base_disp = base.at(time, still)
    against: list[list[Floats]] = [[], [], []]
    for k, motion in enumerate(motions):
        if motion.record is not None:
            lines, factor, delay = lines_of(motion.record, dt), np.ones((1, 1)), 0.0
        else:
            lines = base if at_stations is None else at_stations[k]
            factor, delay = np.reshape(motion.factor, (-1, 1)), motion.delay
        moved = lines.at(time - delay, begun(time, delay))
        for rows, own, of_base in zip(against, moved, (acc, base_vel, base_disp), strict=True):
            rows.append(factor * own - of_base)
    return np.concatenate([acc, *(row for rows in against for row in rows)])


def late_warnings(motions: Sequence[SupportMotion], motion: GroundMotion, end: float) -> list[str]:
    """Warn where a run ends before a record has passed its last support, and where supports stay displaced.

    Parameters
    ----------
    end : of the run [s]
    """
    found = []
    last = max(motions, key=lambda one: one.delay)
    late = _arias_after(motion, end - last.delay, end)
    if late > _LATE:
        found.append(
            f"{last.name} moves {last.delay:.4g} s behind the record, and {late:.2g} of its Arias intensity "
            f"comes there after the end of the run at {end:.4g} s; set transient.duration to "
            f"{end + last.delay:.4g} s"
        )
    for own in motions:
        if own.record is not None and (late := _arias_after(own.record, end, np.inf)) > _LATE:
            found.append(
                f"{own.name}: {late:.2g} of the Arias intensity of its record {own.record.name} comes after "
                f"the end of the run at {end:.4g} s; set transient.duration to {own.record.duration:.4g} s"
            )
    rests = [_rest(own, motion) for own in motions]
    k = int(np.argmax([rest.displacement for rest in rests]))
    rest, own = rests[k], motions[k]
    if rest.displacement_share > _SAID:
        found.append(
            f"{own.name} ends {1e3 * rest.displacement:.3g} mm from the base, "
            f"{100.0 * rest.displacement_share:.2g} % of its largest distance, when the record has passed: "
            "that is what the record ends with, an offset of the ground or what is left of a baseline"
        )
    return found


def _arias_after(motion: GroundMotion, begin: float, end: float) -> float:
    """Share of a record's Arias intensity between two times."""
    squared, time = (motion.acc**2).sum(axis=0), np.arange(motion.acc.shape[1]) * motion.dt
    return float(squared[(time > begin) & (time <= end)].sum() / max(float(squared.sum()), 1e-300))


@dataclass(frozen=True)
class _Rest:
    """Velocity and displacement of a relative motion once all has passed, [m/s, m] and of the peaks."""

    velocity: float
    velocity_share: float
    displacement: float
    displacement_share: float


def _rest(support: SupportMotion, motion: GroundMotion) -> _Rest:
    """How a support ends against the base when a record has passed both."""
    tail = int(np.ceil(support.delay / motion.dt)) + 2
    duration = max(motion.duration, 0.0 if support.record is None else support.record.duration)
    count = int(np.ceil(duration / motion.dt)) + tail
    acc = np.zeros((3, count))
    acc[:, : motion.acc.shape[1]] = motion.acc
    base = StraightLines(motion.acc, motion.dt)
    _, vel, disp = np.split(add_support_rows(acc, motion.dt, [support], base)[3:], 3)
    ends, shares = [], []
    for rows, of_base in ((vel, base.vel), (disp, base.disp)):
        ends.append(float(np.abs(rows[:, -1]).max()))
        least = max(1e-9 * float(np.abs(of_base).max()), 1e-300)  # below, round-off of equal motions
        shares.append(ends[-1] / max(float(np.abs(rows).max()), least))
    return _Rest(ends[0], shares[0], ends[1], shares[1])


def refuse_drift(motion: GroundMotion, supports: Sequence[SupportMotion], location: str) -> None:
    """Raise where supports do not come to rest against the base when a record has passed.

    A permanent offset of the ground is at rest; where it comes from the delay alone it is no offset of the
    ground, which both take part in, but the velocity that the record ends with.

    Parameters
    ----------
    motion : of the base
    location : file and key, for messages

    Raises
    ------
    RecordError
    """
    for support in supports:
        rest = _rest(support, motion)
        remedy = (
            "; it counts as what is left of a baseline: correct the record, as `correction: peer` does, and "
            "check its displacement"
        )
        if rest.velocity_share > VELOCITY:
            raise RecordError(
                f"{location}: record {motion.name}: {support.name} ends with a velocity of "
                f"{rest.velocity:.3g} m/s against the base, {rest.velocity_share:.1%} of its peak, limit "
                f"{VELOCITY:.0%}{remedy}"
            )
        alike = support.record is None and np.all(np.equal(support.factor, 1.0))
        if alike and rest.displacement_share > DISPLACEMENT:
            raise RecordError(
                f"{location}: record {motion.name}: {support.name} moves {support.delay:.4g} s behind the "
                f"base and ends {rest.displacement:.3g} m from it, {rest.displacement_share:.0%} of its "
                f"largest distance, limit {DISPLACEMENT:.0%}: the record ends with a velocity{remedy}"
            )
