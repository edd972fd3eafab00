"""From recorded azimuths to the model's axes.

The model's z is up; its x points to `x_azimuth` (degrees clockwise from north) and y is 90 degrees to the
left of x seen from above, that is to `x_azimuth` - 90. With x_azimuth = 90, x is east and y is north.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from romdam.core.errors import RecordError
from romdam.records.channel import Orientation

SMALLEST_ANGLE = 30.0  # degrees between two horizontal channels; less, and their noise decides the motion


def rotation(where: Sequence[Orientation], x_azimuth: float, location: str) -> NDArray[np.float64]:
    """Matrix (3, k) that turns k recorded channels into motion along x, y, z.

    Parameters
    ----------
    where : orientation of each channel; two horizontal, or one vertical, or all three
    x_azimuth : azimuth of the model's x [degrees]
    location : names the record in errors

    Raises
    ------
    RecordError
        for one horizontal channel alone, more than two, two that are almost parallel, or two verticals.
    """
    level = [i for i, w in enumerate(where) if w.azimuth is not None]
    upright = [i for i, w in enumerate(where) if w.azimuth is None]
    if len(level) not in (0, 2) or len(upright) > 1 or not where:
        raise RecordError(
            f"{location}: rotation to x_azimuth needs two horizontal channels, one vertical at most; "
            f"it has {len(level)} and {len(upright)}; name them under `components`"
        )
    matrix = np.zeros((3, len(where)))
    for i in upright:
        matrix[2, i] = where[i].vertical
    if level:
        azimuths = [float(where[i].azimuth or 0.0) for i in level]
        matrix[:2, level] = _horizontal(azimuths, x_azimuth, location)
    return matrix


def _horizontal(azimuths: list[float], x_azimuth: float, location: str) -> NDArray[np.float64]:
    """Recorded = D @ (motion along x, y); D's rows are the channels' directions. Return its inverse."""
    angle = np.radians(x_azimuth - np.array(azimuths))  # counterclockwise from x to the channel
    directions = np.column_stack([np.cos(angle), np.sin(angle)])
    if abs(np.linalg.det(directions)) < np.sin(np.radians(SMALLEST_ANGLE)):
        raise RecordError(
            f"{location}: channels at {azimuths[0]:g} and {azimuths[1]:g} degrees are within "
            f"{SMALLEST_ANGLE:g} degrees of parallel; they do not give two directions of motion"
        )
    inverse = np.linalg.inv(directions)
    return np.where(np.abs(inverse) < 1e-15, 0.0, inverse)
