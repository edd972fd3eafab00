"""Motions at stations that are not coherent with a record, which stays the motion where it is.

Two places at a distance d have the coherency exp(-(loss omega d)^2) of Luco and Wong (without the delay of a
wave, which is added where motions are delayed). With gamma the coherencies of the stations with the record,
Gamma those among them, U the record's transform, and Z transforms of independent random motions like it,

    U_j = gamma_j U + sum_k S_jk Z_k,    S S = Gamma - gamma gamma^T,

so that the mean square of U_j is the record's and the coherency of any two is Gamma: a simulation that is
conditioned on the record. Every Z has the record's envelope and its energy in each third of an octave, filled
with white noise. Luco and Wong's model is smooth at d = 0, so that strains are finite; models with
exp(-|d|) such as Harichandran and Vanmarcke's are not.

References
----------
Luco, Wong, Response of a rigid foundation to a spatially random ground motion, Earthquake Engineering and
Structural Dynamics 14 (1986), 891-908. Kameda, Morikawa, Conditioned stochastic processes for conditional
random fields, Journal of Engineering Mechanics 120 (1994), 855-875.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.motion import GroundMotion, Incoherence
from romdam.records.processing.integrate import displacement, velocity

_LOWEST = 0.1  # Hz, below which the motion stays coherent: distances are short against its waves
_PARTS = 3.0  # bands of an octave
_SPARE = 5.0  # s of rest behind a record, so that its end does not wrap onto its start


def incoherent_motions(motion: GroundMotion, incoherence: Incoherence) -> Floats:
    """Motions at stations at the record's own samples, before any delay.

    Parameters
    ----------
    incoherence : distances of k stations from where the motion is the record

    Returns
    -------
    (k, 3, nt) acceleration [m/s2]; components are independent of each other but for the record
    """
    return _motions(
        motion.acc.tobytes(), motion.acc.shape, motion.dt, tuple(incoherence.distance.tolist()),
        incoherence.loss, incoherence.seed,
    )  # fmt: skip


@lru_cache(maxsize=2)  # of a run: its steps and its estimates of error ask for the same motions again
def _motions(
    samples: bytes, shape: tuple[int, int], dt: float, distance: tuple[float, ...], loss: float, seed: int
) -> Floats:
    acc, at = np.frombuffer(samples).reshape(shape), np.array(distance)
    count = shape[1]
    size = 1 << (2 * count + int(_SPARE / dt)).bit_length()  # a power of two, which transforms are quick for
    omega = 2.0 * np.pi * np.fft.rfftfreq(size, dt)
    with_record = np.exp(-((loss * omega[:, None] * at) ** 2))
    among = np.exp(-((loss * omega[:, None, None] * (at[:, None] - at)) ** 2))
    value, vector = np.linalg.eigh(among - with_record[:, :, None] * with_record[:, None, :])
    root = np.einsum("fjm,fm,fkm->fjk", vector, np.sqrt(np.maximum(value, 0.0)), vector, optimize=True)
    found = np.zeros((len(at), *shape))
    for component in np.flatnonzero(acc.any(axis=1)).tolist():
        record = np.fft.rfft(acc[component], size)
        companions = np.stack(
            [
                np.fft.rfft(_companion(record, size, dt, np.random.default_rng([seed, component, k])))
                for k in range(len(at))
            ]
        )
        apart = (with_record - 1.0) * record[:, None] + np.einsum("fjk,kf->fj", root, companions)
        difference = np.fft.irfft(apart.T, size)[:, :count]
        found[:, component] = acc[component] + _at_rest_in_the_end(difference, dt)
    return found


def _companion(record: np.ndarray, size: int, dt: float, random: np.random.Generator) -> Floats:
    """A random motion (size,) with a record's envelope and energy in bands of a third of an octave."""
    freq = np.fft.rfftfreq(size, dt)
    octave = np.log2(np.maximum(freq, 1e-12) / _LOWEST)
    total = np.zeros(size)
    for band in range(int(np.ceil(_PARTS * octave[-1])) + 1):
        off = np.clip(np.abs(_PARTS * octave - band), 0.0, 1.0)
        gain = np.cos(0.5 * np.pi * off)  # squares of all bands sum to one
        if not gain.any():
            continue
        spectrum = np.zeros(size, dtype=complex)  # of the band's analytic signal
        spectrum[: len(freq)] = 2.0 * gain * record
        envelope = np.abs(np.fft.ifft(spectrum)) / np.sqrt(2.0)
        share = (gain[1:-1] ** 2).sum() * 2.0 / size  # of white noise that passes the band
        filled = np.fft.irfft(gain * np.fft.rfft(envelope * random.standard_normal(size)), size)
        total += filled / np.sqrt(max(share, 1e-300))
    return np.asarray(total)


def _at_rest_in_the_end(acc: Floats, dt: float) -> Floats:
    """Accelerations (k, nt) less straight lines in time, so that velocity and displacement end at zero."""
    time = dt * np.arange(acc.shape[1])
    lines = np.stack([np.ones_like(time), time / max(time[-1], dt)])
    ends = np.stack([velocity(lines, dt)[:, -1], displacement(lines, dt)[:, -1]])
    wanted = np.stack([velocity(acc, dt)[:, -1], displacement(acc, dt)[:, -1]])
    return np.asarray(acc - np.linalg.solve(ends, wanted).T @ lines)
