"""Segments: where facets of two faces lie on each other, and quadrature points on them."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from romdam.core.arrays import Bools, Floats, Ints
from romdam.geometry.elements import simplex_rule
from romdam.geometry.nearest import tree
from romdam.scene.mortar.clipping import clip, polygon_areas
from romdam.scene.mortar.surface import Pieces, Surface, local_coordinates

REACH = 0.1  # distance of pieces that face each other, in sizes of the smaller, beyond the tolerance
_OPPOSED = -0.5  # cosine: faces that touch look at each other
_NOTHING = 1e-12  # share of a piece that is round-off
_DEGREE = {"tri3": 1, "quad4": 2, "tri6": 2, "quad8": 3, "quad9": 4}  # of shape functions in the plane
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
class Samples:
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


def segments(slave: Surface, master: Surface, tolerance: float) -> Segments:
    """Clip the pieces of two faces that look at each other, in the plane of the slave's.

    Parameters
    ----------
    tolerance : distance of the faces [m]; faceted curved ones may be apart by `REACH` of a piece more
    """
    I, J = slave.pieces, master.pieces
    i, j = _near(I, J, tolerance)
    frame = _frames(I)[i]
    flat = frame[:, :2]
    subject = np.einsum("nck,ndk->ncd", J.corners[j] - I.centre[i][:, None], flat)[:, ::-1]
    window = np.einsum("nck,ndk->ncd", I.corners[i] - I.centre[i][:, None], flat)
    corners, count = clip(subject, window)
    area = polygon_areas(corners)
    least = _NOTHING * np.minimum(np.abs(polygon_areas(window)), np.abs(polygon_areas(subject)))
    on = np.flatnonzero((count > 2) & (area > least))
    i, j, corners, count = i[on], j[on], corners[on], count[on]
    centre = I.centre[i] + np.einsum("nd,ndk->nk", _middle(corners, count), flat[on])
    cosine = np.einsum("nk,nk->n", I.normal[i], J.normal[j])
    distance = np.einsum("nk,nk->n", J.centre[j] - centre, J.normal[j]) / cosine
    near = np.flatnonzero(np.abs(distance) <= _reach(I, J, i, j, tolerance))
    return Segments(
        I.facet[i[near]],
        J.facet[j[near]],
        frame[on][near],
        I.centre[i[near]],
        corners[near],
        area[on][near],
        distance[near],
        cosine[near],
    )


def _near(I: Pieces, J: Pieces, tolerance: float) -> tuple[Ints, Ints]:
    """Pairs of pieces whose surroundings meet and that look at each other."""
    by_centre = tree(J.centre)
    lists = by_centre.query_ball_point(I.centre, I.radius + J.radius.max() + tolerance, return_sorted=True)
    i = np.repeat(np.arange(len(lists)), [len(members) for members in lists])
    j = np.concatenate([np.zeros(0, dtype=int), *lists]).astype(np.int64)
    apart = J.centre[j] - I.centre[i]
    reach = _reach(I, J, i, j, tolerance)
    met = np.linalg.norm(apart, axis=1) <= I.radius[i] + J.radius[j] + reach
    met &= np.einsum("nk,nk->n", I.normal[i], J.normal[j]) < _OPPOSED
    return i[met], j[met]


def _reach(I: Pieces, J: Pieces, i: Ints, j: Ints, tolerance: float) -> Floats:
    return np.asarray(tolerance + REACH * 2.0 * np.minimum(I.radius[i], J.radius[j]))


def _frames(pieces: Pieces) -> Floats:
    first = pieces.corners[:, 1] - pieces.corners[:, 0]
    first -= np.einsum("nk,nk->n", first, pieces.normal)[:, None] * pieces.normal
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(pieces.normal, first), pieces.normal], axis=1)


def _middle(corners: Floats, count: Ints) -> Floats:
    there = np.arange(corners.shape[1]) < count[:, None]
    return np.asarray((corners * there[..., None]).sum(axis=1) / count[:, None])


def samples(slave: Surface, master: Surface, where: Segments, degree: int) -> Samples:
    """Quadrature points that integrate polynomials of a degree over all segments.

    Where the slave face is curved the weights are of its own surface, and a facet that is covered has the
    area that its own quadrature gives it.

    Parameters
    ----------
    degree : of the integrand in the plane, where facets are triangles or parallelograms
    """
    piece, corner = _fan(where)
    exact = slave.is_affine and master.is_affine
    xi, weight = simplex_rule(degree if exact else degree + _CURVED, 2)
    a, b, c = corner.transpose(1, 0, 2)
    points = a[:, None] + xi[:, :1] * (b - a)[:, None] + xi[:, 1:] * (c - a)[:, None]
    double = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    here = [
        local_coordinates(face.mapping, _flat_nodes(face, facet, where, piece), points)
        for face, facet in ((slave, where.slave[piece]), (master, where.master[piece]))
    ]
    size = double[:, None] * weight
    if not slave.is_straight:
        size = _on_surface(slave, where, piece, here[0], size)
    return Samples(where.slave[piece], where.master[piece], here[0], here[1], size)


def _fan(where: Segments) -> tuple[Ints, Floats]:
    """Triangles (nt, 3, 2) of all polygons, and the segment of each."""
    corners = where.corners
    width = corners.shape[1]
    triangles = np.stack(
        [np.repeat(corners[:, :1], width - 2, axis=1), corners[:, 1:-1], corners[:, 2:]], axis=2
    ).reshape(-1, 3, 2)
    piece = np.repeat(np.arange(len(corners)), width - 2)
    some = np.flatnonzero(polygon_areas(triangles) > 0.0)
    return piece[some], triangles[some]


def _flat_nodes(face: Surface, facet: Ints, where: Segments, piece: Ints) -> Floats:
    """Nodes that give facets their shape, in the planes of segments."""
    nodes = face.points[face.facets[facet][:, : len(face.mapping.nodes)]] - where.origin[piece][:, None]
    return np.einsum("nak,ndk->nad", nodes, where.frame[piece][:, :2])


def _on_surface(slave: Surface, where: Segments, piece: Ints, xi: Floats, size: Floats) -> Floats:
    """Weights of the plane over the cosine to the curved surface; covered facets get their own area."""
    facet = where.slave[piece]
    slope = slave.element.gradient(xi.reshape(-1, 2)).reshape(*xi.shape[:2], 2, -1)
    tangents = np.einsum("nqda,nak->nqdk", slope, slave.points[slave.facets[facet]], optimize=True)
    normal = np.cross(tangents[:, :, 0], tangents[:, :, 1])
    cosine = np.einsum("nqk,nk->nq", normal, where.frame[piece][:, 2]) / np.linalg.norm(normal, axis=2)
    size = size / cosine
    covered = np.bincount(facet, size.sum(axis=1), len(slave.facets))
    share = np.divide(slave.areas, covered, out=np.ones_like(covered), where=covered > 0.0)
    share[np.abs(share - 1.0) > 1e-2] = 1.0
    return np.asarray(size * share[facet][:, None])


def integrand_degree(slave: Surface, master: Surface, multiplier: str) -> int:
    """Degree in the plane of a multiplier times a shape function of either face."""
    return _DEGREE[multiplier] + max(_DEGREE[slave.element.name], _DEGREE[master.element.name])
