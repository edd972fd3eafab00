"""Text of decks: tables, numbers that lose no digit, sentences in a head."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from textwrap import wrap


def exact(value: float) -> str:
    """Shortest text that reads back as the same number, always with a point or an exponent."""
    return repr(float(value))


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """CSV with a head; whole numbers and words as they are."""
    lines = [",".join(exact(v) if isinstance(v, float) else str(v) for v in row) for row in rows]
    return "\n".join([",".join(head), *lines]) + "\n"


def comments(mark: str, title: str, stated: Iterable[str]) -> str:
    """A script's head: what it is, and what differs from romdam's model."""
    lines = [title, "What differs from romdam's model:", *(stated or ["nothing"])]
    return "\n".join(f"{mark} {part}" for line in lines for part in wrap(line, 110))


def assignments(values: Mapping[str, object]) -> str:
    """Python that gives names to values."""
    return "\n".join(f"{name} = {value!r}" for name, value in values.items())
