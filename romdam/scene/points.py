"""Points and faces of a block as weights of its nodes: what acts on them is the same on every mesh."""

from __future__ import annotations

import numpy as np

from romdam.core.arrays import Floats, Ints
from romdam.core.errors import ConfigError
from romdam.core.scene import Block
from romdam.geometry.elements import Element, facet_element
from romdam.geometry.facets import area_elements
from romdam.geometry.meshes.kinds import facets_by_kind, kinds_of
from romdam.scene.select import nearest_node

_STEPS = 20  # of Newton's method in an element; a straight one takes 1
_CONVERGED = 1e-12  # change of a reference coordinate
_ON_NODE = 1e-9  # of the block's size, from a node at which a point is that node


def point_weights(
    block: Block, at: tuple[float, float, float], tolerance: float, location: str
) -> tuple[Ints, Floats]:
    """Nodes (m,) and weights (m,) that give the displacement of a point of a block.

    Parameters
    ----------
    tolerance : distance up to which it may be outside all elements [m]; of a block without elements, from the
        nearest node
    location : file and key, for messages

    Raises
    ------
    ConfigError
        for a point farther outside.
    """
    if block.matrices is not None:
        return np.array([nearest_node(block, at, tolerance, location)]), np.ones(1)
    point = np.array(at, dtype=float)
    distance = np.linalg.norm(block.points - point, axis=1)
    node = int(distance.argmin())
    if distance[node] <= _ON_NODE * float(np.ptp(block.points, axis=0).max()):
        return np.array([node]), np.ones(1)
    least, weights = np.inf, None
    for element, _, cells in kinds_of(block.element, block.cells):
        corners = block.points[cells]
        low, high = corners.min(axis=1), corners.max(axis=1)
        reach = tolerance + 0.1 * (high - low).max(axis=1, keepdims=True)  # curved ones bulge
        near = np.flatnonzero(((point > low - reach) & (point < high + reach)).all(axis=1))
        for cell in cells[near]:
            xi = _reference(element, block.points[cell], point)
            inside = _into(element, xi)
            off = float(np.linalg.norm(element.shape(inside[None])[0] @ block.points[cell] - point))
            if off < least:
                # a point just outside follows the element as it would go on
                least, weights = off, (cell, element.shape(xi[None])[0])
    if weights is None or least > tolerance:
        wanted = ", ".join(f"{x:.6g}" for x in at)
        low, high = block.points.min(axis=0), block.points.max(axis=0)
        box = " by ".join(f"{a:.6g} to {b:.6g}" for a, b in zip(low, high, strict=True))
        how = "outside its elements, " + (
            f"by {least:.4g} m" if np.isfinite(least) else f"{distance[node]:.4g} m from its nearest node"
        )
        raise ConfigError(
            f"{location}: ({wanted}) is {how}, limit {tolerance:g} m; block {block.name!r} reaches over "
            f"{box} m; name a point of it, or raise `tolerance`"
        )
    return weights


def face_weights(block: Block, facets: Ints) -> tuple[Floats, float]:
    """Weights (n,) of a block's nodes in the mean of their displacement over facets, and the area [m2]."""
    share, area = np.zeros(len(block.points)), 0.0
    for _, of_kind, _ in facets_by_kind(facets):
        element = facet_element(of_kind)
        xi, weight = element.rule
        size = np.linalg.norm(area_elements(block.points, of_kind, xi), axis=2) * weight
        area += float(size.sum())
        np.add.at(share, of_kind, size @ element.shape(xi))
    return share / area, area


def _reference(element: Element, nodes: Floats, point: Floats) -> Floats:
    """(3,) reference coordinates of a point in an element, or beyond it, by Newton's method."""
    xi = element.nodes[: element.corners].mean(axis=0)
    for _ in range(_STEPS):
        away = point - element.shape(xi[None])[0] @ nodes
        J = element.gradient(xi[None])[0] @ nodes
        try:
            step = np.linalg.solve(J.T, away)
        except np.linalg.LinAlgError:
            break
        xi = np.clip(xi + step, -3.0, 3.0)
        if np.abs(step).max() < _CONVERGED:
            break
    return np.asarray(xi)


def _into(element: Element, xi: Floats) -> Floats:
    """The reference coordinates moved into the element."""
    if element.box:
        return np.clip(xi, -1.0, 1.0)
    if element.linear == "pyramid5":
        z = float(np.clip(xi[2], 0.0, 1.0 - 1e-9))
        return np.append(np.clip(xi[:2], z - 1.0, 1.0 - z), z)
    flat = 2 if element.linear == "wedge6" else 3
    inside = np.maximum(xi[:flat], 0.0)
    inside = inside / max(float(inside.sum()), 1.0)
    return inside if flat == 3 else np.append(inside, np.clip(xi[2], 0.0, 1.0))
