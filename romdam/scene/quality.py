"""Whether the cells of a mesh can carry an integration."""

from __future__ import annotations

import numpy as np

from romdam.errors import MeshError
from romdam.scene.elements import ELEMENTS, Floats, jacobians
from romdam.scene.model import Block

_CHUNK = 4096  # cells at a time


def refuse_bad_cells(block: Block, place: str) -> None:
    """Raise if a cell is turned inside out, occurs twice or has its nodes in another format's order.

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
    _refuse_stray_midsides(block, place)
    element = ELEMENTS[block.element]
    for first in range(0, len(block.cells), _CHUNK):
        jacobian = jacobians(block.points, block.cells[first : first + _CHUNK], element, element.rule[0])
        refuse_inverted(block, np.linalg.det(jacobian), first, place)


def _refuse_stray_midsides(block: Block, place: str) -> None:
    """A mid-edge node half an edge away from its middle is one of another edge: a wrong node order."""
    element = ELEMENTS[block.element]
    if not element.quadratic:
        return
    ends = block.points[block.cells[:, np.array(element.edges)]]
    middle = block.points[block.cells[:, element.corners :]]
    length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
    off = np.linalg.norm(middle - ends.mean(axis=2), axis=2) / length
    if off.max() < 0.5:
        return
    cell, edge = np.unravel_index(np.argmax(off), off.shape)
    raise MeshError(
        f"{place}: mid-edge node {element.corners + edge} of element {cell} of block {block.name!r} "
        f"({block.element}, both counted from 0) is {off[cell, edge]:.3g} edge lengths off the middle of its "
        "edge, limit 0.5: the file's node order is not that of its format; export the mesh anew"
    )


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
