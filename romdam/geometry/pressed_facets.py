"""Nodal forces of a pressure on the part of facets below a level."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from romdam.core.arrays import Floats, Ints
from romdam.geometry.elements import Rule, facet_element, simplex_rule
from romdam.geometry.facets import area_elements, below, small_triangles
from romdam.geometry.meshes.kinds import facets_by_kind

_CUTS = 6  # parts of an edge of a facet that the level cuts


def force_below(points: Floats, facets: Ints, level: float, pressure: Callable[[Floats], Floats]) -> Floats:
    """Nodal force of a pressure into the block on the part of facets below a level, (n, 3) [N].

    Parameters
    ----------
    pressure : depths below the level [m] -> pressures there [Pa]
    """
    force, (xi, weight) = np.zeros_like(points), simplex_rule(5, 2)
    for _, of_kind, _ in facets_by_kind(facets):
        element = facet_element(of_kind)
        top = points[of_kind, 2].max(axis=1)
        bottom = points[of_kind, 2].min(axis=1)
        whole = of_kind[top <= level]
        if len(whole):
            np.add.at(force, whole, -_pressed(points, whole, level, pressure, element.rule))
        for facet in of_kind[(top > level) & (bottom < level)]:
            # points and weights on the part below the level: the facet is cut into small triangles, and the
            # water's edge is taken as straight in each of them
            triangles, shape = small_triangles(element.name, _CUTS)
            height = shape @ points[facet][:, 2] - level
            wet = [*triangles[(height <= 0.0).all(axis=1)]]
            for k in np.flatnonzero((height < 0.0).any(axis=1) & (height > 0.0).any(axis=1)):
                wet += below(triangles[k], height[k])
            corners = np.array(wet).reshape(-1, 3, 2)
            edges = corners[:, 1:] - corners[:, :1]
            wet_xi = (corners[:, :1] + xi @ edges).reshape(-1, 2)
            rule = wet_xi, np.outer(np.abs(np.linalg.det(edges)), weight).ravel()
            np.add.at(force, facet, -_pressed(points, facet[None], level, pressure, rule)[0])
    return force


def _pressed(
    points: Floats, facets: Ints, level: float, pressure: Callable[[Floats], Floats], rule: Rule
) -> Floats:
    """int p N n dA of the facets' nodes, (nf, nodes per facet, 3) [N]; n is outward."""
    element = facet_element(facets)
    xi, weight = rule
    shape, normal = element.shape(xi), area_elements(points, facets, xi)
    depth = np.maximum(level - points[facets][..., 2] @ shape.T, 0.0)
    return np.einsum("q,fq,qj,fqk->fjk", weight, pressure(depth), shape, normal, optimize=True)
