"""Response-spectrum analysis: peaks of modes, their combination, and the largest normal stress at a point.

Modes below a cut-off frequency answer the spectrum, each with r_i = (response of mode i) * Sd(omega_i, xi_i).
What is stiffer follows the ground: it answers the spectral acceleration at the cut-off statically, all of it
in phase, and is one column more of the combination, which nothing correlates with (missing-mass method).

References
----------
Der Kiureghian, Earthquake Eng. Struct. Dyn. 9 (1981) 419; Wilson, Der Kiureghian, Bayo, ibid. 187 (CQC).
Menun, Der Kiureghian, J. Struct. Eng. 126 (2000) 474 (envelopes of several responses at once).
US NRC Regulatory Guide 1.92, rev. 3 (2012), C.1.4 (missing mass), C.2.1 (three components by SRSS).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import permutations
from typing import Literal

import numpy as np
from scipy.linalg import block_diag

from romdam.core.arrays import Floats, Ints
from romdam.core.errors import ConfigError
from romdam.core.motion import AXES, GroundMotion
from romdam.core.system import System
from romdam.records.spectra import pseudo_acceleration

Combination = Literal["cqc", "srss"]
Directions = Literal["srss", "100-40-40", "100-30-30"]
_LESSER = {"100-40-40": 0.4, "100-30-30": 0.3}  # share of the other two components
_OFF = 0.005  # of the damping ratio of a spectrum, by which the leading mode may differ untold
_PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))
_STARTS = 600  # directions on a half sphere, 6 degrees apart: the best is below the peak by 1 % at most
_TURNS = 100  # of the iteration from there, which gains at every turn
_CHUNK = 4096  # nodes at a time: 60 MB for 600 directions


@dataclass(frozen=True)
class Spectrum:
    """A spectrum at the modes of a structure, m of them, and the modes themselves.

    Attributes
    ----------
    modes : (m,) numbers of the reduced coordinates that answer the spectrum, ascending in frequency
    freq : (m,) [Hz]
    damping : (m,) ratios
    load : (m, 3) phi^T M r of modes of unit mass [kg^0.5]
    sa : (3, m) spectral acceleration [m/s2]
    zpa : (3,) acceleration of what is stiffer [m/s2]
    """

    modes: Ints
    freq: Floats
    damping: Floats
    load: Floats
    sa: Floats
    zpa: Floats


@dataclass(frozen=True)
class ModalPeaks:
    """Peaks of a structure's coordinates, direction by direction of the ground.

    Attributes
    ----------
    columns : (3, n, c) coordinates of each column; the last column is what follows the ground statically
    correlation : (c, c) of the columns
    directions : rule by which the three directions are combined
    """

    columns: Floats
    correlation: Floats
    directions: Directions

    def combined(self, rows: Floats) -> Floats:
        """Peaks (k,) of responses rows @ q, both signs of which occur.

        Parameters
        ----------
        rows : (k, n)
        """
        return combine_directions(self.by_direction(rows), self.directions)

    def by_direction(self, rows: Floats) -> Floats:
        """Peaks (3, k) of responses rows @ q, (k, n), each of one direction of the ground."""
        peaks = []
        for columns in self.columns:
            response = rows @ columns
            peaks.append(((response @ self.correlation) * response).sum(axis=1))
        return np.sqrt(np.maximum(peaks, 0.0))

    def covariance(self, rows: Floats) -> Floats:
        """Sums (3, k, 6, 6) of r_i rho_ij r_j^T of six responses at each of k points, rows (k, 6, n)."""
        flat = rows.reshape(-1, rows.shape[2])
        total = []
        for columns in self.columns:
            response = (flat @ columns).reshape(len(rows), 6, -1)
            total.append((response @ self.correlation) @ response.transpose(0, 2, 1))
        return np.array(total)


def modes_below(system: System, cutoff: float) -> tuple[Ints, Floats, Floats]:
    """Numbers, frequencies [Hz] and effective damping ratios (m,) of modes up to a frequency.

    Raises
    ------
    ConfigError
        for one that is damped critically.
    """
    with np.errstate(divide="ignore"):
        omega = np.sqrt(system.K.diagonal() / system.M.diagonal())
    modes = np.flatnonzero(omega <= 2.0 * np.pi * cutoff)
    modes = modes[np.argsort(omega[modes])]
    freq, damping = omega[modes] / (2.0 * np.pi), system.effective_ratios[1][modes]
    if (damping >= 1.0).any():
        k = int(np.argmax(damping >= 1.0))
        raise ConfigError(
            f"damping: the mode at {freq[k]:.4g} Hz has a ratio of {damping[k]:.3g}, limit 1; lower it, or "
            "linear_stage.cutoff below that frequency"
        )
    return modes, freq, damping


def spectrum_of_motion(system: System, motion: GroundMotion, cutoff: float) -> Spectrum:
    """The spectrum of a ground motion at the damping of each mode; what is stiffer has its peak."""
    modes, freq, damping = modes_below(system, cutoff)
    sa = np.zeros((3, len(modes)))
    for k, (f, ratio) in enumerate(zip(freq, damping, strict=True)):
        sa[:, k] = pseudo_acceleration(motion.acc, motion.dt, np.array([1.0 / f]), float(ratio))[:, 0]
    load = np.asarray(system.load)[modes, :3]
    return Spectrum(modes, freq, damping, load, sa, np.abs(motion.acc).max(axis=1))


def periods_of(system: System, cutoff: float) -> Floats:
    """Periods (m + 1,) at which a spectrum is needed, rising: of the cut-off, and of the modes [s]."""
    return np.append(1.0 / cutoff, 1.0 / modes_below(system, cutoff)[1][::-1])


def spectrum_given(
    system: System, cutoff: float, ordinates: Mapping[str, Floats], ratio: float
) -> tuple[Spectrum, list[str]]:
    """Given spectra at the modes, and what is doubtful about them; see `modes_below`.

    Parameters
    ----------
    ordinates : axis -> (m + 1,) spectral accelerations at `periods_of`; no ground motion along others [m/s2]
    ratio : damping ratio of these spectra
    """
    modes, freq, damping = modes_below(system, cutoff)
    sa, zpa = np.zeros((3, len(modes))), np.zeros(3)
    for axis, values in ordinates.items():
        sa[AXES.index(axis)], zpa[AXES.index(axis)] = values[:0:-1], values[0]
    load = np.asarray(system.load)[modes, :3]
    concerns = []
    leading = int((load**2).sum(axis=1).argmax()) if len(modes) else 0
    if len(modes) and abs(damping[leading] - ratio) > _OFF:
        concerns.append(
            f"linear_stage: the leading mode at {freq[leading]:.4g} Hz has {100 * damping[leading]:.3g} % of "
            f"critical damping, and the spectra are taken as they are, at {100 * ratio:g} %"
        )
    return Spectrum(modes, freq, damping, load, sa, zpa), concerns


def modal_peaks(
    load: Floats,
    stiffness: Floats,
    spectrum: Spectrum,
    combination: Combination = "cqc",
    directions: Directions = "srss",
) -> ModalPeaks:
    """Make the columns of a combination from the spectrum.

    Parameters
    ----------
    load : (n, 3) phi^T M r of modes of unit mass; those that are not of the spectrum follow the ground
    stiffness : (n,) phi^T K phi; of modes with mass omega^2 [1/s2]
    """
    modes, count = spectrum.modes, len(spectrum.modes)
    columns = np.zeros((3, len(stiffness), count + 1))
    static = load.T / stiffness  # displacement for a unit acceleration
    for k in range(3):
        columns[k, :, count] = static[k] * spectrum.zpa[k]
        columns[k, modes, count] = 0.0
        columns[k, modes, np.arange(count)] = static[k, modes] * spectrum.sa[k]
    rho = np.eye(count) if combination == "srss" else cqc(np.sqrt(stiffness[modes]), spectrum.damping)
    return ModalPeaks(columns, block_diag(rho, 1.0), directions)


def cqc(omega: Floats, damping: Floats) -> Floats:
    """Correlation coefficients (m, m) of the complete quadratic combination.

    Parameters
    ----------
    omega : (m,) [rad/s]
    damping : (m,) ratios; undamped modes are uncorrelated with all others
    """
    ratio = omega[:, None] / omega
    first, second = np.meshgrid(damping, damping, indexing="ij")
    above = 8.0 * np.sqrt(first * second) * (ratio * first + second) * ratio**1.5
    below = (1.0 - ratio**2) ** 2 + 4.0 * first * second * ratio * (1.0 + ratio**2)
    below += 4.0 * (first**2 + second**2) * ratio**2
    rho = np.divide(above, below, out=np.zeros_like(above), where=below > 0.0)
    np.fill_diagonal(rho, 1.0)
    return rho


def combine_directions(peaks: Floats, rule: Directions) -> Floats:
    """Peaks (...) of three components of the ground together, from those of each, (3, ...)."""
    return np.asarray((_weights(peaks, rule) * peaks).sum(axis=0))


def _weights(peaks: Floats, rule: Directions) -> Floats:
    """Factors (3, ...) of the components' peaks whose sum of products is the combined peak.

    They are also what the component at the peak of the combination has of its own peak.
    """
    if rule == "srss":
        total = np.sqrt((peaks**2).sum(axis=0))
        return np.divide(peaks, total, out=np.zeros_like(peaks), where=total > 0.0)
    lesser = _LESSER[rule]
    shares = np.array(sorted(set(permutations((1.0, lesser, lesser)))))
    sums = np.tensordot(shares, peaks, axes=1)
    return np.moveaxis(shares[sums.argmax(axis=0)], -1, 0)


def largest_normal_stress(static: Floats, covariance: Floats, rule: Directions) -> Floats:
    """Largest normal stress (k,) over all directions n: n . S n + R(n), an estimate of the principal stress.

    R(n) is the combined peak of the normal stress along n, which is linear in the modes. The largest over
    time of the major principal stress is the largest over n of that over time of the normal stress along n,
    so that no mode needs a sign. The principal stress of combined components would be of no instant.

    Parameters
    ----------
    static : (k, 6) S [Pa]
    covariance : (3, k, 6, 6) see `ModalPeaks.covariance` [Pa2]
    rule : of the directions of the ground
    """
    starts = np.array([_products(n) for n in _half_sphere(_STARTS)])
    largest = np.empty(len(static))
    for first in range(0, len(static), _CHUNK):
        part = slice(first, first + _CHUNK)
        S, C = static[part], covariance[:, part]
        values = S @ starts.T + combine_directions(_sizes(C, starts), rule)
        best = values.max(axis=1)
        products = starts[values.argmax(axis=1)]
        for _ in range(_TURNS):
            # the tensor that has the peak along n, and its own principal direction
            forces = np.einsum("dkab,kb->dka", C, products)
            peaks = np.sqrt(np.maximum(np.einsum("dka,ka->dk", forces, products), 0.0))
            shares = np.divide(_weights(peaks, rule), peaks, out=np.zeros_like(peaks), where=peaks > 0.0)
            tensor = S + (shares[..., None] * forces).sum(axis=0)
            direction = np.linalg.eigh(_matrix(tensor))[1][:, :, 2]
            products = _products(direction)
            peaks = np.sqrt(np.maximum(np.einsum("dkab,ka,kb->dk", C, products, products), 0.0))
            best = np.maximum(best, (S * products).sum(axis=1) + combine_directions(peaks, rule))
        largest[part] = best
    return largest


def _sizes(covariance: Floats, products: Floats) -> Floats:
    """Peaks (3, k, s) of the normal stress along s directions, from covariance (3, k, 6, 6)."""
    pairs = (products[:, :, None] * products[:, None]).reshape(-1, 36)
    square = covariance.reshape(*covariance.shape[:2], 36) @ pairs.T
    return np.asarray(np.sqrt(np.maximum(square, 0.0)))


def _products(n: Floats) -> Floats:
    """What a normal stress along unit vectors (..., 3) takes of the six components, (..., 6)."""
    return np.stack([n[..., k] * n[..., l] * (1.0 if k == l else 2.0) for k, l in _PAIRS], axis=-1)


def _matrix(stress: Floats) -> Floats:
    """Symmetric matrices (..., 3, 3) of six components (..., 6)."""
    matrix = np.empty((*stress.shape[:-1], 3, 3))
    for number, (k, l) in enumerate(_PAIRS):
        matrix[..., k, l] = matrix[..., l, k] = stress[..., number]
    return matrix


def _half_sphere(count: int) -> Floats:
    """Unit vectors (count, 3) spread evenly over a half sphere, on a spiral."""
    height = (np.arange(count) + 0.5) / count
    turn = np.pi * (1.0 + np.sqrt(5.0)) * np.arange(count)
    radius = np.sqrt(1.0 - height**2)
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), height])
