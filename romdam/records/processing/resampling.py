"""Another sampling interval for a ground acceleration, without aliasing.

Between its samples a record is straight ("linear") or the signal of its spectrum below the Nyquist frequency
("fourier"). A coarser interval cannot carry all frequencies: they are taken out first, with zero phase. Here
are also the parts of a record (its first seconds, its strongest seconds) and an even interval for film that
was digitized at uneven times.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from romdam.core.errors import RecordError
from romdam.core.motion import MOST_SAMPLES, GroundMotion

Method = Literal["linear", "fourier"]
INTERVAL = 0.005  # s of digitized film: agencies bring it to 200 samples a second for their Volume 2 ...
FINER = 1.02  # ... and it is halved until it is at most so many mean steps, so that no motion is folded back
LONGEST_GAP = 0.5  # s between two points; more is a gap, not a step of digitizing


def resample(
    acc: NDArray[np.float64], dt_old: float, dt_new: float, method: Method = "linear"
) -> NDArray[np.float64]:
    """Resample acceleration along its last axis.

    Parameters
    ----------
    acc : (..., nt) acceleration [m/s2]
    dt_old, dt_new : sampling intervals [s]
    method : "linear" keeps the straight lines between samples; "fourier" keeps the band-limited signal

    Returns
    -------
    (..., nt_new) at times k dt_new within the record: nt_new = floor((nt - 1) dt_old / dt_new) + 1

    Raises
    ------
    RecordError
        for an interval that is not positive and finite, longer than the record, or makes too many samples.
    """
    duration = (acc.shape[-1] - 1) * dt_old
    for label, value in (("dt of the record", dt_old), ("dt asked for", dt_new)):
        if not (np.isfinite(value) and value > 0.0):
            raise RecordError(f"resampling: {label} must be positive and finite, got {value!r} s")
    if dt_new > duration:
        raise RecordError(
            f"resampling: dt {dt_new:g} s is longer than the record ({duration:g} s); choose a smaller dt"
        )
    if np.isclose(dt_new, dt_old, rtol=1e-9, atol=0.0):
        return acc.copy()
    _refuse_huge(duration / dt_new, f"dt {dt_new:g} s makes of {duration:g} s")
    nt = acc.shape[-1]
    n = 2 * nt  # as many zeros again, so that the end does not wrap onto the start
    if dt_new > dt_old:  # low-pass: 1 up to 0.8 of the new Nyquist frequency, 0 beyond it, a cosine between
        freq = np.fft.rfftfreq(n, dt_old)
        nyquist = 0.5 / dt_new
        edge = np.clip((freq / nyquist - 0.8) / 0.2, 0.0, 1.0)
        gain = 0.5 * (1.0 + np.cos(np.pi * edge))
        acc = np.fft.irfft(np.fft.rfft(acc, n, axis=-1) * gain, n, axis=-1)[..., :nt]
    # 1e-9 of a step, so that a duration that is a multiple of dt_new keeps its last sample in floating point
    time = np.arange(int(np.floor(duration / dt_new + 1e-9)) + 1, dtype=np.float64) * dt_new
    if method == "linear":
        return _linear_at(acc, dt_old, time)
    # band-limited values: a longer transform gives a fine grid, which has the new times or is 8 times as
    # fine; then straight lines on it
    step = float(time[1] - time[0])
    refine = max(1, round(dt_old / step))
    if not np.isclose(refine * step, dt_old, rtol=1e-9):
        refine = 8 * int(np.ceil(dt_old / step))
    _refuse_huge(n * refine, f"the Fourier grid of dt {step:g} s takes")
    spectrum = np.fft.rfft(acc, n, axis=-1)
    if refine > 1:
        spectrum[..., -1] *= 0.5  # the Nyquist line splits into a pair once it is inside the band
    fine = np.fft.irfft(spectrum, n * refine, axis=-1) * refine
    return _linear_at(fine, dt_old / refine, time)


def _refuse_huge(samples: float, what: str) -> None:
    if samples > MOST_SAMPLES:
        raise RecordError(
            f"resampling: {what} {samples:.3g} samples, the limit is {MOST_SAMPLES:.3g}; choose a larger dt"
        )


def resample_motion(motion: GroundMotion, dt: float, *, band_limited: bool = False) -> NDArray[np.float64]:
    """Resample a ground motion to the analysis step, as `resampling` of its provenance says (else linear).

    Parameters
    ----------
    dt : analysis step [s]
    band_limited : "fourier" in any case

    Returns
    -------
    (3, nt) acceleration [m/s2]

    Raises
    ------
    RecordError
        naming the record.
    """
    fourier = band_limited or motion.provenance.get("resampling") == "fourier"
    try:
        return resample(motion.acc, motion.dt, dt, "fourier" if fourier else "linear")
    except RecordError as error:
        raise RecordError(f"record {motion.name}: {error}") from None


def lost_between(acc: NDArray[np.float64], dt: float, step: float) -> tuple[float, float]:
    """Measure what a record, straight between its samples, loses where it is straight between steps.

    Parameters
    ----------
    acc : (..., nt) acceleration [m/s2]
    dt, step : sampling interval of the record, and length of the steps [s]

    Returns
    -------
    (L2, largest) of the loss at the samples, relative to that of the record
    """
    steps = math.ceil((acc.shape[-1] - 1) * dt / step)
    at_steps = _linear_at(acc, dt, np.arange(steps + 1, dtype=np.float64) * step)
    lost = _linear_at(at_steps, step, np.arange(acc.shape[-1], dtype=np.float64) * dt) - acc
    tiny = float(np.finfo(np.float64).tiny)
    share = float(np.linalg.norm(lost)) / max(float(np.linalg.norm(acc)), tiny)
    return share, float(np.abs(lost).max()) / max(float(np.abs(acc).max()), tiny)


def _linear_at(acc: NDArray[np.float64], dt: float, time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values (..., n) at `time` (n,) [s] of what is linear between samples; the last one from its time on."""
    position = np.minimum(time / dt, acc.shape[-1] - 1)
    index = np.minimum(position.astype(np.int64), acc.shape[-1] - 2)
    weight = position - index
    return (1.0 - weight) * acc[..., index] + weight * acc[..., index + 1]


