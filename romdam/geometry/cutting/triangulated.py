"""A triangulated surface that cuts: its file (STL or a mesh), its nearest triangles, their sides, its rim.

For the nearest triangle all are tried, most by the sphere around them.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np

from romdam.core.arrays import Bools, Floats, Ints
from romdam.core.errors import MeshError, listed, quote
from romdam.core.jit import njit
from romdam.geometry.elements import ELEMENT_OF_CELL
from romdam.geometry.facets import row_numbers
from romdam.geometry.meshes.data import EVERYTHING
from romdam.geometry.meshes.files import read_mesh_file
from romdam.geometry.nearest import tree

log = logging.getLogger(__name__)

_EDGES = ((0, 1), (1, 2), (2, 0))


class _Nearest(NamedTuple):
    """Nearest points (n, 3), the normals (n, 3) of the surface there, and whether they are on its rim."""

    point: Floats
    normal: Floats
    rim: Bools


@dataclass(frozen=True)
class Triangulated:
    """Triangles (nt, 3) of vertices (n, 3) [m] that hang together; they run counterclockwise from above.

    Attributes
    ----------
    normals : (nt, 7, 3) at the vertices, on the edges and inside of every triangle: means of the triangles
        there, by their angles at vertices, so that the sign of the distance is right everywhere
    rim : (nt, 7) True where these belong to the rim

    References
    ----------
    Baerentzen and Aanaes, Signed distance computation using the angle weighted pseudonormal, IEEE TVCG 11(3)
    (2005).
    """

    points: Floats
    triangles: Ints
    normals: Floats
    rim: Bools

    @classmethod
    def of(cls, points: Floats, triangles: Ints, location: str) -> Self:
        """Make a surface of triangles; `location` is file and key, for messages.

        Raises
        ------
        MeshError
            for triangles without an area, edges of more than two triangles, and neighbours that are turned.
        """
        corner = points[triangles]
        cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        size = np.linalg.norm(cross, axis=1, keepdims=True)
        _refuse(size[:, 0] <= 0.0, corner, "have no area; mesh the surface anew", location)
        face = cross / size
        # edge 0 of all triangles, then edge 1 and edge 2
        edges = np.concatenate([triangles[:, list(edge)] for edge in _EDGES])
        owner = np.tile(np.arange(len(triangles)), 3)
        key = row_numbers(np.sort(edges, axis=1))
        _, inverse, count = np.unique(key, return_inverse=True, return_counts=True)
        crowded = np.asarray((count[inverse] > 2).reshape(3, -1).any(axis=0))
        _refuse(crowded, corner, "share an edge with two others", location)
        way = np.zeros(len(count))
        np.add.at(way, inverse, np.where(edges[:, 0] < edges[:, 1], 1.0, -1.0))
        twisted = np.asarray(((way != 0.0) & (count == 2))[inverse].reshape(3, -1).any(axis=0))
        _refuse(twisted, corner, "run the other way round than a neighbour", location)
        at_edge = np.zeros((len(count), 3))
        np.add.at(at_edge, inverse, face[owner])
        at_vertex = np.zeros_like(points)
        for k in range(3):
            a, b = (corner[:, (k + step) % 3] - corner[:, k] for step in (1, 2))
            angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), _dot(a, b))
            np.add.at(at_vertex, triangles[:, k], angle[:, None] * face)
        free_edge = count[inverse] == 1
        free = np.zeros(len(points), dtype=bool)
        free[edges[free_edge]] = True
        normals = np.concatenate(
            [at_vertex[triangles], at_edge[inverse].reshape(3, -1, 3).swapaxes(0, 1), face[:, None]], axis=1
        )
        inner = np.zeros((len(triangles), 1), dtype=bool)
        rim = np.hstack([free[triangles], free_edge.reshape(3, -1).T, inner])
        return cls(points, triangles, normals / np.linalg.norm(normals, axis=2, keepdims=True), rim)

    def distance(self, points: Floats) -> Floats:
        """Signed distance (n,) [m]; beyond the rim, from the planes of the triangles there."""
        near = self._nearest(points)
        away = points - near.point
        height = _dot(away, near.normal)
        return np.where(near.rim, height, np.copysign(np.linalg.norm(away, axis=1), height))

    def normal(self, points: Floats) -> Floats:
        """Unit normal (n, 3) of the surface next to points."""
        return self._nearest(points).normal

    def beyond(self, points: Floats) -> Floats:
        """Distance of points outside of its rim, along the surface (n,) [m]."""
        near = self._nearest(points)
        away = points - near.point
        height = _dot(away, near.normal)
        return np.linalg.norm(away - height[:, None] * near.normal, axis=1) * near.rim

    def _nearest(self, points: Floats) -> _Nearest:
        """Points of the surface that are nearest to others."""
        corner = self.points[self.triangles]
        centre = corner.mean(axis=1)
        radius = np.linalg.norm(corner - centre[:, None], axis=2).max(axis=1)
        first = tree(centre).query(points)[1]
        row = nearest_triangles(np.ascontiguousarray(points), corner, np.c_[centre, radius], first)
        at, feature = _on_triangles(points, corner[row])
        return _Nearest(at, self.normals[row, feature], self.rim[row, feature])


def _refuse(wrong: Bools, corner: Floats, what: str, location: str) -> None:
    if wrong.any():
        at = ", ".join(f"{x:.6g}" for x in corner[np.argmax(wrong)].mean(axis=0))
        raise MeshError(
            f"{location}: {np.count_nonzero(wrong)} of {len(wrong)} triangles {what} (the first around "
            f"({at}) m), limit 0: a surface that cuts has two sides; export it anew"
        )


def _on_triangles(points: Floats, corner: Floats) -> tuple[Floats, Ints]:
    """Nearest points (n, 3) of triangles (n, 3, 3) to points (n, 3), and what they lie on.

    Features are numbered 0 to 2 for corners, 3 to 5 for edges, 6 for the inside.
    """
    a, u, v = corner[:, 0], corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    n = np.cross(u, v)
    s, t = (_dot(np.cross(*pair), n) / _dot(n, n) for pair in ((points - a, v), (u, points - a)))
    inside = (s > 0.0) & (t > 0.0) & (s + t < 1.0)
    at, feature = a + s[:, None] * u + t[:, None] * v, np.full(s.shape, 6)
    least = np.where(inside, 0.0, np.inf)
    for k, (i, j) in enumerate(_EDGES):
        side = corner[:, j] - corner[:, i]
        share = np.clip(_dot(points - corner[:, i], side) / _dot(side, side), 0.0, 1.0)
        on = corner[:, i] + share[:, None] * side
        apart = _dot(points - on, points - on)
        nearer = apart < least
        at[nearer], least[nearer] = on[nearer], apart[nearer]
        feature[nearer] = np.where(share == 0.0, i, np.where(share == 1.0, j, 3 + k))[nearer]
    return at, feature


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.einsum("nk,nk->n", a, b))


def read_surface(path: Path, group: str | int | None, scale: float, location: str) -> Triangulated:
    """Read a surface; corners at the same position become a single vertex.

    Parameters
    ----------
    group : name or number of the group of its facets; all where None
    scale : of the coordinates, in metres
    location : file and key, for messages

    Raises
    ------
    MeshError
        for files that cannot be read or have no such triangles, and for what is no surface with two sides.
    """
    file = read_mesh_file(path, f"{location}.file")
    for remark in file.remarks:
        log.warning("%s: %s", path, remark)
    label, members = EVERYTHING, [np.arange(len(cells.ids)) for cells in file.cells]
    if group is not None:
        label = str(group) if str(group) in file.groups else file.numbers.get(str(group), "")
        if label not in file.groups:
            raise MeshError(
                f"{location}.group: group {quote(group)} does not exist in {path}; its groups are "
                f"{listed(file.groups)}"
            )
        members = file.groups[label]
    file.refuse_unsound(label, members, 2, f"{location}.file: {path}")
    triangles = [np.zeros((0, 3), dtype=np.int64)]
    for cells, members_of in zip(file.cells, members, strict=True):
        if cells.dim == 2:
            corner = cells.nodes[members_of, : ELEMENT_OF_CELL[cells.kind].corners]
            triangles += [corner[:, [0, k, k + 1]] for k in range(1, corner.shape[1] - 1)]
    corners = file.points[np.concatenate(triangles).ravel()]
    if not len(corners):
        raise MeshError(
            f"{location}: {path} holds no triangles or "
            f"quadrilaterals{'' if group is None else ' in this group'}"
            "; export a surface"
        )
    points, number = np.unique(corners, axis=0, return_inverse=True)
    return Triangulated.of(points * scale, number.reshape(-1, 3), f"{location}.file: {path}")


@njit(cache=True)
def nearest_triangles(points: Floats, corners: Floats, spheres: Floats, first: Ints) -> Ints:
    """Number of the nearest of triangles, for every point.

    Parameters
    ----------
    points : (n, 3) [m]
    corners : (nt, 3, 3) [m]
    spheres : (nt, 4) centre and radius of a sphere around every triangle [m]
    first : (n,) a triangle that is near each point; the nearer, the fewer are looked at
    """
    nearest = first.copy()
    for i in range(len(points)):
        p = points[i]
        least = _apart(p, corners[first[i]])
        for t in range(len(corners)):
            x, y, z = p[0] - spheres[t, 0], p[1] - spheres[t, 1], p[2] - spheres[t, 2]
            if x * x + y * y + z * z < (least + spheres[t, 3]) ** 2:
                apart = _apart(p, corners[t])
                if apart < least:
                    least, nearest[i] = apart, t
    return nearest


@njit(cache=True)
def _apart(p: Floats, corner: Floats) -> float:
    """Distance of a point from a triangle (3, 3)."""
    a, u, v = corner[0], corner[1] - corner[0], corner[2] - corner[0]
    n = np.array([u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]])
    square = n[0] ** 2 + n[1] ** 2 + n[2] ** 2
    w = p - a
    s = _triple(w, v, n) / square
    t = _triple(u, w, n) / square
    if s >= 0.0 and t >= 0.0 and s + t <= 1.0:
        return float(abs(w[0] * n[0] + w[1] * n[1] + w[2] * n[2]) / np.sqrt(square))
    least = np.inf
    for k in range(3):
        start, side = corner[k], corner[(k + 1) % 3] - corner[k]
        away = p - start
        length = side[0] ** 2 + side[1] ** 2 + side[2] ** 2
        share = (away[0] * side[0] + away[1] * side[1] + away[2] * side[2]) / length
        away = away - min(max(share, 0.0), 1.0) * side
        least = min(least, away[0] ** 2 + away[1] ** 2 + away[2] ** 2)
    return float(np.sqrt(least))


@njit(cache=True)
def _triple(a: Floats, b: Floats, c: Floats) -> float:
    """(a x b) . c."""
    return float(
        (a[1] * b[2] - a[2] * b[1]) * c[0]
        + (a[2] * b[0] - a[0] * b[2]) * c[1]
        + (a[0] * b[1] - a[1] * b[0]) * c[2]
    )
