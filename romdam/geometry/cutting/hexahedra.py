"""Hexahedra cut into two hexahedra, where a surface crosses four edges that run side by side."""

from __future__ import annotations

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.errors import MeshError
from romdam.geometry.cutting.mesh import Mesh
from romdam.geometry.cutting.surfaces import CuttingSurface, crossing_shares, on_edges
from romdam.geometry.elements import ELEMENTS
from romdam.geometry.facets import row_numbers

_FAMILIES = np.array(  # edges that run side by side, from one facet to the opposite one
    [[(0, 1), (3, 2), (4, 5), (7, 6)], [(0, 3), (1, 2), (5, 6), (4, 7)], [(0, 4), (1, 5), (2, 6), (3, 7)]]
)
_FACETS = [set(facet) for facet in ELEMENTS["hex8"].facets]
_FACET_OF = [[_FACETS.index(set(family[:, side].tolist())) for side in (0, 1)] for family in _FAMILIES]


def cut_hexahedra(mesh: Mesh, level: Floats, surface: CuttingSurface, location: str) -> Mesh:
    """Cut every hexahedron that the surface crosses, and note the sides.

    Parameters
    ----------
    level : (n,) distance of the nodes from the surface, exactly zero for those on it [m]

    Raises
    ------
    MeshError
        where the surface does not cross four edges that run side by side, of a cell.
    """
    sign = np.sign(level)[mesh.cells]
    crossing = (sign.min(axis=1) < 0.0) & (sign.max(axis=1) > 0.0)
    cells = np.flatnonzero(crossing)
    across = sign[cells][:, _FAMILIES]
    across = across[..., 0] * across[..., 1] < 0.0  # (n, 3 families, 4 edges)
    family = np.argmax(across.sum(axis=2), axis=1)
    counts = across.sum(axis=(1, 2))
    quadrilateral = across[np.arange(len(cells)), family].all(axis=1) & (counts == 4)
    if not quadrilateral.all():
        worst = np.argmin(quadrilateral)
        at = ", ".join(f"{x:.6g}" for x in mesh.points[mesh.cells[cells[worst]]].mean(axis=0))
        raise MeshError(
            f"{location}: the surface crosses {int(counts[worst])} edges of the hexahedron around ({at}) m "
            f"({np.count_nonzero(~quadrilateral)} of {len(cells)} are cut like this, limit 0); hexahedra are "
            "cut in two only through four edges that run side by side; mesh the block with tetrahedra "
            "(tet10), or with element faces along the surface and `through: faces`"
        )

    # new nodes where the edges meet the surface, (n, 4) by cell
    ends = np.take_along_axis(mesh.cells[cells], _FAMILIES[family].reshape(-1, 8), 1).reshape(-1, 2)
    pairs = np.sort(ends, axis=1)
    _, first, inverse = np.unique(row_numbers(pairs), return_index=True, return_inverse=True)
    start, end = mesh.points[pairs[first, 0]], mesh.points[pairs[first, 1]]
    middle = (start + end) / 2.0
    at_surface = on_edges(crossing_shares(surface, start, end, middle), start, end, middle)
    points, new = np.vstack([mesh.points, at_surface]), len(mesh.points) + inverse.reshape(-1, 4)

    halves, origins = [], []
    row = np.arange(len(cells))
    for side in (0, 1):
        half, origin = mesh.cells[cells].copy(), mesh.origin[cells].copy()
        np.put_along_axis(half, _FAMILIES[family][:, :, 1 - side], new, 1)
        origin[row, np.array(_FACET_OF)[family, 1 - side]] = -1  # the facet between the halves
        halves.append(half)
        origins.append(origin)
    parent = np.concatenate([np.flatnonzero(~crossing), cells, cells])
    cut = Mesh(
        mesh.element,
        points,
        np.concatenate([mesh.cells[~crossing], *halves]),
        np.concatenate([mesh.origin[~crossing], *origins]),
        mesh.sides[parent],
    )
    level = np.concatenate([level, np.zeros(len(points) - len(level))])
    return cut.with_side(np.where(level[cut.cells].sum(axis=1) < 0.0, -1, 1))
