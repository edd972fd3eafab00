"""Triangulated surfaces from files: the facets of STL and mesh files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from romdam.core.errors import MeshError, listed, quote
from romdam.geometry.cutting.triangulated import Triangulated
from romdam.geometry.elements import ELEMENT_OF_CELL
from romdam.geometry.meshes.files import read_mesh_file


def read_surface(path: Path, group: str | int | None, scale: float, location: str) -> Triangulated:
    """Read a surface; corners at one place are one.

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
    members = [np.arange(len(cells.ids)) for cells in file.cells]
    if group is not None:
        label = str(group) if str(group) in file.groups else file.numbers.get(str(group), "")
        if label not in file.groups:
            raise MeshError(
                f"{location}.group: group {quote(group)} does not exist in {path}; its groups are "
                f"{listed(file.groups)}"
            )
        members = file.groups[label]
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
