"""The kinds of cells in mesh files: their numbers and names in every format, and the order of their nodes."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from romdam.core.arrays import Ints

_GMSH_WEDGE15 = (0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11)
_NASTRAN_WEDGE15 = (*range(9), 12, 13, 14, 9, 10, 11)  # the uprights before the top ring
_MED_WEDGE15 = (0, 2, 1, 3, 5, 4, 8, 7, 6, 11, 10, 9, 12, 14, 13)
_UNV_WEDGE15 = (0, 2, 4, 9, 11, 13, 1, 3, 5, 10, 12, 14, 6, 7, 8)
_GMSH_PYRAMID13 = (0, 1, 2, 3, 4, 5, 8, 10, 6, 7, 9, 11, 12)
_MED_PYRAMID13 = (0, 3, 2, 1, 4, 8, 7, 6, 5, 9, 12, 11, 10)


@dataclass(frozen=True)
class Cell:
    """A kind of cell; node orders here are VTK's.

    Attributes
    ----------
    name : in meshio
    dim, nodes : dimension and number of nodes
    vtk, gmsh : numbers of the type; None where the format has none
    abaqus : whether Abaqus has a solid C3D<nodes>, or a shell, of so many nodes
    nastran : entries that hold it
    med, aster : its type in MED and in code_aster's .mail
    unv : its descriptors in I-deas universal files
    orders : format -> for every node its place in the format's own order; the same where not listed
    """

    name: str
    dim: int
    nodes: int
    vtk: int | None = None
    gmsh: int | None = None
    abaqus: bool = False
    nastran: tuple[str, ...] = ()
    orders: dict[str, tuple[int, ...]] = field(default_factory=dict)
    med: str = ""
    aster: str = ""
    unv: tuple[int, ...] = ()

    def in_vtk_order(self, cells: Ints, kind: str) -> Ints:
        """Cells (n, nodes) of a format, their nodes in VTK's order."""
        return cells[:, np.array(self.orders[kind])] if kind in self.orders else cells


# What files hold beside the elements of `romdam.scene.elements`: told apart, and refused in a block.
OTHER_CELLS = (
    Cell("vertex", 0, 1, vtk=1, gmsh=15, med="PO1", aster="POI1"),
    Cell("line", 1, 2, vtk=3, gmsh=1, med="SE2", aster="SEG2"),
    Cell("line3", 1, 3, vtk=21, gmsh=8, med="SE3", aster="SEG3"),
    Cell("wedge", 3, 6, 13, 6, True, ("CPENTA",), {"med": _MED_WEDGE15[:6]}, "PE6", "PENTA6", (112,)),
    Cell("wedge15", 3, 15, 26, 18, True, ("CPENTA",),
         {"gmsh": _GMSH_WEDGE15, "nastran": _NASTRAN_WEDGE15, "aster": _NASTRAN_WEDGE15,
          "med": _MED_WEDGE15, "unv": _UNV_WEDGE15}, "P15", "PENTA15", (113,)),
    Cell("wedge18", 3, 18, gmsh=13, med="P18", aster="PENTA18"),
    Cell("pyramid", 3, 5, 14, 7, True, ("CPYRAM", "CPYRA"), {"med": _MED_PYRAMID13[:5]}, "PY5", "PYRAM5"),
    Cell("pyramid13", 3, 13, 27, 19, False, ("CPYRAM", "CPYRA"),
         {"gmsh": _GMSH_PYRAMID13, "med": _MED_PYRAMID13}, "P13", "PYRAM13"),
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


def uncollapsed(table: Ints, dim: int) -> list[tuple[str, Ints, Ints]]:
    """Kinds of cells in a table (n, nodes) where some may have nodes that stand twice.

    Returns
    -------
    of every kind its name, the rows (k,) that are of it, and these rows' own nodes (k, nodes of the kind)
    """
    if (kinds := COLLAPSED.get((dim, table.shape[1]))) is None:
        return [({(3, 4): "tetra", (3, 10): "tetra10"}[dim, table.shape[1]], np.arange(len(table)), table)]
    left, found = np.ones(len(table), dtype=bool), []
    for kind, frame in kinds.items():
        own = table[:, np.unique(frame, return_index=True)[1]]
        rows = np.flatnonzero(left & (own[:, list(frame)] == table).all(axis=1))
        left[rows] = False
        if len(rows):
            found.append((kind, rows, own[rows]))
    return found
