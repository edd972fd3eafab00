"""What of computed numbers is round-off, and is shown as 0."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from romdam.core.arrays import Floats

ROUND_OFF = 1e-8  # of the largest value of its unit, below which a value is round-off
NOTHING = 1e-12  # m, N, J, Pa: no length, force, energy or stress of a dam that means anything is as small


def without_round_off(values: ArrayLike, largest: float | None = None) -> Floats:
    """Values of one unit as they are shown: 0 where they are round-off [unit of the values, SI].

    Parameters
    ----------
    largest : magnitude that they stand beside; their own largest if not given
    """
    shown = np.array(values, dtype=float)
    most = float(np.nanmax(np.abs(shown), initial=0.0)) if largest is None else largest
    shown[np.abs(shown) < max(ROUND_OFF * most, NOTHING)] = 0.0
    return shown
