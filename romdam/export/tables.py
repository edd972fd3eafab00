"""Text of decks: tables, numbers that lose no digit, sentences in a head."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from textwrap import wrap

from romdam.core.printable import printable


def exact(value: float) -> str:
    """Shortest text that reads back as the same number, always with a point or an exponent."""
    return repr(float(value))


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """CSV with a head: numbers that lose no digit, words quoted where they hold a comma or a quote."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(head)
    writer.writerows([exact(v) if isinstance(v, float) else str(v) for v in row] for row in rows)
    return text.getvalue()


def openings_head(gaps: int, probes: Iterable[str]) -> str:
    """Head of the openings that a script writes: time, every gap, three components of every probe."""
    moved = [f"displacement:{name}:{axis}" for name in probes for axis in "xyz"]
    return table(["time", *(f"opening:{number}" for number in range(gaps)), *moved], [])


def comments(mark: str, title: str, stated: Iterable[str]) -> str:
    """A script's head: what it is, and what differs from romdam's model."""
    lines = [printable(title), "What differs from romdam's model:", *(stated or ["nothing"])]
    return "\n".join(f"{mark} {piece}" for line in lines for piece in wrap(line, 110))


def assignments(values: Mapping[str, object]) -> str:
    """Python that gives names to values."""
    return "\n".join(f"{name} = {value!r}" for name, value in values.items())
