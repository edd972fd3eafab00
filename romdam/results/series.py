"""Times and blocks of a result that are worth a picture: the worst step, the frames of a series, the dam."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from romdam.core.errors import ResultError
from romdam.results.fields import Result


@dataclass(frozen=True)
class Frames:
    """Frames of a series.

    Attributes
    ----------
    count : how many
    window : first and last second; None for the seconds around the largest displacement
    """

    count: int
    window: tuple[float, float] | None = None


_SAMPLES = 150  # nodes of each block at which the rows are sought that are looked at whole
_NEAR = 0.5  # of the largest displacement of these, which such a row reaches
_NUMBERS = 20_000_000  # in memory at once
_AROUND = 2.0  # [s] before and after it


def dam_blocks(result: Result) -> list[str]:
    """All blocks but rock; of results that do not name their rock, those that some joint touches, or all."""
    dataset = result.dataset
    if "rock_blocks" in dataset.attrs:
        rock = json.loads(dataset.attrs["rock_blocks"])
        return [name for name in result.blocks if name not in rock]
    jointed = set(dataset.joint_blocks.values.ravel().tolist()) if "joint_blocks" in dataset else set()
    return [name for name in result.blocks if not jointed or name in jointed]


def worst_displacement_time(result: Result, window: tuple[float, float] | None = None) -> float:
    """Written time at which some node of the dam is farthest from where it was [s].

    Every node is looked at, in the rows in which some of them move by half as much as they ever do.

    Parameters
    ----------
    window : first and last second, with a written time between; all of the result if None
    """
    time = np.asarray(result.dataset.time.values, dtype=float)
    inside = time if window is None else time[(time >= window[0] - 1e-9) & (time <= window[1] + 1e-9)]
    largest, worst = -1.0, float(inside[0])
    for block in dam_blocks(result):
        count = len(result.points(block))
        some = np.unique(np.linspace(0, count - 1, min(count, _SAMPLES)).astype(np.int64))
        reached = _farthest(result, block, inside, some)
        near = inside[reached >= _NEAR * reached.max()]
        for times in np.array_split(near, min(len(near), 1 + 3 * count * len(near) // _NUMBERS)):
            size = _farthest(result, block, times, None)
            if size.max() > largest:
                largest, worst = float(size.max()), float(times[size.argmax()])
    return worst


def _farthest(
    result: Result, block: str, times: NDArray[np.float64], nodes: NDArray[np.int64] | None
) -> NDArray[np.float64]:
    """(times,) how far the farthest node is from where it was [m]."""
    moved = result.displacement(block, nodes=nodes, times=list(times)).values
    return np.asarray(np.linalg.norm(moved, axis=2).max(axis=1))


def frame_times(result: Result, frames: Frames) -> NDArray[np.float64]:
    """Written times of a series: so many, evenly spread over the window, the worst among them, each once.

    That of the largest displacement in the window takes the place of the one nearest to it.

    Parameters
    ----------
    frames : how many, and of which seconds

    Raises
    ------
    ResultError
        where the window has no written time.
    """
    count, window = frames.count, frames.window
    time = np.asarray(result.dataset.time.values, dtype=float)
    worst = None
    if window is None:
        worst = worst_displacement_time(result)
        window = (worst - _AROUND, worst + _AROUND)
    first, last = window
    inside = np.flatnonzero((time >= first - 1e-9) & (time <= last + 1e-9))
    if not len(inside):
        raise ResultError(
            f"{result.path}: no written time lies between {first:g} and {last:g} s, the result has "
            f"{time[0]:g} to {time[-1]:g} s; choose another window"
        )
    rows = np.linspace(inside[0], inside[-1], min(count, len(inside))).round().astype(np.int64)
    row = int(np.abs(time - (worst_displacement_time(result, window) if worst is None else worst)).argmin())
    rows[np.abs(rows - row).argmin()] = row
    return time[np.unique(rows)]
