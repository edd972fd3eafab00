"""Arrays by what they hold, and NamedTuples of them: many in one, and one of many.

Things that are computed side by side (runs, step sizes) are kept in one NamedTuple whose arrays have leading
axes of them. Its fields are reached by name alone: no code here or elsewhere knows their order.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Singles = NDArray[np.float32]
PLACE = np.uint64  # of an entry in a hot loop: numba asks of a signed one whether it counts from the end
Record = Any  # a numpy record, or an array of them: `record_type` names its fields

T = TypeVar("T")


def record_type(**fields: type) -> np.dtype[np.record]:
    """Return the type of numbers that change together, each reached by its name, in kernels too.

    A record is one word to a compiled function, an array of one element seven. From Python, numpy's own
    attributes (`size`) would hide a field of the same name.
    """
    hidden = [name for name in fields if hasattr(np.record, name)]
    assert not hidden, hidden
    return np.dtype((np.record, np.dtype(list(fields.items()), align=True)))  # type: ignore[return-value]


def record(kind: np.dtype[np.record]) -> Record:
    """Make one record of zeros."""
    return np.zeros(1, kind)[0]


def stacked(members: Sequence[T]) -> T:
    """Stack NamedTuples field by field, and those within them; what is no number must be the same in all."""
    first: Any = members[0]
    many: Any = first
    if hasattr(first, "_fields"):
        many = type(first)(*(stacked(values) for values in zip(*members, strict=True)))
    elif isinstance(first, np.ndarray | np.generic | float):
        many = np.stack([np.asarray(member) for member in members])
    made: T = many
    return made


def together(members: Sequence[T]) -> T:
    """As `stacked`, of arrays that are only read: a lone member is not copied."""
    return at(members[0], None) if len(members) == 1 else stacked(members)


def at(many: T, index: int | tuple[int, ...] | slice | None) -> T:
    """Views of one of many, or of some: every array of a NamedTuple, and of those within it, at an index.

    Compiled functions may call it (`romdam.core.jit`), with numbers.
    """
    one: Any = many[index] if isinstance(many, np.ndarray) else many
    if hasattr(one, "_fields"):
        one = type(one)(*(at(values, index) for values in one))
    made: T = one
    return made


def put(many: T, index: int | Ints, one: T) -> None:
    """Write into one of many, or the same into some: the reverse of `at`.

    Compiled functions may call it (`romdam.core.jit`), with a number and arrays in C order.
    """
    target: Any = many
    source: Any = one
    if hasattr(target, "_fields"):
        for rows, values in zip(target, source, strict=True):
            put(rows, index, values)
    else:
        target[index] = source


def rows_like(one: T, count: int) -> T:
    """Zeros for many like one: every array of a NamedTuple, and of those within it, with a leading axis."""
    source: Any = one
    if hasattr(source, "_fields"):
        many: Any = type(source)(*(rows_like(values, count) for values in source))
    else:
        values = np.asarray(source)
        many = np.zeros((count, *values.shape), values.dtype)
    made: T = many
    return made
