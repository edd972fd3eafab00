"""One number or spectrum of a record's components: of the largest, the geometric mean, RotD50, one of them.

References
----------
Boore, D. M. (2010). Orientation-independent, nongeometric-mean measures of seismic intensity from two
horizontal components of motion. BSSA 100(4), 1830-1835.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from romdam.core.errors import RecordError
from romdam.records.measures import measure
from romdam.records.spectra import ROTATIONS, pseudo_acceleration, rotated_psa

Array = NDArray[np.float64]
AXES = ("x", "y", "z")
_PERCENTILE = {"rotd50": 50.0, "rotd100": 100.0}
_ROWS = {"largest": [0, 1, 2], "x": [0], "y": [1], "z": [2]}


def spectrum(acc: Array, dt: float, periods: Array, damping: float, of: str) -> Array:
    """PSa of a record at periods [s], (np,) [m/s2].

    Parameters
    ----------
    acc : (3, nt) along x, y, z [m/s2]
    of : as `of` of a configuration, `romdam.config.sections.motions.target.Of`

    Raises
    ------
    RecordError
        where the components are not there that `of` needs.
    """
    check_components(acc, of)
    if of in _PERCENTILE:
        return rotated_psa(acc[0], acc[1], dt, periods, damping)[of == "rotd100"]
    return _combined(acc, of, lambda rows: pseudo_acceleration(rows, dt, periods, damping))


def peak(acc: Array, of: str) -> float:
    """PGA of a record (3, nt) [m/s2]; raises as `spectrum` does."""
    check_components(acc, of)
    return float(_combined(acc, of, lambda rows: np.max(np.abs(rows), axis=-1)))


def measures(acc: Array, dt: float, of: str) -> dict[str, float]:
    """All of `romdam.records.measures.measure` of a record (3, nt); raises as `spectrum` does.

    Those of RotD are percentiles of each measure over the rotations.
    """
    check_components(acc, of)
    names = list(measure(acc[:1, :2], dt))
    values = _combined(acc, of, lambda rows: np.stack(list(measure(rows, dt).values()), axis=1))
    return dict(zip(names, np.nan_to_num(values).tolist(), strict=True))


def check_components(acc: Array, of: str) -> None:
    """Refuse a measure of components that do not move.

    Raises
    ------
    RecordError
    """
    moves = [axis for axis, row in zip(AXES, acc, strict=True) if np.any(row != 0.0)]
    pair = of in ("geometric_mean", *_PERCENTILE)
    needed = ["x", "y"] if pair else [of] if of in AXES else []
    if missing := [axis for axis in needed if axis not in moves]:
        others = f"; it moves along {', '.join(moves)}, say for example of: {moves[0]}" if moves else ""
        raise RecordError(f"of: {of} needs motion along {', '.join(missing)}, there is none{others}")
    if of == "larger_horizontal" and moves == ["z"]:
        raise RecordError("of: larger_horizontal needs motion along x or y, there is along z only; of: z")


def _combined(acc: Array, of: str, values: Callable[[Array], Array]) -> Array:
    """`values` of rows (k, nt), (k, ...), combined to those of the record, (...)."""
    if of in _PERCENTILE:
        angles = np.pi / ROTATIONS * np.arange(ROTATIONS)
        turned = [values((np.cos(a) * acc[0] + np.sin(a) * acc[1])[None])[0] for a in angles]
        return np.asarray(np.percentile(turned, _PERCENTILE[of], axis=0))
    rows = acc[_ROWS.get(of, [0, 1])]
    if of == "geometric_mean":
        combined = values(rows)
        return np.sqrt(combined[0] * combined[1])
    moves = np.any(rows != 0.0, axis=-1)
    return np.max(values(rows[moves] if moves.any() else rows[:1]), axis=0)
