"""Abaqus input files: nodes, elements, node and element sets, element surfaces.

Read here and not by meshlane 5.5, which ends the process at decks that it cannot read (155 of 199 public ones
with solids), and knows no surfaces. Node orders are VTK's.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from romdam.core.errors import MeshError, quote
from romdam.core.files import check_file, file_text
from romdam.core.scene import Ints
from romdam.geometry.cells import Cell
from romdam.geometry.elements import CELLS, SOLIDS
from romdam.geometry.meshes.cells import Cells
from romdam.geometry.meshes.data import LARGEST, MeshFile, cannot_be_read, checked_mesh, grouped, missing_ids
from romdam.geometry.meshes.formats.abaqus_assembly import Keyword, Lines, flat

_DEEPEST = 10  # of files that include each other
_ASSEMBLY = ("INSTANCE", "END INSTANCE", "PART", "END PART", "ASSEMBLY", "END ASSEMBLY")
_SOLID = re.compile(r"^(?:DC|AC|C)3D(\d+)[A-Z]*$")
_SHELL = re.compile(r"^(?:CPS|CPE|CAX|SFM3D|M3D|R3D|STRI|S|DS)(\d)[A-Z]*\d?$")
_SOLID_TYPES, _SHELL_TYPES = (
    {cell.nodes: cell for cell in CELLS.values() if cell.abaqus and cell.dim == dim} for dim in (3, 2)
)
_REDUCED = re.compile(r"^C3D(?:8|20|27)[A-Z]*R")  # fewer Gauss points than here
_HEX_SIDES = ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0))
_TET_SIDES = ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))
_WEDGE_SIDES = ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0))
_PYRAMID_SIDES = ((0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0))
_SIDES_OF = {"hex8": _HEX_SIDES, "tet4": _TET_SIDES, "wedge6": _WEDGE_SIDES, "pyramid5": _PYRAMID_SIDES}
_SIDES = {e.cell.name: _SIDES_OF[e.linear] for e in SOLIDS.values()}
_REFUSED = {  # what makes or moves nodes and elements in ways that are not followed
    "NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "SYSTEM", "IMPORT",
    "SYMMETRIC MODEL GENERATION",
}  # fmt: skip


@dataclass
class _Deck:
    """Content read so far; numbers are those of the file until the end."""

    location: str
    tags: list[int] = field(default_factory=list)
    points: list[list[float]] = field(default_factory=list)
    blocks: list[tuple[Cell, list[list[int]]]] = field(default_factory=list)  # number and nodes
    sets: dict[str, dict[str, list[list[str]]]] = field(default_factory=lambda: {"ELSET": {}, "NSET": {}})
    surfaces: dict[str, list[tuple[str, int]]] = field(default_factory=dict)  # element or set, side
    left_out: dict[str, list[int]] = field(default_factory=dict)  # type that no block is made of -> numbers
    unread: dict[str, list[int]] = field(default_factory=dict)  # the same of solids
    unsound: dict[str, str] = field(default_factory=dict)  # set or surface -> why it must not be named
    holes: dict[str, int] = field(default_factory=dict)  # set -> numbers of its ranges that are not given
    reduced: Counter[str] = field(default_factory=Counter)  # types of reduced integration
    short: int = 0  # nodes with fewer than three coordinates
    remarks: list[str] = field(default_factory=list)

    def error(self, text: str) -> MeshError:
        """An error that names the file."""
        return MeshError(f"{self.location}: {text}")

    def name(self, kind: str, label: str) -> str:
        """The spelling in which a set was named first; Abaqus does not tell cases apart."""
        known = self.sets[kind]
        return next((other for other in known if other.upper() == label.upper()), label)

    def whole(self, words: list[str], what: str) -> list[int]:
        """Words as whole numbers; `what` has them, for messages."""
        wrong = next((word for word in words if not re.fullmatch(r"[+-]?\d{1,18}", word)), None)
        if wrong is not None:
            raise self.error(f"{what} holds {quote(wrong)}, expected whole numbers; repair the file")
        return [int(word) for word in words]

    def read_nodes(self, options: dict[str, str], lines: Lines) -> None:
        """Read *NODE."""
        if options.get("SYSTEM", "R").upper() != "R":
            raise self.error(
                f"*NODE, SYSTEM={options['SYSTEM']} is not followed; export rectangular coordinates "
                "(SYSTEM=R)"
            )
        for line in lines:
            words = line if line[-1] else line[:-1]
            try:
                position = [float(word) if word else 0.0 for word in words[1:4]]
                (number,) = self.whole(words[:1], "*NODE")
            except (ValueError, MeshError):
                position = []
            if not words or len(words) > 7 or "_" in "".join(words):
                raise self.error(f"*NODE line {quote(','.join(line))} is no node; repair the file")
            self.short += len(position) < 3
            self.tags.append(number)
            self.points.append(position + [0.0] * (3 - len(position)))
        if "NSET" in options:
            self.add("NSET", options["NSET"], [[line[0]] for line in lines])

    def read_elements(self, options: dict[str, str], lines: Lines) -> None:
        """Read *ELEMENT; of types that are neither solids nor shells only the numbers."""
        kind = options.get("TYPE", "").upper()
        solid, shell = _SOLID.match(kind), _SHELL.match(kind)
        cell = (
            _SOLID_TYPES.get(int(solid[1])) if solid else _SHELL_TYPES.get(int(shell[1])) if shell else None
        )
        labels = [options[key] for key in ("ELSET", "INSTANCE") if key in options]
        if cell is None:
            heads = [line for above, line in zip([["1"], *lines], lines, strict=False) if above[-1]]
            numbers = self.whole([line[0] for line in heads], f"*ELEMENT, TYPE={kind}")
            (self.unread if solid else self.left_out).setdefault(kind or "(no type)", []).extend(numbers)
            for label in labels:
                self.add("ELSET", label, [[str(number)] for number in numbers])
            return
        size = cell.nodes
        rows: list[list[int]] = []
        row: list[int] = []
        for line in lines:
            row += self.whole([word for word in line if word], f"*ELEMENT, TYPE={kind}")
            if len(row) > size:
                rows.append(row)
                row = []
        given = {len(row) for row in rows}
        if row or len(given - {size + 1}) > 1 or (len(given) == 2 and size + 1 in given):
            wrong = row or next(row for row in rows if len(row) != size + 1)
            raise self.error(
                f"*ELEMENT, TYPE={kind}: element {wrong[0]} has {len(wrong) - 1} nodes, expected {size}, "
                "each element on lines of its own; repair the file"
            )
        if given - {size + 1}:
            self.remarks.append(
                f"{len(rows)} elements of TYPE={kind} list {max(given) - 1} nodes, of which {size} count"
            )
            rows = [row[: size + 1] for row in rows]
        if _REDUCED.match(kind):
            self.reduced[kind] += len(rows)
        self.blocks.append((cell, rows))
        for label in labels:
            self.add("ELSET", label, [[str(row[0])] for row in rows])

    def add(self, kind: str, label: str, entries: list[list[str]]) -> None:
        """Add entries to a set."""
        self.sets[kind].setdefault(self.name(kind, label), []).extend(entries)

    def read_set(self, options: dict[str, str], lines: Lines, key: str) -> None:
        """Members stay as they are written, [member] or [first, last, step], until everything is known."""
        filled = [[word for word in line if word] for line in lines]
        if "GENERATE" in options:
            wrong = next((line for line in filled if len(line) not in (2, 3)), None)
            if wrong is not None:
                raise self.error(f"*{key}, GENERATE line {quote(','.join(wrong))} is no first, last, step")
            entries = [[*line, "1"][:3] for line in filled]
        else:
            entries = [[word] for line in filled for word in line]
        self.add(key, options.get(key, ""), entries)

    def read_surface(self, options: dict[str, str], lines: Lines) -> None:
        """Read *SURFACE: sides of elements or of sets of elements."""
        label = options.get("NAME", "")
        if options.get("TYPE", "ELEMENT").upper() != "ELEMENT":
            self.remarks.append(f"surface {label!r} of TYPE={options['TYPE']} is left out")
            return
        sides = [
            (line[0], int(line[1][1:])) for line in lines if len(line) > 1 and re.match(r"^[Ss]\d$", line[1])
        ]
        if len(sides) < len(lines):
            self.remarks.append(
                f"{len(lines) - len(sides)} of {len(lines)} lines of surface {label!r} name no side S1 to S6 "
                "and are left out"
            )
        self.surfaces.setdefault(label, []).extend(sides)

    def members(self, kind: str, name: str, known: Ints, above: tuple[str, ...] = ()) -> Ints:
        """Numbers of a set, the sets that it names resolved.

        Raises
        ------
        MeshError
            for words that are neither numbers nor sets.
        """
        members_of: list[Ints] = [np.zeros(0, np.int64)]
        single: list[str] = []
        what = f"*{kind} {name}"
        for entry in self.sets[kind][name]:
            other = self.name(kind, entry[0])
            if len(entry) == 3:
                first, last, step = self.whole(entry, what)
                if step < 1 or last < first:
                    raise self.error(f"{what}, GENERATE {first}, {last}, {step} is no range that goes up")
                start, stop = np.searchsorted(known, first), np.searchsorted(known, last, "right")
                inside = known[start:stop][(known[start:stop] - first) % step == 0]
                if holes := (last - first) // step + 1 - len(inside):
                    self.holes[f"{kind} {name}"] = holes
                members_of.append(inside)
            elif other in self.sets[kind] and other not in (*above, name):
                members_of.append(self.members(kind, other, known, (*above, name)))
            else:
                single += entry
        return np.unique(np.concatenate([*members_of, np.array(self.whole(single, what), dtype=np.int64)]))

    def resolved(self, kind: str, known: Ints) -> dict[str, Ints]:
        """Numbers of all sets; those that cannot be resolved are empty and unsound."""
        members = {}
        for name in self.sets[kind]:
            try:
                members[name] = self.members(kind, name, known)
            except MeshError as error:
                members[name] = np.zeros(0, np.int64)
                self.unsound[name] = str(error).removeprefix(f"{self.location}: ")
        return members

    def surface_cells(
        self, name: str, members: dict[str, Ints], cells: list[Cells], known: Ints
    ) -> list[Cells]:
        """The facets of a surface; they get numbers below zero and join the set of its name.

        Sides of shells and of elements that are left out are no facets of solids; sides that no element has
        make the surface unsound.
        """
        facets_of: dict[str, list[Ints]] = {"triangle": [], "quad": []}
        elements_of: dict[int, list[Ints]] = {}  # side -> elements
        for of, side in self.surfaces[name]:
            label = self.name("ELSET", of)
            if label in members or of.isdecimal():
                elements = members[label] if label in members else np.array([int(of)])
                elements_of.setdefault(side, []).append(elements)
            else:
                self.unsound[name] = f"*SURFACE {name} is of {quote(of)}, which is not given"
        others = 0
        for side, parts in elements_of.items():
            wanted = np.unique(np.concatenate(parts))
            solid = np.zeros(len(wanted), dtype=bool)
            count = 0
            for block in cells:
                if block.dim != 3:
                    continue
                solid |= np.isin(wanted, block.ids)
                corners = _SIDES.get(block.kind, ())
                if side <= len(corners):
                    rows = block.nodes[np.isin(block.ids, wanted)][:, list(corners[side - 1])]
                    facets_of["quad" if rows.shape[1] == 4 else "triangle"].append(rows)
                    count += len(rows)
            others += int(np.isin(wanted[~solid], known).sum())
            lacking = int(solid.sum()) - count + int((~np.isin(wanted, known)).sum())
            if lacking:
                self.unsound[name] = (
                    f"*SURFACE {name}: S{side} of {len(wanted)} elements, {lacking} of which do not have it"
                )
        if others:
            self.remarks.append(f"{others} sides of surface {name!r} are of no solid and are left out")
        first = min([0, *(int(m.min(initial=0)) for m in members.values())]) - 1
        facets = []
        for kind, parts in facets_of.items():
            table = np.concatenate(parts) if parts else np.zeros((0, 1), np.int64)
            if len(table):
                ids = first - np.arange(len(table))
                first -= len(table)
                members[name] = np.union1d(members.get(name, np.zeros(0, np.int64)), ids)
                facets.append(Cells(kind, table, ids))
        return facets

    def mesh(self) -> MeshFile:
        """Number nodes and elements from 0 and turn surfaces into facets."""
        tags = np.array(self.tags, dtype=np.int64)
        tables = [(cell, np.array(rows, dtype=np.int64)) for cell, rows in self.blocks if rows]
        cells = [Cells(c.name, c.in_vtk_order(table[:, 1:], "abaqus"), table[:, 0]) for c, table in tables]
        left_out, unread = (
            {kind: np.array(numbers, dtype=np.int64) for kind, numbers in types.items()}
            for types in (self.left_out, self.unread)
        )
        known = np.unique(
            np.concatenate(
                [np.zeros(0, np.int64), *(c.ids for c in cells), *left_out.values(), *unread.values()]
            )
        )
        members = self.resolved("ELSET", known)
        for name in self.surfaces:
            cells += self.surface_cells(name, members, cells, known)
        nodes = self.resolved("NSET", np.unique(tags))
        mesh = checked_mesh(tags, np.array(self.points), cells, self.location)
        mesh = grouped(mesh, members, nodes, left_out, unread)
        remarks = [*self.remarks, *(f"{name}: {reason}" for name, reason in self.unsound.items())]
        if self.short:
            remarks.append(f"{self.short} nodes have fewer than three coordinates, the others are read as 0")
        if self.holes:
            listed = ", ".join(f"{name} {count}" for name, count in self.holes.items())
            remarks.append(f"ranges of GENERATE hold numbers that are not given ({listed})")
        if self.reduced:
            listed = ", ".join(f"{count} {kind}" for kind, count in sorted(self.reduced.items()))
            remarks.append(f"elements of reduced integration are integrated in full ({listed})")
        return replace(mesh, remarks=(*mesh.remarks, *remarks), unsound=mesh.unsound | self.unsound)


def read_abaqus(path: Path, location: str) -> MeshFile:
    """Read an Abaqus mesh and the files it includes, its instances in their places.

    Element sets and surfaces become groups; the sides of every surface are appended as facets, with element
    numbers below zero.

    Raises
    ------
    MeshError
        for nodes and elements that are generated, and lines that are no numbers.
    """
    deck, renumbered = _Deck(f"{location}: {path}"), []  # type: _Deck, list[str]
    try:
        for keyword, options, lines in flat(_keywords(_lines(deck, path, ())), renumbered):
            if keyword in _REFUSED:
                raise deck.error(
                    f"*{keyword} is not followed; export one flat mesh, with every node and element"
                )
            if keyword in _READ and "INPUT" in options:
                raise deck.error(
                    f"*{keyword}, INPUT={options['INPUT']} is not followed; put the mesh into one file"
                )
            if keyword in _READ:
                _READ[keyword](deck, options, lines)
            elif keyword not in _ASSEMBLY and (close := get_close_matches(keyword, _READ, n=1, cutoff=0.75)):
                raise deck.error(f"*{keyword} is not known; is *{close[0]} meant?")
    except ValueError as error:
        raise cannot_be_read(deck.location, "abaqus", str(error)) from None
    if not deck.tags:
        raise cannot_be_read(deck.location, "abaqus", "no *NODE block")
    mesh = deck.mesh()
    ids = () if renumbered else missing_ids([c for c in mesh.cells if c.ids.min() > 0])  # no surface's sides
    return replace(mesh, remarks=(*mesh.remarks, *renumbered, *ids))


def _lines(deck: _Deck, path: Path, above: tuple[Path, ...]) -> Iterator[str]:
    """Lines of a file and of those it includes, without comments."""
    check_file(path, LARGEST, MeshError)
    here = path.resolve()
    if here in above or len(above) >= _DEEPEST:
        what = "includes itself" if here in above else f"is included {_DEEPEST} files deep, the limit"
        raise deck.error(f"*INCLUDE: {path} {what}; put the mesh into one file")
    for line in file_text(path).split("\n"):
        text = line.strip()
        if not text or text.startswith("**"):
            continue
        if re.match(r"\*\s*INCLUDE\b", text, re.IGNORECASE):
            match = re.search(r"""\b(?:INPUT|FILE)\s*=\s*["']?([^"',]+)""", text, re.IGNORECASE)
            if match is None or not (path.parent / match[1].strip()).is_file():
                raise deck.error(
                    f"{quote(text)}: there is no such file beside {path.name}; put the mesh into one file"
                )
            yield from _lines(deck, path.parent / match[1].strip(), (*above, here))
        else:
            yield text


def _keywords(lines: Iterator[str]) -> Iterator[Keyword]:
    """Keyword, options and the data lines below it; a comma at the end continues the keyword's line."""
    head, data = "", []  # type: str, Lines
    for text in lines:
        if text.startswith("*"):
            yield (*_head(head), data)
            head, data = text[1:], []
        elif head.endswith(",") and not data and "=" in text:
            head += text
        else:
            data.append([word.strip() for word in text.split(",")])
    yield (*_head(head), data)


def _head(text: str) -> tuple[str, dict[str, str]]:
    keyword, *rest = (word.strip() for word in text.split(","))
    pairs = (word.partition("=") for word in rest if word)
    options = {key.strip().upper(): value.strip().strip("\"'") for key, _, value in pairs}
    return " ".join(keyword.upper().split()), options


_READ: dict[str, Callable[[_Deck, dict[str, str], Lines], None]] = {
    "NODE": _Deck.read_nodes,
    "ELEMENT": _Deck.read_elements,
    "ELSET": lambda deck, options, lines: deck.read_set(options, lines, "ELSET"),
    "NSET": lambda deck, options, lines: deck.read_set(options, lines, "NSET"),
    "SURFACE": _Deck.read_surface,
}
