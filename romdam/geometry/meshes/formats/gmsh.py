"""Gmsh's .msh, versions 1, 2.2, 4.0 and 4.1, as text and binary.

A file is a sequence of sections, each from $Name to $EndName. Elements belong to entities (points, curves,
surfaces, volumes of the geometry), and entities to physical groups, which become the groups of the mesh:

- 4.0 and 4.1: $Entities gives every entity's groups, and $Nodes and $Elements are in blocks of one entity.
- 2.2: $Elements has for every element its number, type, and tags, of which the first is a physical group and
  the second the entity. An element of an entity in two groups stands there twice.
- 1: $NOD and $ELM, which always give group and entity. They are read as sections of 2.2.

$PhysicalNames names the groups. Text is a sequence of numbers; in binary, how long a section is follows from
its own counts alone.

Read here and not by meshio 5.3, which takes the last of two nodes with one tag, another node for a tag that
is not given, what numbers there are for a count that is larger, and the first physical group of several.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np

from romdam.core.errors import quote
from romdam.core.scene import Floats, Ints
from romdam.geometry.elements import CELLS
from romdam.geometry.facets import row_numbers
from romdam.geometry.meshes.cells import Cells
from romdam.geometry.meshes.data import EVERYTHING, Groups, MeshFile, cannot_be_read, checked_mesh
from romdam.geometry.meshes.formats.gmsh_numbers import Bytes, GmshLayout, Numbers, Words, counts, whole

_TYPES = {cell.gmsh: cell for cell in CELLS.values() if cell.gmsh is not None}
# Nodes of Gmsh's other types, which no block is made of (GmshDefines.h): of high order, and incomplete ones.
_SIZES = {
    13: 18, 14: 14, 20: 9, 21: 10, 22: 12, 23: 15, 24: 15, 25: 21, 26: 4, 27: 5, 28: 6, 29: 20, 30: 35,
    31: 56, 36: 16, 37: 25, 38: 36, 39: 12, 40: 16, 41: 20, 42: 28, 43: 36, 90: 40, 91: 75, 92: 64, 93: 125,
    118: 30, 119: 55,
}  # fmt: skip
_ANY = -1  # stands for the dimension of a named group where version 2.0 gives none
_EXPORT = "save it from gmsh with Mesh.MshFileVersion = 4.1"


@dataclass
class _Content:
    """Content read so far; the lists of nodes and of elements have an array for every block that was read."""

    tags: list[Ints] = field(default_factory=list)
    points: list[Floats] = field(default_factory=list)
    cells: list[Cells] = field(default_factory=list)
    physical: list[dict[int, Ints]] = field(default_factory=list)  # for each of `cells`: group -> rows
    entities: dict[tuple[int, int], list[int]] | None = None  # (dim, tag) -> groups, in 4.0 and 4.1
    # for each of `cells`, before 4.0: entity, group, and a number that elements of the same nodes share
    origin: list[Ints] = field(default_factory=list)
    names: dict[tuple[int, int], str] = field(default_factory=dict)  # (dim, group) -> name
    left_out: Counter[int] = field(default_factory=Counter)  # type -> elements that no block is made of
    seen: set[str] = field(default_factory=set)

    def read_entities(self, stream: Numbers, of_point: int = 3) -> None:
        """Read $Entities: the groups of every entity.

        A point has `of_point` coordinates, any other entity the six of its box. The numbers behind the groups
        are the entities on its boundary, which are not needed.
        """
        self.entities = {}
        for dim, count in enumerate(counts(stream, 4, "size")):
            for _ in range(count):
                (tag,) = counts(stream, 1)
                stream.floats(6 if dim else of_point)
                groups = [abs(g) for g in counts(stream, counts(stream, 1, "size")[0])]
                if dim:
                    stream.ints(counts(stream, 1, "size")[0], "int")
                if (dim, tag) in self.entities:
                    raise ValueError(f"$Entities gives entity {tag} of dimension {dim} twice")
                self.entities[dim, tag] = groups

    def read_nodes_41(self, stream: Numbers) -> None:
        """Read $Nodes of version 4.1."""
        blocks, total, *_ = counts(stream, 4, "size")
        for _ in range(blocks):
            dim, _, parametric = counts(stream, 3)
            (count,) = counts(stream, 1, "size")
            self.tags.append(stream.ints(count, "size"))
            width = 3 + (dim if parametric else 0)
            self.points.append(stream.floats(count * width).reshape(count, width)[:, :3])
        _compare(sum(map(len, self.tags)), total, "Nodes")

    def read_nodes_40(self, stream: Numbers) -> None:
        """Read $Nodes of version 4.0, where every node's number stands before its coordinates."""
        blocks, total = counts(stream, 2, "size")
        for _ in range(blocks):
            _, dim, parametric = counts(stream, 3)
            (count,) = counts(stream, 1, "size")
            self.add_nodes(stream, count, 3 + (dim if parametric else 0))
        _compare(sum(map(len, self.tags)), total, "Nodes")

    def read_elements_41(self, stream: Numbers, tag_first: bool = False) -> None:
        """Read $Elements of version 4.1, or of 4.0, where the entity's tag stands before its dimension."""
        blocks, total, *_ = counts(stream, 2 if tag_first else 4, "size")
        done = 0
        for _ in range(blocks):
            dim, tag, kind = counts(stream, 3)
            dim, tag = (tag, dim) if tag_first else (dim, tag)
            (count,) = counts(stream, 1, "size")
            size = _size(kind)
            number = "int" if tag_first else "size"
            rows = stream.ints(count * (1 + size), number).reshape(count, 1 + size)
            if self.entities is not None and (dim, tag) not in self.entities:
                raise ValueError(f"$Elements are of entity {tag} of dimension {dim}, which is not given")
            groups = (self.entities or {}).get((dim, tag), [])
            self.add(kind, rows[:, 0], rows[:, 1:], {g: np.arange(count) for g in groups})
            if kind in _TYPES and _TYPES[kind].dim != dim:
                raise ValueError(f"$Elements of type {kind} are of an entity of dimension {dim}")
            done += count
        _compare(done, total, "Elements")

    def add_nodes(self, stream: Numbers, count: int, width: int = 3) -> None:
        """Add nodes: number, then coordinates and perhaps parameters, `width` numbers."""
        if isinstance(stream, Bytes):
            raw = stream.records(count, [("tag", "int", 1), ("x", "float", width)])
            self.tags.append(raw["tag"].astype(np.int64).reshape(count))
            self.points.append(raw["x"].astype(float)[:, :3])
            return
        rows = stream.floats((1 + width) * count).reshape(count, 1 + width)
        self.tags.append(whole(rows[:, 0], "Nodes"))
        self.points.append(rows[:, 1:4])

    def read_nodes_22(self, stream: Numbers) -> None:
        """Read $Nodes of version 2.2."""
        self.add_nodes(stream, stream.count_line() if isinstance(stream, Bytes) else counts(stream, 1)[0])

    def read_elements_22(self, stream: Numbers) -> None:
        """Read $Elements of version 2.2.

        Elements differ in length, so that they are found one by one, and then taken by type and number of
        tags together.
        """
        if isinstance(stream, Bytes):
            self.read_elements_22_binary(stream)
            return
        assert isinstance(stream, Words)
        (total,) = counts(stream, 1)
        numbers = whole(stream.numbers, "Elements")
        flat, at = numbers.tolist(), 1
        starts: dict[tuple[int, int], list[int]] = {}
        for k in range(total):
            if at + 3 > len(flat):
                raise ValueError(f"$Elements ends after {k} of {total} elements: the file was cut")
            kind, tags = flat[at + 1], flat[at + 2]
            if tags < 0:
                raise ValueError(f"$Elements gives element {flat[at]} {tags} tags")
            starts.setdefault((kind, tags), []).append(at)
            at += 3 + tags + _size(kind)
        stream.at = 1
        stream.ints(at - 1, "int")  # takes them from the stream, and refuses a section that was cut
        for (kind, tags), firsts in starts.items():
            rows = numbers[np.array(firsts)[:, None] + np.arange(3 + tags + _size(kind))]
            self.add_22(kind, np.delete(rows, [1, 2], axis=1), tags)
        self.refuse_mixed_entities()

    def read_elements_22_binary(self, stream: Bytes) -> None:
        """Read $Elements of version 2.2 from bytes.

        A header has type, count and number of tags of the elements that follow; some writers put one before
        every element.
        """
        total, done = stream.count_line(), 0
        rows: dict[tuple[int, int], list[Ints]] = {}
        while done < total:
            kind, count, tags = counts(stream, 3)
            if count < 1 or tags < 0:
                raise ValueError(f"$Elements has a header of {count} elements with {tags} tags")
            width = 1 + tags + _size(kind)
            rows.setdefault((kind, tags), []).append(stream.ints(count * width, "int").reshape(count, width))
            done += count
        _compare(done, total, "Elements")
        for (kind, tags), parts in rows.items():
            self.add_22(kind, np.concatenate(parts), tags)
        self.refuse_mixed_entities()

    def read_elements_1(self, stream: Numbers) -> None:
        """Read $ELM of version 1: number, type, physical group, entity, count of nodes and nodes."""
        rows: dict[int, list[list[int]]] = {}
        for _ in range(counts(stream, 1)[0]):
            number, kind, group, entity, count = counts(stream, 5)
            if count != _size(kind):
                raise ValueError(f"$ELM gives element {number} of type {kind} {count} nodes")
            rows.setdefault(kind, []).append([number, group, entity, *counts(stream, count)])
        for kind, elements in rows.items():
            self.add_22(kind, np.array(elements, dtype=np.int64), 2)

    def add_22(self, kind: int, rows: Ints, tags: int) -> None:
        """Add elements of a type.

        Parameters
        ----------
        rows : (n, 1 + tags + nodes) number, tags (physical group, entity, ...) and nodes
        """
        nothing = np.zeros(len(rows), dtype=np.int64)
        group = np.abs(rows[:, 1]) if tags else nothing
        groups = {int(g): np.flatnonzero(group == g) for g in np.unique(group) if g}
        self.add(kind, rows[:, 0], rows[:, 1 + tags :], groups)
        if kind in _TYPES:
            # numbers of nodes' sets, apart for every type
            same = row_numbers(np.sort(rows[:, 1 + tags :], axis=1)) + (len(self.cells) << 40)
            self.origin.append(np.stack([rows[:, 2] if tags > 1 else nothing, group, same], axis=1))

    def refuse_mixed_entities(self) -> None:
        """Refuse an entity that is partly in a group: an element has lost its group.

        A sound entity is in each of its groups as a whole, so it has as many elements as groups times
        elements of different nodes.
        """
        for dim in (2, 3):
            origins = [o for o, c in zip(self.origin, self.cells, strict=True) if c.dim == dim]
            rows = np.concatenate([np.zeros((0, 3), np.int64), *origins])
            entities = np.unique(rows[:, 0])
            if len(entities) < 2:
                continue  # written by what knows no entities
            for entity in entities:
                here = rows[rows[:, 0] == entity]
                groups, sizes = np.unique(here[:, 1], return_counts=True)
                if len(here) != len(groups) * len(np.unique(here[:, 2])):
                    listed = ", ".join(f"{n} in group {g}" for g, n in zip(groups, sizes, strict=True))
                    raise ValueError(
                        f"$Elements of entity {entity} of dimension {dim} are partly in one group "
                        f"({listed}); an entity is in a group as a whole"
                    )

    def add(self, kind: int, ids: Ints, nodes: Ints, groups: dict[int, Ints]) -> None:
        """Add elements of a kind, with the rows of every group."""
        if (cell := _TYPES.get(kind)) is None:
            self.left_out[kind] += len(ids)
            return
        self.cells.append(Cells(cell.name, cell.in_vtk_order(nodes, "gmsh"), ids))
        self.physical.append(groups)


