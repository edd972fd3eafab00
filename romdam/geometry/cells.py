"""The kinds of cells in mesh files: their numbers and names in every format, and the order of their nodes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from romdam.core.arrays import Ints
from romdam.geometry.meshes.orders import ORDERS


@dataclass(frozen=True)
class Cell:
    """A kind of cell; node orders here are VTK's.

    Attributes
    ----------
    name : in meshio and meshlane
    dim, nodes : dimension and number of nodes
    vtk, gmsh : numbers of the type; None where the format has none
    abaqus : whether Abaqus has a solid C3D<nodes>, or a shell, of so many nodes
    nastran : entries that hold it
    med, aster : its type in MED and in code_aster's .mail
    unv : its descriptors in I-deas universal files
    """

    name: str
    dim: int
    nodes: int
    vtk: int | None = None
    gmsh: int | None = None
    abaqus: bool = False
    nastran: tuple[str, ...] = ()
    med: str = ""
    aster: str = ""
    unv: tuple[int, ...] = ()

    @property
    def orders(self) -> dict[str, tuple[int, ...]]:
        """By format, for every node its place in the format's own order; the same where not listed."""
        return ORDERS.get(self.name, {})

    def in_vtk_order(self, cells: Ints, kind: str) -> Ints:
        """Cells (n, nodes) of a format, their nodes in VTK's order."""
        return cells[:, np.array(self.orders[kind])] if kind in self.orders else cells


# What files hold beside the elements of `romdam.geometry.elements`: told apart, and refused in a block.
OTHER_CELLS = (
    Cell("vertex", 0, 1, vtk=1, gmsh=15, med="PO1", aster="POI1"),
    Cell("line", 1, 2, vtk=3, gmsh=1, med="SE2", aster="SEG2"),
    Cell("line3", 1, 3, vtk=21, gmsh=8, med="SE3", aster="SEG3"),
    Cell("wedge18", 3, 18, gmsh=13, med="P18", aster="PENTA18"),
    Cell("pyramid14", 3, 14, gmsh=14),
)  # fmt: skip

# Solids and facets as hexahedra and quadrilaterals some of whose nodes stand twice, in the order of VTK and
# ANSYS (Element Reference, SOLID185, SOLID186): for every node of these its own. The most collapsed first.
COLLAPSED: dict[tuple[int, int], dict[str, tuple[int, ...]]] = {
    (3, 8): {
        "tetra": (0, 1, 2, 2, 3, 3, 3, 3),
        "pyramid": (0, 1, 2, 3, 4, 4, 4, 4),
        "wedge": (0, 1, 2, 2, 3, 4, 5, 5),
        "hexahedron": tuple(range(8)),
    },
    (3, 20): {
        "tetra10": (0, 1, 2, 2, 3, 3, 3, 3, 4, 5, 2, 6, 3, 3, 3, 3, 7, 8, 9, 9),
        "pyramid13": (0, 1, 2, 3, 4, 4, 4, 4, 5, 6, 7, 8, 4, 4, 4, 4, 9, 10, 11, 12),
        "wedge15": (0, 1, 2, 2, 3, 4, 5, 5, 6, 7, 2, 8, 9, 10, 5, 11, 12, 13, 14, 14),
        "hexahedron20": tuple(range(20)),
    },
    (2, 4): {"triangle": (0, 1, 2, 2), "quad": tuple(range(4))},
    (2, 8): {"triangle6": (0, 1, 2, 2, 3, 4, 2, 5), "quad8": tuple(range(8))},
}

PLAIN = {(dim, len(set(own))): kind for (dim, _), kinds in COLLAPSED.items() for kind, own in kinds.items()}


def uncollapsed(table: Ints, dim: int) -> list[tuple[str, Ints, Ints]]:
    """Kinds of cells in a table (n, nodes) where some may have nodes that stand twice.

    Returns
    -------
    of every kind its name, the rows (k,) that are of it, and these rows' own nodes (k, nodes of the kind)
    """
    if (kinds := COLLAPSED.get((dim, table.shape[1]))) is None:
        return [(PLAIN[dim, table.shape[1]], np.arange(len(table)), table)]
    left, by_kind = np.ones(len(table), dtype=bool), []
    for kind, frame in kinds.items():
        corners = table[:, np.unique(frame, return_index=True)[1]]
        rows = np.flatnonzero(left & (corners[:, list(frame)] == table).all(axis=1))
        left[rows] = False
        if len(rows):
            by_kind.append((kind, rows, corners[rows]))
    return by_kind
