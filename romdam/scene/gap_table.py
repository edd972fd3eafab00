"""Initial gaps from a table of points on the joint."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from romdam.core.errors import ConfigError
from romdam.core.files import check_file
from romdam.geometry.elements import Floats
from romdam.geometry.nearest import nearest

_COLUMNS = ("x", "y", "z", "gap")
_LARGEST = 100e6  # bytes
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
    table = _read(path, location)
    points, gap = table[:, :3], table[:, 3]
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


def _read(path: Path, location: str) -> Floats:
    try:
        check_file(path, _LARGEST, ConfigError)
        with path.open(newline="", encoding="utf-8-sig") as stream:
            rows = list(csv.DictReader(stream, skipinitialspace=True))
    except (ConfigError, OSError, UnicodeDecodeError, csv.Error) as error:
        raise ConfigError(
            f"{location}: {path} cannot be read ({error}); give a CSV file with x,y,z,gap"
        ) from None
    missing = [column for column in _COLUMNS if not rows or column not in rows[0]]
    if missing:
        what = f"lacks column {', '.join(missing)}" if rows else "has no rows"
        raise ConfigError(
            f"{location}: {path} {what}; its first line must be x,y,z,gap, then one point per line in m"
        )
    table = []
    for number, row in enumerate(rows, start=2):
        try:
            values = [float(row[column] or "") for column in _COLUMNS]
        except ValueError:
            values = [np.nan]
        if not np.all(np.isfinite(values)):
            words = ",".join(str(row[column]) for column in _COLUMNS)
            raise ConfigError(
                f"{location}: {path} line {number}: expected four finite numbers x,y,z,gap, got {words!r}"
            )
        table.append(values)
    return np.array(table)
