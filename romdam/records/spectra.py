"""Response spectra of single-degree-of-freedom oscillators: u'' + 2 xi omega u' + omega^2 u = -a_g.

The ground acceleration a_g is linear between samples, and the recursion is exact for it. An interval is
divided into substeps of at most an eighth of the oscillator's period. The peak is found in two passes:

1. All oscillators are integrated over the record. The largest response at the substeps is kept for each chunk
   of `CHUNK` intervals.
2. Chunks that may contain the peak are integrated again. There the response between two substeps is computed
   from its derivatives, so that the result is the peak itself and not the nearest substep.

After the last sample a_g falls to zero within one interval, and the oscillator vibrates freely. The peak of
this free vibration, from its closed form, counts too.

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
SUBSTEPS = 8.0  # in a period, at least
ROTATIONS = 180  # angles of RotD, one for each degree
ROTATED_SUBSTEPS = 32.0  # in a period: the error of a parabola through them is below 1e-4 of the peak
EXTREME_SUBSTEPS = 16.0  # in a period: cos(pi / 16), a peak is missed by 2 % at most, by 0.6 % on average
CHUNK = 64  # intervals between two stored states
NEAR_PEAK = 0.9  # of the largest value at substeps; cos(pi / 8) = 0.924 of a peak is seen there at least


@dataclass(frozen=True)
class Spectra:
    """Peak responses of oscillators that are at rest when the record starts.

    Attributes
    ----------
    periods : (np,) [s]
    dampings : (nd,) damping ratios
    sd : (k, nd, np) relative displacement of k components [m]
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
        """Pseudo-acceleration omega^2 sd, (k, nd, np) [m/s2]."""
        return (2.0 * np.pi / self.periods) ** 2 * self.sd


def response_spectra(
    acc: Array, dt: float, periods: Array, dampings: Array | tuple[float, ...] = (0.05,)
) -> Spectra:
    """Compute Sd, Sv and Sa of k components at all periods and damping ratios.

    Parameters
    ----------
    acc : (k, nt) or (nt,) ground acceleration, linear between samples, zero from one interval after the last
        sample on [m/s2]
    dt : sampling interval [s]
    periods : (np,) positive [s]
    dampings : (nd,) damping ratios in [0, 1)

    Raises
    ------
    RecordError
        if a period or a damping ratio is out of range.
    """
    acc = np.pad(np.atleast_2d(np.asarray(acc, dtype=np.float64)), ((0, 0), (0, 1)))  # a zero at the end
    periods, dampings = _validated(periods, dampings)
    shape = (acc.shape[0], dampings.size, periods.size)
    sd, sv, sa = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    for d, damping in enumerate(dampings):
        for group, substeps, coefficients in _substep_groups(periods.tobytes(), dt, float(damping)):
            for k, component in enumerate(acc):
                states, largest, last = _integrate(component, substeps, coefficients, True)
                peaks = _refine_peaks(component, substeps, coefficients, states, largest)
                after = _free_vibration_peaks(last, 2.0 * np.pi / periods[group], float(damping))
                sd[k, d, group], sv[k, d, group], sa[k, d, group] = np.maximum(peaks, after)
    return Spectra(periods, dampings, sd, sv, sa)


def pseudo_acceleration(acc: Array, dt: float, periods: Array, damping: float = 0.05) -> Array:
    """Compute the pseudo-acceleration spectrum alone, (k, np) [m/s2].

    Parameters and errors are those of `response_spectra`.
    """
    acc = np.pad(np.atleast_2d(np.asarray(acc, dtype=np.float64)), ((0, 0), (0, 1)))  # a zero at the end
    periods, _ = _validated(periods, (damping,))
    sd = np.zeros((acc.shape[0], periods.size))
    for group, substeps, coefficients in _substep_groups(periods.tobytes(), dt, float(damping)):
        for k, component in enumerate(acc):
            states, largest, last = _integrate(component, substeps, coefficients, False)
            within = _refine_peaks(component, substeps, coefficients, states, largest)[0]
            after = _free_vibration_peaks(last, 2.0 * np.pi / periods[group], float(damping))[0]
            sd[k, group] = np.maximum(within, after)
    return sd * (2.0 * np.pi / periods) ** 2


