"""MED, the mesh files of SALOME and code_aster, versions 3 and 4.

Read here and not by meshlane 5.5, which opens any HDF5 file in its caller's process, where damaged bytes may
kill it.

Solids are numbered the other way round from VTK's: `Cell.orders` has what Gmsh 4.15 writes, which is what
meshlane has from MEDCoupling's faces. Files in VTK's order are in use, so elements that are inside out are
turned.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from romdam.core.errors import ResultError, quote
from romdam.core.scene import Floats, Ints
from romdam.core.sealed import reading_foreign
from romdam.geometry.elements import CELLS
from romdam.geometry.meshes.data import Cells, Groups, MeshFile, cannot_be_read, checked_mesh

if TYPE_CHECKING:
    import h5py

_TYPES = {cell.med: cell for cell in CELLS.values() if cell.med}
_METRES = {"", "m", "meter", "metre", "SI"}


@dataclass
class _Content:
    """Content read so far; families are numbers that stand for the groups of an element or node."""

    points: Floats
    node_family: Ints
    cells: list[Cells] = field(default_factory=list)
    families: list[Ints] = field(default_factory=list)  # of every one of `cells`
    remarks: list[str] = field(default_factory=list)


def read_med(path: Path, location: str) -> MeshFile:
    """Read the one mesh of a MED file; groups of elements and nodes by name.

    Raises
    ------
    MeshError
        for files that HDF5 cannot read, several meshes, several time steps, and counts that do not fit.
    """
    location = f"{location}: {path}"
    try:
        with reading_foreign(path) as file:
            name, mesh = _only(file["ENS_MAA"], "mesh")
            content = _mesh(mesh)
            groups = _members(file.get(f"FAS/{name}/ELEME"), content.families)
            nodes = _members(file.get(f"FAS/{name}/NOEUD"), [content.node_family])
    except (ResultError, ValueError) as error:
        raise cannot_be_read(location, "MED", str(error)) from None
    tags = np.arange(1, len(content.points) + 1)
    checked = checked_mesh(tags, content.points, content.cells, location)
    return replace(
        checked,
        groups=groups,
        node_sets={label: node_members[0] for label, node_members in nodes.items()},
        remarks=(*checked.remarks, *content.remarks),
    )


def _only(group: h5py.Group, what: str) -> tuple[str, h5py.Group]:
    names = list(group)
    if len(names) != 1:
        raise ValueError(f"it holds {len(names)} of a {what} ({', '.join(names)}), limit one")
    return names[0], group[names[0]]


def _mesh(mesh: h5py.Group) -> _Content:
    if int(mesh.attrs["ESP"]) != 3 or int(mesh.attrs.get("TYP", 0)) != 0:
        raise ValueError("its mesh is structured, or not one of three dimensions")
    _, step = _only(mesh, "time step")
    nodes = step["NOE"]
    count = len(nodes["COO"]) // 3
    points = np.asarray(nodes["COO"], dtype=float).reshape(3, count).T
    content = _Content(points, _family(nodes, count))
    unit = _text(mesh.attrs.get("UNI", b""))[:16].strip()
    if unit not in _METRES:
        content.remarks.append(f"it says that its coordinates are in {quote(unit)}; they are read in `unit`")
    first = 1
    for kind, group in step["MAI"].items():
        if kind not in _TYPES:
            content.remarks.append(f"elements of type {kind} are left out")
            continue
        cell, flat = _TYPES[kind], np.asarray(group["NOD"], dtype=np.int64)
        count = int(group["NOD"].attrs.get("NBR", len(flat) // cell.nodes))
        if len(flat) != count * cell.nodes:
            raise ValueError(f"{group.name} has {len(flat)} nodes of {count} elements of {cell.nodes}")
        table = cell.in_vtk_order(flat.reshape(cell.nodes, count).T, "med")
        content.cells.append(Cells(cell.name, table, np.arange(first, first + count)))
        content.families.append(_family(group, count))
        first += count
    return content


def _text(value: object) -> str:
    return value.decode("latin-1").strip("\0 ") if isinstance(value, bytes) else str(value)


def _family(group: h5py.Group, count: int) -> Ints:
    if "FAM" not in group:
        return np.zeros(count, dtype=np.int64)
    family = np.asarray(group["FAM"], dtype=np.int64)
    if len(family) != count:
        raise ValueError(f"{group.name}/FAM has {len(family)} families of {count}")
    return family


def _members(table: h5py.Group | None, families: list[Ints]) -> Groups:
    """Groups from the family of every element or node; a table names the groups of every family."""
    groups: dict[int, list[str]] = {0: []}
    for family in (table or {}).values():
        names = family["GRO/NOM"][:] if "GRO" in family else ()
        groups[int(family.attrs["NUM"])] = [_text(name.tobytes()) for name in names]
    lost = set(np.unique(np.concatenate([np.zeros(1, np.int64), *families])).tolist()) - set(groups)
    if lost:
        raise ValueError(f"family {min(lost)} is used and not given ({len(lost)} such families)")
    members: Groups = {}
    for name in sorted({name for names_of in groups.values() for name in names_of}):
        numbers = [number for number, names_of in groups.items() if name in names_of]
        members[name] = [np.flatnonzero(np.isin(family, numbers)) for family in families]
    return members
