"""Bodies of a mesh: parts that share no node with each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from romdam.core.arrays import Floats, Ints
from romdam.core.errors import MeshError
from romdam.geometry.meshes.data import MeshFile

_SAME = 1e-6  # of the mesh's largest extent: centres that are nearer than this along an axis count as level
_SHOWN = 8  # bodies that a message lists


def cells_of_body(file: MeshFile, members: Sequence[Ints], number: int, location: str) -> list[Ints]:
    """The solid elements of one of the bodies that some elements make, by their rows in every kind.

    Parameters
    ----------
    members : rows in every kind of the file
    number : of the body, from 1, along x, then y, then z of the middles of their boxes
    location : start of the message

    Raises
    ------
    MeshError
        where there are fewer bodies, saying how many and where.
    """
    solid = [k for k, cells in enumerate(file.cells) if cells.dim == 3]
    tables = [file.cells[k].nodes[members[k]] for k in solid]
    numbers, boxes = number_bodies(file.points, tables)
    if number > len(boxes):
        raise MeshError(
            f"{location} has {len(boxes)} {'body' if len(boxes) == 1 else 'bodies'} in this block, no number "
            f"{number}: {bodies_text(boxes)}, in the file's unit"
        )
    chosen = [np.zeros(0, np.int64) for _ in members]
    for k, of_cells in zip(solid, numbers, strict=True):
        chosen[k] = members[k][of_cells == number]
    return chosen


def number_bodies(points: Floats, tables: Sequence[Ints]) -> tuple[list[Ints], Floats]:
    """Number the bodies that elements make.

    Parameters
    ----------
    points : (n, 3)
    tables : of every kind, (elements, nodes of one)

    Returns
    -------
    of every kind the number of each element's body, from 1; (bodies, 2, 3) lowest and highest corner of each
    """
    # a node that the file does not give joins nothing
    known = [np.where(table < 0, table.max(axis=1, keepdims=True), table) for table in tables]
    used, local = np.unique(np.concatenate([table.ravel() for table in known]), return_inverse=True)
    of_cells = [
        nodes.reshape(table.shape)
        for nodes, table in zip(
            np.split(local, np.cumsum([table.size for table in known])[:-1]), known, strict=True
        )
    ]
    first = np.concatenate([np.repeat(nodes[:, 0], len(nodes[0])) for nodes in of_cells if len(nodes)])
    links = coo_array((np.ones(len(first)), (first, local.ravel())), shape=(len(used), len(used)))
    count, part = connected_components(links, directed=False)
    boxes = np.full((count, 2, 3), np.nan)
    for bound, extreme in enumerate((np.fmin, np.fmax)):
        extreme.at(boxes[:, bound], part, points[used])
    extent = float(np.nanmax(np.ptp(boxes.reshape(-1, 3), axis=0), initial=np.finfo(float).tiny))
    level = np.round(boxes.mean(axis=1) / (_SAME * extent))
    order = np.lexsort((level[:, 2], level[:, 1], level[:, 0]))
    number = np.empty(count, np.int64)
    number[order] = np.arange(1, count + 1)
    return [number[part[nodes[:, 0]]] for nodes in of_cells], boxes[order]


def bodies_text(boxes: Floats) -> str:
    """Numbers and extents of bodies in words, from their (bodies, 2, 3) corners."""
    extents = [
        f"{k} ({', '.join(f'{a} {low:.6g}..{high:.6g}' for a, low, high in zip('xyz', *box, strict=True))})"
        for k, box in enumerate(boxes[:_SHOWN], 1)
    ]
    return ", ".join(extents) + (", ..." if len(boxes) > _SHOWN else "")
