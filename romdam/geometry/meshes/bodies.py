"""Bodies of a mesh: parts that share no node with each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from romdam.core.arrays import Floats, Ints
from romdam.geometry.elements import ELEMENT_OF_CELL
from romdam.geometry.meshes.data import MeshFile

_SAME = 1e-6  # of the mesh's largest extent: centres that are nearer than this along an axis count as level
_SHOWN = 8  # bodies that a message lists


@dataclass(frozen=True)
class Bodies:
    """Bodies that some solid elements make, from 1 along x, then y, then z of the middles of their boxes.

    Attributes
    ----------
    numbers : of every kind of the file, the number of each member's body; of solids only
    boxes : (bodies, 2, 3) lowest and highest corner of each
    """

    numbers: dict[int, Ints]
    boxes: Floats

    @property
    def counted(self) -> str:
        """How many there are, in words."""
        return f"{len(self.boxes)} {'body' if len(self.boxes) == 1 else 'bodies'}"

    def members(self, number: int, members: Sequence[Ints]) -> list[Ints]:
        """The elements of one body, by their rows in every kind of the file."""
        chosen = [np.zeros(0, np.int64) for _ in members]
        for k, of_cells in self.numbers.items():
            chosen[k] = members[k][of_cells == number]
        return chosen


def find_bodies(file: MeshFile, members: Sequence[Ints]) -> Bodies:
    """Find the bodies that some elements make; those of another order are another body.

    Parameters
    ----------
    members : rows in every kind of the file
    """
    solid = [k for k, cells in enumerate(file.cells) if cells.dim == 3]
    tables = [file.cells[k].nodes[members[k]] for k in solid]
    orders = [_order(file.cells[k].kind) for k in solid]
    numbers, boxes = number_bodies(file.points, tables, orders)
    return Bodies(dict(zip(solid, numbers, strict=True)), boxes)


def _order(kind: str) -> str:
    """What elements of one block have in common: nodes at corners only, or along edges too."""
    element = ELEMENT_OF_CELL.get(kind)
    if element is None or element.name == "hex27":
        return kind
    return "linear" if element.corners == len(element.nodes) else "quadratic"


def number_bodies(
    points: Floats, tables: Sequence[Ints], orders: Sequence[str] | None = None
) -> tuple[list[Ints], Floats]:
    """Number the bodies that elements make.

    Parameters
    ----------
    points : (n, 3)
    tables : of every kind, (elements, nodes of one)
    orders : of every kind; kinds of different ones make no body together, whatever nodes they share

    Returns
    -------
    of every kind the number of each element's body, from 1; (bodies, 2, 3) lowest and highest corner of each
    """
    # a node that the file does not give joins nothing
    known = [np.where(table < 0, table.max(axis=1, keepdims=True), table) for table in tables]
    every = list(dict.fromkeys(orders or ()))
    shifts = [every.index(order) * len(points) for order in orders or ()] or [0] * len(tables)
    shifted = [(table + shift).ravel() for table, shift in zip(known, shifts, strict=True)]
    used, local = np.unique(np.concatenate(shifted), return_inverse=True)
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
        extreme.at(boxes[:, bound], part, points[used % len(points)])
    extent = float(np.nanmax(np.ptp(boxes.reshape(-1, 3), axis=0), initial=0.0))
    level = np.round(boxes.mean(axis=1) / (_SAME * extent if extent > 0.0 else 1.0))
    order = np.lexsort((level[:, 2], level[:, 1], level[:, 0]))
    number = np.empty(count, np.int64)
    number[order] = np.arange(1, count + 1)
    return [number[part[nodes[:, 0]]] for nodes in of_cells], boxes[order]


def bodies_text(boxes: Floats) -> str:
    """Numbers and extents of bodies in words, from their (bodies, 2, 3) corners."""
    extents = [f"{k} ({extent_text(box)})" for k, box in enumerate(boxes[:_SHOWN], 1)]
    return ", ".join(extents) + (", ..." if len(boxes) > _SHOWN else "")


def extent_text(box: Floats) -> str:
    """The extent of a box in words, from its (2, 3) corners."""
    return ", ".join(f"{a} {low:.6g}..{high:.6g}" for a, low, high in zip("xyz", *box, strict=True))
