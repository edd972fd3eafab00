"""Nearest points: of few by all their distances, of many by a tree, which takes 0.1 s to be loaded."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from romdam.core.arrays import Floats, Ints

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

_FEW = 500_000  # distances that take less than it takes to load scipy.spatial
_TIED = 1e-9  # relative difference of two squares that rounding explains


def tree(points: Floats) -> cKDTree[Any]:
    """A k-d tree of points (n, 3)."""
    from scipy.spatial import cKDTree  # here: with scipy.special it takes 0.1 s, which few scenes need

    return cKDTree(points)


def nearest(points: Floats, places: Floats, reach: float = np.inf) -> tuple[Floats, Ints]:
    """Distance (m,) from each place (m, 3) to the nearest of points (n, 3), and its number (m,).

    Where none is nearer than `reach`, the distance is infinite and the number n. The tree decides between
    points that are equally near, however few there are, so that their number changes no result.
    """
    if len(points) > 1 and len(points) * len(places) <= _FEW:
        square = np.square(places[:, None] - points[None]).sum(axis=2)
        number = square.argmin(axis=1)
        least, second = np.partition(square, 1, axis=1)[:, :2].T
        near = least < reach**2
        if not (near & (second <= least * (1.0 + _TIED))).any():
            return np.where(near, np.sqrt(least), np.inf), np.where(near, number, len(points))
    distance, number = tree(points).query(places, distance_upper_bound=reach)
    return distance, number


def merge_near(points: Floats, tolerance: float) -> Ints:
    """(n,) the same number for points within a tolerance [m] of each other, and for chains of such points."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    pairs = tree(points).query_pairs(tolerance, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(points),) * 2)
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)
