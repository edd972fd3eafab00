"""The numbers of one section of a .msh file, written as text or as bytes, taken one after the other."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from romdam.core.errors import quote
from romdam.core.scene import Floats, Ints
from romdam.geometry.meshes.data import numbers_of

_LARGEST = 2.0**53  # beyond it text numbers are not whole any more


class GmshLayout(NamedTuple):
    """Byte order and the size of size_t of a binary file."""

    order: str
    size: int


class Numbers(Protocol):
    """Numbers of a section, however they are written.

    Every method raises ValueError where the section has fewer.
    """

    def floats(self, count: int) -> Floats:
        """The next `count` numbers."""

    def ints(self, count: int, kind: str) -> Ints:
        """The next `count` whole numbers, of kind `int` or `size`."""


def counts(stream: Numbers, count: int, kind: str = "int") -> list[int]:
    """A few whole numbers."""
    return [int(n) for n in stream.ints(count, kind)]


class Words:
    """Of a section written as text."""

    def __init__(self, body: bytes, name: str) -> None:
        if b"_" in body:  # float() would read 1_0 as 10
            raise ValueError(f"${name} holds an underscore")
        self.numbers, self.at, self.name = numbers_of(body.split(), f"${name}"), 0, name

    def floats(self, count: int) -> Floats:
        """The next `count` numbers."""
        values = self.numbers[self.at : self.at + max(count, 0)]
        if count < 0 or len(values) < count:
            raise ValueError(f"${self.name} ends {count - len(values)} numbers early: the file was cut")
        self.at += count
        return values

    def ints(self, count: int, kind: str) -> Ints:
        """The next `count` whole numbers."""
        return whole(self.floats(count), self.name)

    def refuse_rest(self) -> None:
        """Raise where numbers are left over."""
        if self.at < len(self.numbers):
            raise ValueError(
                f"${self.name} holds {len(self.numbers) - self.at} numbers more than its counts say"
            )


class Bytes:
    """Of a binary section that begins at `at`."""

    def __init__(self, data: bytes, at: int, name: str, layout: GmshLayout) -> None:
        self.data, self.at, self.name = data, at, name
        self.kinds = {
            "int": f"{layout.order}i4",
            "size": f"{layout.order}u{layout.size}",
            "float": f"{layout.order}f8",
        }

    def floats(self, count: int) -> Floats:
        """The next `count` numbers."""
        return np.asarray(self._take(count, np.dtype(self.kinds["float"])).astype(float))

    def ints(self, count: int, kind: str) -> Ints:
        """The next `count` whole numbers."""
        return np.asarray(self._take(count, np.dtype(self.kinds[kind])).astype(np.int64))

    def records(self, count: int, fields: list[tuple[str, str, int]]) -> NDArray[Any]:
        """The next `count` records of fields (name, kind, how many)."""
        return self._take(count, np.dtype([(name, self.kinds[kind], (n,)) for name, kind, n in fields]))

    def count_line(self) -> int:
        """A count written as text before the bytes (version 2.2)."""
        end = self.data.find(b"\n", self.at, self.at + 40)
        text = self.data[self.at : max(end, self.at)]
        self.at = end + 1
        if end < 0 or not text.strip().isdigit():
            raise ValueError(f"${self.name} begins with {quote(text)}, not a count")
        return int(text)

    def _take(self, count: int, dtype: np.dtype[Any]) -> NDArray[Any]:
        left = (len(self.data) - self.at) // dtype.itemsize
        if not 0 <= count <= left:
            raise ValueError(
                f"${self.name} says that {count} items follow where {left} can: the file was cut"
            )
        values = np.frombuffer(self.data, dtype, count, self.at)
        self.at += count * dtype.itemsize
        return values


def whole(numbers: Floats, name: str) -> Ints:
    """Numbers of a section as whole ones; raises ValueError where one is not."""
    odd = np.flatnonzero(~((numbers == np.rint(numbers)) & (np.abs(numbers) < _LARGEST)))
    if len(odd):
        raise ValueError(f"${name} holds {numbers[odd[0]]:g} where a whole number is meant")
    return numbers.astype(np.int64)
