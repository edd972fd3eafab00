"""Blocks read from mesh files, of the formats in `FORMATS`.

A reader gives a `MeshFile`: all nodes, and elements kind by kind (solids, and facets of surfaces), with
groups of both. A block takes the solid elements of one group, or of all, or of one body of them. These are
its `members`: element numbers in every kind of the file. Its nodes are those of its elements, counted anew.
Groups of facets and sets of nodes become its named faces, where they lie on its boundary. Wrong elements are
refused where a block takes them; what else is odd in a file is a remark.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from romdam.config.quantities import to_si
from romdam.config.sections.geometry.mesh_file import BlockMeshConfig, MeshFileConfig
from romdam.core.errors import MeshError
from romdam.core.files import check_file
from romdam.core.scene import Block, Bools, Ints, Material
from romdam.geometry.elements import ELEMENT_OF_CELL, ELEMENTS, SOLIDS, facet_frame
from romdam.geometry.facets import all_facets, boundary_facets, facet_keys, row_numbers
from romdam.geometry.meshes.bodies import Bodies, bodies_text, find_bodies
from romdam.geometry.meshes.data import EVERYTHING, LARGEST, MeshFile, Numbered
from romdam.geometry.meshes.formats.abaqus import read_abaqus
from romdam.geometry.meshes.formats.ansys import read_ansys
from romdam.geometry.meshes.formats.aster import read_aster
from romdam.geometry.meshes.formats.gmsh import read_gmsh
from romdam.geometry.meshes.formats.med import read_med
from romdam.geometry.meshes.formats.nastran import read_nastran
from romdam.geometry.meshes.formats.stl import read_stl
from romdam.geometry.meshes.formats.unv import read_unv
from romdam.geometry.meshes.formats.vtu import read_vtu
from romdam.geometry.meshes.interfaces import without_interfaces
from romdam.geometry.meshes.kinds import facets_by_kind, mixed_cells
from romdam.geometry.meshes.quality import refuse_bad_cells
from romdam.geometry.meshes.refinement import refine

FORMATS: dict[str, Callable[[Path, str], MeshFile]] = {
    ".msh": read_gmsh,
    ".bdf": read_nastran,
    ".nas": read_nastran,
    ".dat": read_nastran,
    ".inp": read_abaqus,
    ".med": read_med,
    ".unv": read_unv,
    ".mail": read_aster,
    ".cdb": read_ansys,
    ".vtu": read_vtu,
    ".stl": read_stl,
}


class MeshFiles:
    """The mesh files of a scene: each is read once, and `unused` says what of it no block has taken.

    Parameters
    ----------
    folder : at which relative paths start

    Attributes
    ----------
    remarks : what in the files has not been used and what of them is odd, for the result
    node_numbers : block -> (n,) the file's numbers of its nodes; not of refined blocks
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.remarks: list[str] = []
        self.node_numbers: dict[str, Ints] = {}
        self._read: dict[Path, MeshFile] = {}
        self._used: dict[Path, list[Bools]] = {}
        self._bodies: dict[tuple[Path, str], Bodies] = {}

    def bodies(self, config: MeshFileConfig, location: str) -> Bodies:
        """The bodies of one group of a file; their boxes are in the file's unit.

        Raises
        ------
        MeshError
            for a file that cannot be read, and a missing group.
        """
        path = self.folder / config.file
        file = self._file(path, location)
        label, members = _members(file, config.group, path, location)
        if (path, label) not in self._bodies:
            if not _solid_count(file, members):
                raise MeshError(f"{location}.file: {path} has no solid elements, and so no bodies")
            self._bodies[path, label] = find_bodies(file, members)
        return self._bodies[path, label]

    def blocks(self, name: str, config: BlockMeshConfig, material: Material, location: str) -> list[Block]:
        """The blocks of one section: one of its name, or one for each body.

        Raises
        ------
        MeshError
            as `block`, and for another number of bodies than names of them.
        """
        if not config.names:
            return [self.block(name, config, material, location)]
        bodies = self.bodies(config, location)
        if len(bodies.boxes) != len(config.names):
            raise MeshError(
                f"{location}.bodies: {self.folder / config.file} has {bodies.counted} in this block, and "
                f"{len(config.names)} are named: {bodies_text(bodies.boxes)}, in the file's unit"
            )
        return [
            self.block(body, config.model_copy(update={"body": number}), material, location)
            for number, body in enumerate(config.names, 1)
        ]

    def block(self, name: str, config: MeshFileConfig, material: Material, location: str) -> Block:
        """Make a block of the cells of one group of a file, in metres; nodes of other groups are left out.

        Groups of facets (gmsh physical surfaces, Nastran shells by property, Abaqus shell element sets,
        VTU cell values) become faces where they lie on the block's boundary; so do Abaqus node sets, as
        the facets whose corners all belong to the set.

        Parameters
        ----------
        location : file and key, for messages

        Raises
        ------
        MeshError
            for a file that cannot be read, a missing group, unsupported, inverted or overlapping elements.
        """
        path = self.folder / config.file
        scale = to_si(f"1 {config.unit}", "m")
        file = self._file(path, location)
        if name in file.groups and _solid_count(file, file.groups[name]) and str(config.group) != name:
            taken = "all groups" if config.group is None else f"group {config.group!r}"
            self.remarks.append(f"{path}: block {name!r} takes {taken}, and there is a group {name!r} too")
        label, members = _members(file, config.group, path, location)
        if config.body is not None:
            bodies = self.bodies(config, location)
            if config.body > len(bodies.boxes):
                raise MeshError(
                    f"{location}.body: {path} has {bodies.counted} in this block, no number {config.body}: "
                    f"{bodies_text(bodies.boxes)}, in the file's unit"
                )
            members = bodies.members(config.body, members)
        file.refuse_unsound(label, members, 3, f"{location}.file: {path}")
        if label != EVERYTHING and label in file.left_out:
            self.remarks.append(f"{path}: group {label!r} holds {file.left_out[label]} too, left out")
        for used, members_of in zip(self._used[path], members, strict=True):
            used[members_of] = True
        element, cells = _cells(file, members, file.left_out.get(label, ""), f"{location}.file: {path}")
        nodes, local = np.unique(cells, return_inverse=True)
        cells = local.reshape(cells.shape)
        number = np.full(len(file.points) + 1, -1)  # the last entry is for -1: a node that the file lacks
        number[nodes] = np.arange(len(nodes))
        faces = _faces(file, boundary_facets(cells, element), number)
        block = Block(
            name,
            element,
            file.points[nodes] * scale,
            cells,
            material,
            faces,
            unsound_faces=file.unsound_faces,
        )
        refuse_bad_cells(block, f"{location}.file: {path}")
        if not config.refine:
            self.node_numbers[name] = np.asarray(file.tags)[nodes]
        for _ in range(config.refine):
            block = refine(block, f"{location}.refine")
        return block

    def _file(self, path: Path, location: str) -> MeshFile:
        """A file, which is read when it is asked for the first time."""
        if path not in self._read:
            file = self._read[path] = read_mesh_file(path, f"{location}.file")
            self._used[path] = [np.zeros(len(c.ids), dtype=bool) for c in file.cells]
            self.remarks += [f"{path}: {remark}" for remark in file.remarks]
        return self._read[path]

    def numbered(self, config: MeshFileConfig) -> Numbered:
        """The numbers and positions [m] of all nodes in the file of a block that has been made."""
        file = self._read[self.folder / config.file]
        return Numbered(file.tags, file.points * to_si(f"1 {config.unit}", "m"), file.frames)

    def unused(self) -> list[str]:
        """Say which solid elements of the files belong to no block."""
        remarks = []
        for path, file in self._read.items():
            solid = [(c, u) for c, u in zip(file.cells, self._used[path], strict=True) if c.dim == 3]
            total = sum(len(u) for _, u in solid)
            left = {c.kind: int((~u).sum()) for c, u in solid if not u.all()}
            if left:
                groups = []
                for label, members in file.groups.items():
                    uses = zip(members, file.cells, self._used[path], strict=True)
                    if any((~u[m]).any() for m, c, u in uses if c.dim == 3):
                        groups.append(label)
                remarks.append(
                    f"{path}: {sum(left.values())} of its {total} solid elements "
                    f"({', '.join(f'{n} {kind}' for kind, n in left.items())}) belong to no block; groups of "
                    f"them: {', '.join(groups) or 'none'}"
                )
        return remarks


