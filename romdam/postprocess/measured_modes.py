"""Measured modes of a structure and the computed ones that they are compared with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from romdam.core.arrays import Floats, Ints
from romdam.core.errors import ResultError


@dataclass(frozen=True)
class MeasuredMode:
    """A mode from a vibration test.

    Attributes
    ----------
    frequency : [Hz]
    damping : ratio, NaN where not measured
    mode : number of the computed one, from 1; None where it is to be found
    direction : 0, 1 or 2 where the mode moves most along x, y or z; None where not known
    """

    name: str
    frequency: float
    damping: float
    mode: int | None
    direction: int | None


def match_modes(measured: Sequence[MeasuredMode], freq: Floats, motion: Floats) -> Ints:
    """Number, from 1, of the computed mode of every measured one.

    Those that are not stated follow from the assignment, each mode once, with the least sum of
    ln(computed / measured)^2; a direction leaves only the modes that move most along it.

    Parameters
    ----------
    freq : (m,) computed [Hz]; rigid motions at 0 are nobody's
    motion : (m, 3) share of the kinetic energy along x, y, z

    Raises
    ------
    ResultError
        where too few modes move along a direction.
    """
    numbers = np.array([mode.mode or 0 for mode in measured])
    free = np.flatnonzero(numbers == 0)
    cost = np.full((len(free), len(freq)), np.inf)
    main = motion.argmax(axis=1)
    for row, k in enumerate(free.tolist()):
        mode = measured[k]
        fits = (freq > 0.0) & ((main == mode.direction) if mode.direction is not None else True)
        fits[numbers[numbers > 0] - 1] = False
        cost[row, fits] = np.log(freq[fits] / mode.frequency) ** 2
    try:
        rows, columns = linear_sum_assignment(cost)
    except ValueError:
        raise ResultError(
            f"{len(measured)} measured modes find no partner each among {len(freq)} computed ones, of which "
            f"{', '.join(f'{int((main == k).sum())} move most along {a}' for k, a in enumerate('xyz'))} and "
            f"{int((freq == 0.0).sum())} are rigid; ask for more with -n, or correct the directions"
        ) from None
    numbers[free[rows]] = columns + 1
    return numbers
