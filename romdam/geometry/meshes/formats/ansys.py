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
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from romdam.core.errors import quote
from romdam.core.files import file_text
from romdam.core.scene import Ints
from romdam.geometry.cells import COLLAPSED, PLAIN, uncollapsed
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

_SOLIDS = {  # routines of SOLID elements of three dimensions
    5, 45, 46, 62, 64, 65, 69, 70, 72, 73, 87, 90, 92, 95, 96, 97, 98, 117, 122, 123, 147, 148, 164, 168, 185,
    186, 187, 190, 191, 215, 216, 217, 225, 226, 227, 231, 232, 236, 237, 239, 240, 278, 279, 285, 291,
}  # fmt: skip
_SHELLS = {28, 41, 43, 63, 93, 131, 132, 152, 154, 157, 163, 181, 200, 281}
_FIELD = re.compile(r"(\d*)(?:(i)|[aeg])(\d+)(?:\.\d+)?(?:e\d+)?", re.IGNORECASE)  # of a Fortran format
_HEAD = 11  # numbers before an element's nodes
_MATERIAL, _TYPE, _COUNT, _NUMBER = 0, 1, 8, 10  # places of them


@dataclass
class _Content:
    """Content read so far."""

    lines: list[str]
    at: int = 0
    types: dict[int, int] = field(default_factory=dict)  # number -> routine, as 185 of SOLID185
    current: int | None = None  # type of elements that do not say theirs
    tags: list[int] = field(default_factory=list)
    points: list[str] = field(default_factory=list)  # three words each
    rows: dict[tuple[int, int], list[list[int]]] = field(default_factory=dict)  # dim, nodes -> rows
    components: dict[str, dict[str, Ints]] = field(default_factory=lambda: {"NODE": {}, "ELEM": {}})
    left_out: dict[str, list[int]] = field(default_factory=dict)  # type that no block is made of -> numbers
    unread: dict[str, list[int]] = field(default_factory=dict)  # the same of what may be solids
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

    def format(self) -> tuple[list[int], int]:
        """Widths of the whole numbers in a line, and of what follows them."""
        line = self.line().strip()
        fields = [_FIELD.fullmatch(word) for word in line.replace(" ", "").strip("()").split(",")]
        widths = [int(f[3]) for f in fields if f and f[2] for _ in range(int(f[1] or 1))]
        if not all(fields) or not widths:
            raise self.error(f"{quote(line)} is no format such as (19i9)")
        return widths, next((int(f[3]) for f in fields if f and not f[2]), 0)

    def whole(self, text: str, widths: list[int]) -> list[int]:
        """Whole numbers of columns of these widths."""
        ends = np.cumsum(widths).tolist()
        words = [text[a:b].strip() for a, b in zip([0, *ends], ends, strict=False) if text[a:].strip()]
        if not all(re.fullmatch(r"[+-]?\d{1,18}", word) for word in words):
            raise self.error(f"{quote(text.strip())} is not whole numbers of {widths[0]} columns")
        return [int(word) for word in words]

    def refuse_other_count(self, name: str, said: int | None, count: int) -> None:
        """Refuse a block whose head says another number of items."""
        if said is not None and said != count:
            raise self.error(f"{name} holds {count}, and says {said}: the file was cut")

    def read_type(self, words: list[str]) -> None:
        """Read ET: number and routine of an element type; those by names of parameters are not known."""
        digits = re.sub(r"^[A-Za-z]+", "", words[2]) if len(words) > 2 else ""
        if digits.isdecimal() and words[1].isdecimal():
            self.types[int(words[1])] = int(digits)

    def read_types(self, words: list[str]) -> None:
        """Read ETBLOCK: numbers and routines of element types."""
        widths, _ = self.format()
        while (row := self.whole(self.line(), widths)) and row[0] != -1:
            self.types[row[0]] = row[1] if len(row) > 1 else 0

    def read_current(self, words: list[str]) -> None:
        """Read TYPE: the type of elements that do not say theirs."""
        self.current = self.types.get(int(words[1])) if words[1:] and words[1].isdecimal() else None

    def read_nodes(self, words: list[str]) -> None:
        """Read NBLOCK."""
        widths, wide = self.format()
        first, start = len(self.tags), sum(widths)
        while not (line := self.line()).lstrip().upper().startswith(("N,", "-1")):
            at = [line[k : k + wide].strip() for k in range(start, len(line.rstrip()), wide)] if wide else []
            self.tags.append(self.whole(line[:start], widths)[0] if line.strip() else 0)
            self.points += [word.upper().replace("D", "E") or "0" for word in (*at, "0", "0", "0")[:3]]
            if self.tags[-1] < 1:
                raise self.error(f"{quote(line.strip())} is no node")
        self.refuse_other_count("NBLOCK", _said(words, 4), len(self.tags) - first)

    def read_elements(self, words: list[str]) -> None:
        """Read EBLOCK; of a block without SOLID, whose elements do not say their type, only the numbers."""
        solid = words[2:3] and words[2].upper() == "SOLID"
        widths, _ = self.format()
        count, said = 0, _said(words, 4)
        while (row := self.whole(self.line(), widths))[:1] != [-1] and (row or count != said):
            if not row or (solid and len(row) < _HEAD):
                raise self.error(f"an element of {len(row)} numbers, expected {_HEAD} and its nodes")
            if solid:
                while len(row) < _HEAD + row[_COUNT]:
                    row += self.whole(self.line(), widths) or [0]
                self.add(row)
            else:
                known = self.current is not None and self.current not in _SOLIDS
                kind = f"of type {self.current}" if known else "in a block that is not in the form SOLID"
                (self.left_out if known else self.unread).setdefault(kind, []).append(row[0])
            count += 1
        if not row and self.at == len(self.lines):  # a blank line ends a block, but not a file
            raise ValueError("it ends amid EBLOCK: the file was cut")
        self.refuse_other_count("EBLOCK", said, count)

    def add(self, row: list[int]) -> None:
        """Add a solid or a shell; of others only the number."""
        routine, nodes = self.types.get(row[_TYPE]), row[_HEAD:]
        dim = 3 if routine in _SOLIDS else 2 if routine in _SHELLS else 0
        if routine is None:
            self.unread.setdefault(f"of type {row[_TYPE]}, which ET does not give", []).append(row[_NUMBER])
        elif (dim, len(nodes)) in PLAIN:
            self.rows.setdefault((dim, len(nodes)), []).append([row[_NUMBER], row[_MATERIAL], *nodes])
        else:
            types = self.unread if dim == 3 else self.left_out
            types.setdefault(f"of type {routine} with {len(nodes)} nodes", []).append(row[_NUMBER])

    def read_component(self, words: list[str]) -> None:
        """Read CMBLOCK; a negative number ends a range that the one before it begins."""
        name, kind, said = ([*words, "", "", ""])[1], "".join(words[2:3]).upper()[:4], _said(words, 3)
        widths, _ = self.format()
        if said is None:
            raise self.error(f"{quote(','.join(words))} does not say how many items it has")
        items: list[int] = []
        while len(items) < said:
            items += self.whole(self.line(), widths) or [0]
        if len(items) != said or 0 in items:
            raise self.error(f"component {name} does not hold the {said} numbers that it says")
        if kind not in self.components:
            self.remarks.append(f"component {name} of {kind or 'nothing'} is left out")
            return
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
        for blocks that end early or hold other numbers of items than they say.
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
            nodes_of = _collapsed(table[:, 2:], dim)
            for kind, cell_rows, nodes in uncollapsed(nodes_of, dim):
                cells.append(Cells(kind, nodes, table[cell_rows, 0]))
                materials.append(table[cell_rows, 1])
        mesh = checked_mesh(np.array(content.tags, dtype=np.int64), points, cells, location)
    except ValueError as error:
        raise cannot_be_read(location, "ANSYS", str(error)) from None
    left_out, unread = (
        {kind: np.array(numbers, dtype=np.int64) for kind, numbers in types.items()}
        for types in (content.left_out, content.unread)
    )
    mesh = grouped(mesh, content.components["ELEM"], content.components["NODE"], left_out, unread)
    groups = mesh.groups
    solids = any(
        len(m) for members in groups.values() for m, c in zip(members, cells, strict=True) if c.dim == 3
    )
    groups = groups if solids else by_value(materials) | groups
    remarks = [*mesh.remarks, *content.remarks]
    if not left_out:
        remarks += missing_ids(cells)
    return replace(mesh, groups=groups, remarks=tuple(remarks))


