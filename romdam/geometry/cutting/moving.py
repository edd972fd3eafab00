"""Nodes moved onto a surface along the faces that they lie on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from romdam.core.arrays import Bools, Floats, Ints
from romdam.geometry.cutting.mesh import Mesh
from romdam.geometry.cutting.shapes import quality
from romdam.geometry.cutting.surfaces import CuttingSurface
from romdam.geometry.elements import ELEMENTS
from romdam.geometry.facets import area_vectors

NEAR = 0.3  # of a node's shortest edge that crosses: how far it may be moved, so that no sliver is left
_FLAT = 0.03  # mean square of the sine between faces around a node below which they are a single smooth face
_ACROSS = 1e-4  # square of the sine between a surface and what a node can move along: below, it has no way
_WORSE = 0.3  # of a cell's quality: below, one of its nodes is put back
_ON = 1e-12  # of the largest coordinate: on the surface
_STEPS = 20


def snapped(mesh: Mesh, surface: CuttingSurface, kept: Ints) -> tuple[Mesh, Floats]:
    """Move corner nodes onto a surface that crosses one of their edges near them.

    Parameters
    ----------
    kept : (nf, nodes per facet) facets that stay in shape: the boundary, and those between sides

    Returns
    -------
    the mesh, and the distance of its nodes from the surface (n,), exactly zero for those on it [m]
    """
    corners = np.unique(mesh.corners)
    level = np.zeros(len(mesh.points))
    level[corners] = surface.distance(mesh.points[corners])
    ends = mesh.corners[:, np.array(ELEMENTS[mesh.element].edges)].reshape(-1, 2)
    crossing = ends[level[ends[:, 0]] * level[ends[:, 1]] < 0.0]
    length = np.linalg.norm(mesh.points[crossing[:, 1]] - mesh.points[crossing[:, 0]], axis=1)
    shortest = np.full(len(mesh.points), np.inf)  # of the edges that cross at a node
    for column in crossing.T:
        np.minimum.at(shortest, column, length)
    shortest[np.isinf(shortest)] = 0.0
    shift = shift_onto(mesh, surface, corners, kept, NEAR * shortest)
    shift[_put_back(mesh, shift)] = 0.0
    level[shift.any(axis=1) | on_surface(level, mesh.points)] = 0.0
    return with_shift(mesh, shift), level


def shift_onto(mesh: Mesh, surface: CuttingSurface, nodes: Ints, kept: Ints, reach: Floats) -> Floats:
    """Shift (n, 3) that takes some nodes onto a surface, along the facets that are to keep their shape [m].

    Nodes that are on it, and those that would have to move farther than `reach` (n,), stay where they are.
    """
    level = surface.distance(mesh.points[nodes])
    nodes = nodes[(np.abs(level) <= reach[nodes]) & ~on_surface(level, mesh.points)]
    projectors = _free_directions(mesh.points, kept, nodes)
    target, small = mesh.points[nodes], _ON * float(np.abs(mesh.points).max())
    for _ in range(_STEPS):  # Newton's method
        height, normal = surface.distance(target), surface.normal(target)
        way = np.einsum("kij,kj->ki", projectors, normal)
        slope = np.einsum("ki,ki->k", way, normal)
        length = np.divide(height, slope, out=np.zeros_like(height), where=slope > _ACROSS)
        target = target - length[:, None] * way
        if (np.abs(length) <= small / 100.0).all():
            break
    way = target - mesh.points[nodes]
    on = on_surface(surface.distance(target), mesh.points) & (np.linalg.norm(way, axis=1) <= reach[nodes])
    shift = np.zeros_like(mesh.points)
    shift[nodes[on]] = way[on]
    return shift


def with_shift(mesh: Mesh, shift: Floats) -> Mesh:
    """Move corner nodes by a shift (n, 3), and mid-edge nodes by the mean of their ends'."""
    element = ELEMENTS[mesh.element]
    shift = shift.copy()
    if element.quadratic:
        for k, middle in enumerate(element.middles, start=element.corners):
            shift[mesh.cells[:, k]] = shift[mesh.cells[:, list(middle)]].mean(axis=1)
    return replace(mesh, points=mesh.points + shift)


def _free_directions(points: Floats, kept: Ints, nodes: Ints) -> Floats:
    """Projectors (k, 3, 3) onto the directions in which nodes can move and facets keep their shape."""
    vectors = area_vectors(points, kept).sum(axis=1)
    size = np.linalg.norm(vectors, axis=1)
    outer = np.einsum("fi,fj->fij", vectors, vectors) / size[:, None, None]
    total, area = np.zeros((len(points), 3, 3)), np.zeros(len(points))
    for column in kept.T:
        np.add.at(total, column, outer)
        np.add.at(area, column, size)
    mean = total[nodes] / np.maximum(area[nodes], np.finfo(float).tiny)[:, None, None]
    value, vector = np.linalg.eigh(mean)
    free = vector * (value <= _FLAT)[:, None, :]
    return np.asarray(free @ vector.swapaxes(1, 2))


def _put_back(mesh: Mesh, shift: Floats) -> Ints:
    """Nodes whose move would spoil a cell: of its nodes, those that move farthest, one after the other."""
    length, back = np.linalg.norm(shift, axis=1), np.zeros(len(shift), dtype=bool)
    touched = mesh.corners[(length[mesh.corners] > 0.0).any(axis=1)]
    before, points = quality(mesh.points, touched), mesh.points + shift
    while True:
        bad = touched[quality(points, touched) < _WORSE * before]
        if not len(bad):
            return np.flatnonzero(back)
        farthest = bad[np.arange(len(bad)), np.argmax(np.where(back[bad], -1.0, length[bad]), axis=1)]
        back[farthest] = True
        points[farthest] = mesh.points[farthest]


def on_surface(distance: Floats, points: Floats) -> Bools:
    """True where distances from a surface are rounding, for a mesh of such points."""
    return np.asarray(np.abs(distance) <= _ON * float(np.abs(points).max()))
