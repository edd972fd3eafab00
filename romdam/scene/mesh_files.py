"""Blocks read from mesh files: gmsh .msh, Nastran .bdf/.nas, Abaqus .inp and .vtu, through meshio."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from romdam.config.models import MeshFileConfig
from romdam.config.quantities import to_si
from romdam.errors import ConfigError, MeshError
from romdam.scene.elements import ELEMENTS
from romdam.scene.facets import boundary_facets
from romdam.scene.mesh_groups import MeshFile, read_mesh_file
from romdam.scene.model import Block, Ints, Material
from romdam.scene.quality import refuse_bad_cells

log = logging.getLogger(__name__)

SOLIDS = {"tetra": "tet4", "tetra10": "tet10", "hexahedron": "hex8", "hexahedron20": "hex20"}
_FACET_CORNERS = {"triangle": 3, "triangle6": 3, "quad": 4, "quad8": 4, "quad9": 4}


def mesh_file_block(name: str, config: MeshFileConfig, material: Material, folder: Path, place: str) -> Block:
    """Read the cells of one group of a mesh file, in metres; nodes of other groups are left out.

    Groups of facets (gmsh physical surfaces, Nastran shells by property, Abaqus shell element sets,
    VTU cell values) become faces where they lie on the block's boundary; so do Abaqus node sets, as
    the facets whose corners all belong to the set.

    Parameters
    ----------
    folder : where a relative path starts
    place : file and key, for messages

    Raises
    ------
    ConfigError
        for an unknown length unit.
    MeshError
        for a file that cannot be read, a missing group, unsupported or inverted elements.
    """
    path = folder / config.file
    scale = _metres(config.unit, place)
    file = read_mesh_file(path, f"{place}.file")
    members = _members(file, config.group, path, place)
    element, cells = _cells(file, members, path, place)
    _name_loose_nodes(file, path, place)
    used, local = np.unique(cells, return_inverse=True)
    points = np.asarray(file.mesh.points, dtype=float)[used] * scale
    cells = local.reshape(cells.shape)
    number = np.full(len(file.mesh.points), -1)
    number[used] = np.arange(len(used))
    faces = _faces(file, boundary_facets(cells, element), number, ELEMENTS[element].facets)
    block = Block(name, element, points, cells, material, faces)
    refuse_bad_cells(block, f"{place}.file: {path}")
    return block


def _name_loose_nodes(file: MeshFile, path: Path, place: str) -> None:
    """Log which nodes of a file no element uses: they are left out."""
    taken = np.zeros(len(file.mesh.points), dtype=bool)
    for block in file.mesh.cells:
        taken[np.asarray(block.data)] = True
    loose = np.flatnonzero(~taken)
    if len(loose):
        at = ", ".join(f"{x:.6g}" for x in file.mesh.points[loose[0]])
        log.warning(
            "%s.file: %s: node %d (counted from 0, at (%s) in the file's unit) belongs to no element and is "
            "left out (%d such nodes)",
            place, path, loose[0], at, len(loose),
        )  # fmt: skip


def _metres(unit: str, place: str) -> float:
    try:
        return to_si(f"1 {unit}", "m")
    except ValueError as error:
        raise ConfigError(f"{place}.unit: {error}") from None


def _members(file: MeshFile, group: str | int | None, path: Path, place: str) -> list[Ints]:
    """Cell numbers of the group in every block of the file."""
    if group is None:
        return [np.arange(len(block.data)) for block in file.mesh.cells]
    label = str(group)
    label = (
        label
        if label in file.groups and _solids(file, file.groups[label])
        else file.numbers.get(label, label)
    )
    if label not in file.groups or not _solids(file, file.groups[label]):
        known = [g for g, members in file.groups.items() if _solids(file, members)]
        what = "holds no solid elements" if label in file.groups else "does not exist"
        raise MeshError(
            f"{place}.group: group {group!r} {what} in {path}; groups of solid elements are "
            f"{', '.join(known) or 'none: leave `group` out to take all elements'}"
        )
    return file.groups[label]


def _solids(file: MeshFile, members: list[Ints]) -> int:
    return sum(len(m) for m, block in zip(members, file.mesh.cells, strict=True) if block.dim == 3)


def _cells(file: MeshFile, members: list[Ints], path: Path, place: str) -> tuple[str, Ints]:
    """The block's element and its cells, in the file's node numbers."""
    found: dict[str, list[Ints]] = {}
    for m, block in zip(members, file.mesh.cells, strict=True):
        if block.dim == 3 and len(m):
            found.setdefault(block.type, []).append(np.asarray(block.data, dtype=np.int64)[m])
    counts = {kind: sum(map(len, cells)) for kind, cells in found.items()}
    listed = ", ".join(f"{count} {kind}" for kind, count in counts.items()) or "no solid elements"
    if not set(counts) <= set(SOLIDS) or not counts:
        raise MeshError(
            f"{place}.file: {path} has {listed} in this block; supported are {', '.join(SOLIDS)} "
            "(8- and 20-node hexahedra, 4- and 10-node tetrahedra); mesh the part with one of these"
        )
    if len(counts) > 1:
        raise MeshError(
            f"{place}.file: {path} mixes elements in this block ({listed}), limit one kind per block; "
            "put each kind into a group and a block of its own, tied by joints, or mesh with one kind"
        )
    kind, cells = next(iter(found.items()))
    return SOLIDS[kind], np.concatenate(cells)


def _faces(
    file: MeshFile, boundary: Ints, number: Ints, table: tuple[tuple[int, ...], ...]
) -> dict[str, Ints]:
    """Named facets on the block's boundary, outward; `number` maps the file's nodes to the block's."""
    corners = 3 if len(table[0]) in (3, 6) else 4
    keys = np.sort(boundary[:, :corners], axis=1)
    index = {tuple(key): f for f, key in enumerate(keys.tolist())}
    faces = {}
    for label, members in file.groups.items():
        found = {
            index.get(tuple(key), -1)
            for m, block in zip(members, file.mesh.cells, strict=True)
            if _FACET_CORNERS.get(block.type) == corners
            for key in np.sort(number[np.asarray(block.data)[m][:, :corners]], axis=1).tolist()
        }
        if chosen := sorted(found - {-1}):
            faces[label] = boundary[chosen]
    for label, nodes in file.node_sets.items():
        inside = np.isin(keys, number[np.asarray(nodes, dtype=np.int64)]).all(axis=1)
        if inside.any():
            faces.setdefault(label, boundary[inside])
    return faces
