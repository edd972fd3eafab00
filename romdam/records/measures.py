"""Intensity measures of ground acceleration, as plain arrays; romdam.results wraps them with units.

References
----------
Arias, A. (1970). A measure of earthquake intensity. EPRI (1988). Cumulative absolute velocity, NP-5930.
Trifunac, M. D., Brady, A. G. (1975). Duration of strong ground motion. BSSA 65(3).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from romdam.records.processing.integrate import displacement, velocity

Array = NDArray[np.float64]
GRAVITY = 9.80665  # m/s2, the Arias intensity's g


def peak_ground(acc: Array, dt: float) -> dict[str, Array]:
    """PGA [m/s2], PGV [m/s], PGD [m] of acceleration (..., nt), from rest, no baseline assumed.

    Acceleration is straight between samples, so that velocity has its extremes where acceleration is zero.
    """
    vel, first, second = velocity(acc, dt), acc[..., :-1], acc[..., 1:]
    crosses = first * second < 0.0
    share = np.where(crosses, first / np.where(crosses, first - second, 1.0), 0.0)  # of the step
    between = vel[..., :-1] + 0.5 * dt * share * first
    largest = np.maximum(np.max(np.abs(vel), axis=-1), np.max(np.abs(between), axis=-1, initial=0.0))
    pga, pgd = (np.max(np.abs(values), axis=-1) for values in (acc, displacement(acc, dt)))
    return {"pga": pga, "pgv": largest, "pgd": pgd}


def arias_history(acc: Array, dt: float) -> Array:
    """Arias intensity up to each sample, (..., nt) [m/s].

    By the trapezoidal rule: for a record band-limited below half of Nyquist the sum of squares is the
    integral itself, while straight lines between samples lose up to a third of what lies at Nyquist.
    """
    return np.pi / (2.0 * GRAVITY) * _running(acc**2, dt)


def cumulative_absolute_velocity(acc: Array, dt: float) -> Array:
    """CAV, the integral of |acc|, (...) [m/s]."""
    return _running(np.abs(acc), dt)[..., -1]


def significant_duration(acc: Array, dt: float, start: float, end: float) -> Array:
    """Time in which Arias intensity rises from share `start` to share `end`, (...) [s]; NaN for no motion."""
    husid = arias_history(acc, dt)
    rows = husid.reshape(-1, husid.shape[-1])
    time = np.arange(rows.shape[-1], dtype=np.float64) * dt
    spans = [_crossing(row, time, end) - _crossing(row, time, start) for row in rows]
    return np.array(spans).reshape(husid.shape[:-1])


def moving(acc: Array) -> Array:
    """The components of (k, nt) accelerations that move at all; the first where none does."""
    moves = np.any(acc != 0.0, axis=-1)
    return acc[moves] if moves.any() else acc[:1]


def fourier_amplitude(acc: Array, dt: float) -> tuple[Array, Array]:
    """Frequencies (nf,) [Hz] and |integral of acc exp(-i omega t) dt|, (..., nf) [m/s]."""
    freq: Array = np.arange(acc.shape[-1] // 2 + 1, dtype=np.float64) / (acc.shape[-1] * dt)
    return freq, np.abs(np.fft.rfft(acc, axis=-1)) * dt


def content_frequency(acc: Array, dt: float, share: float) -> float:
    """Frequency below which a share of the power of the acceleration (k, nt) lies, its mean aside [Hz]."""
    power = (np.abs(np.fft.rfft(acc, axis=1)) ** 2).sum(axis=0)
    below = np.cumsum(power[1:])
    duration = acc.shape[1] * dt
    if not below.size or below[-1] <= 0.0:
        return 1.0 / (duration - dt)
    return (int(np.searchsorted(below, share * below[-1])) + 1) / duration


def measure(acc: Array, dt: float) -> dict[str, Array]:
    """All scalar measures of each component.

    Parameters
    ----------
    acc : (k, nt) [m/s2], pads included
    dt : [s]

    Returns
    -------
    dict from name (romdam.config.sections.motions.records.MEASURES) to (k,) values in SI
    """
    rows = np.atleast_2d(acc)
    length = np.full(rows.shape[0], (rows.shape[1] - 1) * dt)
    return peak_ground(rows, dt) | {
        "arias": arias_history(rows, dt)[..., -1],
        "cav": cumulative_absolute_velocity(rows, dt),
        "d5_75": significant_duration(rows, dt, 0.05, 0.75),
        "d5_95": significant_duration(rows, dt, 0.05, 0.95),
        "duration": length,
        "dt": np.full(rows.shape[0], dt),
    }


def _running(values: Array, dt: float) -> Array:
    total = np.zeros_like(values)
    np.cumsum(0.5 * dt * (values[..., 1:] + values[..., :-1]), axis=-1, out=total[..., 1:])
    return total


def _crossing(row: Array, time: Array, share: float) -> float:
    if row[-1] <= 0.0:
        return float("nan")
    level = share * row[-1]
    after = int(np.searchsorted(row, level))
    rise = row[after] - row[after - 1]
    return float(time[after] - (row[after] - level) / rise * (time[after] - time[after - 1]))
