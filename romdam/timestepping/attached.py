"""Forces of attachments of a run, from what was observed of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from romdam.core.system import History, System


def with_attached_forces(history: History, system: System) -> History:
    """The history with the forces of attachments, and without the rows that were observed for them."""
    bearing = system.bearing
    if bearing is None or not history.disp.size:
        return history
    rows = bearing.rows
    force = bearing.force(history.disp[:, rows], history.vel[:, rows])
    peaks = np.stack([force.min(axis=0), force.max(axis=0)])
    if len(history.base_disp):  # whose rates are not kept
        e = history.base_disp[:, rows]
        every = bearing.force(e, np.zeros_like(e))
        springs = bearing.damping == 0.0
        peaks[:, springs] = np.stack([every.min(axis=0), every.max(axis=0)])[:, springs]
    fields = ("disp", "vel", "acc", "base_disp")
    kept = {name: getattr(history, name) for name in fields}
    kept = {name: np.delete(values, rows, axis=1) if values.size else values for name, values in kept.items()}
    return replace(history, attached=force, attached_peaks=peaks, **kept)