def extremes(
    acc: Array, dt: float, periods: Array, damping: float, near: float
) -> tuple[NDArray[np.int64], Array, Array, NDArray[np.bool_]]:
    """Find the local extremes of the oscillators' responses to one component.

    Extremes are those of the values at substeps, of which a period has `EXTREME_SUBSTEPS`. The free vibration
    after the last sample is left out: a record that is to be matched ends with zeros.

    Parameters
    ----------
    acc : (nt,) [m/s2]
    near : an extreme is returned if it is at least this fraction of the peak of its period

    Returns
    -------
    numbers : (ne,) index of the period, ascending
    time : (ne,) [s]
    value : (ne,) pseudo-acceleration with its sign [m/s2]
    is_peak : (ne,) whether it is the peak of its period

    Raises
    ------
    RecordError
        if a period or the damping ratio is out of range.
    """
    periods, _ = _validated(periods, (damping,))
    of_period: list[tuple[NDArray[Any], ...]] = [()] * periods.size
    for group, substeps, coefficients in _substep_groups(
        periods.tobytes(), dt, float(damping), EXTREME_SUBSTEPS
    ):
        for column, index in enumerate(np.flatnonzero(group)):
            history = (2.0 * np.pi / periods[index]) ** 2 * _history(acc, substeps, coefficients[:, column])
            size = np.abs(history)
            peak = int(np.argmax(size))
            is_extreme = (
                (size[1:-1] >= size[:-2]) & (size[1:-1] > size[2:]) & (size[1:-1] >= near * size[peak])
            )
            at = np.union1d(1 + np.flatnonzero(is_extreme), peak)
            of_period[index] = np.full(at.size, index), at * dt / substeps, history[at], at == peak
    numbers, time, value, is_peak = (np.concatenate(column) for column in zip(*of_period, strict=True))
    return numbers.astype(np.int64), time, value, is_peak.astype(bool)


def rotated_psa(
    first: Array, second: Array, dt: float, periods: Array, damping: float = 0.05
) -> tuple[Array, Array]:
    """Compute RotD50 and RotD100 of the pseudo-acceleration from two orthogonal horizontal components.

    The responses to both components are combined linearly for 180 angles. The histories extend one period
    beyond the last sample, because the free vibration reaches its peak within half a period.

    Parameters
    ----------
    first, second : (nt,) [m/s2]

    Returns
    -------
    rotd50, rotd100 : (np,) median and largest of all angles [m/s2]

    Raises
    ------
    RecordError
        if a period or the damping ratio is out of range, or a period too long for the sampling interval.
    """
    periods, _ = _validated(periods, (damping,))
    if np.max(periods) > MOST_SAMPLES * dt:
        raise RecordError(
            f"spectra: a period of {np.max(periods):g} s is too long for samples of {dt:g} s, the limit is "
            f"{MOST_SAMPLES * dt:g} s"
        )
    angles = np.radians(np.arange(ROTATIONS))
    rotd = np.zeros((2, periods.size))
    for group, substeps, coefficients in _substep_groups(
        periods.tobytes(), dt, float(damping), ROTATED_SUBSTEPS
    ):
        for column, index in enumerate(np.flatnonzero(group)):
            free_vibration = np.zeros(1 + int(np.ceil(periods[index] / dt)))
            u1, u2 = (
                _history(np.append(component, free_vibration), substeps, coefficients[:, column])
                for component in (first, second)
            )
            radius = np.hypot(u1, u2)
            order = np.argsort(-radius)
            peaks = _rotated_peaks(u1, u2, radius, order, np.cos(angles), np.sin(angles))
            rotd[:, index] = np.median(peaks), np.max(peaks)
    omega2 = (2.0 * np.pi / periods) ** 2
    return rotd[0] * omega2, rotd[1] * omega2


