"""The kinds of cells in mesh files: their numbers and names in every format, and the order of their nodes."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from romdam.core.arrays import Ints


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

    def in_vtk_order(self, cells: Ints, kind: str) -> Ints:
        """Cells (n, nodes) of a format, their nodes in VTK's order."""
        return cells[:, np.array(self.orders[kind])] if kind in self.orders else cells


# What files hold beside the elements of `romdam.scene.elements`: told apart, and refused in a block.
OTHER_CELLS = (
    Cell("vertex", 0, 1, vtk=1, gmsh=15),
    Cell("line", 1, 2, vtk=3, gmsh=1),
    Cell("line3", 1, 3, vtk=21, gmsh=8),
    Cell("wedge", 3, 6, vtk=13, gmsh=6, abaqus=True, nastran=("CPENTA",)),
    Cell("wedge15", 3, 15, vtk=26, gmsh=18, abaqus=True, nastran=("CPENTA",)),
    Cell("wedge18", 3, 18, gmsh=13),
    Cell("pyramid", 3, 5, vtk=14, gmsh=7, abaqus=True, nastran=("CPYRAM", "CPYRA")),
    Cell("pyramid13", 3, 13, vtk=27, gmsh=19, nastran=("CPYRAM", "CPYRA")),
    Cell("pyramid14", 3, 14, gmsh=14),
)
