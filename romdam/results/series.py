"""Times and blocks of a result that are worth a picture: the worst step, the frames of a series, the dam."""

from __future__ import annotations

import json

import numpy as np
from numpy.typing import NDArray

from romdam.core.errors import ResultError
from romdam.results.fields import Result

Frames = tuple[int, tuple[float, float] | None]

_SAMPLES = 150  # nodes of each block that the largest displacement is looked for at
_AROUND = 2.0  # [s] before and after it


def dam_blocks(result: Result) -> list[str]:
    """All blocks but rock; of results that do not name their rock, those that some joint touches, or all."""
    dataset = result.dataset
    if "rock_blocks" in dataset.attrs:
        rock = json.loads(dataset.attrs["rock_blocks"])
        return [name for name in result.blocks if name not in rock]
    jointed = set(dataset.joint_blocks.values.ravel().tolist()) if "joint_blocks" in dataset else set()
    return [name for name in result.blocks if not jointed or name in jointed]


def worst_displacement_time(result: Result) -> float:
    """Time at which some node is farthest from where it was, among a sample of the dam's nodes [s]."""
    largest, time = -1.0, 0.0
    for block in dam_blocks(result):
        count = len(result.points(block))
        nodes = np.unique(np.linspace(0, count - 1, min(count, _SAMPLES)).astype(np.int64))
        moved = result.displacement(block, nodes=nodes)
        size = np.linalg.norm(moved.values, axis=2).max(axis=1)
        if size.max() > largest:
            largest, time = float(size.max()), float(moved.time[int(size.argmax())])
    return time


def frame_times(result: Result, frames: Frames) -> NDArray[np.float64]:
    """Written times of a series: so many, evenly spread over the window, each once.

    Parameters
    ----------
    frames : how many, and the first and last second, or None for the seconds around the largest displacement

    Raises
    ------
    ResultError
        where the window has no written time.
    """
    count, window = frames
    time = np.asarray(result.dataset.time.values, dtype=float)
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
    rows = np.unique(np.linspace(inside[0], inside[-1], min(count, len(inside))).round().astype(np.int64))
    return time[rows]
