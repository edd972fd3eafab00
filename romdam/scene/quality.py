"""Whether the cells of a mesh can carry an integration."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from romdam.errors import MeshError
from romdam.scene.elements import ELEMENTS, Floats, jacobians
from romdam.scene.facets import row_numbers
from romdam.scene.model import Block

_CHUNK = 4096  # cells at a time
_COINCIDENT = 1e-6  # distance of two nodes relative to the block's diagonal


def refuse_bad_cells(block: Block, place: str) -> None:
    """Raise if a cell is turned inside out, occurs twice or has its nodes in another format's order.

    Parameters
    ----------
    place : start of the message

    Raises
    ------
    MeshError
    """
    unique = np.unique(row_numbers(np.sort(block.cells, axis=1)))
    if len(unique) < len(block.cells):
        raise MeshError(
            f"{place}: {len(block.cells) - len(unique)} of {len(block.cells)} elements of block "
            f"{block.name!r} occur twice, limit 0; remove duplicates, or select one `group` of the file"
        )
    refuse_loose_nodes(block, place)
    _refuse_coincident_nodes(block, place)
    _refuse_stray_midsides(block, place)
    element = ELEMENTS[block.element]
    for first in range(0, len(block.cells), _CHUNK):
        jacobian = jacobians(block.points, block.cells[first : first + _CHUNK], element, element.rule[0])
        refuse_inverted(block, _determinants(jacobian), first, place)


def _determinants(matrices: Floats) -> Floats:
    """Of (..., 3, 3), by the rule of Sarrus: LAPACK takes a microsecond for each."""
    (a, b, c), (d, e, f), (g, h, i) = np.moveaxis(matrices, (-2, -1), (0, 1))
    return np.asarray(a * (e * i - f * h) + b * (f * g - d * i) + c * (d * h - e * g))


def refuse_loose_nodes(block: Block, place: str = "mesh") -> None:
    """Raise if a node belongs to no element: nothing holds it, and no matrix has its row.

    Raises
    ------
    MeshError
        naming the first.
    """
    loose = np.flatnonzero(np.bincount(block.cells.ravel(), minlength=len(block.points)) == 0)
    if len(loose):
        raise MeshError(
            f"{place}: node {_node(block, loose[0])} of block {block.name!r} belongs to no element "
            f"({len(loose)} such nodes, limit 0): remove it, or mesh what it was meant for"
        )


def _refuse_coincident_nodes(block: Block, place: str) -> None:
    """Two nodes at one place are a crack that no joint knows of."""
    reach = _COINCIDENT * float(np.linalg.norm(np.ptp(block.points, axis=0)))
    pairs = cKDTree(block.points).query_pairs(reach, output_type="ndarray")
    if len(pairs):
        first, second = pairs[np.lexsort(pairs.T[::-1])][0]
        raise MeshError(
            f"{place}: {len(pairs)} pairs of nodes of block {block.name!r} coincide (nodes {first} and "
            f"{_node(block, second)} are the first, counted from 0; within {reach:.1g} m), limit 0: the "
            "block is cut there; merge duplicate nodes, or make it two blocks with a joint or a tie"
        )


def _node(block: Block, node: int) -> str:
    return f"{node} at ({', '.join(f'{x:.6g}' for x in block.points[node])})"


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
