"""MED, the mesh files of SALOME and code_aster, versions 2.1 to 4.

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

from romdam.core.errors import MeshError, ResultError, listed, quote
from romdam.core.scene import Floats, Ints
from romdam.core.sealed import reading_foreign
from romdam.geometry.elements import CELLS
from romdam.geometry.meshes.cells import Cells
from romdam.geometry.meshes.data import EVERYTHING, Groups, MeshFile, cannot_be_read, checked_mesh

if TYPE_CHECKING:
    import h5py

_TYPES = {cell.med: cell for cell in CELLS.values() if cell.med}
_UNREAD = {"POE": "polyhedra", "POE2": "polyhedra", "OCT": "hexagonal prisms", "O12": "hexagonal prisms"}
_METRES = {"", "m", "meter", "metre", "SI"}


@dataclass
class _Content:
    """Content read so far; families are numbers that stand for the groups of an element or node."""

    points: Floats
    node_family: Ints
    cells: list[Cells] = field(default_factory=list)
    families: list[Ints] = field(default_factory=list)  # of every one of `cells`
    remarks: list[str] = field(default_factory=list)
    unread: dict[str, Ints] = field(default_factory=dict)  # what solids of a type are -> their families


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
            if not len(file.get("ENS_MAA", ())):
                raise MeshError("it is an HDF5 file without meshes, ENS_MAA")
            wrong = {name: _not_of_space(mesh) for name, mesh in file["ENS_MAA"].items()}
            solid = [name for name, why in wrong.items() if not why]
            if not solid:
                reasons = (f"{quote(name)} {why}" for name, why in wrong.items())
                raise MeshError(f"it has no unstructured mesh in x, y and z: {', '.join(reasons)}")
            if len(solid) > 1:  # a mesh of an interface has facets alone
                solid = [name for name in solid if _has_solids(file["ENS_MAA"][name])] or solid
            if len(solid) > 1:
                raise MeshError(f"it has {len(solid)} meshes of solids, {listed(solid)}, limit one")
            (name,) = solid
            mesh = file["ENS_MAA"][name]
            content = _mesh(mesh)
            if len(wrong) > 1:
                content.remarks.append(f"of its {len(wrong)} meshes {quote(name)} is read")
            families = mesh.get("FAS", file.get(f"FAS/{name}", {}))
            unsound: dict[str, str] = {}
            groups = _members(families.get("ELEME"), content.families, unsound)
            _refuse_unread(families.get("ELEME"), content.unread, unsound)
            nodes = _members(families.get("NOEUD"), [content.node_family], unsound)
    except (ResultError, MeshError) as error:
        raise cannot_be_read(location, "MED", str(error).removeprefix(f"{path}: ")) from None
    tags = np.arange(1, len(content.points) + 1)
    checked = checked_mesh(tags, content.points, content.cells, location)
    return replace(
        checked,
        groups=groups,
        node_sets={label: node_members[0] for label, node_members in nodes.items()},
        remarks=(*checked.remarks, *content.remarks, *sorted(set(unsound.values()))),
        unsound=unsound,
    )


def _not_of_space(mesh: h5py.Group) -> str:
    """Say why a mesh is not an unstructured one of three dimensions; empty where it is."""
    dimension = mesh.attrs.get("ESP", mesh.attrs.get("DIM"))
    if dimension is None:
        return "does not state its dimension, DIM"
    if int(dimension) != 3:
        return f"has {int(dimension)} dimensions"
    return "is structured" if int(mesh.attrs.get("TYP", 0)) else ""


def _steps(mesh: h5py.Group) -> list[h5py.Group]:
    """The time steps of a mesh; version 2 has none, and the mesh is its own."""
    return [mesh] if "NOE" in mesh else [step for step in mesh.values() if "NOE" in step]


def _has_solids(mesh: h5py.Group) -> bool:
    kinds = {kind for step in _steps(mesh) for kind in step.get("MAI", ())}
    return any(kind in _UNREAD or (kind in _TYPES and _TYPES[kind].dim == 3) for kind in kinds)


def _mesh(mesh: h5py.Group) -> _Content:
    name = quote(mesh.name.rpartition("/")[2])
    steps = _steps(mesh)
    if not steps:
        raise MeshError(f"its mesh {name} has no nodes, NOE")
    if len(steps) != 1:
        raise MeshError(f"its mesh {name} has {len(steps)} time steps ({', '.join(mesh)}), limit one")
    (step,) = steps
    nodes = step["NOE"]
    for group, key, what in ((nodes, "COO", "coordinates of nodes"), (step, "MAI", "elements")):
        if key not in group:
            raise MeshError(f"its mesh {name} has no {what}, {key}")
    count = len(nodes["COO"]) // 3
    points = np.asarray(nodes["COO"], dtype=float).reshape(3, count).T
    content = _Content(points, _family(nodes, count, "nodes"))
    unit = _text(mesh.attrs.get("UNI", b""))[:16].strip()
    if unit not in _METRES:
        content.remarks.append(f"it says that its coordinates are in {quote(unit)}; they are read in `unit`")
    first = 1
    facets = step.get("FAC", {})  # version 2 has facets apart, or their families alone
    families = {kind: group for kind, group in facets.items() if "NOD" not in group and kind in step["MAI"]}
    apart = [(kind, group) for kind, group in facets.items() if kind not in families]
    for kind, group in [*step["MAI"].items(), *apart]:
        if kind in _UNREAD:
            content.unread[f"elements of type {kind} ({_UNREAD[kind]})"] = np.asarray(
                group.get("FAM", [0]), dtype=np.int64
            )
            continue
        if kind not in _TYPES:
            content.remarks.append(f"elements of type {kind} are left out")
            continue
        if "NOD" not in group:
            raise MeshError(f"its elements of type {kind} name no nodes, NOD")
        cell, flat = _TYPES[kind], np.asarray(group["NOD"], dtype=np.int64)
        count = int(group["NOD"].attrs.get("NBR", len(flat) // cell.nodes))
        if len(flat) != count * cell.nodes:
            raise MeshError(
                f"its type {kind} has {len(flat)} nodes of {count} elements of {cell.nodes}, in NOD"
            )
        table = cell.in_vtk_order(flat.reshape(cell.nodes, count).T, "med")
        content.cells.append(Cells(cell.name, table, np.arange(first, first + count)))
        family = _family(families.get(kind, group), count, f"elements of type {kind}")
        content.families.append(family)
        first += count
    return content


def _text(value: object) -> str:
    return value.decode("latin-1").strip("\0 ") if isinstance(value, bytes) else str(value)


def _family(group: h5py.Group, count: int, what: str) -> Ints:
    if "FAM" not in group:
        return np.zeros(count, dtype=np.int64)
    family = np.asarray(group["FAM"], dtype=np.int64)
    if len(family) != count:
        raise MeshError(f"it has {len(family)} families of {count} {what}, in FAM")
    return family


def _refuse_unread(table: h5py.Group | None, unread: dict[str, Ints], unsound: dict[str, str]) -> None:
    """Note the groups with solids that are not read, and all elements, as what no block may name."""
    for what, families in unread.items():
        reason = f"has solids that are not read, {what}"
        unsound[EVERYTHING] = reason
        for family in (table or {}).values():
            if "GRO" in family and np.isin(int(family.attrs["NUM"]), families):
                unsound |= {_text(name.tobytes()): reason for name in family["GRO/NOM"][:]}


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