def read_gmsh(path: Path, location: str) -> MeshFile:
    """Read a .msh file.

    Raises
    ------
    MeshError
        for what is damaged, of another version, partitioned, or contradicts itself.
    """
    location = f"{location}: {path}"
    try:
        content = _sections(path.read_bytes())
        mesh = checked_mesh(
            np.concatenate([np.zeros(0, np.int64), *content.tags]),
            np.vstack([np.zeros((0, 3)), *content.points]),
            content.cells,
            location,
        )
        return _grouped(mesh, content)
    except ValueError as error:
        raise cannot_be_read(location, "gmsh", str(error)) from None


def _sections(data: bytes) -> _Content:
    """Read the sections one after another, by the readers of the file's version; others are passed over."""
    # version 1 has no $MeshFormat, and other names
    for new, old in ((b"Nodes", b"NOD"), (b"Elements", b"ELM")) if data.lstrip().startswith(b"$NOD") else ():
        head = b"$MeshFormat\n1 0 8\n$EndMeshFormat\n" if new == b"Nodes" else b""
        data = data.replace(b"$" + old, head + b"$" + new).replace(b"$END" + old, b"$End" + new)
    content, at, layout, version = _Content(), 0, None, 0.0
    while (at := _past_blanks(data, at)) < len(data):
        end = data.find(b"\n", at)
        end = len(data) if end < 0 else end
        head = data[at:end].strip()
        name = head[1:].decode("latin-1")
        if not re.fullmatch(rb"\$[A-Za-z]+", head):
            raise ValueError(f"expected a section such as $Nodes, got {quote(head.decode('latin-1'))}")
        if name in content.seen and name in ("MeshFormat", "PhysicalNames", "Entities", "Nodes", "Elements"):
            raise ValueError(f"${name} is given twice")
        if not content.seen and name not in ("MeshFormat", "Comments"):
            raise ValueError("it does not begin with $MeshFormat")
        content.seen.add(name)
        stop = data.find(b"$End" + name.encode(), end)  # bytes may stand before it on its line
        if stop < 0:
            raise ValueError(f"${name} is not closed by $End{name}: the file was cut")
        if name == "MeshFormat":
            version, layout = _layout(data[end + 1 : stop])
        elif name == "PhysicalNames":
            content.names = _physical_names(data[end + 1 : stop])
        elif name.startswith("Partitioned"):
            raise ValueError("it is partitioned; save the mesh before it is partitioned")
        elif reader := _READERS.get((name, version)):
            if layout is None:
                words = Words(data[end + 1 : stop], name)
                reader(content, words)
                words.refuse_rest()
            else:  # where a section of bytes ends follows from its counts
                stream = Bytes(data, end + 1, name, layout)
                reader(content, stream)
                stop = stream.at
        at = _past_blanks(data, stop)
        end = data.find(b"\n", at)
        end = len(data) if end < 0 else end
        if data[at:end].strip() != b"$End" + name.encode():
            raise ValueError(f"${name} does not end with $End{name} where its counts say")
        at = end
    for name in ("Nodes", "Elements"):
        if name not in content.seen:
            raise ValueError(f"it has no ${name}")
    return content


