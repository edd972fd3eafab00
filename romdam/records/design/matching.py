"""Spectral matching in the time domain: wavelets are added until the spectrum is the target's.

The wavelet of a period is an oscillation under a bell, placed so that the oscillator of that period answers
it at the time of its own peak. What its samples integrate to, once and twice, is taken out under the same
bell: neither velocity nor displacement drifts, wherever it is cut, and no baseline has to be corrected. The
amplitudes are those of a damped least-squares problem (Levenberg, Marquardt) of the oscillators' linear
answers; what keeps it from going round in circles is that every other extreme of an oscillator that would
grow above the target is held there too.

References
----------
Al Atik, L., Abrahamson, N. (2010). An improved method for nonstationary spectral matching. Earthquake
Spectra 26(3), 601-617: the wavelet and its width.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from romdam.core.errors import RecordError
from romdam.core.motion import GroundMotion
from romdam.records.components import AXES
from romdam.records.design.target import Target
from romdam.records.measures import measure
from romdam.records.spectra import extremes, pseudo_acceleration

Array = NDArray[np.float64]
ROUNDS = 40  # of amplitudes, each with up to TRIES dampings
PATIENCE = 8  # rounds without a smaller departure that end a search
TRIES = 3
REACH = 3.5  # widths of a wavelet to each side; exp(-12) of it is left
NEAR = (0.8, 0.6, 0.9)  # of the largest, extremes that may become it; the next is tried where one fails
DAMPING = 0.03  # of the least-squares problem at first, relative to its norm
LEAST_DAMPING = 1e-5
WITHIN_ALL = 0.95  # of the tolerance, where the problem has the periods between too
WITHIN = 0.6  # of the tolerance, between the periods of the problem there is the rest
SAMPLES = 4.0  # of the record in the shortest period, at least
STATED = {"pga": "m/s2", "pgv": "m/s", "pgd": "m", "arias": "m/s", "d5_95": "s"}


@dataclass(frozen=True)
class Extremes:
    """Largest answers of oscillators.

    Attributes
    ----------
    which : (ne,) number of the period
    time, value : (ne,) [s], pseudo-acceleration with its sign over the target's
    largest : (ne,) whether it is the oscillator's peak
    """

    which: NDArray[np.int64]
    time: Array
    value: Array
    largest: NDArray[np.bool_]

    @property
    def departure(self) -> Array:
        """(np,) of the peaks from the target."""
        return np.abs(self.value[self.largest]) - 1.0

    @property
    def mean_departure(self) -> float:
        """Mean fourth power of the departures, in which the largest counts most."""
        return float(np.mean(self.departure**4))


def match_motion(
    motion: GroundMotion, factor: float, target: Target, tolerance: float
) -> tuple[Array, tuple[int, int], dict[str, object]]:
    """Match the horizontal components, or the one that the target is of; multiply the others by `factor`.

    Returns
    -------
    (3, nt) acceleration [m/s2], the samples of zeros that were added before and after, and an account with
    the measures of each component before (scaled alone) and after

    Raises
    ------
    RecordError
        where a component cannot be matched.
    """
    first, last = target.periods[0], target.periods[-1]
    if first < SAMPLES * motion.dt:
        raise RecordError(
            f"{motion.name}: match: target.periods begin at {first:g} s, a record of dt = {motion.dt:g} s "
            f"can be matched from {SAMPLES * motion.dt:g} s on; raise the first period"
        )
    if last > motion.duration:
        raise RecordError(
            f"{motion.name}: match: target.periods end at {last:g} s, the record lasts {motion.duration:g} s;"
            " lower the last period, or take a longer record"
        )
    longest = target.periods[-1:]  # may peak a period after the record, and its wavelet reaches on from there
    pad = int(np.ceil((REACH * bell_width(longest)[0] + longest[0]) / motion.dt))
    scaled = np.pad(factor * motion.acc, ((0, 0), (pad, pad)))
    acc, report, finer = scaled.copy(), dict[str, object](), target.with_midpoints()
    moving_axes = [axis for axis in (0, 1) if np.any(motion.acc[axis] != 0.0)]
    for axis in [AXES.index(target.of)] if target.of in AXES else moving_axes:
        alone = pseudo_acceleration(scaled[axis], motion.dt, target.periods, target.damping)[0]
        first_factor = float(np.exp(np.mean(np.log(target.sa / alone))))
        acc[axis], rounds, departure = first_factor * scaled[axis], 0, np.inf
        for near, periods in zip(NEAR, (target, finer, finer), strict=True):
            within = WITHIN * tolerance if periods is target else WITHIN_ALL * tolerance
            trial, more = match_component(acc[axis], motion.dt, periods, within, near)
            reached = departure_of(trial, motion.dt, target)
            if reached < departure:
                acc[axis], rounds, departure = trial, rounds + more, reached
            if departure <= tolerance:
                break
        if departure > tolerance:
            psa = pseudo_acceleration(acc[axis], motion.dt, finer.periods, target.damping)[0]
            worst = finer.periods[int(np.argmax(np.abs(psa / finer.sa - 1.0)))]
            raise RecordError(
                f"{motion.name}, component {AXES[axis]}: cannot be matched: {100 * departure:.1f} % from the "
                f"target at {worst:.3g} s is left, the limit is {100 * tolerance:g} %; narrow "
                "target.periods, raise match.tolerance, or take a record whose spectrum is nearer to the "
                "target"
            )
        before, after = measure(scaled[axis], motion.dt), measure(acc[axis], motion.dt)
        report[AXES[axis]] = {
            "factor": first_factor * factor,
            "rounds": rounds,
            "departure": departure,
            "before": {f"{name} [{unit}]": float(before[name][0]) for name, unit in STATED.items()},
            "after": {f"{name} [{unit}]": float(after[name][0]) for name, unit in STATED.items()},
        }
    moving = np.flatnonzero(np.any(acc != 0.0, axis=0))
    begin = min(pad, max(0, int(moving[0]) - 1))  # a sample of rest stays at both ends
    end = max(acc.shape[1] - pad, min(acc.shape[1], int(moving[-1]) + 2))
    return acc[:, begin:end], (pad - begin, end - acc.shape[1] + pad), report


def departure_of(acc: Array, dt: float, target: Target) -> float:
    """Largest |PSa / target - 1| of one component (nt,), also between the periods of the target."""
    finer = target.with_midpoints()
    psa = pseudo_acceleration(acc, dt, finer.periods, target.damping)[0]
    return float(np.max(np.abs(psa / finer.sa - 1.0)))


def match_component(
    acc: Array, dt: float, target: Target, tolerance: float, near: float
) -> tuple[Array, int]:
    """Add wavelets to one component (nt,); the nearest to the target of all rounds, and its number."""
    now = find_extremes(acc, dt, target, near)
    best, least, at, damping = acc, float(np.max(np.abs(now.departure))), 0, DAMPING
    for number in range(1, ROUNDS + 1):
        if least <= tolerance or number > at + PATIENCE:
            break
        answers, waves = _answers(acc.size, dt, target, now)
        for _ in range(TRIES):
            trial = acc + _amplitudes(answers, now, damping) @ waves
            then = find_extremes(trial, dt, target, near)
            if then.mean_departure < now.mean_departure:
                break
            damping = min(3.0 * damping, 1.0)
        else:  # at a corner, where peaks change places: the smallest of the steps, and on
            damping = DAMPING
        acc, now, damping = trial, then, max(0.5 * damping, LEAST_DAMPING)
        if (departure := float(np.max(np.abs(now.departure)))) < least:
            best, least, at = acc, departure, number
    return best, at


def find_extremes(acc: Array, dt: float, target: Target, near: float) -> Extremes:
    """Peaks of all oscillators, and what extremes come near them."""
    which, time, value, largest = extremes(acc, dt, target.periods, target.damping, near)
    return Extremes(which, time, value / target.sa[which], largest)


def _amplitudes(answers: Array, now: Extremes, damping: float) -> Array:
    """Of the wavelets (nw,) [m/s2]: peaks to the target, other extremes not above it."""
    wanted = 1.0 - np.abs(now.value)
    held = now.largest | (wanted < 0.0)
    for _ in range(4):
        some = answers[held]
        normal = some.T @ some
        ridge = damping**2 * np.linalg.norm(normal, 2)
        amplitudes = np.linalg.solve(normal + ridge * np.eye(len(normal)), some.T @ wanted[held])
        above = (answers @ amplitudes > wanted + 0.005) & ~held
        if not above.any():
            break
        held |= above
    return np.asarray(amplitudes)


def _answers(size: int, dt: float, target: Target, now: Extremes) -> tuple[Array, Array]:
    """Growth of each extreme over the target for each wavelet, (ne, nw), and the wavelets (nw, nt) [m/s2].

    There is a wavelet for every period, as high as the target there.
    """
    peaked = np.flatnonzero(now.largest)
    periods: Array = target.periods[now.which]
    sa: Array = target.sa[now.which]
    time: Array = np.arange(size, dtype=np.float64) * dt
    peaks: Array = now.time[peaked]
    waves: Array = wavelets(time, np.asarray(periods[peaked], float), target.damping, peaks)
    waves = np.asarray(sa[peaked])[:, None] * waves
    sign = np.sign(now.value) / sa
    answers = []
    for rows in np.array_split(np.arange(sa.size), 1 + sa.size // 64):
        # pseudo-acceleration at the extremes' times after a unit sample of ground acceleration, (rows, nt)
        omega = 2.0 * np.pi / periods[rows][:, None]
        damped = omega * np.sqrt(1.0 - target.damping**2)
        after = np.maximum(now.time[rows][:, None] - np.arange(size) * dt, 0.0)
        decay = np.exp(-target.damping * omega * after)
        impulse_answers = -dt * omega**2 / damped * decay * np.sin(damped * after)
        answers.append(sign[rows, None] * (impulse_answers @ waves.T))
    return np.concatenate(answers), waves


def wavelets(time: Array, periods: Array, damping: float, peaks: Array) -> Array:
    """(np, nt) cosines under a bell, to which the oscillators answer with peaks at `peaks` (np,) [s].

    Their sum and their first moment are zero, which are the velocity and the displacement that they leave.
    """
    omega = 2.0 * np.pi / periods * np.sqrt(1.0 - damping**2)
    lead = np.arctan2(np.sqrt(1.0 - damping**2), damping) / omega
    t, width = time - (peaks - lead)[:, None], bell_width(periods)[:, None]
    bell = np.where(np.abs(t) <= REACH * width, np.exp(-((t / width) ** 2)), 0.0)
    bell[:, [0, -1]] = 0.0  # the straight lines to a first or last sample weigh half
    waves, tau = bell * np.cos(omega[:, None] * t), t / width
    moments = np.array([[np.sum(bell * tau ** (i + j), axis=1) for j in (0, 1)] for i in (0, 1)])
    sums = np.stack([np.sum(waves, axis=1), np.sum(waves * tau, axis=1)], axis=1)
    level, slope = np.linalg.solve(np.moveaxis(moments, -1, 0), sums[..., None])[..., 0].T
    return np.asarray(waves - bell * (level[:, None] + slope[:, None] * tau))


def bell_width(periods: Array) -> Array:
    """Width of the wavelets' bells (np,) [s], 1.178 f^-0.93 of Al Atik and Abrahamson."""
    return np.asarray(1.178 * periods**0.93)
