"""Initial gaps from a table of points on the joint."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from romdam.core.csv_table import read_table
from romdam.geometry.elements import Floats
from romdam.geometry.nearest import nearest

_COLUMNS = ("x", "y", "z", "gap")
_FLAT = 1e-6  # a table narrower than this share of its length is a line


def table_gap(path: Path, position: Floats, location: str) -> Floats:
    """Gap at every position (n, 3) from a CSV file with columns x, y, z, gap [m].

    The points are projected on their best-fitting plane (a joint is a graph over it); between them
    the gap is linear, outside it is that of the nearest point.

    Raises
    ------
    ConfigError
        for a file that cannot be read, lacks a column or a row, or holds something else than numbers.
    """
    table = read_table(path, location=location).columns(_COLUMNS, "one point per line in m")
    points, gap = np.stack([table[axis] for axis in "xyz"], axis=1), table["gap"]
    at_nearest = gap[nearest(points, position)[1]]
    centre = points.mean(axis=0)
    _, spread, axes = np.linalg.svd(points - centre, full_matrices=False)
    flat = (points - centre) @ axes.T, (position - centre) @ axes.T
    rank = int(np.count_nonzero(spread > _FLAT * max(spread[0], 1e-300)))
    if rank == 0 or len(points) == 1:
        return at_nearest
    if rank == 1:
        order = np.argsort(flat[0][:, 0])
        return np.interp(flat[1][:, 0], flat[0][order, 0], gap[order])
    from scipy.interpolate import LinearNDInterpolator  # here: half a second that few scenes need

    interpolate, places = LinearNDInterpolator(flat[0][:, :2], gap), flat[1][:, :2]
    value = interpolate(places)
    # nodes on the table's rim may fall outside by rounding: look a millionth further in
    value = np.where(np.isnan(value), interpolate(places * (1.0 - 1e-6)), value)
    return np.where(np.isnan(value), at_nearest, value)
