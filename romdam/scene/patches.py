"""Contact points farther apart than the nodes of a joint's faces: each stands for a patch of the face.

The pressure p on the face and the mean jump w that is conjugate to it are linear between contact points. With
the hat functions N_a of the contact points, sampled at the gaps i of the mesh of area A_i,

    M_ab = sum_i A_i N_a N_b,     w_a = sum_b M^-1_ab sum_i A_i N_b w_i,     A_a = sum_b M_ab.

This is the L2 projection of the jump, and its transpose spreads a contact force as the dual multiplier of its
point. A jump that is linear over the face, so every rigid motion of its sides, is exact at the contact
points, and a uniform pressure stays uniform. Means over patches (w_a the mean over N_a, or over the nearest
nodes) are not linear: a joint that rocks would turn about the middle of its last patch instead of its edge.

References
----------
Wohlmuth, SIAM J. Numer. Anal. 38 (2000) 989: dual multipliers.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Floats, Ints
from romdam.core.errors import ConfigError
from romdam.core.machine import memory_limit
from romdam.core.scene import Joint
from romdam.scene.mortar.surface import MortarSurface

if TYPE_CHECKING:
    from scipy.spatial import Delaunay

_CORNER = 30.0  # turn of a face's outline from which on a node is a corner of it [degree]
_STEEPEST = (
    60.0  # angle of a gap's normal with the mean one, up to which the face is seen as a plane [degree]
)
_CLOSE = 0.75  # of the spacing: contact points inside the outline are no nearer to each other
_ROUNDING = 1e-9  # of the spacing, and of weights
_ON_EDGE = 1e-9  # share of a triangle's corner, below which a place may be in the next one too
_ON_CIRCLE = 1e-6  # angle by which four points may be off a circle [rad]
_SLIVER = 1e-6  # of the square of its longest side: area of a triangle that is none
_CHUNK = 4_000_000  # numbers at a time
_FINEST = 100.0  # spacings between two nodes, beyond which nothing can be meant by one
_DENSE = 5  # matrices of all nodes by all contact points at a time


def coarsen_gaps(
    joint: Joint, surface: MortarSurface, spacing: float, along: Floats, origin: Floats, location: str
) -> Joint:
    """Replace the gaps of a joint by contact points about `spacing` apart; see the module.

    Parameters
    ----------
    joint : with gaps at all nodes of the face that can open; what follows from its areas is not changed
    surface : that they stand on
    spacing : distance of contact points [m]
    along : (2, 3) unit vectors along j and k in the middle of the joint, of a normal that does not depend on
        which block is named first
    origin : (3,) a node of the face: of contact points that might as well stand elsewhere those nearer to it
        are taken, whichever block is named first and whatever the axes
    location : file and key of the joint, for messages

    Returns
    -------
    Joint, the same one where the nodes are no closer than that

    Raises
    ------
    ConfigError
        for a face that is curved too much to be seen as a plane, or that so few points do not cover.
    """
    cosine = float((joint.axes[:, 0] @ mean_normal(joint)).min())
    if cosine < np.cos(np.radians(_STEEPEST)):
        raise ConfigError(
            f"{location}.spacing: the face turns by {np.degrees(np.arccos(max(cosine, -1.0))):.0f} degrees, "
            f"limit {_STEEPEST:g} degrees, so that contact points between its nodes have no plane to stand "
            "in; leave spacing out, and every node has a gap"
        )
    distance = float(np.sqrt(joint.whole_area.sum() / len(joint.area)))
    if spacing < distance / _FINEST:
        raise ConfigError(
            f"{location}.spacing: {spacing:g} m is {spacing / distance:.3g} of the distance of the nodes, "
            f"{distance:.3g} m, limit {1.0 / _FINEST:g} of it; leave it out, and every node has a gap"
        )
    flat = (joint.position - joint.position.mean(axis=0)) @ along.T
    seen = (origin - joint.position.mean(axis=0)) @ along.T
    points = _contact_points(flat, _outline(surface, joint.corner), spacing, seen)
    if len(points) == len(flat):
        return joint
    size = 8.0 * _DENSE * len(flat) * len(points)
    if size > memory_limit(None):
        raise ConfigError(
            f"{location}.spacing: {len(points)} gaps for {len(flat)} nodes take {size / 1e9:.3g} GB, and "
            f"{memory_limit(None) / 1e9:.3g} GB are there; give a larger spacing, or leave it out, and every "
            "node has a gap"
        )
    hats = _hats(flat[points], flat)
    lumped = np.zeros((0, 0)) if hats is None else joint.area[:, None] * hats
    area = lumped.sum(axis=0)
    if hats is None or not (area > 0.0).all():
        raise ConfigError(
            f"{location}.spacing: {len(points)} gaps {spacing:g} m apart do not cover the face of "
            f"{len(flat)} nodes; give a smaller spacing, or leave it out, and every node has a gap"
        )
    spread = np.linalg.solve(hats.T @ lumped, lumped.T)
    spread[np.abs(spread) < _ROUNDING * np.abs(spread).max(axis=1, keepdims=True)] = 0.0
    spread /= spread.sum(axis=1, keepdims=True)
    corners = np.arange(len(joint.corner)), joint.corner
    at_corner = csr_matrix((np.ones(len(flat)), corners), shape=(len(flat), len(surface.points)))
    exact = joint.at_point or joint.weights
    return replace(
        joint,
        position=joint.position[points],
        area=area,
        share=hats.T @ joint.share,
        axes=joint.axes[points],
        weights=(csr_matrix(spread @ joint.weights[0]), csr_matrix(spread @ joint.weights[1])),
        at_point=(csr_matrix(exact[0][points]), csr_matrix(exact[1][points])),
        water=np.zeros(len(points)),
        corner=joint.corner[points],
        patches=csr_matrix(csr_matrix(lumped.T / area[:, None]) @ at_corner),
    )


def mean_normal(joint: Joint) -> Floats:
    """Unit normal (3,) of a joint, mean over its area."""
    mean = joint.area @ joint.axes[:, 0]
    return np.asarray(mean / np.linalg.norm(mean))


def _outline(surface: MortarSurface, corner: Ints) -> list[Ints]:
    """Closed loops of gaps around a face, each once around; `corner` has the node of every gap."""
    number = np.full(len(surface.points), -1)
    number[corner] = np.arange(len(corner))
    corners = number[surface.facets[:, : surface.element.corners]]
    corners = corners[(corners >= 0).all(axis=1)]
    edges = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2)
    seen = {(a, b) for a, b in edges.tolist() if a != b}
    following = {a: b for a, b in sorted(seen) if (b, a) not in seen}
    loops = []
    while following:
        first = node = min(following)
        loop = []
        while node in following:
            loop.append(node)
            node = following.pop(node)
        if node == first and len(loop) > 2:
            loops.append(np.array(loop))
    return loops


def _contact_points(flat: Floats, loops: list[Ints], spacing: float, origin: Floats) -> Ints:
    """Choose gaps about `spacing` apart: corners of the outline, points between them, then points inside.

    All is counted from the corner nearest to the origin, counterclockwise, so that of gaps which would do as
    well one is chosen that neither axes nor numbers of facets change.

    Parameters
    ----------
    flat, origin : (n, 2), (2,) in axes of the face, right-handed about a normal of its own [m]
    """
    chosen, unit, rows = list[int](), _ROUNDING * spacing, flat
    for k, around in enumerate(sorted(loops, key=len, reverse=True)):
        x, y = flat[around].T
        loop = around if x @ (np.roll(y, -1) - np.roll(y, 1)) > 0.0 else around[::-1]
        ahead = np.roll(flat[loop], -1, axis=0) - flat[loop]
        behind = np.roll(ahead, 1, axis=0)
        turn = np.abs(
            np.arctan2(behind[:, 0] * ahead[:, 1] - behind[:, 1] * ahead[:, 0], (behind * ahead).sum(axis=1))
        )
        corners = np.flatnonzero(turn > np.radians(_CORNER))
        if not len(corners):
            corners = np.arange(len(loop))[:1]
        apart = np.round(np.linalg.norm(flat[loop[corners]] - origin, axis=1) / unit)
        corners = np.roll(corners, -int(apart.argmin()))
        corners = corners + np.where(corners < corners[0], len(loop), 0)
        ends = np.append(corners, corners[0] + len(loop))
        if k == 0 and len(corners) > 1:  # axes along the first side, and inwards from it
            first_side = flat[loop[ends[1] % len(loop)]] - flat[loop[ends[0]]]
            a, b = first_side / np.linalg.norm(first_side)
            rows = flat @ np.array([[a, -b], [b, a]])
        for first, last in pairwise(ends.tolist()):
            side = loop[np.arange(first, last + 1) % len(loop)]
            along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(flat[side], axis=0), axis=1)))
            pieces = max(1, round(along[-1] / spacing))
            wanted = np.linspace(0.0, along[-1], pieces + 1)[:-1]
            off = np.abs(along[:, None] - wanted) / unit
            chosen += side[np.round(off).argmin(axis=0)].tolist()
    points = list(dict.fromkeys(chosen))
    # row by row along the longer extent of the face, so that points of a regular mesh stand in rows
    rows = np.round(rows[:, np.argsort(-np.round(np.ptp(rows, axis=0) / unit), kind="stable")] / unit)
    least = _CLOSE * spacing
    distance = np.full(len(flat), np.inf)
    for point in points:
        distance = np.minimum(distance, np.linalg.norm(flat - flat[point], axis=1))
    for point in np.lexsort((rows[:, 1], rows[:, 0])).tolist():
        if distance[point] >= least:
            points.append(point)
            distance = np.minimum(distance, np.linalg.norm(flat - flat[point], axis=1))
    return np.sort(np.array(points, dtype=np.int64))


def _hats(points: Floats, places: Floats) -> Floats | None:
    """Hat functions (n, m) of contact points (m, 2) at places (n, 2), or None without a triangle.

    Their sum is 1. They are linear on the triangles of a Delaunay triangulation, and beyond its hull as on
    the nearest one.
    Four points on a circle, as of a regular mesh, have two triangulations: the mean of both is taken, so that
    round-off, which decides between them, changes nothing.
    """
    from scipy.spatial import Delaunay, QhullError

    try:
        triangles = _both_ways(Delaunay(points), points)
    except QhullError:
        return None
    corners = points[triangles]
    sides = corners[:, 1:] - corners[:, :1]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    sound = np.abs(np.linalg.det(sides)) > _SLIVER * longest**2
    if not sound.any():
        return None
    triangles, corners, inverse = triangles[sound], corners[sound], np.linalg.inv(sides[sound])
    hats = np.zeros((len(places), len(points)))
    step = max(1, _CHUNK // (3 * len(triangles)))
    for first in range(0, len(places), step):
        some = np.arange(first, min(first + step, len(places)))
        within = np.einsum("nti,tij->ntj", places[some, None] - corners[None, :, 0], inverse)
        shares = np.concatenate([1.0 - within.sum(axis=2, keepdims=True), within], axis=2)
        inside = shares.min(axis=2)
        inside = inside >= np.minimum(inside.max(axis=1), 0.0)[:, None] - _ON_EDGE  # or in the nearest one
        place, triangle = np.nonzero(inside)
        weight = shares[place, triangle] / inside.sum(axis=1)[place, None]
        np.add.at(hats, (some[place][:, None], triangles[triangle]), weight)
    hats[np.abs(hats) < _ROUNDING] = 0.0
    return np.asarray(hats / hats.sum(axis=1, keepdims=True))


def _both_ways(delaunay: Delaunay, points: Floats) -> Ints:
    """Triangles (n, 3) of a triangulation, and of the other one where four points are on a circle."""
    more = []
    for number, (triangle, others) in enumerate(zip(delaunay.simplices, delaunay.neighbors, strict=True)):
        for apex, other in zip(triangle, others, strict=True):
            if other < number:  # none is -1
                continue
            a, b = (corner for corner in triangle if corner != apex)
            (opposite,) = set(delaunay.simplices[other].tolist()) - {int(a), int(b)}
            angles = [_angle(points, end, a, b) for end in (apex, opposite)]
            if abs(sum(angles) - np.pi) < _ON_CIRCLE:
                more += [(apex, opposite, a), (apex, opposite, b)]
    return np.concatenate([delaunay.simplices, np.array(more, dtype=np.int64).reshape(-1, 3)])


def _angle(points: Floats, at: int, a: int, b: int) -> float:
    """Angle at a point between two others [rad]; opposite ones of four points on a circle add up to pi."""
    one, two = points[a] - points[at], points[b] - points[at]
    return float(np.arctan2(abs(one[0] * two[1] - one[1] * two[0]), one @ two))
