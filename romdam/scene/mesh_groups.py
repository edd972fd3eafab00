"""Files of four formats -> cells and labelled groups of cells, whatever the format calls them."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree.ElementTree import ParseError

import numpy as np

from romdam.errors import MeshError
from romdam.scene.abaqus import read_abaqus
from romdam.scene.model import Ints

if TYPE_CHECKING:
    import meshio

FORMATS = {
    ".msh": "gmsh",
    ".bdf": "nastran",
    ".nas": "nastran",
    ".dat": "nastran",
    ".inp": "abaqus",
    ".vtu": "vtu",
}
_UNREADABLE = (  # what meshio's readers let through on a damaged file
    OSError,
    ValueError,
    LookupError,
    TypeError,
    AttributeError,
    AssertionError,
    RuntimeError,
    EOFError,
    ParseError,
    struct.error,
    zlib.error,
)
_PREFERRED = ("gmsh:physical", "nastran:ref", "medit:ref", "group", "region", "material", "CellEntityIds")

Groups = dict[str, list[Ints]]


@dataclass(frozen=True)
class MeshFile:
    """A mesh as it is in its file.

    Attributes
    ----------
    mesh : points, and cells in blocks of one type each, in the VTK order
    groups : label -> cell numbers in every one of the blocks; a label is a name, or a number as text
    node_sets : label -> node numbers
    numbers : label -> the other label of the same group (gmsh: number as text -> name)
    """

    mesh: meshio.Mesh
    groups: Groups
    node_sets: dict[str, Ints]
    numbers: dict[str, str]


def read_mesh_file(path: Path, place: str) -> MeshFile:
    """Read a gmsh, Nastran, Abaqus or VTU file.

    Raises
    ------
    MeshError
        for a file that is missing, of another format or damaged, and for what meshio would misread.
    """
    kind = FORMATS.get(path.suffix.lower())
    if kind is None:
        raise MeshError(f"{place}: {path} is of no known format; known endings are {', '.join(FORMATS)}")
    if not path.is_file():
        raise MeshError(f"{place}: no mesh file {path}; give its path relative to the configuration file")
    if kind == "abaqus":
        return MeshFile(*read_abaqus(path, place), {})
    mesh = _read(path, kind, place)
    if kind == "nastran":
        _check_nastran(path, mesh, place)
        return MeshFile(mesh, _by_value(mesh, "nastran:ref"), {}, {})
    if kind == "gmsh":
        return _gmsh_groups(mesh)
    return MeshFile(mesh, _by_value(mesh, _integer_array(mesh, path, place)), {}, {})


def _read(path: Path, kind: str, place: str) -> meshio.Mesh:
    import meshio
    from meshio import gmsh, nastran, vtu  # not meshio.read, which ends the process on an error

    try:
        if kind == "nastran":
            return nastran._nastran.read_buffer(StringIO(_bulk_data(path.read_text(errors="replace"))))
        return (gmsh if kind == "gmsh" else vtu).read(path)
    except (meshio.ReadError, *_UNREADABLE) as error:
        why = " ".join(str(error).split()) or type(error).__name__
        raise MeshError(
            f"{place}: {path} cannot be read as a {kind} file ({why}); supported solid elements are "
            "8- and 20-node hexahedra and 4- and 10-node tetrahedra; export the mesh anew, or as .msh or .vtu"
        ) from None


def _bulk_data(text: str) -> str:
    """Nastran bulk data between the lines that meshio waits for; partial decks lack them."""
    lines = text.expandtabs(8).splitlines()
    begin = next((k for k, line in enumerate(lines) if line.strip().upper().startswith("BEGIN BULK")), -1)
    end = next((k for k, line in enumerate(lines) if line.upper().startswith("ENDDATA")), len(lines))
    return "\n".join(["BEGIN BULK", *lines[begin + 1 : end], "ENDDATA", ""])


def _by_value(mesh: meshio.Mesh, key: str | None) -> Groups:
    """Groups from integer cell data: the label is the value."""
    data = [np.asarray(values) for values in mesh.cell_data.get(key, [])]
    present = sorted({int(v) for values in data for v in np.unique(values)})
    return {str(value): [np.flatnonzero(values == value) for values in data] for value in present}


def _gmsh_groups(mesh: meshio.Mesh) -> MeshFile:
    by_number = _by_value(mesh, "gmsh:physical")
    groups: Groups = {}
    numbers: dict[str, str] = {}
    dimensions = [block.dim for block in mesh.cells]
    names = {(int(number), int(dim)): name for name, (number, dim) in mesh.field_data.items()}
    for label, members in by_number.items():
        for dim in (2, 3):
            own = [m if d == dim else m[:0] for m, d in zip(members, dimensions, strict=True)]
            name = names.get((int(label), dim), label)
            if any(len(m) for m in own) and label != "0":
                groups[name] = own if name not in groups else _union(groups[name], own)
                if dim == 3:
                    numbers[label] = name
    return MeshFile(mesh, groups, {}, numbers)


def _union(a: list[Ints], b: list[Ints]) -> list[Ints]:
    return [np.union1d(x, y) for x, y in zip(a, b, strict=True)]


def _integer_array(mesh: meshio.Mesh, path: Path, place: str) -> str | None:
    """The integer cell array that holds the groups of a VTU file; None if there is none."""
    names = [
        name
        for name, values in mesh.cell_data.items()
        if not name.startswith("vtk")
        and all(np.asarray(v).dtype.kind in "iu" and np.ndim(v) == 1 for v in values)
    ]
    chosen = [name for name in _PREFERRED if name in names] or names
    if len(names) > 1 and chosen is names:
        raise MeshError(
            f"{place}: {path} has {len(names)} integer cell arrays ({', '.join(names)}) and none is named "
            f"{' or '.join(_PREFERRED[3:6])}; rename the one that holds the groups"
        )
    return chosen[0] if chosen else None


def _check_nastran(path: Path, mesh: meshio.Mesh, place: str) -> None:
    """Refuse what meshio passes over in silence."""
    solids = ("CHEXA", "CTETRA", "CPENTA", "CPYRA")
    written = sum(line.upper().startswith(solids) for line in path.read_text(errors="replace").splitlines())
    found = sum(len(block.data) for block in mesh.cells if block.dim == 3)
    if written != found:
        raise MeshError(
            f"{place}: {path} has {written} solid elements but {found} can be read; "
            "write elements in small or free field format (CHEXA, not CHEXA*)"
        )
    systems = np.unique(mesh.point_data.get("nastran:ref", 0))
    if systems.any():
        raise MeshError(
            f"{place}: {path} gives grid points in coordinate system {int(systems.max())}, limit 0 "
            "(the basic one); export with basic coordinates"
        )