def _collapsed(table: Ints, dim: int) -> Ints:
    """Elements (n, nodes) whose mid-edge nodes follow from corners that stand twice.

    ANSYS uses none of the mid-edge nodes of an edge or face without extent; they may be 0.
    """
    kinds = COLLAPSED.get((dim, table.shape[1]), {})
    corners = {20: 8, 8: 4}.get(table.shape[1], 0) if len(kinds) and (dim, table.shape[1]) != (3, 8) else 0
    table, left = table.copy(), np.ones(len(table), dtype=bool)
    for frame in kinds.values() if corners else ():
        whole = table[:, np.unique(frame, return_index=True)[1]][:, list(frame)]
        rows = left & (whole[:, :corners] == table[:, :corners]).all(axis=1)
        table[rows] = whole[rows]
        left &= ~rows
    return table


def _said(words: list[str], k: int) -> int | None:
    return int(words[k]) if k < len(words) and words[k].isdecimal() else None


_READ: dict[str, Callable[[_Content, list[str]], None]] = {
    "ET": _Content.read_type,
    "ETBLOCK": _Content.read_types,
    "NBLOCK": _Content.read_nodes,
    "EBLOCK": _Content.read_elements,
    "CMBLOCK": _Content.read_component,
    "TYPE": _Content.read_current,
    "/UNITS": _Content.read_units,
    **dict.fromkeys(("NGEN", "EGEN", "NSYM", "ESYM", "VMESH", "NTRAN"), _Content.refuse_moved),
}
