"""Orders of an element's nodes in file formats: for every node in VTK's order its place in theirs.

Formats that are not listed have VTK's. Gmsh: reference manual, "Node ordering". Nastran: Quick Reference
Guide, CHEXA, CPENTA (CTETRA and CPYRAM are as VTK's). code_aster: U3.01.00. Abaqus: C3D27. MED and I-deas:
as Gmsh 4.15 writes them; MED numbers solids the other way round, I-deas goes ring after ring, corners and
middles in turn.
"""

_GMSH_HEX20 = (0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15)
_GMSH_HEX27 = (*_GMSH_HEX20, 22, 23, 21, 24, 20, 25, 26)
_GMSH_WEDGE15 = (0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11)
_NASTRAN_WEDGE15 = (*range(9), 12, 13, 14, 9, 10, 11)  # the uprights before the top ring
_MED_WEDGE15 = (0, 2, 1, 3, 5, 4, 8, 7, 6, 11, 10, 9, 12, 14, 13)
_UNV_WEDGE15 = (0, 2, 4, 9, 11, 13, 1, 3, 5, 10, 12, 14, 6, 7, 8)
_GMSH_PYRAMID13 = (0, 1, 2, 3, 4, 5, 8, 10, 6, 7, 9, 11, 12)
_MED_PYRAMID13 = (0, 3, 2, 1, 4, 8, 7, 6, 5, 9, 12, 11, 10)
_GMSH_TET10 = (0, 1, 2, 3, 4, 5, 6, 7, 9, 8)
_MED_HEX20 = (0, 3, 2, 1, 4, 7, 6, 5, 11, 10, 9, 8, 15, 14, 13, 12, 16, 19, 18, 17)
_MED_HEX27 = (*_MED_HEX20, 21, 23, 24, 22, 20, 25, 26)
_MED_TET10 = (0, 2, 1, 3, 6, 5, 4, 7, 9, 8)
_UNV_HEX20 = (0, 2, 4, 6, 12, 14, 16, 18, 1, 3, 5, 7, 13, 15, 17, 19, 8, 9, 10, 11)  # ring after ring
_UNV_TET10 = (0, 2, 4, 9, 1, 3, 5, 6, 7, 8)
_NASTRAN_HEX20 = (*range(12), 16, 17, 18, 19, 12, 13, 14, 15)  # the uprights before the top ring
_ASTER_HEX27 = (*_NASTRAN_HEX20, 24, 22, 21, 23, 20, 25, 26)
_ABAQUS_HEX27 = (*range(20), 26, 24, 23, 25, 21, 22, 20)  # the middle, then the faces S1 to S6

ORDERS: dict[str, dict[str, tuple[int, ...]]] = {
    "hexahedron": {"med": _MED_HEX20[:8]},
    "hexahedron20": {
        "gmsh": _GMSH_HEX20,
        "nastran": _NASTRAN_HEX20,
        "aster": _NASTRAN_HEX20,
        "med": _MED_HEX20,
        "unv": _UNV_HEX20,
    },
    "hexahedron27": {"gmsh": _GMSH_HEX27, "abaqus": _ABAQUS_HEX27, "aster": _ASTER_HEX27, "med": _MED_HEX27},
    "tetra": {"med": _MED_TET10[:4]},
    "tetra10": {"gmsh": _GMSH_TET10, "med": _MED_TET10, "unv": _UNV_TET10},
    "wedge": {"med": _MED_WEDGE15[:6]},
    "wedge15": {
        "gmsh": _GMSH_WEDGE15,
        "nastran": _NASTRAN_WEDGE15,
        "aster": _NASTRAN_WEDGE15,
        "med": _MED_WEDGE15,
        "unv": _UNV_WEDGE15,
    },
    "pyramid": {"med": _MED_PYRAMID13[:5]},
    "pyramid13": {"gmsh": _GMSH_PYRAMID13, "med": _MED_PYRAMID13},
    "quad8": {"unv": (0, 2, 4, 6, 1, 3, 5, 7)},
    "triangle6": {"unv": (0, 2, 4, 1, 3, 5)},
}