def _past_blanks(data: bytes, at: int) -> int:
    while at < len(data) and data[at : at + 1].isspace():
        at += 1
    return at


def _layout(body: bytes) -> tuple[float, GmshLayout | None]:
    """Version, and byte order with the size of size_t; None for text."""
    words = body.split(None, 3)
    try:
        version, binary, size = float(words[0]), int(words[1]), int(words[2])
    except (ValueError, IndexError):
        raise ValueError("$MeshFormat does not give version, type and size") from None
    if (
        not (2.0 <= version <= 2.2 or version in (1.0, 4.0, 4.1))
        or binary not in (0, 1)
        or size not in (4, 8)
    ):
        raise ValueError(
            f"version {version:g}, type {binary}, size {size}; versions 2.2, 4.0 and 4.1 are read: {_EXPORT}"
        )
    version = 2.2 if version in (2.0, 2.1) else version
    if not binary:
        return version, None
    mark = body.partition(b"\n")[2][:4]
    if mark not in (b"\1\0\0\0", b"\0\0\0\1"):
        raise ValueError("its byte order cannot be told")
    return version, GmshLayout("<" if mark[0] else ">", size)


def _physical_names(body: bytes) -> dict[tuple[int, int], str]:
    """(dimension, group) -> name, after a line with their count."""
    lines = [line for line in body.decode("utf-8", errors="replace").splitlines() if line.strip()]
    names: dict[tuple[int, int], str] = {}
    for line in lines[1:]:
        match = re.fullmatch(r"""\s*(?:(\d+)\s+)?(\d+)\s*(["']?)(.*)\3\s*""", line)
        key = (int(match[1] or _ANY), int(match[2])) if match else (0, 0)
        if not match or key in names:
            raise ValueError(
                f"$PhysicalNames line {quote(line)} is no dimension, number and name, or a second"
            )
        names[key] = match[4]
    if not lines or int(lines[0]) != len(names):
        raise ValueError(f"$PhysicalNames lists {len(names)} names, and says {quote((lines or [''])[0])}")
    return names


