"""Forces that vary in time at the steps of a run, and what the steps lose of them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.motion import ForceSignal

_PARTS = 8  # of the record's step: a table that is finer is not followed row by row
_WHOLE = 1e-6  # relative, to which a ratio of two steps counts as whole
LOST = 0.01  # of a force in L2, above which steps do not follow it


def add_force_rows(ground: Floats, dt: float, signals: Sequence[ForceSignal]) -> Floats:
    """Add the sizes of forces at every step, (rows + k, nt), to a run's ground motion (rows, nt)."""
    if not signals:
        return ground
    time: Floats = dt * np.arange(ground.shape[1], dtype=np.float64)
    return np.concatenate([ground, np.stack([signal.at(time) for signal in signals])])


def step_of_signals(dt: float, signals: Sequence[ForceSignal]) -> float:
    """The record's step, or a part of it, an eighth at least, no longer than the tables' steps [s]."""
    least = min((float(np.diff(signal.time).min()) for signal in signals), default=dt)
    return dt / min(_PARTS, max(1, math.ceil(dt / least * (1.0 - _WHOLE))))


def lost_at_steps(signal: ForceSignal, dt: float, seconds: float) -> float:
    """Share of a force, in L2 over the run, by which straight lines between steps miss it."""
    steps: Floats = dt * np.arange(round(seconds / dt) + 1, dtype=np.float64)
    inside = signal.time[(signal.time > 0.0) & (signal.time < steps[-1])]
    ends = np.array([signal.time[-1] * (1.0 + 1e-12)])  # where a force ends at once
    time = np.union1d(np.union1d(steps, inside), ends[ends < steps[-1]])
    exact, taken = signal.at(time), np.interp(time, steps, signal.at(steps))
    size = _squared(exact, time)
    return math.sqrt(_squared(exact - taken, time) / size) if size > 0.0 else 0.0


def _squared(values: Floats, time: Floats) -> float:
    """Integral of the square of what is straight between some times."""
    first, second = values[:-1], values[1:]
    return float(((first**2 + first * second + second**2) / 3.0 * np.diff(time)).sum())


def force_warnings(signals: Sequence[ForceSignal], dt: float, seconds: float) -> list[str]:
    """Warn of forces that the steps of a run do not follow, that do not act, or that go on beyond it."""
    found = list[str]()
    for signal in signals:
        if signal.time[0] >= seconds:
            found.append(
                f"{signal.name}: begins at {signal.time[0]:g} s, and the run ends at {seconds:g} s, so it "
                "does nothing; shorten `start`, or run longer"
            )
            continue
        if signal.time[-1] > seconds * (1.0 + _WHOLE):
            found.append(
                f"{signal.name}: its table goes to {signal.time[-1]:g} s, and the run ends at {seconds:g} s; "
                "take a longer record, or a longer transient.duration"
            )
        lost = lost_at_steps(signal, dt, seconds)
        if lost > LOST:
            found.append(
                f"{signal.name}: steps of {dt:g} s miss {100.0 * lost:.2g} % of it in L2, limit "
                f"{100.0 * LOST:g} %; set outputs.output_interval to {dt / 4.0:.3g} s or less"
            )
    return found
