"""In-structure (floor) response spectra of a run.

An oscillator of frequency f and damping ratio xi stands at an output node and follows its absolute
acceleration, that relative to the base plus that of the base. The ordinate is the largest absolute
acceleration of the oscillator, during the run and after its end, at which the place is taken to stop.

Joint forces act for less than a step where joints close, and the acceleration at the steps is a sample of
them that says nothing of their impulse. The velocity does. So the velocity relative to the base is the cubic
spline through its values at the base steps, all of which count, and its derivative is the acceleration: its
integral over each step is the change of the velocity, and smooth motion is met to fourth order. The
acceleration of the base is straight between the steps, as it was integrated.

References
----------
US NRC Regulatory Guide 1.122, rev. 1 (1978); ASCE/SEI 4-16, section 6.2.3.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_banded

from romdam.core.arrays import Floats, Ints
from romdam.core.system import StepMotion
from romdam.postprocess.stated_errors import percent
from romdam.records.spectra import response_spectra

LEAST = 0.01  # of the largest ordinate of a place at a frequency, by which a direction with less is measured
AT_REST = (
    0.1  # of a place's peak acceleration in the last second: a floor that moves more has not come to rest
)
SUBSTEPS = 8  # of a base step: the derivative of the spline is straight between them
_LAST = 1.0  # [s] at the end of a run, in which a floor is to be at rest


@dataclass(frozen=True)
class FloorSpectra:
    """Floor spectra of a run, p places along x, y and z, d damping ratios, f frequencies.

    Attributes
    ----------
    places : their names
    dampings : (d,) [1]
    frequencies : (f,) [Hz]
    ordinates : (p, 3, d, f) largest absolute acceleration of the oscillators [m/s2]
    peak : (p, 3) largest absolute acceleration of the place itself [m/s2]
    late : (p,) largest acceleration of the last second over that of the whole run [1]
    error : (p, 3, d, f) relative difference to the ordinates of a better run; None where there is none [1]
    error_of : what the better run has that this one has not
    highest_mode : frequency of the highest mode kept of the block that keeps fewest [Hz]; None for all modes
    broadened : (p, 3, d, f) ordinates with peaks broadened [m/s2]; None where that was not asked for
    """

    places: tuple[str, ...]
    dampings: Floats
    frequencies: Floats
    ordinates: Floats
    peak: Floats
    late: Floats
    error: Floats | None = None
    error_of: str = ""
    highest_mode: float | None = None
    broadened: Floats | None = None

    @property
    def below_modes(self) -> Ints:
        """Numbers of the frequencies up to that of the highest mode."""
        most = np.inf if self.highest_mode is None else self.highest_mode
        return np.flatnonzero(self.frequencies <= most)


def floor_spectra(
    motion: StepMotion,
    places: Mapping[str, Sequence[int]],
    dampings: Sequence[float],
    frequencies: Sequence[float],
) -> FloorSpectra:
    """Compute the floor spectra of a run.

    Parameters
    ----------
    motion : of the output nodes at every base step
    places : name -> numbers of its output nodes, of which the largest ordinate counts
    dampings : (d,) damping ratios
    frequencies : (f,) rising, up to half of the sampling rate [Hz]
    """
    nodes = np.unique(np.concatenate([np.asarray(numbers, dtype=int) for numbers in places.values()]))
    columns = (3 * nodes[:, None] + np.arange(3)).ravel()
    absolute = absolute_acceleration(motion, columns)
    ratios, hertz = np.asarray(dampings, dtype=float), np.asarray(frequencies, dtype=float)
    step = motion.dt / SUBSTEPS
    shape = (len(nodes), 3, len(ratios), len(hertz))
    at_nodes = response_spectra(absolute.T, step, 1.0 / hertz, ratios).sa.reshape(shape)
    largest = np.abs(absolute).max(axis=0).reshape(-1, 3)
    last = np.abs(absolute[-max(1, round(_LAST / step)) :]).max(axis=0).reshape(-1, 3).max(axis=1)
    late = last / np.maximum(largest.max(axis=1), np.finfo(float).tiny)
    of_place = [np.searchsorted(nodes, np.asarray(numbers, dtype=int)) for numbers in places.values()]

    def over_nodes(values: Floats) -> Floats:
        return np.array([values[numbers].max(axis=0) for numbers in of_place])

    return FloorSpectra(
        places=tuple(places),
        dampings=ratios,
        frequencies=hertz,
        ordinates=over_nodes(at_nodes),
        peak=over_nodes(largest),
        late=over_nodes(late),
    )


def absolute_acceleration(motion: StepMotion, columns: Ints) -> Floats:
    """Absolute acceleration of some components of the nodes, `SUBSTEPS` times a base step [m/s2].

    Parameters
    ----------
    columns : (n,) of `motion.vel`

    Returns
    -------
    (SUBSTEPS (nt - 1) + 1, n)
    """
    slopes = _spline_slopes(motion.vel[:, columns], motion.acc[[0, -1]][:, columns], motion.dt)
    rise = np.diff(motion.vel[:, columns], axis=0) / motion.dt
    steps, ground = len(rise), motion.ground[:, columns % 3]
    absolute = np.empty((steps, SUBSTEPS, len(columns)))
    for k in range(SUBSTEPS):  # the derivative of the cubic, at a share of each step
        x = k / SUBSTEPS
        relative = 6.0 * x * (1.0 - x) * rise
        relative += (1.0 - x) * (1.0 - 3.0 * x) * slopes[:-1] + x * (3.0 * x - 2.0) * slopes[1:]
        absolute[:, k] = relative + (1.0 - x) * ground[:-1] + x * ground[1:]
    return np.vstack([absolute.reshape(-1, len(columns)), slopes[-1] + ground[-1]])


def _spline_slopes(values: Floats, ends: Floats, h: float) -> Floats:
    """Slopes (nt, n) of cubic splines through values (nt, n) at steps h, those at the ends (2, n) as given.

    Their second derivatives are continuous: m[i-1] + 4 m[i] + m[i+1] = 3 (v[i+1] - v[i-1]) / h.
    """
    slopes = np.empty_like(values)
    slopes[0], slopes[-1] = ends
    count = len(values) - 2
    if count > 0:
        right = 3.0 * (values[2:] - values[:-2]) / h
        right[0] -= slopes[0]
        right[-1] -= slopes[-1]
        bands = np.ones((3, count))
        bands[1] = 4.0
        slopes[1:-1] = solve_banded((1, 1), bands, right)
    return slopes


def relative_difference(ordinates: Floats, better: Floats) -> Floats:
    """|S - S'| / S' of spectra (p, 3, d, f); S' counts as `LEAST` of the largest direction at least."""
    size = np.maximum(better, LEAST * better.max(axis=1, keepdims=True))
    return np.abs(ordinates - better) / np.where(size > 0.0, size, 1.0)


