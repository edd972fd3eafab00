"""From counts to ground acceleration: the response of an instrument is divided out within a stated band.

A record is continued to zero beyond its ends before it is transformed, so that no sample of it is tapered and
nothing wraps round. Within the band it is divided by the response as it is, without a water level; outside,
where the response is so small that dividing by it only amplifies noise, a cosine takes the motion to zero.
The band reaches down to 0 Hz where the instrument does.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.errors import RecordError

LOWEST = 0.01  # Hz, of a band that does not begin at 0
LOW_GAIN = 1e-3  # of the largest within the band, below which the lower end lies
HIGH_GAIN = 0.03  # the same of the upper end: filters against aliasing fall steeply
NYQUIST_SHARE = 0.9
SHOULDER = 2.0  # width of the lower cosine: a factor of frequency
PERIODS = 2.0  # of the lowest frequency, that a record is continued by
SHORTEST = 5.0  # s, at least
OUTSIDE = 0.01  # of the recorded energy, that is told


class Response(Protocol):
    """Complex gain at frequencies (n,) [Hz] above 0."""

    def __call__(self, freq: Floats, *, native: bool) -> np.ndarray:
        """Counts over m/s2, or over the instrument's own unit of input."""


@dataclass(frozen=True)
class Band:
    """Frequencies between which a response is divided out unchanged, and where the cosines end [Hz]."""

    stop: float
    low: float
    high: float
    end: float

    def gain(self, freq: Floats) -> Floats:
        """(n,) 1 within the band, 0 beyond the cosines."""
        gain = np.ones_like(freq)
        if self.low > 0.0:
            gain *= _cosine((freq - self.stop) / (self.low - self.stop))
        return gain * _cosine((self.end - freq) / (self.end - self.high))

    def __str__(self) -> str:
        """As messages name it."""
        return f"{self.low:.3g} to {self.high:.3g} Hz"


def remove_response(counts: Floats, dt: float, response: Response) -> tuple[Floats, Band, float]:
    """Divide an instrument's response out.

    Parameters
    ----------
    counts : (nt,) as recorded, finite
    dt : [s]

    Returns
    -------
    (nt,) acceleration [m/s2], the band, and the share of the recorded energy without its mean that is outside

    Raises
    ------
    RecordError
        for a response that leaves no band.
    """
    band, reaches_zero = find_band(response, 0.5 / dt)
    mean = float(np.mean(counts))
    lowest = band.stop or 1.0 / SHORTEST
    pad = int(np.ceil(max(SHORTEST, PERIODS / lowest) / dt))
    ramp = 0.5 * (1.0 - np.cos(np.pi * (np.arange(pad) + 0.5) / pad))
    moving = counts - mean
    padded = np.concatenate([moving[0] * ramp, moving, moving[-1] * ramp[::-1]])
    size = 1 << int(padded.size - 1).bit_length()
    spectrum = np.fft.rfft(padded, size)
    freq: Floats = np.asarray(np.fft.rfftfreq(size, dt), dtype=np.float64)
    gain = band.gain(freq)
    inside = gain > 0.0
    inside[0] = False
    divided = np.zeros_like(spectrum)
    divided[inside] = gain[inside] * spectrum[inside] / response(freq[inside], native=False)
    if reaches_zero:  # at 0 Hz as at the first frequency above it
        first = complex(response(freq[1:2], native=False)[0]).real
        divided[0] = spectrum[0] / first
    acc = np.fft.irfft(divided, size)[pad : pad + counts.size]
    if reaches_zero:
        acc = acc + mean / first
    energy = np.abs(np.fft.rfft(moving, size)) ** 2
    outside = float(energy[gain < 0.5].sum() / max(float(energy.sum()), 1e-300))
    return np.asarray(acc), band, outside


def find_band(response: Response, nyquist: float) -> tuple[Band, bool]:
    """The band in which a response is divided out, and whether it begins at 0 Hz because the response does.

    Parameters
    ----------
    nyquist : [Hz]

    Raises
    ------
    RecordError
    """
    freq: Floats = np.geomspace(1e-3 * min(1.0, nyquist), NYQUIST_SHARE * nyquist, 2000)
    native = np.abs(response(freq, native=True))
    if not np.all(np.isfinite(native)) or not native.max() > 0.0:
        raise RecordError("it is zero or not finite below Nyquist's frequency")
    peak = int(np.argmax(native))
    weak_low = np.flatnonzero(native[:peak] < LOW_GAIN * native[peak])
    weak_high = np.flatnonzero(native[peak:] < HIGH_GAIN * native[peak])
    high = float(freq[peak + weak_high[0] - 1]) if weak_high.size else float(freq[-1])
    end = min(nyquist, high / NYQUIST_SHARE)
    unit = np.abs(response(freq[[0, -1]], native=False)) / native[[0, -1]]
    if native[0] > 0.5 * native[peak] and np.isclose(unit[0], unit[1], rtol=1e-6):
        return Band(0.0, 0.0, high, end), True  # an accelerometer
    low = max(LOWEST, float(freq[weak_low[-1] + 1]) if weak_low.size else 0.0)
    if not SHOULDER * low < high:
        raise RecordError(f"it leaves no band: {low:.3g} to {high:.3g} Hz")
    return Band(low / SHOULDER, low, high, end), False


def _cosine(x: Floats) -> Floats:
    """Rise from 0 at 0 to 1 at 1."""
    return np.asarray(0.5 * (1.0 - np.cos(np.pi * np.clip(x, 0.0, 1.0))))