def read_mesh_file(path: Path, location: str) -> MeshFile:
    """Read a file of one of `FORMATS`.

    Raises
    ------
    MeshError
        for a file that is missing, no file, too large, of another format, or damaged. What a job need not
        name is left out with a remark, and refused where the job names it (`MeshFile.refuse_unsound`).
    """
    read = FORMATS.get(path.suffix.lower())
    if read is None:
        raise MeshError(f"{location}: {path} is of no known format; known endings are {', '.join(FORMATS)}")
    try:
        check_file(path, LARGEST, MeshError)
        file = read(path, location)
    except OSError as error:
        raise MeshError(f"{location}: {path} cannot be read ({error})") from None
    except MeshError as error:
        if not path.exists():
            raise MeshError(
                f"{location}: no mesh file {path}; give its path relative to the configuration file"
            ) from None
        text = str(error)
        raise MeshError(text if text.startswith(location) else f"{location}: {text}") from None
    return _with_facets(without_interfaces(file))


def _with_facets(file: MeshFile) -> MeshFile:
    """The file with its groups of facets judged: which are unsound as faces, and remarks on them.

    A group is unsound as a face if one of its facets has a fault, or lies across solid elements: they have
    all its corners, and none has it as a face. If facets lie apart from solid elements, that is a remark.
    """
    remarks, unsound = list[str](), dict[str, str]()
    solid = np.zeros(len(file.points) + 1, dtype=bool)
    for cells in file.cells:
        if cells.dim == 3:
            solid[cells.nodes] = True
    solid[-1] = False  # the entry of -1: nodes that the file lacks
    if not solid.any():  # a surface
        return file
    for fault in file.faults:
        for label, rows_of in file.groups.items():
            if file.cells[fault.kind].dim == 2 and np.isin(fault.rows, rows_of[fault.kind]).any():
                unsound[label] = fault.reason
    corners_of = {
        k: cells.nodes[:, : ELEMENT_OF_CELL[cells.kind].corners]
        for k, cells in enumerate(file.cells)
        if cells.dim == 2
    }
    on_faces: dict[int, Bools] = {}
    for width in {corner.shape[1] for corner in corners_of.values()}:
        kinds = [k for k, corner in corners_of.items() if corner.shape[1] == width]
        ends = np.cumsum([len(corners_of[k]) for k in kinds])[:-1]
        on = _on_faces(file, np.concatenate([corners_of[k] for k in kinds]))
        on_faces |= dict(zip(kinds, np.split(on, ends), strict=True))
    for k, corner in corners_of.items():
        cells, off = file.cells[k], ~on_faces[k]
        members = {label: members_of[k] for label, members_of in file.groups.items() if len(members_of[k])}
        for label, members_of in members.items():
            lost = members_of[off[members_of]]
            bad = lost[solid[corner[lost]].all(axis=1)]
            if len(bad):
                unsound[label] = (
                    f"element {cells.ids[bad[0]]} ({cells.kind}) is no face of a solid element, whose "
                    f"corners it has ({len(bad)} such elements, limit 0)"
                )
                remarks.append(f"group {label!r}: {unsound[label]}; no key may name it as a face")
            elif len(lost):
                remarks.append(
                    f"{len(lost)} of {len(members_of)} {cells.kind} of group {label!r} lie on no solid "
                    "element"
                )
    return replace(
        file,
        remarks=(*file.remarks, *remarks),
        unsound_faces=file.unsound | file.unsound_faces | unsound,
    )