def cut_or_extended(acc: NDArray[np.float64], samples: int) -> NDArray[np.float64]:
    """The first samples of acceleration (3, nt), followed by zeros where there are not as many."""
    return np.pad(acc[:, :samples], ((0, 0), (0, max(0, samples - acc.shape[1]))))


def strongest_part(motion: GroundMotion, seconds: float) -> tuple[float, GroundMotion]:
    """Cut a motion to the seconds with the largest integral of squared acceleration, all components together.

    Returns
    -------
    (start, part) : the time at which the part begins [s], and the part; 0 and the whole of a shorter motion
    """
    length = round(seconds / motion.dt)
    if length + 1 >= motion.acc.shape[1]:
        return 0.0, motion
    energy = np.concatenate([[0.0], np.cumsum((motion.acc**2).sum(axis=0))])
    first = int(np.argmax(energy[length + 1 :] - energy[: -length - 1]))
    return first * motion.dt, replace(motion, acc=motion.acc[:, first : first + length + 1])


def even_series(
    times: NDArray[np.float64], values: NDArray[np.float64], digit: float, location: str
) -> tuple[NDArray[np.float64], float, tuple[str, ...]]:
    """Bring values of digitized film to an even interval.

    Film has a time with every value. Where the times are even but for their last printed digit, the values
    stay as they are. Otherwise straight lines between them are sampled.

    Parameters
    ----------
    times, values : (n,) as printed, times in s
    digit : last printed digit of the times [s]
    location : names the channel in errors

    Returns
    -------
    (values, interval, warnings) : (m,) at the interval [s]; a warning where they were sampled

    Raises
    ------
    RecordError
        for times that fall, or leave a gap.
    """
    if times.size < 2 or not np.all(np.isfinite(times)):
        raise RecordError(f"{location}: fewer than two times, or one that is no number; the file is damaged")
    steps = np.diff(times)
    worst = int(np.argmin(steps))
    if steps[worst] < 0.0:
        raise RecordError(
            f"{location}: the times fall from {times[worst]:g} to {times[worst + 1]:g} s; the file is damaged"
        )
    if (longest := float(np.max(steps))) > LONGEST_GAP:
        raise RecordError(
            f"{location}: {longest:g} s without a value from {times[np.argmax(steps)]:g} s on (limit "
            f"{LONGEST_GAP:g} s); the file is damaged"
        )
    dt = float((times[-1] - times[0]) / steps.size)
    if dt > 0.0 and np.max(np.abs(times - times[0] - dt * np.arange(times.size))) <= 0.6 * digit:
        return values, dt, ()
    interval = INTERVAL
    while interval > FINER * dt > 0.0:
        interval *= 0.5
    grid = times[0] + interval * np.arange(int((times[-1] - times[0]) / interval + 1e-6) + 1)
    even = np.interp(grid, times, values)
    kept = float(np.max(np.abs(even))) / max(float(np.max(np.abs(values))), 1e-300)
    said = (
        f"the times are uneven ({np.mean(steps):.4g} s on average): read at {interval:g} s by straight "
        f"lines, which keep {100.0 * kept:.4g} % of the peak"
    )
    return even, interval, (said,)
