"""What is said of a motion when all has been done to it: how it ends, and what that has changed.

The same is said whatever was done: nothing, a correction, or wavelets that match a spectrum.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from romdam.records.measures import measure
from romdam.records.processing.integrate import displacement, velocity
from romdam.records.spectra import pseudo_acceleration

Array = NDArray[np.float64]
VELOCITY, DISPLACEMENT = 0.01, 0.1  # of their peaks, at the end of a motion
CHANGE = 0.1  # of a measure
PERIODS: Array = np.array([0.2, 0.5, 1.0, 3.0, 10.0])  # s, of 5 % damping
MEASURES = {
    "pga": ("PGA", "m/s2"), "pgv": ("PGV", "m/s"), "pgd": ("PGD", "m"), "arias": ("Arias intensity", "m/s"),
}  # fmt: skip
_ROUND_OFF = 1e-9  # of the largest component's peak: what a rotation leaves of nothing


def said_of_end(acc: Array, dt: float, names: Sequence[str]) -> tuple[str, ...]:
    """Say where a motion does not end at rest.

    A velocity above 1 % of its peak or a displacement above 10 % of its peak is what is left of a baseline,
    or a permanent offset; the structure sees the first as a constant acceleration.

    Parameters
    ----------
    acc : (k, nt) [m/s2]
    names : of the components, k
    """
    remarks = []
    moving = np.flatnonzero(_moving(acc))
    vel, disp = velocity(acc, dt), displacement(acc, dt)
    for name, rows, limit, unit in (
        ("velocity", vel, VELOCITY, "m/s"),
        ("displacement", disp, DISPLACEMENT, "m"),
    ):
        peak, last = np.max(np.abs(rows), axis=-1), np.abs(rows[..., -1])
        share = np.where(peak > 0.0, last / np.where(peak > 0.0, peak, 1.0), 0.0)
        beyond = [row for row in moving.tolist() if share[row] > limit]
        if beyond:
            ends = ", ".join(
                f"{last[row]:.3g} {unit} along {names[row]}, {100 * share[row]:.1f} % of its peak"
                for row in beyond
            )
            remarks.append(
                f"the {name} ends at {ends} (limit {100 * limit:g} %); correct the record, or take the "
                "offset for real"
            )
    return tuple(remarks)


def said_of_changes(
    before: Array, after: Array, dt: float, names: Sequence[str], what: str
) -> tuple[str, ...]:
    """Say where a peak, Arias intensity or a spectral acceleration has changed by more than `CHANGE`.

    Parameters
    ----------
    before : (k, nt) [m/s2]
    after : (k, nt with pads) [m/s2]
    names : of the components, k
    what : has changed them, "the correction"
    """
    had, has = measure(before, dt), measure(after, dt)
    rows = np.flatnonzero(_moving(before))
    said = []
    for row in rows.tolist():
        pairs = [(text, unit, had[name][row], has[name][row]) for name, (text, unit) in MEASURES.items()]
        spectra = (pseudo_acceleration(acc[row], dt, PERIODS)[0] for acc in (before, after))
        for period, old, new in zip(PERIODS, *spectra, strict=True):
            pairs.append((f"Sa({period:g} s)", "m/s2", old, new))
        changes = [
            f"{text} from {old:.3g} to {new:.3g} {unit} ({100 * (new / old - 1.0):+.0f} %)"
            for text, unit, old, new in pairs
            if old > 0.0 and abs(new - old) > CHANGE * old
        ]
        if changes:
            said.append(f"{what} changes, along {names[row]}, {', '.join(changes)}")
    return tuple(said)


def _moving(acc: Array) -> NDArray[np.bool_]:
    """(k,) components that move."""
    peak = np.max(np.abs(acc), axis=-1)
    return np.asarray(peak > _ROUND_OFF * np.max(peak, initial=0.0))