def _on_faces(file: MeshFile, corners: Ints) -> Bools:
    """True for facets, by their corners (n, 3 or 4), that are faces of a solid element."""
    width = corners.shape[1]
    rows = [np.sort(corners, axis=1)]
    for cells in file.cells:
        element = ELEMENT_OF_CELL.get(cells.kind)
        if cells.dim == 3 and element is not None:
            facets = all_facets(cells.nodes, element.name)[0][:, : ELEMENTS[element.facet].corners]
            rows += [
                np.sort(facet_nodes, axis=1)
                for _, facet_nodes, _ in facets_by_kind(facets)
                if facet_nodes.shape[1] == width
            ]
        elif cells.dim == 3:
            return np.ones(len(corners), dtype=bool)  # faces of a kind that is not read
    number = row_numbers(np.concatenate(rows))
    return np.isin(number[: len(corners)], number[len(corners) :])


def _members(file: MeshFile, group: str | int | None, path: Path, location: str) -> tuple[str, list[Ints]]:
    """Label of a group of solid elements, and its element numbers in every kind of the file.

    A group is asked for by its label or by the other label that `MeshFile.numbers` has for it.

    Raises
    ------
    MeshError
        for a group that does not exist, or has no solid elements.
    """
    if group is None:
        return EVERYTHING, [np.arange(len(c.ids)) for c in file.cells]
    label = str(group)
    if label not in file.groups or not _solid_count(file, file.groups[label]):
        label = file.numbers.get(label, label)
    if label not in file.groups or not _solid_count(file, file.groups[label]):
        known = [g for g, members in file.groups.items() if _solid_count(file, members)]
        what = "holds no solid elements" if label in file.groups else "does not exist"
        raise MeshError(
            f"{location}.group: group {group!r} {what} in {path}; groups of solid elements are "
            f"{', '.join(known) or 'none: leave `group` out to take all elements'}"
        )
    return label, file.groups[label]


