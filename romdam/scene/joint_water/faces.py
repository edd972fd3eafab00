"""Mean pressure around the nodes of a joint's face, integrated section by section of its diagram."""

from __future__ import annotations

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.scene import JointFace
from romdam.geometry.elements import Element, facet_element, simplex_rule
from romdam.geometry.facets import area_elements, below
from romdam.scene.joint_water.diagram import Diagram
from romdam.scene.mortar.surface import local_coordinates

_DEGREE = 5  # of the rules: pressure, shape function and area of a facet that no kink cuts
_POINTS = 3  # Gauss points along each direction of a quadrilateral, to the same degree
_CUT = 1e-9  # of the values at a facet's corners, by which a kink must pass through it


def mean_pressure(points: Floats, face: JointFace, diagram: Diagram) -> Floats:
    """int p N dA / int N dA at the corners of the face, (nodes of the block,) [Pa]; NaN elsewhere.

    Resultant and moment of the pressure over flat facets are those of its diagram.
    """
    force, area = np.zeros(len(points)), np.zeros(len(points))
    for facets in face.facets:
        element = facet_element(facets)
        kinks = diagram.kinks(points[facets].reshape(-1, 3)).reshape(*facets.shape, -1)
        least = _CUT * np.abs(kinks).max(axis=(0, 1))
        cut = ((kinks.min(axis=1) < -least) & (kinks.max(axis=1) > least)).any(axis=1)
        xi, weight = element.rule_of(_POINTS if element.box else _DEGREE)
        shape, dA = element.shape(xi), np.linalg.norm(area_elements(points, facets, xi), axis=2) * weight
        np.add.at(area, facets, dA @ shape)
        at = np.einsum("qa,fak->fqk", shape, points[facets[~cut]])
        p = diagram.pressure(at.reshape(-1, 3)).reshape(at.shape[:2])
        np.add.at(force, facets[~cut], (p * dA[~cut]) @ shape)
        for facet in facets[cut]:
            force[facet] += _cut_force(points[facet], element, diagram)
    with np.errstate(invalid="ignore"):
        return np.asarray(force / area)


def _cut_force(corners: Floats, element: Element, diagram: Diagram) -> Floats:
    """int p N dA of one facet, in pieces none of which has a kink within, (corners,) [N]."""
    xi, weight = simplex_rule(_DEGREE, 2)
    fan = [corners[[0, k, k + 1]] for k in range(1, len(corners) - 1)]
    for k in range(diagram.kinks(corners).shape[1]):
        values = diagram.kinks(np.concatenate(fan))[:, k].reshape(-1, 3)
        fan = [
            triangle for piece, value in zip(fan, values, strict=True) for triangle in _split(piece, value)
        ]
    pieces = np.array(fan)
    sides = pieces[:, 1:] - pieces[:, :1]
    at = (pieces[:, :1] + xi @ sides).reshape(-1, 3)
    dA = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)[:, None] * weight
    plane = np.linalg.svd(corners - corners.mean(axis=0))[2][:2].T
    within = local_coordinates(element, (corners @ plane)[None], (at @ plane)[None])[0]
    return np.asarray((diagram.pressure(at) * dA.ravel()) @ element.shape(within))


def _split(piece: Floats, value: Floats) -> list[Floats]:
    if (value >= 0.0).all() or (value <= 0.0).all():
        return [piece]
    return below(piece, value) + below(piece, -value)
