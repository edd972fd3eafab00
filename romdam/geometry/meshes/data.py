"""A mesh as it stands in a file: nodes and elements with the file's numbers, checked and counted from 0."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from romdam.core.errors import MeshError, quote
from romdam.core.scene import Floats, Ints
from romdam.geometry.elements import CELLS, ELEMENT_OF_CELL, SOLIDS, jacobians

LARGEST = 2e9  # bytes of a mesh file
_FARTHEST = 1e12  # of a coordinate, in whatever unit: beyond it squares and cubes lose all digits
_LOOSE_SHARE, _LOOSE_NUMBER = 0.1, 3  # of nodes in no element: above both, elements are missing


@dataclass(frozen=True)
class Cells:
    """Elements of one kind.

    Attributes
    ----------
    kind : a key of `romdam.geometry.elements.CELLS`
    nodes : (n, nodes per element) in the VTK order; the file's numbers, or from 0 once they are checked
    ids : (n,) the elements' numbers in the file
    """

    kind: str
    nodes: Ints
    ids: Ints

    @property
    def dim(self) -> int:
        """Dimension of the elements."""
        return CELLS[self.kind].dim


Groups = dict[str, list[Ints]]


@dataclass(frozen=True)
class MeshFile:
    """Content of a mesh file.

    Attributes
    ----------
    points : (n, 3) in the file's unit
    tags : (n,) the nodes' numbers in the file
    cells : elements, kind by kind
    groups : label -> element numbers in every one of `cells`; a label is a name, or a number as text
    node_sets : label -> node numbers
    numbers : label -> the other label of the same group (gmsh: number as text -> name)
    remarks : what was in the file and has not been used, and what of it is odd; for warnings
    """

    points: Floats
    tags: Ints
    cells: list[Cells]
    groups: Groups = field(default_factory=dict)
    node_sets: dict[str, Ints] = field(default_factory=dict)
    numbers: dict[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()


def checked_mesh(tags: Ints, points: Floats, cells: list[Cells], location: str) -> MeshFile:
    """Number nodes from 0, once every number is given once, every position is finite and every node known.

    Parameters
    ----------
    tags, points : (n,) and (n, 3) of the nodes, in the file's order
    cells : with the file's node numbers
    location : file and key, for messages

    Raises
    ------
    MeshError
    """
    if not len(points):
        raise MeshError(f"{location} has no nodes; export the mesh anew")
    _refuse_repeated(tags, "node", location)
    far = np.flatnonzero(~(np.abs(points) <= _FARTHEST).all(axis=1))
    if len(far):
        at = ", ".join(f"{x:.6g}" for x in points[far[0]])
        raise MeshError(
            f"{location}: node {tags[far[0]]} is at ({at}), expected finite coordinates up to {_FARTHEST:g} "
            f"({len(far)} such nodes); repair the file"
        )
    if cells:
        _refuse_repeated(np.concatenate([c.ids for c in cells]), "element", location)
    order = np.argsort(tags, kind="stable")
    known, numbered = tags[order], []
    for c in cells:
        rank = np.minimum(np.searchsorted(known, c.nodes), len(known) - 1)
        lost = np.argwhere(known[rank] != c.nodes)
        if len(lost):
            row, column = lost[0]
            raise MeshError(
                f"{location}: elements use node {c.nodes[row, column]}, which is not given (the first is "
                f"element {c.ids[row]}, {c.kind}; {len(lost)} such uses); repair the file"
            )
        numbered.append(replace(c, nodes=np.asarray(order[rank], dtype=np.int64)))
    for c in numbered:
        nodes = np.sort(c.nodes, axis=1)
        twice = np.flatnonzero((nodes[:, 1:] == nodes[:, :-1]).any(axis=1))
        if c.dim == 3 and len(twice):
            raise MeshError(
                f"{location}: element {c.ids[twice[0]]} ({c.kind}) names a node twice ({len(twice)} such "
                "elements, limit 0): it is collapsed; mesh with full hexahedra or tetrahedra"
            )
    return MeshFile(points, tags, numbered, remarks=_remarks(tags, points, numbered, location))


def _refuse_repeated(numbers: Ints, what: str, location: str) -> None:
    distinct, counts = np.unique(numbers, return_counts=True)
    twice = distinct[counts > 1]
    if len(twice):
        raise MeshError(
            f"{location}: {what} {twice[0]} is given twice (several parts?), limit once "
            f"({len(twice)} such numbers); renumber, or merge the parts into one flat mesh with sets"
        )


def _remarks(tags: Ints, points: Floats, cells: list[Cells], location: str) -> tuple[str, ...]:
    """Remarks on nodes that no element uses; raises where these are so many that elements are missing."""
    taken = np.zeros(len(tags), dtype=bool)
    for block in cells:
        taken[block.nodes] = True
    loose = tags[~taken]
    if len(loose) > max(_LOOSE_NUMBER, _LOOSE_SHARE * len(tags)):
        raise MeshError(
            f"{location}: {len(loose)} of {len(tags)} nodes belong to no element (the first is {loose[0]}), "
            f"limit {100 * _LOOSE_SHARE:g} %: elements are missing, or the file was cut; export it anew, "
            "without unused nodes"
        )
    if not len(loose):
        return ()
    at = ", ".join(f"{x:.6g}" for x in points[np.argmin(taken)])
    return (
        f"node {loose[0]} (at ({at}) in the file's unit) belongs to no element and is left out "
        f"({len(loose)} such nodes)",
    )


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


def by_number(
    mesh: MeshFile, elements: dict[str, Ints], nodes: dict[str, Ints]
) -> tuple[Groups, dict[str, Ints]]:
    """Groups of elements and sets of nodes that name their members by the file's numbers.

    Raises
    ------
    ValueError
        for members that are not given.
    """
    every = np.concatenate([np.zeros(0, np.int64), *(c.ids for c in mesh.cells)])
    for what, sets, known in (("element", elements, every), ("node", nodes, mesh.tags)):
        for name, members in sets.items():
            lost = members[~np.isin(members, known)]
            if len(lost):
                raise ValueError(
                    f"group {name!r} has {what} {lost[0]}, which is not given ({len(lost)} such members): "
                    "the file was cut, or has lost them"
                )
    order = np.argsort(mesh.tags, kind="stable")
    groups = {
        n: [np.flatnonzero(np.isin(c.ids, members)) for c in mesh.cells] for n, members in elements.items()
    }
    return groups, {n: order[np.searchsorted(mesh.tags[order], members)] for n, members in nodes.items()}


def turned(mesh: MeshFile, kinds: Sequence[str]) -> MeshFile:
    """Turn elements of some kinds that are inside out, for formats whose writers differ on what is outside.

    MED's order of nodes is the mirror image of VTK's, edges and facets included.
    """
    cells, remarks = [], []
    for block in mesh.cells:
        if block.dim == 3 and block.kind in kinds and block.kind in ELEMENT_OF_CELL:
            element = ELEMENT_OF_CELL[block.kind]
            centre = element.nodes[: element.corners].mean(axis=0)[None]
            wrong = np.linalg.det(jacobians(mesh.points, block.nodes, element, centre)[:, 0]) < 0.0
            if wrong.any():
                mirrored = block.nodes[:, np.argsort(element.cell.orders["med"])]
                block = replace(block, nodes=np.where(wrong[:, None], mirrored, block.nodes))
                remarks.append(
                    f"{wrong.sum()} of {len(wrong)} {block.kind} are inside out in the order of nodes that "
                    "the format has, and have been turned"
                )
        cells.append(block)
    return replace(mesh, cells=cells, remarks=(*mesh.remarks, *remarks))


def missing_ids(cells: list[Cells]) -> tuple[str, ...]:
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
    article = "an" if kind[0] in "aeiou" else "a"
    return MeshError(
        f"{location} cannot be read as {article} {kind} file ({why}); supported "
        f"solid elements are {', '.join(SOLIDS)}; export the mesh anew"
    )


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
