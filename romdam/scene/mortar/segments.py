"""Segments: polygons where facets of two faces lie on each other, and quadrature points on them."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from romdam.core.arrays import Bools, Floats, Ints
from romdam.geometry.elements import simplex_rule
from romdam.geometry.nearest import tree
from romdam.scene.mortar.surface import MortarSurface, local_coordinates

REACH = 0.1  # distance of pieces that face each other, in sizes of the smaller, beyond the tolerance
_OPPOSED = -0.5  # cosine: faces that touch look at each other
_NOTHING = 1e-12  # share of a piece that is round-off
_DEGREE = {"tri3": 1, "quad4": 2, "tri6": 2, "quad8": 3, "quad9": 4}  # of shape functions in the plane
_COVERED = 1e-2  # of a facet's flat pieces, that clipping faceted faces may miss
_CURVED = 6  # degrees more where the map to the plane is no polynomial


@dataclass(frozen=True)
class Segments:
    """Polygons that a slave piece and a master piece share, in the plane of the slave's.

    Attributes
    ----------
    slave, master : (n,) facets
    frame : (n, 3, 3) rows: two tangents and the normal of the plane
    origin : (n, 3) [m]
    corners : (n, c, 2) of the polygon, counterclockwise, the last one repeated
    area : (n,) in the plane [m2]
    distance : (n,) of the two pieces at its centre, positive where they are apart [m]
    cosine : (n,) of their normals, -1 where they are parallel
    """

    slave: Ints
    master: Ints
    frame: Floats
    origin: Floats
    corners: Floats
    area: Floats
    distance: Floats
    cosine: Floats

    def only(self, some: Bools) -> Segments:
        """Some of them."""
        return Segments(*(getattr(self, field.name)[some] for field in fields(self)))


@dataclass(frozen=True)
class SegmentPoints:
    """Quadrature points on the triangles of segments.

    Attributes
    ----------
    slave, master : (n,) facets
    xi_slave, xi_master : (n, q, 2) reference coordinates in them
    weight : (n, q) [m2]
    """

    slave: Ints
    master: Ints
    xi_slave: Floats
    xi_master: Floats
    weight: Floats


def segments(slave: MortarSurface, master: MortarSurface, tolerance: float) -> Segments:
    """Clip the pieces of two faces that look at each other, in the plane of the slave's.

    Parameters
    ----------
    tolerance : distance of the faces [m]; faceted curved ones may be apart by `REACH` of a piece more
    """
    I, J = slave.pieces, master.pieces

    # pairs of pieces whose surroundings meet and that look at each other
    largest = I.radius + J.radius.max() + tolerance
    lists = tree(J.centre).query_ball_point(I.centre, largest, return_sorted=True)
    i = np.repeat(np.arange(len(lists)), [len(members) for members in lists])
    j = np.concatenate([np.zeros(0, dtype=int), *lists]).astype(np.int64)
    reach = tolerance + REACH * 2.0 * np.minimum(I.radius[i], J.radius[j])
    met = np.linalg.norm(J.centre[j] - I.centre[i], axis=1) <= I.radius[i] + J.radius[j] + reach
    met &= np.einsum("nk,nk->n", I.normal[i], J.normal[j]) < _OPPOSED
    i, j, reach = i[met], j[met], reach[met]

    # clip in planes whose first axis is the first edge of the slave's piece
    tangent = I.corners[:, 1] - I.corners[:, 0]
    tangent -= np.einsum("nk,nk->n", tangent, I.normal)[:, None] * I.normal
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    frame = np.stack([tangent, np.cross(I.normal, tangent), I.normal], axis=1)[i]
    plane = frame[:, :2]
    subject = np.einsum("nck,ndk->ncd", J.corners[j] - I.centre[i][:, None], plane)[:, ::-1]
    window = np.einsum("nck,ndk->ncd", I.corners[i] - I.centre[i][:, None], plane)
    corners, count = clip(subject, window)
    area = polygon_areas(corners)
    least = _NOTHING * np.minimum(np.abs(polygon_areas(window)), np.abs(polygon_areas(subject)))
    kept = np.flatnonzero((count > 2) & (area > least))
    i, j, corners, count = i[kept], j[kept], corners[kept], count[kept]

    # distance of the two planes at the mean of the polygon's corners
    real = np.arange(corners.shape[1]) < count[:, None]
    mean = (corners * real[..., None]).sum(axis=1) / count[:, None]
    centre = I.centre[i] + np.einsum("nd,ndk->nk", mean, plane[kept])
    cosine = np.einsum("nk,nk->n", I.normal[i], J.normal[j])
    distance = np.einsum("nk,nk->n", J.centre[j] - centre, J.normal[j]) / cosine
    all_pairs = Segments(
        I.facet[i], J.facet[j], frame[kept], I.centre[i], corners, area[kept], distance, cosine
    )
    return all_pairs.only(np.abs(distance) <= reach[kept])


def samples(slave: MortarSurface, master: MortarSurface, where: Segments, degree: int) -> SegmentPoints:
    """Quadrature points that integrate polynomials of a degree over all segments.

    Where the slave face is curved the weights are of the curved surface, and a facet that is covered has the
    area that the facet's quadrature gives it.

    Parameters
    ----------
    degree : of the integrand in the plane, where facets are triangles or parallelograms
    """
    # triangles (nt, 3, 2) that fan out from the first corner of every polygon, and the segment of each
    width = where.corners.shape[1]
    first = np.repeat(where.corners[:, :1], width - 2, axis=1)
    triangles = np.stack([first, where.corners[:, 1:-1], where.corners[:, 2:]], axis=2).reshape(-1, 3, 2)
    segment = np.repeat(np.arange(len(where.corners)), width - 2)
    real = np.flatnonzero(polygon_areas(triangles) > 0.0)
    segment, triangles = segment[real], triangles[real]

    exact = slave.is_affine and master.is_affine
    xi, weight = simplex_rule(degree if exact else degree + _CURVED, 2)
    a, b, c = triangles.transpose(1, 0, 2)
    points = a[:, None] + xi[:, :1] * (b - a)[:, None] + xi[:, 1:] * (c - a)[:, None]
    double = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    size = double[:, None] * weight

    local = []
    for face, facet in ((slave, where.slave[segment]), (master, where.master[segment])):
        shape_nodes = face.facets[facet][:, : len(face.mapping.nodes)]
        away = face.points[shape_nodes] - where.origin[segment][:, None]
        flat = np.einsum("nak,ndk->nad", away, where.frame[segment][:, :2])
        local.append(local_coordinates(face.mapping, flat, points))
    if not slave.is_straight:
        size = _on_surface(slave, where, segment, local[0], size)
    return SegmentPoints(where.slave[segment], where.master[segment], local[0], local[1], size)


def _on_surface(slave: MortarSurface, where: Segments, segment: Ints, xi: Floats, size: Floats) -> Floats:
    """Weights of the plane over the cosine to the curved surface; covered facets get their whole area.

    A facet is covered where the polygons fill its flat pieces, which may miss much of it at a curved edge.
    """
    facet = where.slave[segment]
    slope = slave.element.gradient(xi.reshape(-1, 2)).reshape(*xi.shape[:2], 2, -1)
    tangents = np.einsum("nqda,nak->nqdk", slope, slave.points[slave.facets[facet]], optimize=True)
    normal = np.cross(tangents[:, :, 0], tangents[:, :, 1])
    cosine = np.einsum("nqk,nk->nq", normal, where.frame[segment][:, 2]) / np.linalg.norm(normal, axis=2)
    size = size / cosine
    covered = np.bincount(facet, size.sum(axis=1), len(slave.facets))
    share = np.divide(slave.areas, covered, out=np.ones_like(covered), where=covered > 0.0)
    pieces, count = slave.pieces, len(slave.facets)
    across = np.cross(
        pieces.corners[:, 2] - pieces.corners[:, 0], pieces.corners[:, 3] - pieces.corners[:, 1]
    )
    flat = np.bincount(pieces.facet, 0.5 * np.linalg.norm(across, axis=1), count)
    filled = np.bincount(where.slave, where.area, count) / flat
    share[np.abs(filled - 1.0) > _COVERED] = 1.0
    return np.asarray(size * share[facet][:, None])


def integrand_degree(slave: MortarSurface, master: MortarSurface, multiplier: str) -> int:
    """Degree in the plane of a multiplier times a shape function of either face."""
    return _DEGREE[multiplier] + max(_DEGREE[slave.element.name], _DEGREE[master.element.name])


def clip(subject: Floats, window: Floats) -> tuple[Floats, Ints]:
    """Clip convex polygons by convex polygons, pair by pair.

    Sutherland and Hodgman, Communications of the ACM 17 (1974) 32: each edge of the window cuts off what
    lies to its right.

    Parameters
    ----------
    subject : (n, a, 2) corners, counterclockwise; a corner may stand twice
    window : (n, b, 2) likewise

    Returns
    -------
    corners : (n, c, 2) of what both cover, counterclockwise; the last one repeated
    count : (n,) of corners, 0 where nothing is left
    """
    corners, count = subject, np.full(len(subject), subject.shape[1])
    for k in range(window.shape[1]):
        origin = window[:, k]
        edge = window[:, (k + 1) % window.shape[1]] - origin
        n, width, _ = corners.shape
        real = np.arange(width) < count[:, None]
        following = np.where(np.arange(1, width + 1) < count[:, None], np.arange(1, width + 1), 0)
        away = corners - origin[:, None]
        left = edge[:, None, 0] * away[..., 1] - edge[:, None, 1] * away[..., 0]
        next_left = np.take_along_axis(left, following, axis=1)
        inside = left >= 0.0
        crosses = inside != (next_left >= 0.0)
        share = np.divide(left, left - next_left, out=np.zeros_like(left), where=crosses)
        ahead = np.take_along_axis(corners, following[..., None], axis=1)
        crossing = corners + share[..., None] * (ahead - corners)
        # after each corner stands the point where the edge that begins there crosses the line
        candidates = np.stack([corners, crossing], axis=2).reshape(n, 2 * width, 2)
        kept = np.stack([inside & real, crosses & real], axis=2).reshape(n, 2 * width)
        # move the kept ones of every polygon to its front and repeat the last
        count = kept.sum(axis=1)
        order = np.argsort(~kept, axis=1, kind="stable")[:, : max(int(count.max(initial=0)), 1)]
        column = np.minimum(np.arange(order.shape[1]), np.maximum(count - 1, 0)[:, None])
        order = np.take_along_axis(order, column, axis=1)
        corners = np.take_along_axis(candidates, order[..., None], axis=1)
    return corners, count


def polygon_areas(corners: Floats) -> Floats:
    """Area of polygons (n, c, 2), counterclockwise positive."""
    x, y = (corners - corners[:, :1]).transpose(2, 0, 1)
    return np.asarray(0.5 * (x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1))