def _free_vibration_peaks(state: Array, omega: Array, xi: float) -> Array:
    """Compute the largest |u|, |u'|, |u''| (3, np) of free vibrations from a state u [m], u' [m/s], (2, np).

    Each of u, u', u'' is a solution x of x'' + 2 xi omega x' + omega^2 x = 0. Its first extreme is where
    tan(omega_d t) = omega_d x' / (omega^2 x + xi omega x') with the values at t = 0; later ones are smaller.
    """
    omega_d = omega * np.sqrt(1.0 - xi**2)
    u, v = state
    a = -2.0 * xi * omega * v - omega**2 * u
    x, rate = np.array([u, v, a]), np.array([v, a, -2.0 * xi * omega * a - omega**2 * v])
    t = np.arctan2(omega_d * rate, omega**2 * x + xi * omega * rate) % np.pi / omega_d
    undecayed = x * np.cos(omega_d * t) + (rate + xi * omega * x) / omega_d * np.sin(omega_d * t)
    return np.maximum(np.abs(x), np.abs(undecayed) * np.exp(-xi * omega * t))


def _validated(periods: Array, dampings: Array | tuple[float, ...]) -> tuple[Array, Array]:
    """Return periods and damping ratios as arrays, or raise a RecordError if one is out of range."""
    periods = np.atleast_1d(np.asarray(periods, dtype=np.float64))
    ratios = np.atleast_1d(np.asarray(dampings, dtype=np.float64))
    if not np.all((periods > 0.0) & np.isfinite(periods)):
        raise RecordError(f"spectra: periods must be positive and finite, the least is {np.min(periods):g} s")
    if not np.all((ratios >= 0.0) & (ratios < 1.0)):
        raise RecordError(f"spectra: damping ratios must lie in [0, 1), got {ratios.tolist()}")
    return periods, ratios


@functools.lru_cache(maxsize=64)  # the records of a suite have few different dt
def _substep_groups(
    period_bytes: bytes, dt: float, damping: float, least: float = SUBSTEPS
) -> tuple[tuple[NDArray[np.bool_], int, Array], ...]:
    """Group the periods by the number of substeps in a sampling interval, a power of two.

    Parameters
    ----------
    period_bytes : the bytes of the periods (np,) [s], which can be a key of the cache
    least : substeps in a period, at least

    Returns
    -------
    tuple of (which periods (np,), number of substeps, coefficients (11, periods of the group))
    """
    periods = np.frombuffer(period_bytes)
    power = np.ceil(np.log2(np.maximum(least * dt / periods, 1.0)) - 1e-9).astype(int)
    groups = []
    for p in np.unique(power):
        group, substeps = power == p, 2 ** int(p)
        groups.append((group, substeps, _coefficients(2.0 * np.pi / periods[group], damping, dt / substeps)))
    return tuple(groups)


def _coefficients(omega: Array, xi: float, h: float) -> Array:
    """Compute the coefficients c (11, np) of a substep h.

    With a_g from a0 to a1 the state u [m], v = u' [m/s] becomes

        u1 = c0 u + c1 v + c2 a0 + c3 a1,    v1 = c4 u + c5 v + c6 a0 + c7 a1,

    and c8 = omega^2, c9 = 2 xi omega, c10 = h. They follow from the impulse response g, with
    g'' + 2 xi omega g' + omega^2 g = 0, g(0) = 0, g'(0) = 1, and its two integrals. Power series are exact to
    round-off for h omega <= 2 pi / 8; the closed forms would suffer from cancellation for h omega -> 0.
    """
    omega2, damping = omega**2, 2.0 * xi * omega
    terms = [np.zeros_like(omega), np.ones_like(omega)]  # g = sum terms[k] h^k / k!
    while len(terms) < 24:
        terms.append(-damping * terms[-1] - omega2 * terms[-2])
    g, g_rate, integral, second_integral = np.zeros((4, omega.size))
    factor = 1.0  # h^k / k!
    for k, term in enumerate(terms):
        g += term * factor
        g_rate += terms[k + 1] * factor if k + 1 < len(terms) else 0.0
        integral += term * (factor * h / (k + 1))
        second_integral += term * (factor * h**2 / ((k + 1) * (k + 2)))
        factor *= h / (k + 1)
    # u for a unit step of a_g is -integral, for a unit ramp -second_integral; v is -g and -integral
    return np.array(
        [
            g_rate + damping * g, g, -integral + second_integral / h, -second_integral / h,
            -omega2 * g, g_rate, -g + integral / h, -integral / h,
            omega2, damping, np.full_like(omega, h),
        ]
    )  # fmt: skip


