"""I-deas universal files (.unv): nodes, elements, groups, as SALOME, Gmsh, I-deas and Femap write them.

No library reads them with their groups. `_READ` has the datasets; others are left out.

References
----------
SDRC, Universal file datasets 15, 164, 752, 780, 781, 2411, 2412, 2417 to 2477. Quadratic elements are
numbered ring after ring, corners and middles in turn (`Cell.orders` has what Gmsh 4.15 writes).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from romdam.core.errors import quote
from romdam.core.files import file_text
from romdam.geometry.elements import CELLS
from romdam.geometry.meshes.cells import Cells
from romdam.geometry.meshes.data import (
    MeshFile,
    by_value,
    cannot_be_read,
    checked_mesh,
    grouped,
    missing_ids,
    numbers_of,
)

_CELLS = {number: cell for cell in CELLS.values() for number in cell.unv}
_BEAMS = {11, 21, 22, 23, 24}  # whose nodes have a line of orientation before them
_NODE, _ELEMENT = 7, 8  # codes of what a group has


class _Line(NamedTuple):
    """A line and its number in the file, from 1."""

    number: int
    text: str

    def whole(self, least: int) -> list[int]:
        """Whole numbers of ten columns each, or between blanks; at least so many."""
        words = [self.text[k : k + 10].strip() for k in range(0, len(self.text.rstrip()), 10)]
        words = words if all(map(_is_whole, words)) else self.text.split()
        if len(words) < least or not all(map(_is_whole, words)):
            raise ValueError(
                f"line {self.number}: {quote(self.text.strip())} is not {least} whole numbers or more"
            )
        return [int(word) for word in words]


Lines = list[_Line]


@dataclass
class _Content:
    """Content read so far."""

    tags: list[int] = field(default_factory=list)
    points: list[str] = field(default_factory=list)  # three words each
    rows: dict[str, list[list[int]]] = field(default_factory=dict)  # cell -> number, property, nodes
    groups: dict[str, dict[int, list[int]]] = field(default_factory=dict)  # name -> code -> numbers
    left_out: dict[str, list[int]] = field(default_factory=dict)  # type that no block is made of -> numbers
    others: Counter[str] = field(default_factory=Counter)  # what else is left out
    metre: float = 1.0  # of the file's lengths

    def read_nodes(self, lines: Lines) -> None:
        """Read a dataset of nodes, two lines each."""
        for k in range(0, len(lines), 2):
            head, coordinates = _record(lines, k, 2)
            self.add_node(head.whole(4)[:2], coordinates, coordinates.text.split())

    def read_old_nodes(self, lines: Lines) -> None:
        """Read a dataset of nodes, a line each."""
        for line in lines:
            head = line._replace(text=line.text[:40]).whole(4)[:2]
            self.add_node(head, line, line.text[40:].split())

    def add_node(self, head: list[int], line: _Line, words: list[str]) -> None:
        """Add a node: number and coordinate system, three words."""
        if len(words) != 3:
            raise ValueError(f"line {line.number}: {quote(line.text.strip())} is not three coordinates")
        if head[1] > 1:
            self.others[f"nodes in coordinate system {head[1]}, read as if it were the first,"] += 1
        self.tags.append(head[0])
        self.points += [word.upper().replace("D", "E") for word in words]

    def read_elements(self, lines: Lines, words: int) -> None:
        """Read a dataset of elements, whose heads have so many numbers; the last is that of nodes."""
        k = 0
        while k < len(lines):
            head = lines[k].whole(words)
            number, kind, prop, count = head[0], head[1], head[_PROPERTY[words]], head[words - 1]
            skipped = 2 if kind in _BEAMS else 1
            taken = _record(lines, k + skipped, -(-max(count, 1) // 8))
            nodes = [node for line in taken for node in line.whole(1)]
            if len(nodes) != count:
                raise ValueError(
                    f"line {lines[k].number}: element {number} has {len(nodes)} nodes, and says {count}"
                )
            cell = _CELLS.get(kind)
            if cell is None or cell.nodes != count:
                self.left_out.setdefault(f"of type {kind} with {count} nodes", []).append(number)
            else:
                self.rows.setdefault(cell.name, []).append([number, prop, *nodes])
            k += skipped + len(taken)

    def read_groups(self, lines: Lines, width: int) -> None:
        """Groups; each entity has its code and number, and in the newer form two words more.

        The head ends with the number of entities; how many sets of loads and supports stand before it differs
        between writers.
        """
        k = 0
        while k < len(lines):
            if not lines[k].text.strip():  # some write a line for the members of an empty group
                k += 1
                continue
            count = lines[k].whole(6)[-1]
            _, name = _record(lines, k, 2)
            taken = _record(lines, k + 2, -(-count * width // 8))
            words = [word for line in taken for word in line.whole(width)]
            if len(words) != count * width:
                raise ValueError(
                    f"line {lines[k].number}: the group says {count} members, and has {len(words) // width}"
                )
            members = self.groups.setdefault(name.text.strip(), {})
            for code, number in zip(words[::width], words[1::width], strict=True):
                if code in (_NODE, _ELEMENT):
                    members.setdefault(code, []).append(number)
                else:
                    self.others[f"group members of code {code}"] += 1
            k += 2 + len(taken)

    def read_units(self, lines: Lines) -> None:
        """Read the dataset of units: how many of the file's lengths a metre is."""
        factors = [word.upper().replace("D", "E") for _, text in lines[1:] for word in text.split()]
        self.metre = float(numbers_of(factors[:1], "the units")[0]) if factors else 1.0


