"""ANSYS archive files (.cdb, CDWRITE): nodes, elements and components.

Read here and not by meshlane 5.5, which ends a block at the first line that it cannot read, does not compare
counts, and passes over members of components that are not given.

References
----------
ANSYS Mechanical APDL, Command Reference: NBLOCK, EBLOCK, CMBLOCK, ET; Element Reference: SOLID185, SOLID186
and SOLID187, whose prisms, pyramids and tetrahedra are hexahedra with nodes that stand twice
(`romdam.geometry.cells.uncollapsed`).
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from romdam.core.errors import quote
from romdam.core.files import file_text
from romdam.core.scene import Ints
from romdam.geometry.cells import PLAIN, uncollapsed
from romdam.geometry.meshes.data import (
    Cells,
    MeshFile,
    by_number,
    by_value,
    cannot_be_read,
    checked_mesh,
    missing_ids,
    numbers_of,
)

_SOLIDS = {5, 45, 64, 65, 69, 70, 87, 90, 92, 95, 185, 186, 187, 226, 227, 231, 232, 278, 279, 285}
_SHELLS = {28, 41, 43, 63, 93, 131, 132, 152, 154, 157, 163, 181, 200, 281}
_FORMAT = re.compile(r"\((\d+)i(\d+)(?:,(\d+)[eg](\d+)[.\d]*(?:e\d+)?)?\)", re.IGNORECASE)
_HEAD = 11  # numbers before an element's nodes
_MATERIAL, _TYPE, _COUNT, _NUMBER = 0, 1, 8, 10  # places of them


@dataclass
class _Content:
    """Content read so far."""

    lines: list[str]
    at: int = 0
    types: dict[int, int] = field(default_factory=dict)  # number -> routine, as 185 of SOLID185
    tags: list[int] = field(default_factory=list)
    points: list[str] = field(default_factory=list)  # three words each
    rows: dict[tuple[int, int], list[list[int]]] = field(default_factory=dict)  # dim, nodes -> rows
    components: dict[str, dict[str, Ints]] = field(default_factory=lambda: {"NODE": {}, "ELEM": {}})
    others: Counter[str] = field(default_factory=Counter)
    left: set[int] = field(default_factory=set)  # numbers of elements that are left out
    remarks: list[str] = field(default_factory=list)

    def line(self) -> str:
        """The next line."""
        if self.at >= len(self.lines):
            raise ValueError("it ends amid a block: the file was cut")
        self.at += 1
        return self.lines[self.at - 1]

    def error(self, text: str) -> ValueError:
        """An error at the line read last."""
        return ValueError(f"line {self.at}: {text}")

    def format(self) -> tuple[int, int, int]:
        """Number of whole numbers in a line, their width and that of coordinates."""
        line = self.line().strip()
        match = _FORMAT.fullmatch(line.replace(" ", ""))
        if match is None:
            raise self.error(f"{quote(line)} is no format such as (19i9)")
        return int(match[1]), int(match[2]), int(match[4] or 0)

    def whole(self, text: str, width: int) -> list[int]:
        """Whole numbers of columns of a width."""
        words = [text[k : k + width].strip() for k in range(0, len(text.rstrip()), width)]
        if not all(re.fullmatch(r"[+-]?\d{1,18}", word) for word in words):
            raise self.error(f"{quote(text.strip())} is not whole numbers of {width} columns")
        return [int(word) for word in words]

    def refuse_other_count(self, name: str, said: int | None, count: int) -> None:
        """Refuse a block whose head says another number of items."""
        if said is not None and said != count:
            raise self.error(f"{name} holds {count}, and says {said}: the file was cut")

    def read_type(self, words: list[str]) -> None:
        """Read ET: number and routine of an element type."""
        digits = re.sub(r"^[A-Za-z]+", "", words[2]) if len(words) > 2 else ""
        if not (digits.isdecimal() and words[1].isdecimal()):
            raise self.error(f"{quote(','.join(words))} gives no element type by numbers")
        self.types[int(words[1])] = int(digits)

    def read_types(self, words: list[str]) -> None:
        """Read ETBLOCK: numbers and routines of element types."""
        _, width, _ = self.format()
        while (row := self.whole(self.line(), width)) and row[0] != -1:
            self.types[row[0]] = row[1] if len(row) > 1 else 0

    def read_nodes(self, words: list[str]) -> None:
        """Read NBLOCK."""
        head, width, wide = self.format()
        first = len(self.tags)
        while not (line := self.line()).lstrip().upper().startswith(("N,", "-1")):
            start = head * width
            at = [line[k : k + wide].strip() for k in range(start, len(line.rstrip()), wide)] if wide else []
            self.tags.append(self.whole(line[:start], width)[0] if line.strip() else 0)
            self.points += [word.upper().replace("D", "E") or "0" for word in (*at, "0", "0", "0")[:3]]
            if self.tags[-1] < 1:
                raise self.error(f"{quote(line.strip())} is no node")
        self.refuse_other_count("NBLOCK", _said(words, 4), len(self.tags) - first)

    def read_elements(self, words: list[str]) -> None:
        """Read EBLOCK."""
        if len(words) < 3 or words[2].upper() != "SOLID":
            raise self.error(f"{quote(','.join(words))} is not in the form SOLID; write it with CDWRITE, DB")
        _, width, _ = self.format()
        count = 0
        while (row := self.whole(self.line(), width))[:1] != [-1]:
            if len(row) < _HEAD:
                raise self.error(f"an element of {len(row)} numbers, expected {_HEAD} and its nodes")
            while len(row) < _HEAD + row[_COUNT]:
                row += self.whole(self.line(), width) or [0]
            self.add(row)
            count += 1
        self.refuse_other_count("EBLOCK", _said(words, 4), count)

    def add(self, row: list[int]) -> None:
        """Add a solid or a shell; others are counted only."""
        routine, nodes = self.types.get(row[_TYPE]), row[_HEAD:]
        if routine is None:
            raise self.error(f"element {row[_NUMBER]} is of type {row[_TYPE]}, which ET does not give")
        dim = 3 if routine in _SOLIDS else 2 if routine in _SHELLS else 0
        if (dim, len(nodes)) not in PLAIN:
            self.others[f"of type {routine} with {len(nodes)} nodes"] += 1
            self.left.add(row[_NUMBER])
            return
        if min(nodes) < 1:
            raise self.error(
                f"element {row[_NUMBER]} leaves out mid-edge nodes, which it has {len(nodes)} of"
            )
        self.rows.setdefault((dim, len(nodes)), []).append([row[_NUMBER], row[_MATERIAL], *nodes])

    def read_component(self, words: list[str]) -> None:
        """Read CMBLOCK; a negative number ends a range that the one before it begins."""
        name, kind, said = ([*words, "", "", ""])[1], "".join(words[2:3]).upper()[:4], _said(words, 3)
        _, width, _ = self.format()
        if kind not in self.components or said is None:
            raise self.error(f"{quote(','.join(words))} is no component of nodes or elements")
        items: list[int] = []
        while len(items) < said:
            items += self.whole(self.line(), width) or [0]
        if len(items) != said or 0 in items:
            raise self.error(f"component {name} does not hold the {said} numbers that it says")
        ranges = [np.arange(items[k - 1] + 1, -n + 1) for k, n in enumerate(items) if n < 0 and k]
        self.components[kind][name] = np.unique(
            np.concatenate([np.array([n for n in items if n > 0]), *ranges])
        )

    def read_units(self, words: list[str]) -> None:
        """Note /UNITS, which changes nothing."""
        self.remarks.append(f"it says {quote(','.join(words))}; coordinates are read in `unit`")

    def refuse_moved(self, words: list[str]) -> None:
        """Refuse commands that make or move nodes and elements."""
        raise self.error(f"{words[0]} makes or moves nodes and elements, which is not followed; use CDWRITE")


def read_ansys(path: Path, location: str) -> MeshFile:
    """Read a .cdb file; groups are its components, or where there are none the materials.

    Raises
    ------
    MeshError
        for blocks that end early, elements without some of their nodes, and components of what is not given.
    """
    location, content = f"{location}: {path}", _Content(file_text(path).split("\n"))
    try:
        while content.at < len(content.lines):
            words = [word.strip() for word in content.line().partition("!")[0].split(",")]
            if reader := _READ.get(words[0].upper()):
                reader(content, words)
        points = numbers_of(content.points, "the nodes").reshape(-1, 3)
        cells, materials = [], []
        for (dim, _), rows in content.rows.items():
            table = np.array(rows, dtype=np.int64)
            # hexahedra and quadrilaterals with nodes that stand twice as what they are
            for kind, cell_rows, nodes in uncollapsed(table[:, 2:], dim):
                cells.append(Cells(kind, nodes, table[cell_rows, 0]))
                materials.append(table[cell_rows, 1])
        mesh = checked_mesh(np.array(content.tags, dtype=np.int64), points, cells, location)
        elements = {
            n: members[~np.isin(members, list(content.left))]
            for n, members in content.components["ELEM"].items()
        }
        groups, node_sets = by_number(mesh, elements, content.components["NODE"])
    except ValueError as error:
        raise cannot_be_read(location, "ANSYS", str(error)) from None
    solids = any(
        len(m) for members in groups.values() for m, c in zip(members, cells, strict=True) if c.dim == 3
    )
    groups = groups if solids else by_value(materials) | groups
    remarks = [*mesh.remarks, *content.remarks]
    if content.others:
        listed = ", ".join(f"{count} {what}" for what, count in sorted(content.others.items()))
        remarks.append(f"elements that are neither solids nor shells are left out ({listed})")
    if not content.left:
        remarks += missing_ids(cells)
    return replace(mesh, groups=groups, node_sets=node_sets, remarks=tuple(remarks))


def _said(words: list[str], k: int) -> int | None:
    return int(words[k]) if k < len(words) and words[k].isdecimal() else None


_READ: dict[str, Callable[[_Content, list[str]], None]] = {
    "ET": _Content.read_type,
    "ETBLOCK": _Content.read_types,
    "NBLOCK": _Content.read_nodes,
    "EBLOCK": _Content.read_elements,
    "CMBLOCK": _Content.read_component,
    "/UNITS": _Content.read_units,
    **dict.fromkeys(
        ("NGEN", "EGEN", "NROTAT", "NSYM", "ESYM", "VMESH", "NTRAN", "CPINTF"), _Content.refuse_moved
    ),
}