@njit(cache=True, fastmath=True, error_model="numpy")
def _integrate(acc: Array, substeps: int, c: Array, full: bool) -> tuple[Array, Array, Array]:
    """Integrate all oscillators of a group over a component (nt,).

    Parameters
    ----------
    c : (11, np) see `_coefficients`
    full : whether velocity and acceleration are wanted too

    Returns
    -------
    states : (chunks, 2, np) displacement [m] and velocity [m/s] at the start of each chunk
    peaks : (chunks, 3, np) largest |u|, |u'|, |u'' + a_g| at the substeps of each chunk [m], [m/s], [m/s2]
    last : (2, np) displacement and velocity at the end
    """
    a11, a12, b11, b12 = c[0], c[1], c[2], c[3]
    a21, a22, b21, b22 = c[4], c[5], c[6], c[7]
    omega2, damping = c[8], c[9]
    count, chunks = c.shape[1], (acc.size - 1 + CHUNK - 1) // CHUNK
    states, peaks = np.zeros((chunks, 2, count)), np.zeros((chunks, 3, count))
    u, v = np.zeros(count), np.zeros(count)
    peak_u, peak_v, peak_a = np.zeros(count), np.zeros(count), np.zeros(count)
    for chunk in range(chunks):
        states[chunk, 0], states[chunk, 1] = u, v
        peak_u[:], peak_v[:], peak_a[:] = 0.0, 0.0, 0.0
        for n in range(chunk * CHUNK, min((chunk + 1) * CHUNK, acc.size - 1)):
            rise = (acc[n + 1] - acc[n]) / substeps
            for k in range(substeps):
                a0 = acc[n] + k * rise
                a1 = a0 + rise
                for j in range(count):
                    uj = a11[j] * u[j] + a12[j] * v[j] + b11[j] * a0 + b12[j] * a1
                    vj = a21[j] * u[j] + a22[j] * v[j] + b21[j] * a0 + b22[j] * a1
                    u[j], v[j] = uj, vj
                    peak_u[j] = max(peak_u[j], abs(uj))
                    if full:
                        peak_v[j] = max(peak_v[j], abs(vj))
                        peak_a[j] = max(peak_a[j], abs(damping[j] * vj + omega2[j] * uj))
        peaks[chunk, 0], peaks[chunk, 1], peaks[chunk, 2] = peak_u, peak_v, peak_a
    last = np.zeros((2, count))
    last[0], last[1] = u, v
    return states, peaks, last


@njit(cache=True, fastmath=True, error_model="numpy")
def _refine_peaks(acc: Array, substeps: int, c: Array, states: Array, peaks: Array) -> Array:
    """Compute the peaks (3, np) between substeps, by a second pass over the chunks that may contain them.

    Parameters and order of the peaks are those of `_integrate`.
    """
    count = c.shape[1]
    best = np.zeros((3, count))
    for j in range(count):
        for kind in range(3):
            largest = np.max(peaks[:, kind, j])
            for chunk in range(peaks.shape[0]):
                if largest > 0.0 and peaks[chunk, kind, j] >= NEAR_PEAK * largest:
                    peak = _chunk_peak(acc, substeps, c[:, j], states[chunk, :, j], chunk * CHUNK, kind)
                    best[kind, j] = max(best[kind, j], peak)
    return best