def read_unv(path: Path, location: str) -> MeshFile:
    """Read a universal file; its groups, or where there are none the physical properties.

    Raises
    ------
    MeshError
        for datasets that do not end, and lines that are not numbers.
    """
    location, content = f"{location}: {path}", _Content()
    try:
        for name, lines in _datasets(file_text(path).split("\n")):
            if name in _READ:
                _READ[name](content, lines)
            elif name == "71":
                raise ValueError("dataset 71 has elements in an old form; export them as dataset 2412")
            else:
                content.others[f"dataset {name}"] += 1
        points = numbers_of(content.points, "the nodes").reshape(-1, 3)
        tables = {kind: np.array(rows, dtype=np.int64) for kind, rows in content.rows.items()}
        cells = [
            Cells(kind, CELLS[kind].in_vtk_order(table[:, 2:], "unv"), table[:, 0])
            for kind, table in tables.items()
        ]
        mesh = checked_mesh(np.array(content.tags, dtype=np.int64), points, cells, location)
        elements, nodes = (
            {name: np.array(members.get(code, ()), np.int64) for name, members in content.groups.items()}
            for code in (_ELEMENT, _NODE)
        )
    except ValueError as error:
        raise cannot_be_read(location, "universal", str(error)) from None
    left_out = {kind: np.array(numbers, np.int64) for kind, numbers in content.left_out.items()}
    mesh = grouped(mesh, elements, nodes, left_out)
    remarks = [*mesh.remarks]
    if content.others:
        listed = ", ".join(f"{count} {what}" for what, count in sorted(content.others.items()))
        remarks.append(f"left out: {listed}")
    if content.metre != 1.0:
        remarks.append(
            f"its dataset 164 says that a metre is {content.metre:g} of its lengths; they are read in `unit`"
        )
    groups = mesh.groups or by_value([table[:, 1] for table in tables.values()])
    every = (*cells, *(Cells("vertex", ids[:, None], ids) for ids in left_out.values()))
    return replace(mesh, groups=groups, remarks=(*remarks, *missing_ids(every)))


def _datasets(lines: list[str]) -> Iterator[tuple[str, Lines]]:
    """Name and lines of every dataset, which stand between lines of -1."""
    marks = [k for k, line in enumerate(lines) if line.strip() == "-1"]
    if len(marks) % 2 or not marks:
        raise ValueError(f"it has {len(marks)} lines of -1, which open and close datasets: it was cut")
    for first, last in zip(marks[::2], marks[1::2], strict=True):
        if last < first + 2:
            raise ValueError(f"line {first + 1}: an empty dataset")
        name = lines[first + 1].split()
        yield name[0] if name else "", [_Line(k + 1, lines[k]) for k in range(first + 2, last)]


def _is_whole(word: str) -> bool:
    return word.lstrip("+-").isdecimal() and word.isascii() and len(word) < 19


def _record(lines: Lines, first: int, count: int) -> Lines:
    if first + count > len(lines):
        raise ValueError(f"line {lines[-1].number}: its dataset ends amid a record")
    return lines[first : first + count]


_PROPERTY = {6: 2, 8: 3}  # numbers in an element's head -> position of its property
_READ: dict[str, Callable[[_Content, Lines], None]] = {
    "2411": _Content.read_nodes,
    "781": _Content.read_nodes,
    "15": _Content.read_old_nodes,
    "2412": partial(_Content.read_elements, words=6),
    "780": partial(_Content.read_elements, words=8),
    "164": _Content.read_units,
    **dict.fromkeys(("2435", "2452", "2467", "2477"), partial(_Content.read_groups, width=4)),
    **dict.fromkeys(("752", "2417", "2429", "2430", "2432"), partial(_Content.read_groups, width=2)),
}
