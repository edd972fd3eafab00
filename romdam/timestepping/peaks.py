"""Peaks of every gap over all steps."""

from __future__ import annotations

import numpy as np

from romdam.contact.components import NORMAL, SHEAR_J, SHEAR_K
from romdam.core.arrays import Floats, Record, record_type
from romdam.core.jit import VIEWS, njit
from romdam.core.recorded import PEAK_QUANTITIES

PEAKS = record_type(**dict.fromkeys(PEAK_QUANTITIES, float))


def first_peaks(jump: Floats, force: Floats) -> Record:
    """(n,) peaks that the first state sets, `PEAKS`."""
    peaks = np.zeros(len(jump), PEAKS)
    peaks["opening"], peaks["compression"] = jump[:, NORMAL], np.maximum(force[:, NORMAL], 0.0)
    if jump.shape[1] == 3:
        peaks["slip"] = np.hypot(jump[:, SHEAR_J], jump[:, SHEAR_K])
    return peaks


@njit(**VIEWS)
def raise_peaks(peaks: Record, jump: Floats, force: Floats, time: float) -> None:
    """Raise peaks to those of a state at a time [s]."""
    for i in range(len(peaks)):
        peak, opening = peaks[i], jump[i, NORMAL]
        if opening > peak.opening:
            peak.opening, peak.opening_time = opening, time
        peak.compression = max(peak.compression, force[i, NORMAL])
        if jump.shape[1] == 3:
            peak.slip = max(peak.slip, np.sqrt(jump[i, SHEAR_J] ** 2 + jump[i, SHEAR_K] ** 2))


def peaks_at_points(
    peaks: dict[str, Floats], jump: Floats, at_points: Floats, time: Floats
) -> dict[str, Floats]:
    """Peaks of the jumps at the gaps' positions: written ones, and what is reached between written rows.

    Parameters
    ----------
    peaks : of `jump` over every step
    time : (nt,) of the rows [s]; the peaks' times are those of rows
    jump, at_points : (nt, ng, d) written jumps that joint forces see, and at the positions [m]
    """
    if jump is at_points:
        return peaks
    moved = {"opening": (jump[..., NORMAL], at_points[..., NORMAL])}
    if jump.shape[2] == 1:
        moved["slip"] = np.zeros(jump.shape[:2]), np.zeros(jump.shape[:2])
    else:
        moved["slip"] = (
            np.hypot(jump[..., SHEAR_J], jump[..., SHEAR_K]),
            np.hypot(at_points[..., SHEAR_J], at_points[..., SHEAR_K]),
        )
    raised = dict(peaks)
    raised["opening_time"] = time[at_points[..., NORMAL].argmax(axis=0)]
    for name, (seen, at_position) in moved.items():
        raised[name] = at_position.max(axis=0) + peaks[name] - seen.max(axis=0)
    return raised


def node_peaks(disp: Floats, dt: float) -> Floats:
    """(2, m) largest displacement of either sign, and its time, of histories (nt, m) in steps of dt [s]."""
    size = np.abs(disp)
    return np.stack([size.max(axis=0, initial=0.0), dt * size.argmax(axis=0)])


def named_peaks(peaks: Record) -> dict[str, Floats]:
    """Peaks by name, an array each."""
    return {name: peaks[name].copy() for name in PEAKS.names or ()}
