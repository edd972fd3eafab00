"""Nearest points by all distances and by the tree: the same numbers, ties and reach among them."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from romdam.geometry import nearest as module
from romdam.geometry.nearest import nearest


@pytest.mark.parametrize("few", [0, 10**9])
@pytest.mark.parametrize("reach", [np.inf, 0.15])
@pytest.mark.parametrize("places", [0, 1, 60])
def test_both_ways_find_what_the_tree_finds(monkeypatch, few, reach, places):
    monkeypatch.setattr(module, "_FEW", few)
    rng = np.random.default_rng(4)
    points, at = rng.random((40, 3)), rng.random((places, 3))
    distance, number = nearest(points, at, reach)
    expected, own = cKDTree(points).query(at, distance_upper_bound=reach)
    np.testing.assert_array_equal(number, own)
    np.testing.assert_allclose(distance, expected, rtol=1e-14)
    assert number.dtype.kind == "i"


def test_the_tree_decides_between_points_that_are_equally_near(monkeypatch):
    """Corners of a grid seen from its middles: eight are equally near."""
    grid = np.stack(np.meshgrid(*[np.arange(4.0)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    middles = grid[(grid < 3.0).all(axis=1)] + 0.5
    few = nearest(grid, middles)
    monkeypatch.setattr(module, "_FEW", 0)
    many = nearest(grid, middles)
    np.testing.assert_array_equal(few[1], many[1])
    np.testing.assert_array_equal(few[0], many[0])
