"""Gaps and times of two runs that stand for the same: which places, which rows, or a clock for both."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from romdam.core.arrays import Floats, Ints
from romdam.core.errors import ResultError

_LINE = np.array([0.41, 0.57, 0.71])  # of length below 1, in which few planes of a mesh lie
_SAME_PLACE = 1e-3  # [m]
_SAME_TIME = 1e-7  # [s]


def coinciding(position: Floats, reference: Floats) -> tuple[Ints, Ints]:
    """Gaps of one run and those of another at the same places, within 1 mm.

    Where joints meet, several gaps of a run are at one place; they are told apart only if both runs have all
    gaps in one order.

    Parameters
    ----------
    position, reference : (ng, 3), (nr, 3) [m]

    Returns
    -------
    rows of `position`, rising, and those of `reference`
    """
    if len(position) == len(reference) and np.abs(position - reference).max(initial=0.0) < _SAME_PLACE:
        return np.arange(len(position)), np.arange(len(position))
    # candidates are near along one line; loading scipy.spatial would take longer than this
    along, others = position @ _LINE, reference @ _LINE
    order = np.argsort(others)
    first, last = (np.searchsorted(others[order], along + sign * _SAME_PLACE) for sign in (-1.0, 1.0))
    rows = np.repeat(np.arange(len(position)), last - first)
    pairs = order[np.arange(len(rows)) - np.repeat(np.cumsum(last - first) - last, last - first)]
    near = np.linalg.norm(position[rows] - reference[pairs], axis=1) < _SAME_PLACE
    rows, pairs = rows[near], pairs[near]
    alone = (np.bincount(rows)[rows] == 1) & (np.bincount(pairs)[pairs] == 1)
    return rows[alone], pairs[alone]


def coinciding_of_joints(
    position: Floats, joints: Mapping[str, slice], reference: Floats, reference_joints: Mapping[str, slice]
) -> tuple[Ints, Ints, dict[str, slice]]:
    """Gaps at the same places of a joint: their rows in both runs, and each joint's slice of these.

    Parameters
    ----------
    position, reference : see `coinciding`
    joints, reference_joints : name -> slice of its gaps; both have the same names
    """
    rows, pairs = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    common, count = dict[str, slice](), 0
    for name, gaps in joints.items():
        others = reference_joints[name]
        here, there = coinciding(position[gaps], reference[others])
        if len(here):
            rows.append(gaps.start + here)
            pairs.append(others.start + there)
            common[name] = slice(count, count + len(here))
            count += len(here)
    return np.concatenate(rows), np.concatenate(pairs), common


def common_rows(*times: Floats) -> list[NDArray[np.int64]]:
    """Rows of each run at the times that all of them have, rising.

    Parameters
    ----------
    times : (nt,) of each run [s]
    """
    keys = [np.rint(time / _SAME_TIME).astype(np.int64) for time in times]
    common = keys[0]
    for other in keys:
        common = np.intersect1d(common, other)
    return [np.flatnonzero(np.isin(key, common)) for key in keys]


def common_clock(first: Floats, second: Floats, names: tuple[str, str]) -> Floats:
    """Equally spaced times [s] that both runs span, at the larger of their intervals.

    They begin at a row of the run that is written more sparsely.

    Parameters
    ----------
    first, second : (nt,) rising [s]
    names : of both, for a message

    Raises
    ------
    ResultError
        where fewer than three such times are common.
    """
    sparse = max((first, second), key=lambda time: float(np.median(np.diff(time))))
    interval = float(np.median(np.diff(sparse)))
    start, end = max(first[0], second[0]), min(first[-1], second[-1])
    begin = sparse[min(np.searchsorted(sparse, start), len(sparse) - 1)]
    count = int((end - begin) / interval + 1e-6) + 1
    if count < 3:
        raise ResultError(
            f"{names[0]} is of {first[0]:g} to {first[-1]:g} s, {names[1]} of "
            f"{second[0]:g} to {second[-1]:g} s; three steps of {interval:g} s at least must be common"
        )
    return np.asarray(begin + interval * np.arange(count), dtype=np.float64)


def at_times(clock: Floats, time: Floats, values: Floats) -> Floats:
    """Histories (nt, ...) at other times, linear between rows and constant beyond them."""
    from scipy.interpolate import make_interp_spline  # few commands need it

    return np.asarray(make_interp_spline(time, values, k=1)(np.clip(clock, time[0], time[-1])))
