"""Abaqus input files: nodes, elements, node and element sets, element surfaces.

Read here and not by meshio 5.3, which mixes up element sets named on *ELEMENT lines, knows no
surfaces and refuses a whole file for one shell type it does not know. Node orders are VTK's.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from romdam.errors import MeshError
from romdam.scene.model import Ints

if TYPE_CHECKING:
    import meshio

_SOLID = re.compile(r"^(?:DC|AC|C)3D(\d+)[A-Z]*$")
_SHELL = re.compile(r"^(?:CPS|CPE|CAX|SFM3D|M3D|R3D|STRI|S|DS)(\d)[A-Z]*\d?$")
_SOLID_TYPES = {
    4: "tetra",
    10: "tetra10",
    8: "hexahedron",
    20: "hexahedron20",
    5: "pyramid",
    6: "wedge",
    15: "wedge15",
    27: "hexahedron27",
}
_SHELL_TYPES = {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8"}
_HEX_SIDES = ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0))
_TET_SIDES = ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))
_SIDES = {"hexahedron": _HEX_SIDES, "hexahedron20": _HEX_SIDES, "tetra": _TET_SIDES, "tetra10": _TET_SIDES}


@dataclass
class _Deck:
    """What has been read so far; numbers are the file's own until the end."""

    place: str
    nodes: dict[int, list[float]] = field(default_factory=dict)
    blocks: list[tuple[str, list[int], list[list[int]]]] = field(default_factory=list)  # type, numbers, nodes
    element_sets: dict[str, list[int]] = field(default_factory=dict)
    node_sets: dict[str, list[int]] = field(default_factory=dict)
    surfaces: dict[str, list[tuple[str, int]]] = field(default_factory=dict)  # element or set, side


def read_abaqus(path: Path, place: str) -> tuple[meshio.Mesh, dict[str, list[Ints]], dict[str, Ints]]:
    """Read a flat Abaqus mesh.

    Returns
    -------
    mesh : the sides of every surface are appended as facets
    groups : element set or surface -> cell numbers in every block of the mesh
    node_sets : node set -> node numbers

    Raises
    ------
    MeshError
        for unsupported solids, several parts, included files and lines that are no numbers.
    """
    deck = _Deck(f"{place}: {path}")
    for keyword, options, lines in _keywords(path.read_text(errors="replace")):
        if keyword in _READ:
            _READ[keyword](deck, options, lines)
    if not deck.nodes:
        raise MeshError(
            f"{deck.place} cannot be read as an abaqus file: no *NODE block; export the mesh anew"
        )
    return _finish(deck)


def _keywords(text: str) -> Iterator[tuple[str, dict[str, str], list[list[str]]]]:
    """Keyword, options and the comma-separated data lines below it."""
    keyword, options, lines = "", {}, []  # type: str, dict[str, str], list[list[str]]
    for line in text.splitlines():
        if line.startswith("**") or not line.strip():
            continue
        if line.startswith("*"):
            yield keyword, options, lines
            head, *rest = (word.strip() for word in line[1:].split(","))
            keyword, lines = head.upper(), []
            options = {
                key.strip().upper(): value.strip() for key, _, value in (w.partition("=") for w in rest)
            }
        else:
            lines.append([word.strip() for word in line.split(",")])
    yield keyword, options, lines


def _numbers(deck: _Deck, lines: list[list[str]], what: str) -> list[int]:
    words = [word for line in lines for word in line if word]
    try:
        return [int(word) for word in words]
    except ValueError:
        wrong = next(word for word in words if not word.lstrip("+-").isdigit())
        raise MeshError(
            f"{deck.place}: {what} holds {wrong!r}, expected whole numbers; repair the file"
        ) from None


def _read_nodes(deck: _Deck, _: dict[str, str], lines: list[list[str]]) -> None:
    for line in lines:
        try:
            number, position = int(line[0]), [float(word) for word in line[1:4] if word]
        except ValueError:
            raise MeshError(
                f"{deck.place}: *NODE line {','.join(line)!r} is no node; repair the file"
            ) from None
        if number in deck.nodes:
            raise MeshError(
                f"{deck.place}: node {number} is given twice (several parts?), limit once; "
                "export one flat mesh with element sets instead of parts"
            )
        deck.nodes[number] = position + [0.0] * (3 - len(position))


def _read_elements(deck: _Deck, options: dict[str, str], lines: list[list[str]]) -> None:
    kind = options.get("TYPE", "").upper()
    cell_type, size = _cell_type(deck, kind)
    if cell_type is None:
        return
    numbers = _numbers(deck, lines, f"*ELEMENT, TYPE={kind}")
    if len(numbers) % (size + 1):
        raise MeshError(
            f"{deck.place}: *ELEMENT, TYPE={kind} has {len(numbers)} numbers, not a multiple of {size + 1} "
            f"(element and {size} nodes); repair the file"
        )
    rows = [numbers[k : k + size + 1] for k in range(0, len(numbers), size + 1)]
    deck.blocks.append((cell_type, [row[0] for row in rows], [row[1:] for row in rows]))
    if "ELSET" in options:
        deck.element_sets.setdefault(options["ELSET"], []).extend(row[0] for row in rows)


