"""Histories of every base step, thinned to the rows that are written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.recorded import GAP_QUANTITIES
from romdam.core.system import Coordinates, History, StepMotion

_Make = Callable[[slice], tuple[Floats, Floats]]


def thinned(history: History, dt: float, stride: int) -> History:
    """Keep every `stride`-th row of a history of every base step, and the motion of all steps apart.

    Mean joint forces become those of the intervals between the rows that are left.

    Parameters
    ----------
    dt : base step [s]
    """
    motion = StepMotion(dt, history.acc, history.vel, history.ground)
    if stride == 1:
        return replace(history, every_step=motion)
    count = len(history.time)
    fields = {name: getattr(history, name) for name in GAP_QUANTITIES}
    kept = {name: rows[::stride] if len(rows) == count else rows for name, rows in fields.items()}
    mean = history.mean_traction
    if len(mean) == count:
        whole = 1 + (count - 1) // stride * stride
        each = mean[1:whole].reshape(-1, stride, *mean.shape[1:]).mean(axis=1)
        kept["mean_traction"] = np.concatenate([mean[:1], each])
    written = {
        name: getattr(history, name)[::stride] for name in ("time", "disp", "vel", "acc", "ground", "forces")
    }
    written["attached"] = history.attached[::stride]
    made = history.coordinates
    return replace(
        history,
        **kept,
        **written,
        supports=history.supports[::stride],
        energy={name: values[::stride] for name, values in history.energy.items()},
        coordinates=None if made is None else Coordinates(partial(_strided, made.make, stride)),
        every_step=motion,
    )


def _strided(make: _Make, stride: int, rows: slice) -> tuple[Floats, Floats]:
    """Coordinates of some rows of the thinned history."""
    first, step = rows.start or 0, rows.step or 1
    stop = None if rows.stop is None else (rows.stop - 1) * stride + 1
    return make(slice(first * stride, stop, step * stride))
