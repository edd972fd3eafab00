"""Histories and spectra of one component of a ground motion, as a page of figures shows them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from romdam.config.sections.motions.target import NAMED
from romdam.core.arrays import Floats
from romdam.core.motion import GroundMotion
from romdam.postprocess.record_measures import PERIODS
from romdam.records.components import spectrum
from romdam.records.measures import fourier_amplitude
from romdam.records.processing.integrate import displacement, velocity
from romdam.records.spectra import response_spectra

DAMPINGS = (0.02, 0.05)
FOURIER_POINTS = 300


@dataclass(frozen=True)
class RecordCurves:
    """One component of a ground motion.

    Attributes
    ----------
    time : (nt,) [s]
    acc, vel, disp : (nt,) of the ground [m/s2], [m/s], [m]
    psa : damping ratio -> (periods,) pseudo-spectral acceleration at PERIODS [m/s2]
    freq, amplitude : (n,) Fourier amplitude of the acceleration, smoothed [Hz], [m/s]
    """

    time: Floats
    acc: Floats
    vel: Floats
    disp: Floats
    psa: dict[float, Floats]
    freq: Floats
    amplitude: Floats


def record_curves(motion: GroundMotion, axis: int) -> RecordCurves:
    """Histories and spectra of component `axis` of a motion."""
    acc, dt = motion.acc[axis], motion.dt
    freq, amplitude = fourier_amplitude(acc, dt)
    # root mean square in logarithmic bands, so that a page holds lines and not a smear
    edges = np.geomspace(max(freq[1], 0.01), freq[-1], FOURIER_POINTS + 1)
    total, _ = np.histogram(freq[1:], edges, weights=amplitude[1:] ** 2)
    count, _ = np.histogram(freq[1:], edges)
    filled = count > 0
    return RecordCurves(
        time=motion.time,
        acc=acc,
        vel=velocity(acc, dt),
        disp=displacement(acc, dt),
        psa=dict(zip(DAMPINGS, response_spectra(acc, dt, PERIODS, DAMPINGS).psa[0], strict=True)),
        freq=np.sqrt(edges[1:] * edges[:-1])[filled],
        amplitude=np.sqrt(total[filled] / count[filled]),
    )


@dataclass(frozen=True)
class TargetCurves:
    """The records that aim at one target.

    Attributes
    ----------
    of : what of the components is held against it, as it is called
    damping : ratio
    periods, sa : (np,) of the target [s], [m/s2]
    psa : (records, np) as they are used [m/s2]
    """

    of: str
    damping: float
    periods: Floats
    sa: Floats
    psa: Floats


def target_curves(motions: Sequence[GroundMotion]) -> list[TargetCurves]:
    """Spectra of motions beside their targets, one for each target."""
    groups: dict[str, list[GroundMotion]] = {}
    for motion in motions:
        if target := target_of(motion):
            groups.setdefault(str([target[key] for key in ("of", "damping", "sa_m_s2")]), []).append(motion)
    curves = []
    for group in groups.values():
        target = target_of(group[0])
        periods, damping = np.array(target["periods_s"]), float(target["damping"])
        of = next(word for word, name in NAMED.items() if name == target["of"])
        psa = np.array([spectrum(motion.acc, motion.dt, periods, damping, of) for motion in group])
        curves.append(TargetCurves(str(target["of"]), damping, periods, np.array(target["sa_m_s2"]), psa))
    return curves


def target_of(motion: GroundMotion) -> dict[str, Any]:
    """Target of a motion, from its provenance; empty where there is none."""
    about = motion.provenance.get("target")
    return about if isinstance(about, dict) else {}