def _solid_count(file: MeshFile, members: list[Ints]) -> int:
    """Number of solid elements among some elements of every kind."""
    return sum(len(m) for m, cells in zip(members, file.cells, strict=True) if cells.dim == 3)


def _cells(file: MeshFile, members: list[Ints], left_out: str, location: str) -> tuple[str, Ints]:
    """The block's element and its cells (n, nodes of the element), by positions of nodes in the file.

    Raises
    ------
    MeshError
        for kinds of elements that no block is made of, or that do not go together in one.
    """
    kinds: dict[str, list[Ints]] = {}
    for m, cells in zip(members, file.cells, strict=True):
        if cells.dim == 3 and len(m):
            kinds.setdefault(cells.kind, []).append(cells.nodes[m])
    counts = {kind: sum(map(len, cells)) for kind, cells in kinds.items()}
    listed = ", ".join(f"{count} {kind}" for kind, count in counts.items()) or "no solid elements"
    if not set(counts) <= set(ELEMENT_OF_CELL) or not counts:
        known = ", ".join(f"{element.cell.name} ({name})" for name, element in SOLIDS.items())
        raise MeshError(
            f"{location} has {listed} in this block{f' (left out: {left_out})' if left_out else ''}; "
            f"supported are {known}; mesh the part with one of these"
        )
    tables = {kind: np.concatenate(cell_nodes) for kind, cell_nodes in kinds.items()}
    if len(tables) == 1:
        kind, cell_nodes = next(iter(tables.items()))
        return ELEMENT_OF_CELL[kind].name, cell_nodes
    if not (mixed := mixed_cells(tables)):
        raise MeshError(
            f"{location} mixes elements in this block ({listed}); a block takes linear elements "
            "or those with mid-edge nodes, hexahedron27 apart; let `mesh.bodies: auto` make a block of each, "
            "with ties or joints, or put the others into groups and blocks of their own"
        )
    return mixed


def _faces(file: MeshFile, boundary: Ints, number: Ints) -> dict[str, Ints]:
    """Named faces of a block: those of its boundary's facets that a group of facets, or a set of nodes, has.

    Parameters
    ----------
    boundary : (nf, nodes per facet) facets of the block's boundary, outward, in the block's nodes
    number : (nodes of the file + 1,) number in the block of every node of the file, -1 for other nodes
    """
    width = facet_frame(boundary).corners
    keys = facet_keys(boundary[:, :width])
    index = {tuple(key): f for f, key in enumerate(keys.tolist())}
    faces = {}
    for label, members in file.groups.items():
        if label in file.unsound_faces:
            continue
        numbers: set[int] = set()
        for m, cells in zip(members, file.cells, strict=True):
            if cells.dim != 2 or (count := ELEMENT_OF_CELL[cells.kind].corners) > width:
                continue
            corners = number[cells.nodes[m][:, :count]]
            # a triangle among quadrilaterals is a collapsed quadrilateral
            padded = np.pad(corners, ((0, 0), (0, width - count)), mode="edge")
            numbers |= {index.get(tuple(key), -1) for key in facet_keys(padded).tolist()}
        if chosen := sorted(numbers - {-1}):
            faces[label] = boundary[chosen]
    for label, nodes in file.node_sets.items():
        if label in file.unsound_faces:
            continue
        inside = np.isin(keys, number[nodes]).all(axis=1)
        if inside.any():
            faces.setdefault(label, boundary[inside])
    return faces