def _size(kind: int) -> int:
    """Number of nodes of a type."""
    if kind not in _TYPES and kind not in _SIZES:
        raise ValueError(f"element type {kind} is not known")
    return _TYPES[kind].nodes if kind in _TYPES else _SIZES[kind]


def _compare(count: int, said: int, name: str) -> None:
    """Refuse a section that holds another number than it says."""
    if count != said:
        raise ValueError(f"${name} holds {count}, and says {said}")


_READERS: dict[tuple[str, float], Callable[[_Content, Numbers], None]] = {
    ("Nodes", 1.0): _Content.read_nodes_22,
    ("Elements", 1.0): _Content.read_elements_1,
    ("Entities", 4.0): partial(_Content.read_entities, of_point=6),
    ("Nodes", 4.0): _Content.read_nodes_40,
    ("Elements", 4.0): partial(_Content.read_elements_41, tag_first=True),
    ("Entities", 4.1): _Content.read_entities,
    ("Nodes", 4.1): _Content.read_nodes_41,
    ("Elements", 4.1): _Content.read_elements_41,
    ("Nodes", 2.2): _Content.read_nodes_22,
    ("Elements", 2.2): _Content.read_elements_22,
}


def _grouped(mesh: MeshFile, content: _Content) -> MeshFile:
    """The physical groups of faces and solids by name; one name may stand for a group of each dimension."""
    present = {(c.dim, g) for c, groups in zip(mesh.cells, content.physical, strict=True) for g in groups}
    empty = [name for key, name in content.names.items() if key[0] in (2, 3) and key not in present]
    remarks = list(mesh.remarks)
    if empty:
        remarks.append(f"group {empty[0]!r} is named and holds no elements ({len(empty)} such groups)")
    if content.left_out:
        listed = ", ".join(f"{count} of type {kind}" for kind, count in sorted(content.left_out.items()))
        remarks.append(f"elements that no block is made of are left out ({listed})")
    groups: Groups = {}
    numbers: dict[str, str] = {}
    for dim, number in sorted(present, key=lambda key: (key[1], key[0])):
        if dim not in (2, 3):
            continue
        name = content.names.get((dim, number)) or content.names.get((_ANY, number), str(number))
        rows = [  # of each of the mesh's tables of cells
            members.get(number, np.zeros(0, np.int64)) if c.dim == dim else np.zeros(0, np.int64)
            for c, members in zip(mesh.cells, content.physical, strict=True)
        ]
        groups[name] = (
            rows
            if name not in groups
            else [np.union1d(a, b) for a, b in zip(groups[name], rows, strict=True)]
        )
        if dim == 3:
            numbers[str(number)] = name
    left_out = {EVERYTHING: listed} if content.left_out else {}
    return replace(mesh, groups=groups, numbers=numbers, remarks=tuple(remarks), left_out=left_out)
