"""Uniform pressure across a joint comes out uniform for every face type."""

import numpy as np
import pytest
from test_elements import mesh

from romdam.geometry.elements import SOLIDS
from romdam.geometry.facets import area_vectors, facet_areas, gap_weights


def face(element, in_plane=0.0, out_of_plane=0.0):
    """Points and the zmax facets of a 2 x 2 x 1 grid, every node moved at random."""
    block = mesh(element, size=(1.0, 1.0, 0.5))
    rng = np.random.default_rng(4)
    points = block.points.copy()
    points[:, :2] += in_plane * rng.uniform(-1, 1, points[:, :2].shape)
    points[:, 2] += out_of_plane * rng.uniform(-1, 1, len(points))
    return points, block.faces["zmax"]


@pytest.mark.parametrize("in_plane", [0.0, 0.04])
@pytest.mark.parametrize("element", SOLIDS)
def test_gap_forces_equal_the_consistent_force_of_a_uniform_traction(element, in_plane):
    points, facets = face(element, in_plane)
    nodes, area, C = gap_weights(points, facets)
    consistent = np.zeros((len(points), 3))
    np.add.at(consistent, facets, area_vectors(points, facets))
    total = facet_areas(points, facets).sum()
    assert np.abs(C.T @ area - consistent[nodes, 2]).max() < 1e-12 * total
    assert np.abs(consistent[nodes, :2]).max() < 1e-12 * total


@pytest.mark.parametrize("out_of_plane", [0.0, 0.05])
@pytest.mark.parametrize("element", SOLIDS)
def test_areas_are_positive_and_weights_are_means(element, out_of_plane):
    points, facets = face(element, 0.04, out_of_plane)
    _, area, C = gap_weights(points, facets)
    assert area.min() > 0.1 * area.mean()
    exact = 1e-13 if out_of_plane == 0.0 else 1e-4  # the area of a curved facet is no polynomial
    assert area.sum() == pytest.approx(facet_areas(points, facets).sum(), rel=exact)
    assert np.abs(C.sum(axis=1) - 1).max() < 1e-13


@pytest.mark.parametrize("element", ["hex8", "tet4"])
def test_linear_facets_have_nodal_gaps(element):
    _, _, C = gap_weights(*face(element, 0.04))
    assert np.array_equal(C.toarray(), np.eye(C.shape[0]))


@pytest.mark.parametrize(("element", "corner"), [("tet10", 0.0), ("hex20", -1 / 12), ("hex27", 1 / 36)])
def test_consistent_corner_weights_of_quadratic_facets_are_small_or_not_positive(element, corner):
    """Why the sub-areas are needed: int N of a corner is 0 on tri6, -A/12 on quad8 and A/36 on quad9."""
    points, facets = face(element)
    share = area_vectors(points, facets)[:, 0, 2] / facet_areas(points, facets)
    assert np.abs(share - corner).max() < 1e-13


def test_consistent_weights_of_quad9():
    points, facets = face("hex27")
    share = area_vectors(points, facets)[:, :, 2] / facet_areas(points, facets)[:, None]
    assert np.abs(share - np.repeat([1 / 36, 1 / 9, 4 / 9], [4, 4, 1])).max() < 1e-13


@pytest.mark.parametrize("element", SOLIDS)
def test_linear_opening_is_seen_at_the_mean_of_its_area(element):
    points, facets = face(element, 0.02)
    nodes, area, C = gap_weights(points, facets)
    vectors = area_vectors(points, facets)[:, :, 2]
    moment = np.einsum("fj,fj->", vectors, points[facets, 0])  # int x dA, x being in the space of N
    assert area @ (C @ points[nodes, 0]) == pytest.approx(moment, rel=1e-12)
