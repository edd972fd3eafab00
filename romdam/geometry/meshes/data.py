"""A mesh as it stands in a file: nodes and elements with the file's numbers, checked and counted from 0."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from romdam.core.errors import MeshError, quote
from romdam.core.scene import Bools, Floats, Ints
from romdam.geometry.elements import ELEMENT_OF_CELL, jacobians
from romdam.geometry.meshes.cells import Cells
from romdam.geometry.meshes.middles import with_middles

LARGEST = 2e9  # bytes of a mesh file
_FARTHEST = 1e12  # of a coordinate, in whatever unit: beyond it squares and cubes lose all digits


Groups = dict[str, list[Ints]]
EVERYTHING = ""  # in place of the label of a group: all elements of a file


@dataclass(frozen=True)
class Fault:
    """Elements of one kind that no block can take.

    Attributes
    ----------
    kind : position of the kind in `MeshFile.cells`
    rows : (n,) elements of that kind
    reason : names the first element
    """

    kind: int
    rows: Ints
    reason: str


@dataclass(frozen=True)
class Frame:
    """Axes along which a node moves that does not move along x, y and z.

    Attributes
    ----------
    system : number of its coordinate system in the file
    axes : (3, 3), one a row, in x, y, z; None where the file does not give the system
    """

    system: int
    axes: Floats | None = None


class Numbered(NamedTuple):
    """Numbers of nodes (n,), their positions (n, 3) [m], and the frames of those that have some."""

    number: Ints
    points: Floats
    frames: Mapping[int, Frame] = {}


@dataclass(frozen=True)
class MeshFile:
    """Content of a mesh file.

    Attributes
    ----------
    points : (n, 3) in the file's unit; NaN where a number is given at two positions or is not finite
    tags : (n,) the nodes' numbers in the file
    cells : elements, kind by kind; a node that the file does not give is -1, and the element has a fault
    groups : label -> element numbers in every one of `cells`; a label is a name, or a number as text
    node_sets : label -> node numbers
    numbers : label -> the other label of the same group (gmsh: number as text -> name)
    remarks : what was in the file and has not been used, and what of it is odd; for warnings
    faults : elements that a job must not name
    unsound : label, or `EVERYTHING` -> why a job must not name it
    unsound_faces : label -> why a job must not name it as a face
    left_out : label, or `EVERYTHING` -> types of its elements that no block is made of, and how many
    frames : number of a node whose displacement is not along x, y, z -> along what, for matrices
    """

    points: Floats
    tags: Ints
    cells: list[Cells]
    groups: Groups = field(default_factory=dict)
    node_sets: dict[str, Ints] = field(default_factory=dict)
    numbers: dict[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    faults: tuple[Fault, ...] = ()
    unsound: dict[str, str] = field(default_factory=dict)
    unsound_faces: dict[str, str] = field(default_factory=dict)
    left_out: dict[str, str] = field(default_factory=dict)
    frames: dict[int, Frame] = field(default_factory=dict)

    def refuse_unsound(self, label: str, members: list[Ints], dim: int, location: str) -> None:
        """Refuse a group, or `EVERYTHING`, that a job names and that is not sound.

        Parameters
        ----------
        members : numbers of elements in every one of `cells`
        dim : of the elements that count
        location : file and key, for messages

        Raises
        ------
        MeshError
        """
        reasons = [self.unsound[label]] if label in self.unsound else []
        reasons += [
            fault.reason
            for fault in self.faults
            if self.cells[fault.kind].dim == dim and np.isin(fault.rows, members[fault.kind]).any()
        ]
        if reasons:
            what = "" if label == EVERYTHING else f"group {quote(label)}: "
            raise MeshError(f"{location}: {what}{reasons[0]}; repair the file, or name a group without them")


def checked_mesh(tags: Ints, points: Floats, cells: list[Cells], location: str) -> MeshFile:
    """Number nodes from 0, turn elements that are inside out, and note those that no block can take.

    These are elements of nodes that are not given, given at two positions or not finite, solids that name a
    node twice, and elements whose number is given twice. Nodes that no element uses are left out.

    Parameters
    ----------
    tags, points : (n,) and (n, 3) of the nodes, in the file's order
    cells : with the file's node numbers
    location : file and key, for messages

    Raises
    ------
    MeshError
        for a file without nodes.
    """
    if not len(points):
        raise MeshError(f"{location} has no nodes; export the mesh anew")
    tags, points, cells, remarks_of_middles = with_middles(tags, points, cells)
    far: Bools = np.asarray(~(np.abs(points) <= _FARTHEST).all(axis=1))
    _, first, same = np.unique(tags, return_index=True, return_inverse=True)
    moved = np.isin(tags, tags[(points != points[first[same]]).any(axis=1) & ~far])
    kept, remarks = np.sort(first), list(remarks_of_middles)
    if len(kept) < len(tags):
        remarks.append(f"{len(tags) - len(kept)} of {len(tags)} nodes are given again; the first counts")
    tags, far, moved = tags[kept], far[kept], moved[kept]
    points = np.where((moved | far)[:, None], np.nan, points[kept])
    order = np.argsort(tags, kind="stable")
    known = tags[order]
    ids, counts = np.unique(
        np.concatenate([np.zeros(0, np.int64), *(c.ids for c in cells)]), return_counts=True
    )
    again = ids[counts > 1]
    numbered, faults = [], []
    for kind, c in enumerate(cells):
        rank = np.minimum(np.searchsorted(known, c.nodes), len(known) - 1)
        lost = known[rank] != c.nodes
        nodes = np.where(lost, -1, order[rank])
        ordered = np.sort(c.nodes, axis=1)
        repeated: Bools = (ordered[:, 1:] == ordered[:, :-1]) & (c.dim == 3)
        for wrong, what in (
            (lost, "uses node {node}, which is not given"),
            (moved[nodes] & ~lost, "uses node {node}, which is given twice, at two positions"),
            (far[nodes] & ~lost, f"uses node {{node}}, expected finite coordinates up to {_FARTHEST:g}"),
            (repeated, "names a node twice: it is collapsed; mesh with full hexahedra or tetrahedra"),
            (np.isin(c.ids, again)[:, None], "has a number that is given twice"),
        ):
            rows = np.flatnonzero(wrong.any(axis=1))
            if len(rows):
                row = rows[0]
                text = what.format(node=c.nodes[row, np.argmax(wrong[row])])
                reason = f"element {c.ids[row]} ({c.kind}) {text} ({len(rows)} such elements, limit 0)"
                faults.append(Fault(kind, rows, reason))
                remarks.append(f"{reason}; no block can take it")
        numbered.append(replace(c, nodes=np.asarray(nodes, dtype=np.int64)))
    used = np.zeros(len(tags) + 1, dtype=bool)  # the last is of nodes that are not given
    for c in numbered:
        used[c.nodes] = True
    loose = np.flatnonzero(~used[:-1])
    if len(loose):
        at = ", ".join(f"{x:.6g}" for x in points[loose[0]])
        remarks.append(
            f"node {tags[loose[0]]} (at ({at}) in the file's unit) belongs to no element and is left out "
            f"({len(loose)} such nodes of {len(tags)})"
        )
    return _turned(MeshFile(points, tags, numbered, remarks=tuple(remarks), faults=tuple(faults)))


def _turned(mesh: MeshFile) -> MeshFile:
    """Turn solids that are inside out.

    MED's order of nodes is the mirror image of VTK's, edges and facets included.
    """
    cells, remarks = [], []
    for block in mesh.cells:
        if block.dim == 3 and block.kind in ELEMENT_OF_CELL:
            element = ELEMENT_OF_CELL[block.kind]
            centre = element.nodes[: element.corners].mean(axis=0)[None]
            with np.errstate(all="ignore"):  # of nodes that are not finite
                volume = np.linalg.det(jacobians(mesh.points, block.nodes, element, centre)[:, 0])
            wrong = volume < 0.0
            if wrong.any():
                mirrored = block.nodes[:, np.argsort(element.cell.orders["med"])]
                block = replace(block, nodes=np.where(wrong[:, None], mirrored, block.nodes))
                remarks.append(
                    f"{wrong.sum()} of {len(wrong)} {block.kind} are inside out in the order of nodes that "
                    f"the format has, and have been turned (the first is element {block.ids[wrong][0]})"
                )
        cells.append(block)
    return replace(mesh, cells=cells, remarks=(*mesh.remarks, *remarks))


def by_value(values: list[Ints]) -> Groups:
    """Groups of elements with the same value.

    Parameters
    ----------
    values : of every element, kind by kind
    """
    nothing = np.zeros(0, dtype=np.int64)
    groups: Groups = {}
    for k, values_of in enumerate(values):
        order = np.argsort(values_of, kind="stable")
        present, start = np.unique(values_of[order], return_index=True)
        for value, members in zip(present.tolist(), np.split(order, start[1:]), strict=False):
            groups.setdefault(str(value), [nothing] * len(values))[k] = members
    return dict(sorted(groups.items(), key=lambda item: int(item[0])))


def grouped(
    mesh: MeshFile,
    elements: dict[str, Ints],
    nodes: dict[str, Ints],
    left_out: dict[str, Ints] | None = None,
    unread: dict[str, Ints] | None = None,
) -> MeshFile:
    """A mesh with groups of elements and sets of nodes that name their members by the file's numbers.

    Parameters
    ----------
    elements, nodes : label -> numbers of its members
    left_out : type -> numbers of the elements of types that no block is made of
    unread : type -> numbers of solids that cannot be read, which no block may name
    """
    left_out, unread = left_out or {}, unread or {}
    every = np.concatenate([np.zeros(0, np.int64), *(c.ids for c in mesh.cells)])
    known = np.concatenate([every, *left_out.values(), *unread.values()])
    unsound, lost_of, left_of = dict[str, str](), dict[str, str](), dict[str, str]()
    for what, sets, given in (("element", elements, known), ("node", nodes, mesh.tags)):
        for label, members in sets.items():
            lost = members[~np.isin(members, given)]
            if len(lost):
                lost_of[label] = (
                    f"has {what} {lost[0]}, which is not given ({len(lost)} such members, limit 0)"
                )
    for label, members in (elements | {EVERYTHING: known}).items():
        if types := _of_types(members, unread):
            unsound[label] = f"has solids that are not read ({types})"
        if types := _of_types(members, left_out):
            left_of[label] = types
    remarks = []
    if types := _of_types(known, left_out | unread):
        remarks.append(f"elements that no block is made of are left out ({types})")
    if lost_of:
        label, reason = next(iter(lost_of.items()))
        remarks.append(f"group {label!r} {reason}; {len(lost_of)} such groups, which no key may name")
    order = np.argsort(mesh.tags, kind="stable")
    node_sets = {}
    for label, members in nodes.items():
        members = members[np.isin(members, mesh.tags)]
        node_sets[label] = order[np.searchsorted(mesh.tags[order], members)]
    return replace(
        mesh,
        groups={
            n: [np.flatnonzero(np.isin(c.ids, members)) for c in mesh.cells]
            for n, members in elements.items()
        },
        node_sets=node_sets,
        remarks=(*mesh.remarks, *remarks),
        unsound=unsound | lost_of,
        left_out=left_of,
    )


def _of_types(members: Ints, types: dict[str, Ints]) -> str:
    counts = {name: int(np.isin(numbers, members).sum()) for name, numbers in sorted(types.items())}
    return ", ".join(f"{count} {name}" for name, count in counts.items() if count)


def missing_ids(cells: Sequence[Cells]) -> tuple[str, ...]:
    """A remark on numbers left out among the elements', for formats that do not say how many there are."""
    ids = np.unique(np.concatenate([c.ids for c in cells])) if cells else np.zeros(0, int)
    steps = np.diff(ids)
    if not len(ids) or steps.max(initial=1) == 1:
        return ()
    first = int(ids[np.argmax(steps > 1)]) + 1
    return (
        f"elements are numbered {ids[0]} to {ids[-1]}, and {ids[-1] - ids[0] + 1 - len(ids)} of these "
        f"numbers are not given (the first is {first}); the format does not say how many there are",
    )


def cannot_be_read(location: str, kind: str, why: str) -> MeshError:
    """The error for a damaged file; `location` is its key and path."""
    article = "an" if kind[0].lower() in "aei" else "a"
    return MeshError(f"{location} cannot be read as {article} {kind} file ({why}); export the mesh anew")


def numbers_of(words: Sequence[bytes | str], what: str) -> Floats:
    """Words as numbers.

    Raises
    ------
    ValueError
        naming the first word that is none.
    """
    try:
        return np.fromiter(map(float, words), dtype=float, count=len(words))
    except ValueError:
        for number, word in enumerate(words, start=1):
            try:
                float(word)
            except ValueError:
                text = word.decode(errors="replace") if isinstance(word, bytes) else word
                raise ValueError(f"number {number} of {what} is {quote(text)}") from None
        raise
