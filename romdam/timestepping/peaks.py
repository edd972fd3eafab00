"""Peaks of every gap over all steps."""

from __future__ import annotations

import numpy as np

from romdam.contact.components import NORMAL, SHEAR_J, SHEAR_K
from romdam.core.arrays import Floats, Record, record_type

PEAKS = record_type(opening=float, opening_time=float, compression=float, slip=float)


def first_peaks(jump: Floats, force: Floats) -> Record:
    """(n,) peaks that the first state sets, `PEAKS`."""
    peaks = np.zeros(len(jump), PEAKS)
    peaks["opening"], peaks["compression"] = jump[:, NORMAL], np.maximum(force[:, NORMAL], 0.0)
    if jump.shape[1] == 3:
        peaks["slip"] = np.hypot(jump[:, SHEAR_J], jump[:, SHEAR_K])
    return peaks


def raise_peaks(peaks: Record, now: Record, time: float) -> None:
    """Raise peaks to those of a state at a time [s]."""
    peaks["opening_time"][now["opening"] > peaks["opening"]] = time
    for name in ("opening", "compression", "slip"):
        peaks[name] = np.maximum(peaks[name], now[name])


def named_peaks(peaks: Record) -> dict[str, Floats]:
    """Peaks by name, an array each."""
    return {name: peaks[name].copy() for name in PEAKS.names or ()}
