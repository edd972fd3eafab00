"""Boxes meshed by a regular grid of hexahedra, or of tetrahedra that fit from box to box."""

from __future__ import annotations

from itertools import permutations

import numpy as np

from romdam.config.sections.job import BoxConfig
from romdam.core.errors import ConfigError
from romdam.core.scene import Block, Ints, Material
from romdam.geometry.elements import ELEMENTS, Element, Floats
from romdam.geometry.facets import boundary_facets, facets_in_plane, row_numbers

_DIVIDES = 1e-6  # relative: element sizes such as 10/3 are written with a few digits


def box_block(name: str, box: BoxConfig, material: Material, location: str) -> Block:
    """Mesh a box; its faces are xmin, xmax, ymin, ymax, zmin, zmax.

    Parameters
    ----------
    location : file and key of the box, for messages

    Raises
    ------
    ConfigError
        when the element size does not divide the box.
    """
    wanted, counts = box.element_size, []
    sizes = (wanted,) * 3 if isinstance(wanted, float) else wanted
    for length, size, axis in zip(box.size, sizes, "xyz", strict=True):
        count = max(round(length / size), 1)
        if abs(count * size - length) > _DIVIDES * length:
            fewer = max(int(length / size), 1)
            nearest = " or ".join(f"{length / n:.6g}" for n in (fewer + 1, fewer))
            raise ConfigError(
                f"{location}.element_size = {size:g} m does not divide the box, {length:g} m along {axis} "
                f"({length / size:.4g} elements); the nearest sizes that do are {nearest} m"
            )
        counts.append(count)

    low, high = np.array(box.origin), np.array(box.origin) + np.array(box.size)
    lines = [o + s * (np.arange(n + 1) / n) for o, s, n in zip(box.origin, box.size, counts, strict=True)]
    z, y, x = np.meshgrid(lines[2], lines[1], lines[0], indexing="ij")
    points = np.c_[x.ravel(), y.ravel(), z.ravel()]

    # hexahedra whose nodes are numbered along x, then y, then z
    nx, ny, nz = (n + 1 for n in counts)
    first = np.arange(nx * ny * nz).reshape(nz, ny, nx)[:-1, :-1, :-1].ravel()
    ring = np.array([0, 1, nx + 1, nx])
    cells = first[:, None] + np.concatenate([ring, ring + nx * ny])[None]

    points, cells = _split(points, cells, ELEMENTS[box.element].linear)
    points, cells = with_middle_nodes(points, cells, ELEMENTS[box.element])
    boundary, tolerance = boundary_facets(cells, box.element), 1e-6 * min(box.size)
    faces = {}
    for k, axis in enumerate("xyz"):
        faces[f"{axis}min"] = facets_in_plane(points, boundary, k, low[k], tolerance)
        faces[f"{axis}max"] = facets_in_plane(points, boundary, k, high[k], tolerance)
    return Block(name, box.element, points, cells, material, faces)


def hexahedra(number: Ints) -> Ints:
    """Cells (n, 8) of a grid of node numbers, VTK order, the last axis running fastest."""
    low, high = slice(None, -1), slice(1, None)
    corners = [(low, low), (high, low), (high, high), (low, high)]
    rings = [number[i, j, k] for k in (low, high) for i, j in corners]
    return np.stack([ring.ravel() for ring in rings], axis=1)


def _split(points: Floats, cells: Ints, into: str) -> tuple[Floats, Ints]:
    """Hexahedra cut into tetrahedra, two wedges along z, or six pyramids around a node in their middle."""
    if into == "tet4":
        return points, split_into_tets(cells)
    if into == "wedge6":
        return points, cells[:, np.array([(0, 1, 2, 4, 5, 6), (0, 2, 3, 4, 6, 7)])].reshape(-1, 6)
    if into == "pyramid5":
        tips = np.repeat(len(points) + np.arange(len(cells)), 6)
        bases = cells[:, np.array(ELEMENTS["hex8"].facets)[:, ::-1]].reshape(-1, 4)  # seen from the middle
        return np.vstack([points, points[cells].mean(axis=1)]), np.c_[bases, tips]
    return points, cells


_CORNER_AT = {(0, 0, 0): 0, (1, 0, 0): 1, (1, 1, 0): 2, (0, 1, 0): 3}
_CORNER_AT |= {(x, y, 1): corner + 4 for (x, y, _), corner in _CORNER_AT.items()}


def split_into_tets(cells: Ints) -> Ints:
    """Six tetrahedra per hexahedron, all along the diagonal from node 0 to node 6 (Kuhn's subdivision).

    It is the same in every cell, so the diagonals of opposite faces agree and boxes on one grid
    conform wherever they touch; the five-tetrahedra split would need mirrored neighbours.
    The tetrahedra are in the order of the hexahedra.
    """
    tets = []
    for order in permutations(range(3)):
        walk = np.zeros((4, 3), dtype=int)
        for step, axis in enumerate(order):
            walk[step + 1 :, axis] = 1
        tet = [_CORNER_AT[tuple(corner)] for corner in walk.tolist()]
        if np.linalg.det(np.diff(walk, axis=0)) < 0.0:
            tet[2], tet[1] = tet[1], tet[2]
        tets.append(tet)
    return cells[:, np.array(tets)].reshape(-1, 4)


def with_middle_nodes(points: Floats, corners: Ints, element: Element) -> tuple[Floats, Ints]:
    """Append the nodes that an element has in the middle of edges, of facets and of cells.

    Parameters
    ----------
    points : (n, k) of the corners; more than three columns are treated alike
    corners : (nc, corners) of the cells
    """
    cells = corners
    for size in sorted({len(middle) for middle in element.middles}):
        among = np.array([middle for middle in element.middles if len(middle) == size])
        rows = np.sort(corners[:, among].reshape(-1, size), axis=1)
        _, first, inverse = np.unique(row_numbers(rows), return_index=True, return_inverse=True)
        cells = np.hstack([cells, len(points) + inverse.reshape(len(corners), len(among))])
        points = np.vstack([points, points[rows[first]].mean(axis=1)])
    return points, cells
