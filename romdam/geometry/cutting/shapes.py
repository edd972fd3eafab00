"""Shape of cells: how near to a regular tetrahedron, and which are too thin."""

from __future__ import annotations

import numpy as np

from romdam.core.arrays import Floats, Ints
from romdam.core.errors import MeshError
from romdam.geometry.cutting.mesh import Mesh
from romdam.geometry.cutting.surfaces import CuttingSurface
from romdam.geometry.elements import ELEMENTS

_TET_EDGES = np.array(ELEMENTS["tet4"].edges)
_AT_CORNERS = {  # corners of the tetrahedra that a cell is judged by, positive in a sound one
    4: np.array([[0, 1, 2, 3]]),
    8: np.array([[0, 1, 3, 4], [1, 2, 0, 5], [2, 3, 1, 6], [3, 0, 2, 7],
                 [4, 7, 5, 0], [5, 4, 6, 1], [6, 5, 7, 2], [7, 6, 4, 3]]),
}  # fmt: skip
SLIVER = 0.02  # quality below which a cell that a cut makes is too thin


def quality(points: Floats, corners: Ints) -> Floats:
    """Quality (nc,) of cells by their corners: 1 for a regular tetrahedron, 0 for a flat cell.

    It is 6 sqrt(2) V / l^3 with l the root mean square of the edges, negative where the cell is turned inside
    out; of a hexahedron, the least of the tetrahedra at its corners (0.77 for a cube).

    References
    ----------
    Parthasarathy, Graichen and Hathaway, A comparison of tetrahedron quality measures, Finite Elements in
    Analysis and Design 15 (1994), which calls its inverse gamma.
    """
    tets = points[corners[:, _AT_CORNERS[corners.shape[1]]]]
    side = tets[..., 1:, :] - tets[..., :1, :]
    volume = np.einsum("...k,...k->...", np.cross(side[..., 0, :], side[..., 1, :]), side[..., 2, :]) / 6.0
    edge = tets[..., _TET_EDGES[:, 1], :] - tets[..., _TET_EDGES[:, 0], :]
    square = np.einsum("...ek,...ek->...", edge, edge) / 6.0
    return np.asarray((6.0 * np.sqrt(2.0) * volume / square**1.5).min(axis=1))


def refuse_slivers(mesh: Mesh, before: Mesh, places: list[tuple[CuttingSurface, str]]) -> None:
    """Raise if cuts have left cells that are too thin, and half as good as the worst one was before.

    Parameters
    ----------
    mesh, before : with and without the cuts
    places : the surfaces, and file and key of each; the nearest one is named

    Raises
    ------
    MeshError
    """
    shape = quality(mesh.points, mesh.corners)
    limit = min(SLIVER, 0.5 * float(quality(before.points, before.corners).min()))
    thin = np.flatnonzero(shape < limit)
    if not len(thin):
        return
    worst = thin[np.argmin(shape[thin])]
    centre = mesh.points[mesh.corners[worst]].mean(axis=0)
    at = ", ".join(f"{x:.6g}" for x in centre)
    _, location = min(places, key=lambda place: abs(float(place[0].distance(centre[None])[0])))
    raise MeshError(
        f"{location}: the cut leaves {len(thin)} slivers: the worst, around ({at}) m, has a quality of "
        f"{shape[worst]:.3g}, limit {limit:.3g} (1 is a regular tetrahedron); move the "
        "surface away from the faces and edges that it nearly touches there, or onto them, or mesh finer"
    )
