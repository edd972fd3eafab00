"""Response spectra by the exact recursion for acceleration that is linear between samples.

Every step is cut so finely that the oscillator turns at most an eighth of a period. All oscillators run
through the record at once; the few chunks that can hold a peak are run once more, where the response is
known with its derivatives, so that the peak itself is found and not the sample next to it. After the last
sample the ground goes to rest within one interval and the oscillators swing on: the largest of that free
vibration counts too, by its closed form.

References
----------
Nigam, N. C., Jennings, P. C. (1969). Calculation of response spectra from strong-motion records. BSSA 59(2).
Boore, D. M. (2006). Orientation-independent measures of ground motion. BSSA 96(4A); Boore (2010) for RotDnn.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from romdam.core.errors import RecordError
from romdam.core.jit import njit
from romdam.core.motion import MOST_SAMPLES

Array = NDArray[np.float64]
TURNS = 8.0  # substeps a period, at least
ROTATIONS = 180  # one a degree
ROTATED_TURNS = 32.0  # a parabola through samples this close errs by less than 1e-4 of the peak
EXTREME_TURNS = 16.0  # cos(pi / 16): a peak is missed by 2 % at worst, by 0.6 % on average
CHUNK = 64  # samples between stored states
NEAR = 0.9  # cos(pi / 8) = 0.924 of a peak is what the worst placed samples see


@dataclass(frozen=True)
class Spectra:
    """Peak responses of oscillators at rest when the record starts.

    Attributes
    ----------
    periods : (np,) [s]
    dampings : (nd,) ratios
    sd : (k, nd, np) relative displacement [m]
    sv : (k, nd, np) relative velocity [m/s]
    sa : (k, nd, np) absolute acceleration [m/s2]
    """

    periods: Array
    dampings: Array
    sd: Array
    sv: Array
    sa: Array

    @property
    def psa(self) -> Array:
        """(k, nd, np) pseudo-acceleration omega^2 sd [m/s2]."""
        return (2.0 * np.pi / self.periods) ** 2 * self.sd


def response_spectra(
    acc: Array, dt: float, periods: Array, dampings: Array | tuple[float, ...] = (0.05,)
) -> Spectra:
    """Compute Sd, Sv and Sa of k components at all periods and dampings.

    Parameters
    ----------
    acc : (k, nt) or (nt,) [m/s2], linear between samples, zero from one interval after the last
    dt : [s]
    periods : (np,) [s], positive
    dampings : (nd,) ratios in [0, 1)

    Raises
    ------
    RecordError
        for periods or dampings out of range.
    """
    rows = _ended(acc)
    periods, dampings = _checked(periods, dampings)
    shape = (rows.shape[0], dampings.size, periods.size)
    sd, sv, sa = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    for d, damping in enumerate(dampings):
        for group, substeps, coefficients in _groups(periods, dt, float(damping)):
            for row in range(rows.shape[0]):
                states, largest, last = _integrate(rows[row], substeps, coefficients, True)
                peaks = _refine(rows[row], substeps, coefficients, states, largest)
                peaks = np.maximum(peaks, _free_peaks(last, 2.0 * np.pi / periods[group], float(damping)))
                sd[row, d, group], sv[row, d, group], sa[row, d, group] = peaks
    return Spectra(periods, dampings, sd, sv, sa)


def pseudo_acceleration(acc: Array, dt: float, periods: Array, damping: float = 0.05) -> Array:
    """Compute PSa alone, (k, np) [m/s2]."""
    rows = _ended(acc)
    periods, _ = _checked(periods, (damping,))
    peaks = np.zeros((rows.shape[0], periods.size))
    for group, substeps, coefficients in _groups(periods, dt, float(damping)):
        for row in range(rows.shape[0]):
            states, largest, last = _integrate(rows[row], substeps, coefficients, False)
            within = _refine(rows[row], substeps, coefficients, states, largest)[0]
            after = _free_peaks(last, 2.0 * np.pi / periods[group], float(damping))[0]
            peaks[row, group] = np.maximum(within, after)
    return peaks * (2.0 * np.pi / periods) ** 2


def extremes(
    acc: Array, dt: float, periods: Array, damping: float, near: float
) -> tuple[NDArray[np.int64], Array, Array, NDArray[np.bool_]]:
    """Find the extremes of oscillators under one component (nt,) that reach `near` of their peaks.

    Returns
    -------
    number of the period, time [s], pseudo-acceleration with its sign [m/s2], whether it is the peak; (ne,)
    each, by rising period. Between samples extremes are not sought: there are `EXTREME_TURNS` a period.
    Nor are they after the last sample: a record that is to be matched has zeros there
    """
    periods, _ = _checked(periods, (damping,))
    rows: list[tuple[NDArray[Any], ...]] = [()] * periods.size
    for group, substeps, coefficients in _groups(periods, dt, float(damping), EXTREME_TURNS):
        for column, index in enumerate(np.flatnonzero(group)):
            history = (2.0 * np.pi / periods[index]) ** 2 * _history(acc, substeps, coefficients[:, column])
            size = np.abs(history)
            peak = int(np.argmax(size))
            turns = (size[1:-1] >= size[:-2]) & (size[1:-1] > size[2:]) & (size[1:-1] >= near * size[peak])
            at = np.union1d(1 + np.flatnonzero(turns), peak)
            rows[index] = np.full(at.size, index), at * dt / substeps, history[at], at == peak
    which, time, value, largest = (np.concatenate(column) for column in zip(*rows, strict=True))
    return which.astype(np.int64), time, value, largest.astype(bool)


def rotated_psa(
    first: Array, second: Array, dt: float, periods: Array, damping: float = 0.05
) -> tuple[Array, Array]:
    """Compute RotD50 and RotD100 of PSa from two orthogonal components, (np,) each [m/s2].

    Oscillator responses are superposed linearly: two histories are rotated through 180 degrees. They go on
    for one period after the last sample; the free vibration has its largest value within half of that.
    """
    periods, _ = _checked(periods, (damping,))
    if np.max(periods) > MOST_SAMPLES * dt:
        raise RecordError(
            f"spectra: a period of {np.max(periods):g} s is too long for samples of {dt:g} s, the limit is "
            f"{MOST_SAMPLES * dt:g} s"
        )
    angles = np.radians(np.arange(ROTATIONS))
    rotd = np.zeros((2, periods.size))
    for group, substeps, coefficients in _groups(periods, dt, float(damping), ROTATED_TURNS):
        for column, index in enumerate(np.flatnonzero(group)):
            rest = np.zeros(1 + int(np.ceil(periods[index] / dt)))
            u1, u2 = (
                _history(np.append(row, rest), substeps, coefficients[:, column]) for row in (first, second)
            )
            radius = np.hypot(u1, u2)
            order = np.argsort(-radius)
            peaks = _rotated_peaks(u1, u2, radius, order, np.cos(angles), np.sin(angles))
            rotd[:, index] = np.median(peaks), np.max(peaks)
    scale = (2.0 * np.pi / periods) ** 2
    return rotd[0] * scale, rotd[1] * scale


def _ended(acc: Array) -> Array:
    """The components (k, nt) with one sample of rest at their end."""
    return np.pad(np.atleast_2d(np.asarray(acc, dtype=np.float64)), ((0, 0), (0, 1)))


def _free_peaks(state: Array, omega: Array, xi: float) -> Array:
    """Largest |u|, |v|, |u''| (3, np) of oscillators that swing freely from u [m] and v [m/s], (2, np).

    Each is a solution x of x'' + 2 xi omega x' + omega^2 x = 0, so that it turns first where
    tan(omega_d t) = omega_d x' / (omega^2 x + xi omega x'), and is smaller at every later turn.
    """
    damped = omega * np.sqrt(1.0 - xi**2)
    u, v = state
    a = -2.0 * xi * omega * v - omega**2 * u
    x, rate = np.array([u, v, a]), np.array([v, a, -2.0 * xi * omega * a - omega**2 * v])
    turn = np.arctan2(damped * rate, omega**2 * x + xi * omega * rate) % np.pi / damped
    swing = x * np.cos(damped * turn) + (rate + xi * omega * x) / damped * np.sin(damped * turn)
    return np.maximum(np.abs(x), np.abs(swing) * np.exp(-xi * omega * turn))


def _checked(periods: Array, dampings: Array | tuple[float, ...]) -> tuple[Array, Array]:
    periods = np.atleast_1d(np.asarray(periods, dtype=np.float64))
    ratios = np.atleast_1d(np.asarray(dampings, dtype=np.float64))
    if not np.all((periods > 0.0) & np.isfinite(periods)):
        raise RecordError(f"spectra: periods must be positive and finite, the least is {np.min(periods):g} s")
    if not np.all((ratios >= 0.0) & (ratios < 1.0)):
        raise RecordError(f"spectra: damping ratios must lie in [0, 1), got {ratios.tolist()}")
    return periods, ratios


def _groups(
    periods: Array, dt: float, damping: float, turns: float = TURNS
) -> list[tuple[NDArray[np.bool_], int, Array]]:
    """Periods that share a number of substeps (a power of two): which, how many, their recursion."""
    return list(_cached_groups(periods.tobytes(), dt, damping, turns))


@functools.lru_cache(maxsize=64)  # the records of a suite share few dt
def _cached_groups(
    periods: bytes, dt: float, damping: float, turns: float
) -> tuple[tuple[NDArray[np.bool_], int, Array], ...]:
    every = np.frombuffer(periods)
    power = np.ceil(np.log2(np.maximum(turns * dt / every, 1.0)) - 1e-9).astype(int)
    groups = []
    for p in np.unique(power):
        group, substeps = power == p, 2 ** int(p)
        groups.append((group, substeps, _recursion(2.0 * np.pi / every[group], damping, dt / substeps)))
    return tuple(groups)


def _recursion(omega: Array, xi: float, h: float) -> Array:
    """Coefficients (11, np): u1 = c0 u + c1 v + c2 ag0 + c3 ag1, v1 = c4 u + ...; omega^2, 2 xi omega, h.

    Relative displacement u of u'' + 2 xi omega u' + omega^2 u = -ag, with ag linear over h, from the power
    series of the impulse response g (g'' + 2 xi omega g' + omega^2 g = 0, g(0) = 0, g'(0) = 1) and of its
    two integrals: exact to rounding as h omega <= 2 pi / 8, where closed forms cancel for h omega -> 0.
    """
    w2, cw = omega**2, 2.0 * xi * omega
    terms = [np.zeros_like(omega), np.ones_like(omega)]  # g = sum terms[k] h^k / k!
    while len(terms) < 24:
        terms.append(-cw * terms[-1] - w2 * terms[-2])
    g, g1, once, twice = np.zeros((4, omega.size))
    factor = 1.0  # h^k / k!
    for k, term in enumerate(terms):
        g += term * factor
        g1 += terms[k + 1] * factor if k + 1 < len(terms) else 0.0
        once += term * (factor * h / (k + 1))
        twice += term * (factor * h**2 / ((k + 1) * (k + 2)))
        factor *= h / (k + 1)
    # a unit step of ag gives -once, a unit ramp -twice; their rates are -g and -once
    return np.array(
        [
            g1 + cw * g, g, -once + twice / h, -twice / h,
            -w2 * g, g1, -g + once / h, -once / h,
            w2, cw, np.full_like(omega, h),
        ]
    )  # fmt: skip


@njit(cache=True, fastmath=True, error_model="numpy")
def _integrate(acc: Array, substeps: int, c: Array, full: bool) -> tuple[Array, Array, Array]:
    """Run all oscillators; of each chunk: the state at its start, the largest |u|, |v|, |u'' + ag|.

    The last array is the state at the end (2, np): displacement and velocity.
    """
    a11, a12, b11, b12, a21, a22, b21, b22, w2, cw = (
        c[0],
        c[1],
        c[2],
        c[3],
        c[4],
        c[5],
        c[6],
        c[7],
        c[8],
        c[9],
    )
    count, chunks = c.shape[1], (acc.size - 1 + CHUNK - 1) // CHUNK
    states, peaks = np.zeros((chunks, 2, count)), np.zeros((chunks, 3, count))
    u, v = np.zeros(count), np.zeros(count)
    pu, pv, pa = np.zeros(count), np.zeros(count), np.zeros(count)
    for chunk in range(chunks):
        states[chunk, 0], states[chunk, 1] = u, v
        pu[:], pv[:], pa[:] = 0.0, 0.0, 0.0
        for n in range(chunk * CHUNK, min((chunk + 1) * CHUNK, acc.size - 1)):
            rise = (acc[n + 1] - acc[n]) / substeps
            for k in range(substeps):
                a0 = acc[n] + k * rise
                a1 = a0 + rise
                for j in range(count):
                    uj = a11[j] * u[j] + a12[j] * v[j] + b11[j] * a0 + b12[j] * a1
                    vj = a21[j] * u[j] + a22[j] * v[j] + b21[j] * a0 + b22[j] * a1
                    u[j], v[j] = uj, vj
                    pu[j] = max(pu[j], abs(uj))
                    if full:
                        pv[j] = max(pv[j], abs(vj))
                        pa[j] = max(pa[j], abs(cw[j] * vj + w2[j] * uj))
        peaks[chunk, 0], peaks[chunk, 1], peaks[chunk, 2] = pu, pv, pa
    last = np.zeros((2, count))
    last[0], last[1] = u, v
    return states, peaks, last


@njit(cache=True, fastmath=True, error_model="numpy")
def _refine(acc: Array, substeps: int, c: Array, states: Array, peaks: Array) -> Array:
    """Peaks between samples, (3, np): the chunks whose samples come near the largest are run once more."""
    count = c.shape[1]
    best = np.zeros((3, count))
    for j in range(count):
        for kind in range(3):
            largest = np.max(peaks[:, kind, j])
            for chunk in range(peaks.shape[0]):
                if largest > 0.0 and peaks[chunk, kind, j] >= NEAR * largest:
                    found = _chunk_peak(acc, substeps, c[:, j], states[chunk, :, j], chunk * CHUNK, kind)
                    best[kind, j] = max(best[kind, j], found)
    return best


@njit(cache=True, fastmath=True, error_model="numpy")
def _chunk_peak(acc: Array, substeps: int, c: Array, state: Array, first: int, kind: int) -> float:
    """Largest |u|, |v| or |u'' + ag| (kind 0, 1, 2) in one chunk, from the derivatives at each substep."""
    u, v, best, h = state[0], state[1], 0.0, c[10]
    x = np.zeros(7)
    for n in range(first, min(first + CHUNK, acc.size - 1)):
        rise = (acc[n + 1] - acc[n]) / substeps
        for k in range(substeps):
            x[0], x[1] = u, v
            x[2] = -(acc[n] + k * rise) - c[9] * v - c[8] * u
            x[3] = -rise / h - c[9] * x[2] - c[8] * x[1]
            for i in range(4, 7):
                x[i] = -c[9] * x[i - 1] - c[8] * x[i - 2]
            if kind == 2:  # absolute acceleration: its ground part is linear within the step
                x[2] += acc[n] + k * rise
                x[3] += rise / h
            best = max(best, _step_peak(x[kind:], h))
            a0 = acc[n] + k * rise
            u, v = (
                c[0] * u + c[1] * v + c[2] * a0 + c[3] * (a0 + rise),
                c[4] * u + c[5] * v + c[6] * a0 + c[7] * (a0 + rise),
            )
    return best


@njit(cache=True, fastmath=True, error_model="numpy")
def _step_peak(x: Array, h: float) -> float:
    """Largest |value| in [0, h] of a quantity with derivatives x[0..4]: start, end, and turn between."""
    best = max(abs(x[0]), abs(x[0] + h * (x[1] + h * (x[2] / 2 + h * (x[3] / 6 + h * x[4] / 24)))))
    end = x[1] + h * (x[2] + h * (x[3] / 2 + h * x[4] / 6))
    if x[1] * end >= 0.0:
        return best
    t = h * x[1] / (x[1] - end)
    for _ in range(3):
        slope = x[1] + t * (x[2] + t * (x[3] / 2 + t * x[4] / 6))
        bend = x[2] + t * (x[3] + t * x[4] / 2)
        t = min(max(t - slope / bend, 0.0), h) if bend != 0.0 else t
    return max(best, abs(x[0] + t * (x[1] + t * (x[2] / 2 + t * (x[3] / 6 + t * x[4] / 24)))))


@njit(cache=True, fastmath=True)
def _history(acc: Array, substeps: int, c: Array) -> Array:
    """Relative displacement at every substep, ((nt - 1) substeps + 1,)."""
    out = np.zeros((acc.size - 1) * substeps + 1)
    u, v = 0.0, 0.0
    for n in range(acc.size - 1):
        rise = (acc[n + 1] - acc[n]) / substeps
        for k in range(substeps):
            a0 = acc[n] + k * rise
            a1 = a0 + rise
            u, v = c[0] * u + c[1] * v + c[2] * a0 + c[3] * a1, c[4] * u + c[5] * v + c[6] * a0 + c[7] * a1
            out[n * substeps + k + 1] = u
    return out


@njit(cache=True, fastmath=True)
def _rotated_peaks(
    first: Array, second: Array, radius: Array, order: NDArray[np.int64], cosines: Array, sines: Array
) -> Array:
    """Largest |first cos + second sin| for every angle, between samples by a parabola.

    Samples are visited by falling radius: no later one can beat a value that exceeds its radius.
    """
    peaks = np.zeros(cosines.size)
    for i in range(cosines.size):
        best, at = 0.0, 0
        for n in order:
            if radius[n] <= best:
                break
            value = abs(cosines[i] * first[n] + sines[i] * second[n])
            if value > best:
                best, at = value, n
        if 0 < at < first.size - 1:
            x0 = cosines[i] * first[at - 1] + sines[i] * second[at - 1]
            x1 = cosines[i] * first[at] + sines[i] * second[at]
            x2 = cosines[i] * first[at + 1] + sines[i] * second[at + 1]
            bend = x0 - 2.0 * x1 + x2
            best = abs(x1 - (x2 - x0) ** 2 / (8.0 * bend)) if abs(bend) > 0.0 else best
        peaks[i] = best
    return peaks
