"""Peaks of every gap over all steps."""

from __future__ import annotations

import numpy as np

from romdam.core.arrays import Floats

PEAKS = ("opening", "opening_time", "compression", "slip")


def first_peaks(jump: Floats, force: Floats) -> Floats:
    """(4, n) peaks that the first state sets, in the order of `PEAKS`."""
    slip = np.hypot(jump[:, 1], jump[:, 2]) if jump.shape[1] == 3 else np.zeros(len(jump))
    return np.stack([jump[:, 0], np.zeros(len(jump)), np.maximum(force[:, 0], 0.0), slip])


def named_peaks(peaks: Floats) -> dict[str, Floats]:
    """Peaks by name."""
    return dict(zip(PEAKS, peaks, strict=True))