def _cell_type(deck: _Deck, kind: str) -> tuple[str | None, int]:
    """meshio's name and the node count of an element type; None for what is neither solid nor shell."""
    if solid := _SOLID.match(kind):
        size = int(solid[1])
        if size not in _SOLID_TYPES:
            raise MeshError(f"{deck.place}: unsupported element type {kind}; use C3D8, C3D20, C3D4 or C3D10")
        return _SOLID_TYPES[size], size
    shell = _SHELL.match(kind)
    size = int(shell[1]) if shell else 0
    return _SHELL_TYPES.get(size), size


def _read_set(deck: _Deck, options: dict[str, str], lines: list[list[str]], key: str) -> None:
    sets = deck.element_sets if key == "ELSET" else deck.node_sets
    members = sets.setdefault(options.get(key, ""), [])
    if "GENERATE" in options:
        for line in lines:
            first, last, *step = _numbers(deck, [line], f"*{key}, GENERATE")
            members.extend(range(first, last + 1, step[0] if step else 1))
        return
    for word in (word for line in lines for word in line if word):
        members.extend(sets[word] if word in sets else _numbers(deck, [[word]], f"*{key} {options.get(key)}"))


def _read_surface(deck: _Deck, options: dict[str, str], lines: list[list[str]]) -> None:
    if options.get("TYPE", "ELEMENT").upper() != "ELEMENT":
        return
    sides = [
        (line[0], int(line[1][1:])) for line in lines if len(line) > 1 and re.match(r"^[Ss]\d$", line[1])
    ]
    deck.surfaces.setdefault(options.get("NAME", ""), []).extend(sides)


def _refuse_include(deck: _Deck, _: dict[str, str], __: list[list[str]]) -> None:
    raise MeshError(f"{deck.place}: *INCLUDE is not followed; put the mesh into one file")


def _refuse_moved(deck: _Deck, options: dict[str, str], lines: list[list[str]]) -> None:
    if lines:
        raise MeshError(
            f"{deck.place}: *INSTANCE {options.get('NAME', '')} moves its part, which is not followed; "
            "export one flat mesh with element sets instead of parts"
        )


_READ = {
    "NODE": _read_nodes,
    "ELEMENT": _read_elements,
    "ELSET": lambda deck, options, lines: _read_set(deck, options, lines, "ELSET"),
    "NSET": lambda deck, options, lines: _read_set(deck, options, lines, "NSET"),
    "SURFACE": _read_surface,
    "INCLUDE": _refuse_include,
    "INSTANCE": _refuse_moved,
}


def _finish(deck: _Deck) -> tuple[meshio.Mesh, dict[str, list[Ints]], dict[str, Ints]]:
    """Number nodes and elements from 0 and turn surfaces into facets."""
    import meshio

    index = {number: k for k, number in enumerate(deck.nodes)}
    unknown = {n for _, _, rows in deck.blocks for row in rows for n in row if n not in index}
    if unknown:
        raise MeshError(
            f"{deck.place}: elements use node {min(unknown)}, which is not given; repair the file"
        )
    members = {name: set(numbers) for name, numbers in deck.element_sets.items()}
    blocks = list(deck.blocks)
    for name, sides in deck.surfaces.items():
        blocks += _surface_blocks(deck, sides, name, members)
    cells = [(kind, np.array([[index[n] for n in row] for row in rows])) for kind, _, rows in blocks]
    groups = {
        name: [np.flatnonzero(np.isin(np.array(numbers), list(own))) for _, numbers, _ in blocks]
        for name, own in members.items()
    }
    node_sets = {
        name: np.array([index[n] for n in numbers if n in index], dtype=np.int64)
        for name, numbers in deck.node_sets.items()
    }
    return meshio.Mesh(np.array(list(deck.nodes.values())), cells), groups, node_sets


def _surface_blocks(
    deck: _Deck, sides: list[tuple[str, int]], name: str, members: dict[str, set[int]]
) -> list[tuple[str, list[int], list[list[int]]]]:
    """The facets of a surface as blocks; they get numbers below zero and join the set of its name."""
    found: dict[str, list[list[int]]] = {"triangle": [], "quad": []}
    for of, side in sides:
        wanted = members.get(of) or set(_numbers(deck, [[of]], f"*SURFACE {name}"))
        for kind, numbers, rows in deck.blocks:
            for number, row in zip(numbers, rows, strict=True):
                if number in wanted and side <= len(_SIDES.get(kind, ())):
                    corners = [row[k] for k in _SIDES[kind][side - 1]]
                    found["quad" if len(corners) == 4 else "triangle"].append(corners)
    own = members.setdefault(name, set())
    blocks = []
    for kind, rows in found.items():
        if rows:
            used = -min(0, *(min(m, default=0) for m in members.values()))
            numbers = [-used - 1 - k for k in range(len(rows))]
            own.update(numbers)
            blocks.append((kind, numbers, rows))
    return blocks
