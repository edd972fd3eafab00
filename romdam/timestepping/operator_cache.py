"""Operators that one integration has made and the next ones of the same system use again.

A suite shakes one system with many records, each at two or three steps. Its dynamic modes, their propagators
and the flexibility of its gaps over a step are the same for all of them.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import is_dataclass
from threading import Lock
from typing import Any, TypeVar

import numpy as np

Value = TypeVar("Value")

_MOST = 0.5e9  # bytes; the newest stays whatever it takes, the loop holds it anyway


class OperatorCache:
    """Values by key, the latest used for longest; threads may share it, and it is pickled without them."""

    def __init__(self) -> None:
        self._values: dict[Hashable, tuple[Any, int]] = {}  # each with its bytes
        self._lock = Lock()  # of the values; what is computed may ask for others, or be computed twice

    def __reduce__(self) -> tuple[type[OperatorCache], tuple[()]]:
        return OperatorCache, ()

    def get_or_compute(self, key: Hashable, compute: Callable[[], Value]) -> Value:
        """Give the value of a key, computed where it is not here; it is not to be changed."""
        with self._lock:
            held = self._values.get(key)
        if held is None:
            computed = compute()
            held = computed, _bytes(computed)
        with self._lock:
            self._values.pop(key, None)
            self._values[key] = held
            while len(self._values) > 1 and sum(size for _, size in self._values.values()) > _MOST:
                del self._values[next(iter(self._values))]
        value: Value = held[0]
        return value


def _bytes(value: object) -> int:
    """Of the arrays in tuples and dataclasses."""
    if isinstance(value, np.ndarray):
        return value.nbytes
    parts = value if isinstance(value, tuple) else vars(value).values() if is_dataclass(value) else ()
    return sum(map(_bytes, parts))
