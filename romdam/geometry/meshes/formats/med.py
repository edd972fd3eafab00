"""MED, the mesh files of SALOME and code_aster, versions 2.2 to 4.

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
        for files that HDF5 cannot read, several meshes of solids, several time steps, and counts that do not
        fit.
    """
    location = f"{location}: {path}"
    try:
        with reading_foreign(path) as file:
            solid = {name: mesh for name, mesh in file["ENS_MAA"].items() if _of_space(mesh)}
            if len(solid) != 1:
                raise ValueError(
                    f"{len(solid)} of its meshes ({', '.join(file['ENS_MAA'])}) are unstructured and of "
                    "three dimensions, limit one"
                )
            ((name, mesh),) = solid.items()
            content = _mesh(mesh)
            if len(file["ENS_MAA"]) > 1:
                content.remarks.append(f"of its {len(file['ENS_MAA'])} meshes {quote(name)} is read")
            families = mesh.get("FAS", file.get(f"FAS/{name}", {}))
            unsound: dict[str, str] = {}
            groups = _members(families.get("ELEME"), content.families, unsound)
            nodes = _members(families.get("NOEUD"), [content.node_family], unsound)
    except (ResultError, ValueError) as error:
        raise cannot_be_read(location, "MED", str(error)) from None
    tags = np.arange(1, len(content.points) + 1)
    checked = checked_mesh(tags, content.points, content.cells, location)
    return replace(
        checked,
        groups=groups,
        node_sets={label: node_members[0] for label, node_members in nodes.items()},
        remarks=(*checked.remarks, *content.remarks, *sorted(set(unsound.values()))),
        unsound=unsound,
    )


def _of_space(mesh: h5py.Group) -> bool:
    """Tell whether a mesh is unstructured and of three dimensions."""
    return int(mesh.attrs.get("ESP", mesh.attrs["DIM"])) == 3 and int(mesh.attrs.get("TYP", 0)) == 0


def _mesh(mesh: h5py.Group) -> _Content:
    steps = [mesh] if "NOE" in mesh else list(mesh.values())  # version 2 has no time steps
    if len(steps) != 1:
        raise ValueError(f"its mesh has {len(steps)} time steps ({', '.join(mesh)}), limit one")
    (step,) = steps
    nodes = step["NOE"]
    count = len(nodes["COO"]) // 3
    points = np.asarray(nodes["COO"], dtype=float).reshape(3, count).T
    content = _Content(points, _family(nodes, count))
    unit = _text(mesh.attrs.get("UNI", b""))[:16].strip()
    if unit not in _METRES:
        content.remarks.append(f"it says that its coordinates are in {quote(unit)}; they are read in `unit`")
    first = 1
    for kind, group in [*step["MAI"].items(), *step.get("FAC", {}).items()]:  # version 2 has facets apart
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


def _members(table: h5py.Group | None, families: list[Ints], unsound: dict[str, str]) -> Groups:
    """Groups from the family of every element or node; a table names the groups of every family.

    Where it lacks a family, any group may have lost members, and all are unsound.
    """
    groups: dict[int, list[str]] = {0: []}
    for family in (table or {}).values():
        names = family["GRO/NOM"][:] if "GRO" in family else ()
        groups[int(family.attrs["NUM"])] = [_text(name.tobytes()) for name in names]
    lost = set(np.unique(np.concatenate([np.zeros(1, np.int64), *families])).tolist()) - set(groups)
    members: Groups = {}
    for name in sorted({name for names_of in groups.values() for name in names_of}):
        numbers = [number for number, names_of in groups.items() if name in names_of]
        members[name] = [np.flatnonzero(np.isin(family, numbers)) for family in families]
        if lost:
            unsound[name] = f"family {min(lost)} is used and not given ({len(lost)} such families)"
    return members
