"""Sizes of steps: the base step, how it is cut where contact changes, how many make a written row."""

from __future__ import annotations

import math
from dataclasses import dataclass

_PARTS = 8  # of the record's step, or of the written interval: a common step is not sought below
_WHOLE = 1e-6  # relative, to which a ratio of two steps counts as whole
_SAME = 1e-9  # relative, to which two steps are one


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


def grid_steps(dt: float, interval: float | None) -> Steps:
    """Take the longest base step whose multiples hold a record's samples and the written rows.

    A record is straight between its samples, and motion is exact on a grid that holds them. Where the longest
    common step is below an eighth of the shorter of the two, the grid passes by the samples, at an eighth of
    the record's step at most.

    Parameters
    ----------
    dt : of the record [s]
    interval : of the written rows; every base step is written where None [s]
    """
    if interval is None:
        return Steps(dt)
    rows = interval / dt
    for parts in range(1, math.floor(_PARTS * max(1.0, 1.0 / rows) + _WHOLE) + 1):
        stride = round(parts * rows)
        if stride and abs(parts * rows - stride) <= _WHOLE * stride:
            return Steps(interval / stride, stride)
    stride = math.ceil(_PARTS * rows * (1.0 - _WHOLE))
    return Steps(interval / stride, stride)


def holds_samples(base: float, dt: float) -> bool:
    """Tell whether a record's samples lie at base steps."""
    parts = dt / base
    return abs(parts - round(parts)) <= 2.0 * _WHOLE * parts


def fixed_steps(step: float, interval: float | None, dt: float | None = None) -> Steps:
    """Take one step throughout.

    Parameters
    ----------
    interval : of the written rows, a whole multiple of the step; every step is written where None [s]
    dt : of the record [s]; where given, and no shorter than the step, the step is shortened to a whole part
        of the grid that holds the record's samples
    """
    if dt is not None and step <= dt * (1.0 + _SAME):
        grid = grid_steps(dt, interval).base
        step = _whole_part(grid, step, math.ceil(grid / step * (1.0 - _WHOLE)))
    return Steps(step, 1 if interval is None else round(interval / step))


def cut_steps(finest: float, dt: float, interval: float | None) -> Steps:
    """Take the step of the record's grid, cut down to the finest where contact changes.

    A cut into 2 refuses more steps than one into 4, one into 8 takes more small ones; both cost more. So cuts
    are into 4 as far as they go, and the grid's step into what is left, 2, 3 or 5. Where the grid's step has
    no number of finest steps that is made of these, the finest is shortened to the next that has.

    Parameters
    ----------
    finest : longest step where contact changes [s]
    dt : of the record, see `grid_steps` [s]
    interval : of the written rows, which the base step divides; every base step is written where None [s]
    """
    if finest > dt * (1.0 + _SAME):
        return fixed_steps(finest, interval)
    grid = grid_steps(dt, interval)
    parts, left, cuts = math.ceil(grid.base / finest * (1.0 - _WHOLE)), 0, list[int]()
    while left != 1:  # the next number of parts that the cuts make
        left, cuts = parts, []
        for cut in (5, 4, 3, 2):
            while left % cut == 0:
                left, cuts = left // cut, [cut, *cuts]
        parts += int(left != 1)
    return Steps(parts * _whole_part(grid.base, finest, parts), grid.stride, tuple(cuts))


def _whole_part(base: float, step: float, parts: int) -> float:
    """A base step over a number of parts; the step that was asked for itself, where it is that."""
    return step if abs(parts * step - base) <= _SAME * base else base / parts