@njit(cache=True, fastmath=True, error_model="numpy")
def _chunk_peak(acc: Array, substeps: int, c: Array, state: Array, first: int, kind: int) -> float:
    """Compute the largest |u|, |u'| or |u'' + a_g| (kind 0, 1, 2) of one oscillator in a chunk.

    Parameters
    ----------
    state : (2,) displacement and velocity at the start of the chunk
    first : number of the first sample of the chunk
    """
    u, v, best, h = state[0], state[1], 0.0, c[10]
    x = np.zeros(7)  # u and its derivatives up to the sixth, at the start of a substep
    for n in range(first, min(first + CHUNK, acc.size - 1)):
        rise = (acc[n + 1] - acc[n]) / substeps
        for k in range(substeps):
            x[0], x[1] = u, v
            x[2] = -(acc[n] + k * rise) - c[9] * v - c[8] * u
            x[3] = -rise / h - c[9] * x[2] - c[8] * x[1]
            for i in range(4, 7):
                x[i] = -c[9] * x[i - 1] - c[8] * x[i - 2]
            if kind == 2:  # absolute acceleration: a_g is linear within the substep
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
    """Compute the largest |x(t)| for t in [0, h] from x and its four derivatives at 0, x[0..4].

    It is at the start, at the end, or where the rate is zero in between.
    """
    best = max(abs(x[0]), abs(x[0] + h * (x[1] + h * (x[2] / 2 + h * (x[3] / 6 + h * x[4] / 24)))))
    end_rate = x[1] + h * (x[2] + h * (x[3] / 2 + h * x[4] / 6))
    if x[1] * end_rate >= 0.0:
        return best
    t = h * x[1] / (x[1] - end_rate)  # secant, then Newton
    for _ in range(3):
        rate = x[1] + t * (x[2] + t * (x[3] / 2 + t * x[4] / 6))
        curvature = x[2] + t * (x[3] + t * x[4] / 2)
        t = min(max(t - rate / curvature, 0.0), h) if curvature != 0.0 else t
    return max(best, abs(x[0] + t * (x[1] + t * (x[2] / 2 + t * (x[3] / 6 + t * x[4] / 24)))))


@njit(cache=True, fastmath=True)
def _history(acc: Array, substeps: int, c: Array) -> Array:
    """Compute the relative displacement of one oscillator at every substep, ((nt - 1) substeps + 1,) [m]."""
    history = np.zeros((acc.size - 1) * substeps + 1)
    u, v = 0.0, 0.0
    for n in range(acc.size - 1):
        rise = (acc[n + 1] - acc[n]) / substeps
        for k in range(substeps):
            a0 = acc[n] + k * rise
            a1 = a0 + rise
            u, v = c[0] * u + c[1] * v + c[2] * a0 + c[3] * a1, c[4] * u + c[5] * v + c[6] * a0 + c[7] * a1
            history[n * substeps + k + 1] = u
    return history


@njit(cache=True, fastmath=True)
def _rotated_peaks(
    first: Array, second: Array, radius: Array, order: NDArray[np.int64], cosines: Array, sines: Array
) -> Array:
    """Compute the largest |first cos + second sin| for every angle, between samples by a parabola.

    Samples are visited in the order of falling radius. A value cannot exceed the radius of its sample, so the
    search ends at the first radius that is not above the largest value.

    Parameters
    ----------
    first, second, radius : (n,) responses to both components, and their resultant [m]
    order : (n,) sample numbers by falling radius
    cosines, sines : (angles,)
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
            curvature = x0 - 2.0 * x1 + x2
            best = abs(x1 - (x2 - x0) ** 2 / (8.0 * curvature)) if abs(curvature) > 0.0 else best
        peaks[i] = best
    return peaks