def broadened(ordinates: Floats, frequencies: Floats, share: float) -> Floats:
    """Broaden the peaks of spectra (..., f) by a share of their frequency to either side.

    The envelope of the spectrum shifted by every factor from 1 - share to 1 + share: the ordinate at f is the
    largest from f / (1 + share) to f / (1 - share), straight between the frequencies on a logarithmic axis.
    What is outside of the frequencies is not known and does not count.

    References
    ----------
    Regulatory Guide 1.122, C.1 and figure 1, where the sides stay parallel to those of the peak.
    """
    x = np.log(frequencies)
    flat = ordinates.reshape(-1, len(x))
    wide = np.empty(flat.shape)
    for k, at in enumerate(x):
        ends = at - np.log1p(share), at - np.log1p(-share)
        inside = (x >= ends[0]) & (x <= ends[1])
        for row, values in enumerate(flat):
            wide[row, k] = max(values[inside].max(), *np.interp(ends, x, values))
    return wide.reshape(ordinates.shape)


def statement(spectra: FloorSpectra) -> str:
    """Say how far floor spectra may be off, and up to which frequency."""
    below, most = spectra.below_modes, spectra.highest_mode
    up_to = "" if most is None or len(below) == len(spectra.frequencies) else f" up to {most:.3g} Hz"
    parts = list[str]()
    if len(below):
        if spectra.error is None:
            parts.append("The error of the floor spectra by modes and steps is not stated.")
        else:
            error = spectra.error[..., below]
            parts.append(
                f"{spectra.error_of} changes the floor spectra{up_to} by {_percent(error.max())} at most, "
                f"{_percent(np.median(error))} in the median."
            )
    if up_to and most is not None:
        parts.append(
            f"Above {most:.3g} Hz, the frequency of the highest mode kept of some block, motion of the "
            "structure is missing, and the spectra are not reliable."
        )
    return " ".join(parts)


def concerns(spectra: FloorSpectra) -> list[str]:
    """Warnings about floor spectra of a run, one sentence each."""
    found = list[str]()
    beyond = len(spectra.frequencies) - len(spectra.below_modes)
    if beyond:
        found.append(
            f"floor spectra: {beyond} of {len(spectra.frequencies)} frequencies lie above "
            f"{spectra.highest_mode:.3g} Hz, the highest mode kept of some block, and are not reliable; take "
            "more modes, or model.cutoff above the highest frequency"
        )
    worst = int(spectra.late.argmax())
    if spectra.late[worst] > AT_REST:
        found.append(
            f"floor spectra: {spectra.places[worst]} still moves with {_percent(spectra.late[worst])} of its "
            f"peak acceleration in the last second, limit {_percent(AT_REST)}; the spectra take it to "
            "stop at the end: lengthen transient.duration or the record"
        )
    return found


def _percent(value: float) -> str:
    return percent(value)
