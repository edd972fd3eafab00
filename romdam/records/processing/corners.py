"""Corner frequencies of a record's band-pass: searched on the displacement, or from signal to noise.

References
----------
Hearne, M. et al. gmprocess (USGS, public domain): `ridder_fchp`, `snr_check` and `get_corner_frequencies`.
Brune, J. N. (1970). Tectonic stress and the spectra of seismic shear waves. JGR 75(26), 4997-5009.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from romdam.core.errors import RecordError
from romdam.records.processing.correction_steps import butterworth, pad, pad_samples
from romdam.records.processing.integrate import displacement

Array = NDArray[np.float64]
POLYNOMIAL_ORDER = 3
FILTER_ORDER = 5
SOURCE_CORNERS = (0.1, 2.0)  # Hz; gmprocess' floor and ceiling of the source's corner
NEEDED_TO = 5.0  # Hz; gmprocess' `max_freq`


def drift_ratio(acc: Array, dt: float, corner: float) -> float:
    """Largest value of a cubic fitted to displacement after a high-pass, over the largest displacement.

    gmprocess' `ridder_fchp` criterion (S. Brandenberg): a drifting displacement is mostly cubic.
    """
    extra = pad_samples(FILTER_ORDER, corner, dt)
    filtered = butterworth(pad(acc, extra, extra), dt, FILTER_ORDER, (corner, None), False)
    disp = displacement(filtered, dt)[..., extra : extra + acc.shape[-1]]
    time = np.linspace(-1.0, 1.0, disp.shape[-1])
    basis = np.linalg.qr(np.vander(time, POLYNOMIAL_ORDER + 1))[0]
    trend = (disp @ basis) @ basis.T
    peak = np.max(np.abs(disp), axis=-1)
    return float(np.max(np.max(np.abs(trend), axis=-1) / np.where(peak > 0.0, peak, 1.0)))


def search_highpass(acc: Array, dt: float, target: float, band: tuple[float, float]) -> float:
    """Find the lowest corner [Hz] in `band` whose displacement drifts less than `target`, by Ridder's method.

    Parameters
    ----------
    acc : (..., nt) acceleration [m/s2]
    target : drift ratio wanted, see `drift_ratio`
    band : lowest and highest corner allowed [Hz]

    Raises
    ------
    RecordError
        when even the highest corner leaves more drift.
    """
    low = max(band[0], 1.0 / ((acc.shape[-1] - 1) * dt))  # below one over the length nothing can be seen
    if low >= band[1] or drift_ratio(acc, dt, low) <= target:
        return min(low, band[1])
    at_most = drift_ratio(acc, dt, band[1])
    if at_most > target:
        raise RecordError(
            f"correction: no high-pass corner up to {band[1]:g} Hz brings the displacement's drift down to "
            f"{target:g} (it is {at_most:.3g} there); raise `highest` or detrend first"
        )
    from scipy import optimize  # here: reading a record should not wait for it

    def excess(log_corner: float) -> float:
        return drift_ratio(acc, dt, float(np.exp(log_corner))) - target

    root = optimize.ridder(excess, np.log(low), np.log(band[1]), xtol=1e-3, maxiter=60)
    return float(np.exp(float(root)))


def source_corner(magnitude: float | None) -> float:
    """Frequency [Hz] from which a record must stand out of its noise: the corner of Brune's source spectrum.

    As gmprocess' `snr_check` takes it: 10 bar, 3.7 km/s, within 0.1 and 2 Hz; 2 Hz for an unknown magnitude,
    the least that any record must show.
    """
    if magnitude is None:
        return SOURCE_CORNERS[1]
    moment = 10.0 ** (1.5 * magnitude + 16.05)  # dyn cm, Hanks and Kanamori (1979)
    return float(np.clip(4.9e6 * 3.7 * (10.0 / moment) ** (1.0 / 3.0), *SOURCE_CORNERS))


def signal_to_noise_band(
    acc: Array, dt: float, onset: int, threshold: float, magnitude: float | None = None
) -> tuple[float, float]:
    """Find the band [Hz] in which signal over noise exceeds `threshold` in every component.

    The noise is the part before `onset`, the signal the rest; both spectra are smoothed over a ninth of a
    decade and divided by the root of their length. The band must hold all from `source_corner` (or the
    lowest frequency that the noise's length resolves, if that is higher) up to `NEEDED_TO`; elsewhere the
    band would be a sliver between peaks of noise, and a filter to it would take the motion away.

    Raises
    ------
    RecordError
        when less than a second precedes the onset, or the ratio is too small within what the band must hold.
    """
    if onset * dt < 1.0:
        raise RecordError(
            f"correction: signal to noise needs 1 s before the onset, the record has {onset * dt:.2g} s; "
            "give the corners or search them (method: ridder)"
        )
    rows = acc.reshape(-1, acc.shape[-1])
    bands = [_component_band(row, dt, onset, threshold, source_corner(magnitude)) for row in rows]
    return max(b[0] for b in bands), min(b[1] for b in bands)


def _component_band(
    row: Array, dt: float, onset: int, threshold: float, corner: float
) -> tuple[float, float]:
    """Find the band [Hz] of one component (nt,); `corner` is the lowest frequency that it must hold [Hz]."""
    noise, shaking = row[:onset] - np.mean(row[:onset]), row[onset:] - np.mean(row[:onset])
    freq = np.geomspace(max(1.0 / (onset * dt), 0.01), 0.45 / dt, 200)
    noise_spectrum = np.maximum(_smooth_spectrum(noise, dt, freq), np.finfo(float).tiny)
    ratio = _smooth_spectrum(shaking, dt, freq) / noise_spectrum
    needed = np.flatnonzero((freq >= corner) & (freq <= NEEDED_TO))
    first, last = (needed[0], needed[-1]) if needed.size else (0, freq.size - 1)
    least = first + int(np.argmin(ratio[first : last + 1]))
    if ratio[least] < threshold:
        raise RecordError(
            f"correction: signal over noise is {ratio[least]:.3g} at {freq[least]:.3g} Hz, and must be "
            f"{threshold:g} from {freq[first]:.3g} to {freq[last]:.3g} Hz, or the band-pass would filter the "
            "motion away; search the corners on the displacement (`peer`, or method: ridder), or give them"
        )
    below, above = np.flatnonzero(ratio[:first] < threshold), np.flatnonzero(ratio[last:] < threshold)
    low = freq[below[-1] + 1] if below.size else freq[0]
    high = freq[last + above[0] - 1] if above.size else freq[-1]
    return float(low), float(high)


def _smooth_spectrum(row: Array, dt: float, freq: Array) -> Array:
    """Root mean square of the amplitude spectrum within an 18th of a decade of each frequency, (nf,)."""
    spectrum = np.abs(np.fft.rfft(row, max(row.size, 4096))) ** 2 / row.size
    lines = np.fft.rfftfreq(max(row.size, 4096), dt)
    summed = np.concatenate([[0.0], np.cumsum(spectrum)])
    width = 10.0 ** (1.0 / 18.0)
    first = np.searchsorted(lines, freq / width)
    last = np.maximum(np.searchsorted(lines, freq * width), first + 1)
    last = np.minimum(last, lines.size)
    first = np.minimum(first, last - 1)
    return np.sqrt((summed[last] - summed[first]) / (last - first))
