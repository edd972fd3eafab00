"""Whether the cells of a mesh can carry an integration."""

from __future__ import annotations

import numpy as np

from romdam.errors import MeshError
from romdam.scene.elements import ELEMENTS, Floats, jacobians
from romdam.scene.model import Block

_CHUNK = 4096  # cells at a time


def refuse_bad_cells(block: Block, place: str) -> None:
    """Raise if a cell is turned inside out or occurs twice.

    Parameters
    ----------
    place : start of the message

    Raises
    ------
    MeshError
    """
    unique = np.unique(np.sort(block.cells, axis=1), axis=0)
    if len(unique) < len(block.cells):
        raise MeshError(
            f"{place}: {len(block.cells) - len(unique)} of {len(block.cells)} elements of block "
            f"{block.name!r} occur twice, limit 0; remove duplicates, or select one `group` of the file"
        )
    element = ELEMENTS[block.element]
    for first in range(0, len(block.cells), _CHUNK):
        jacobian = jacobians(block.points, block.cells[first : first + _CHUNK], element, element.rule[0])
        refuse_inverted(block, np.linalg.det(jacobian), first, place)


def refuse_inverted(block: Block, determinant: Floats, first: int, place: str = "mesh") -> None:
    """Raise if a determinant of dx/dxi is not positive; (nc, nq) of the cells from number `first` on [m3].

    Raises
    ------
    MeshError
    """
    lowest = determinant.min(axis=1)
    if lowest.min() > 0.0:
        return
    worst = int(np.argmin(lowest))
    cell = first + worst
    centre = ", ".join(f"{x:.6g}" for x in block.points[block.cells[cell]].mean(axis=0))
    raise MeshError(
        f"{place}: element {cell} of block {block.name!r} ({block.element}, counted from 0, around "
        f"({centre})) has a Jacobian determinant of {lowest[worst]:.4g} m3, limit above 0 "
        f"({np.count_nonzero(lowest <= 0.0)} such elements here): its nodes are in the "
        "wrong order or it is turned inside out; repair the mesh"
    )
