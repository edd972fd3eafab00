"""The points and cells of a deck as a mesh of code_aster (.mail), with a group for all that a command names.

Nodes are named N1, N2, ... by the number of their point in the deck, and elements M1, M2, ... in the order in
which they are written. What a command names is a group of nodes or elements. A gap is a node of its own
whose displacement is the jump, as in `romdam.export.keywords`; its number is behind those of the deck.
Springs, contact and added mass sit on elements of one node (POI1).

References
----------
code_aster, U3.01.00, Description du fichier de maillage au format ASTER: names of 8 characters, lines of 80.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from romdam.core.arrays import Ints
from romdam.export.deck import Deck
from romdam.geometry.meshes.kinds import kinds_of

_WORDS = 8  # of 8 characters on a line


@dataclass(frozen=True)
class Groups:
    """Groups that the commands name.

    Attributes
    ----------
    single : points that have a group of their own, see `single_group`
    nodes : name -> points of a group of nodes
    discrete : name -> points that carry a one-node element of that group of elements
    """

    single: Ints
    nodes: Mapping[str, Ints]
    discrete: Mapping[str, Ints]


def block_group(number: int) -> str:
    """Name of a block's group of elements, for its number in the deck."""
    return f"B{number + 1}"


def single_group(point: int) -> str:
    """Name of a point's own group of nodes, for its number in the deck."""
    return f"P{point + 1}"


def mail_text(deck: Deck, groups: Groups) -> str:
    """Write the mesh: nodes of solids and gaps, solids by blocks, one-node elements, groups of nodes."""
    of_solids = np.flatnonzero(deck.meshed)
    numbers = np.concatenate([of_solids, deck.jump_points])
    # a gap's node stands on its side I; where it stands changes nothing
    points = deck.points[np.concatenate([of_solids, deck.gaps.points[:, 0]])]
    lines = ["TITRE", "mesh of romdam", "FINSF", "COOR_3D"]
    for number, (x, y, z) in zip((numbers + 1).tolist(), points.tolist(), strict=True):
        lines.append(f"N{number} {x:.14E} {y:.14E} {z:.14E}")
    lines.append("FINSF")
    first = 1  # number of the next element
    for number, solid in enumerate(deck.solids):
        members = first + np.arange(len(solid.cells))
        for element, rows, cells in kinds_of(solid.element, solid.cells):
            order = element.cell.orders.get("aster")  # of each node in VTK's order its place in code_aster's
            nodes = cells if order is None else cells[:, np.argsort(order)]
            lines += _cells(element.cell.aster, members[rows], nodes)
        lines += _group("GROUP_MA", block_group(number), "M", members)
        first += len(members)
    for name, nodes in groups.discrete.items():
        members = first + np.arange(len(nodes))
        lines += [*_cells("POI1", members, nodes[:, None]), *_group("GROUP_MA", name, "M", members)]
        first += len(members)
    for name, nodes in groups.nodes.items():
        lines += _group("GROUP_NO", name, "N", nodes + 1)
    for point in groups.single.tolist():
        lines += _group("GROUP_NO", single_group(point), "N", np.array([point + 1]))
    return "\n".join([*lines, "FIN", ""])


def _cells(kind: str, members: Ints, cells: Ints) -> Iterator[str]:
    """Elements of a kind: their numbers (n,), and their points (n, nodes) in code_aster's order."""
    yield kind
    for member, cell in zip(members.tolist(), (cells + 1).tolist(), strict=True):
        yield from _lines([f"M{member}", *(f"N{node}" for node in cell)])
    yield "FINSF"


def _group(keyword: str, name: str, letter: str, members: Ints) -> Iterator[str]:
    """A group of elements (M) or nodes (N), by their numbers from 1 on."""
    yield f"{keyword} NOM = {name}"
    yield from _lines([f"{letter}{member}" for member in members.tolist()])
    yield "FINSF"


def _lines(words: list[str]) -> Iterator[str]:
    return (" ".join(words[k : k + _WORDS]) for k in range(0, len(words), _WORDS))
