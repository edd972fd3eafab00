"""What the jitted functions of the march share: whether array views count references, and a copy.

Every view (a row of a run's state) takes an atomic increment and a decrement, dozens per step: a quarter of
the time of the march on the two-cantilever model (24 -> 17 us a step without them). The march itself makes no
arrays, so it needs none; what it calls says so where it does make some, for the option is handed down to the
functions that are called.
"""

from __future__ import annotations

from typing import Any

from numba import njit
from numpy.typing import NDArray

VIEWS: dict[str, Any] = {"cache": True, "_nrt": False}  # no arrays are made here, nor by what is called
ARRAYS: dict[str, Any] = {"cache": True, "_nrt": True}  # arrays may be made, by what is called too


@njit(cache=True)
def copy(source: NDArray[Any], target: NDArray[Any]) -> None:
    """target = source, both (n,).

    Numba compiles `target[:] = source` with the message for shapes that differ: 3 s for every pair of types.
    """
    for i in range(len(target)):
        target[i] = source[i]
