"""A mesh while it is cut: which sides its cells lie on, and what becomes of the facets of its boundary."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np

from romdam.core.arrays import Floats, Ints
from romdam.core.scene import Block
from romdam.geometry.elements import ELEMENTS
from romdam.geometry.facets import row_numbers


@dataclass(frozen=True)
class Mesh:
    """A mesh that conforms throughout.

    Attributes
    ----------
    element : its name in `romdam.geometry.elements`
    points : (n, 3) [m]
    cells : (nc, nodes per cell)
    origin : (nc, facets per cell) the facet of the uncut block's boundary that each facet is of; -1 inside
    sides : (nc, surfaces so far) -1 or 1
    """

    element: str
    points: Floats
    cells: Ints
    origin: Ints
    sides: Ints

    @classmethod
    def of(cls, block: Block) -> Self:
        """The mesh of a block that nothing has cut."""
        facets = Facets.of(block.element, block.cells)
        origin = np.full(len(block.cells) * len(ELEMENTS[block.element].facets), -1)
        origin[facets.boundary] = facets.boundary
        shape = len(block.cells), len(ELEMENTS[block.element].facets)
        sides = np.zeros((len(block.cells), 0), dtype=np.int64)
        return cls(block.element, block.points, block.cells, origin.reshape(shape), sides)

    @property
    def corners(self) -> Ints:
        """Corner nodes of every cell."""
        return self.cells[:, : ELEMENTS[self.element].corners]

    def with_side(self, side: Ints) -> Self:
        """The same with the side of one more surface (nc,)."""
        return replace(self, sides=np.column_stack([self.sides, side]))


class Facets(NamedTuple):
    """All facets of cells, cell after cell, numbered from 0.

    Attributes
    ----------
    rows : (nc times facets per cell, nodes per facet), outward of their cell
    cell : of each
    pairs : (n, 2) numbers of facets that coincide
    boundary : numbers of those of one cell only
    corners : number of corner nodes, which come first in a row
    """

    rows: Ints
    cell: Ints
    pairs: Ints
    boundary: Ints
    corners: int

    @classmethod
    def of(cls, element: str, cells: Ints) -> Self:
        """Facets of cells of an element."""
        table = ELEMENTS[element]
        rows = cells[:, np.array(table.facets)].reshape(-1, len(table.facets[0]))
        corners = ELEMENTS[table.facet].corners
        keys = row_numbers(np.sort(rows[:, :corners], axis=1))
        order = np.argsort(keys, kind="stable")
        first = np.flatnonzero(np.diff(keys[order]) == 0)
        pairs = np.stack([order[first], order[first + 1]], axis=1)
        alone = np.ones(len(rows), dtype=bool)
        alone[pairs] = False
        cell = np.repeat(np.arange(len(cells)), len(table.facets))
        return cls(rows, cell, pairs, np.flatnonzero(alone), corners)
