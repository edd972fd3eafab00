"""Sizes of steps: the base step, how it is cut where contact changes, how many make a written row."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Steps:
    """The steps of a run.

    Attributes
    ----------
    base : step at which the ground motion is given [s]
    stride : base steps per written row
    cuts : into how many a step is cut at each level below the base step; empty where it never is
    """

    base: float
    stride: int = 1
    cuts: tuple[int, ...] = ()

    @property
    def finest(self) -> float:
        """The step where contact changes [s]."""
        return self.base / math.prod(self.cuts)

    @property
    def interval(self) -> float:
        """Time between two written rows [s]."""
        return self.base * self.stride

    @property
    def sizes(self) -> list[float]:
        """The step of every level, the base step first [s]."""
        return [self.base / math.prod(self.cuts[:level]) for level in range(len(self.cuts) + 1)]


def fixed_steps(step: float, interval: float | None) -> Steps:
    """Take one step throughout.

    Parameters
    ----------
    interval : of the written rows, a whole multiple of the step; every step is written where None [s]
    """
    return Steps(step, 1 if interval is None else round(interval / step))


def cut_steps(finest: float, coarse: float, interval: float | None) -> Steps:
    """Take a coarse step, cut down to the finest where contact changes.

    A cut into 2 refuses more steps than one into 4, one into 8 takes more small ones; both cost more, so only
    the base step is cut into 2, where that brings it nearer to the coarse one.

    Parameters
    ----------
    finest : step where contact changes [s]
    coarse : longest base step wanted, the record's own [s]
    interval : of the written rows, which the base step must divide; every base step is written where None [s]
    """

    def fits(step: float) -> bool:
        rows = 1.0 if interval is None else interval / step
        return step <= coarse * (1.0 + 1e-9) and rows > 1.0 - 1e-6 and abs(rows - round(rows)) <= 1e-6 * rows

    base, cuts = finest, tuple[int, ...]()
    while fits(4.0 * base):
        base, cuts = 4.0 * base, (4, *cuts)
    if fits(2.0 * base):
        base, cuts = 2.0 * base, (2, *cuts)
    return Steps(base, 1 if interval is None else round(interval / base), cuts)


def whole_steps(interval: float, step: float) -> Steps:
    """Divide an interval of the written rows by the longest step that does not exceed `step`."""
    stride = math.ceil(interval / step * (1.0 - 1e-9))
    return Steps(interval / stride, stride)
