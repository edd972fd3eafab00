"""Cells and facets of several kinds in one table: hexahedra and quadrilaterals with nodes that stand twice.

So a block has one table of cells, whatever its elements, and all that follows from nodes alone (supports,
numbering, what shares a cell) asks nothing of it. What integrates takes the kinds one by one.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import get_args

import numpy as np

from romdam.config.sections.places import GridElement
from romdam.core.errors import MeshError
from romdam.core.scene import Block, Ints
from romdam.geometry.cells import COLLAPSED, uncollapsed
from romdam.geometry.elements import ELEMENT_OF_CELL, ELEMENTS, Element

# Blocks of several kinds of elements: their cells are hexahedra, some collapsed, see `COLLAPSED`.
MIXED = {"mixed8": "hex8", "mixed20": "hex20"}


def frame(name: str) -> Element:
    """The element that numbers corners, edges and facets of a block's cells: of mixed ones the hexahedron."""
    return ELEMENTS[MIXED.get(name, name)]


def kinds_of(name: str, cells: Ints) -> list[tuple[Element, Ints, Ints]]:
    """The kinds of a block's cells: element, rows of `cells`, and the cells in that element's own nodes."""
    if name not in MIXED:
        return [(ELEMENTS[name], np.arange(len(cells)), cells)]
    return [(ELEMENT_OF_CELL[kind], rows, cell_nodes) for kind, rows, cell_nodes in uncollapsed(cells, 3)]


def mixed_cells(tables: dict[str, Ints]) -> tuple[str, Ints] | None:
    """Cells of several kinds as those of one block, and its element; None where no hexahedron stands for all.

    Parameters
    ----------
    tables : name of the cell -> (n, nodes of the kind)
    """
    for name, whole in MIXED.items():
        kinds = COLLAPSED[3, ELEMENTS[whole].cell.nodes]
        if set(tables) <= set(kinds):
            return name, np.concatenate([table[:, list(kinds[kind])] for kind, table in tables.items()])
    return None


def refuse_wedges(block: Block, what: str, location: str) -> None:
    """Raise where a block has elements with facets of two kinds.

    Parameters
    ----------
    what : is not done with them, such as `are not cut`
    location : file and key

    Raises
    ------
    MeshError
    """
    if block.element not in get_args(GridElement):
        raise MeshError(
            f"{location}: block {block.name!r} has wedges or pyramids ({block.element}), which {what}; mesh "
            "it with hexahedra or tetrahedra alone"
        )


def chunks_of(block: Block, size: int) -> Iterator[tuple[Element, Ints, Ints]]:
    """The kinds of a block's cells as `kinds_of` has them, so many cells at a time."""
    for element, rows, cells in kinds_of(block.element, block.cells):
        for first in range(0, len(cells), size):
            yield element, rows[first : first + size], cells[first : first + size]


def facets_by_kind(
    facets: Ints,
) -> list[tuple[Ints, Ints, Ints]]:
    """Triangles and quadrilaterals of facets apart: rows, facets in their own nodes, the columns of these."""
    kinds = COLLAPSED.get((2, facets.shape[1]))
    if kinds is None or not (facets[:, 2] == facets[:, 3]).any():
        return [(np.arange(len(facets)), facets, np.arange(facets.shape[1]))]
    columns = {kind: np.unique(facet_nodes, return_index=True)[1] for kind, facet_nodes in kinds.items()}
    return [(rows, facet_nodes, columns[kind]) for kind, rows, facet_nodes in uncollapsed(facets, 2)]
