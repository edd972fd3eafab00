"""Tetrahedra cut in two, and in two again, until no edge crosses the surface."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple, Self

import numpy as np

from romdam.core.arrays import Bools, Floats, Ints
from romdam.geometry.boxes import with_middle_nodes
from romdam.geometry.cutting.mesh import Mesh
from romdam.geometry.cutting.surfaces import CuttingSurface, crossing_shares, on_edges
from romdam.geometry.elements import ELEMENTS

_EDGES = np.array(ELEMENTS["tet4"].edges)
_OPPOSITE = np.argsort([(set(range(4)) - set(f)).pop() for f in ELEMENTS["tet4"].facets])  # facet of a corner


class _Edges(NamedTuple):
    """Edges that cross: keys (ne,) ascending, lower and higher node (ne, 2), share of the way from the lower
    one, new nodes (ne,), and their turn: an edge is cut before all of a higher turn."""

    key: Ints
    nodes: Ints
    share: Floats
    new: Ints
    turn: Ints


class _Pieces(NamedTuple):
    """Tetrahedra: corners (n, 4), where these are in the cell they are of (n, 4, 4 barycentric), that cell,
    and the facets of the uncut boundary that theirs are of."""

    corners: Ints
    within: Floats
    cell: Ints
    origin: Ints

    def only(self, which: Bools) -> Self:
        """Some of them."""
        return type(self)(*(field[which] for field in self))  # type: ignore[arg-type]

    @classmethod
    def joined(cls, groups: list[Self]) -> Self:
        """All pieces of several groups."""
        return cls(*(np.concatenate(fields) for fields in zip(*groups, strict=True)))


def cut_tetrahedra(mesh: Mesh, level: Floats, surface: CuttingSurface) -> Mesh:
    """Cut every tetrahedron that the surface crosses, and note the sides.

    Each edge that crosses is cut at one node, and with it all cells around it, one edge after the other: so
    neighbours agree on every diagonal. The longest edges come first, which leaves the best shapes. Quadratic
    cells are cut in their own coordinates: their curved edges and volumes stay what they were.

    Parameters
    ----------
    level : (n,) distance of the corner nodes from the surface, exactly zero for those on it [m]
    """
    crossing = (level[mesh.corners].min(axis=1) < 0.0) & (level[mesh.corners].max(axis=1) > 0.0)
    cells = np.flatnonzero(crossing)
    edges, points = _crossing_edges(mesh, cells, level, surface)
    level = np.concatenate([level, np.zeros(len(edges.new))])
    unit = np.broadcast_to(np.eye(4), (len(cells), 4, 4))
    pieces = _cut(_Pieces(mesh.corners[cells], unit, cells, mesh.origin[cells]), edges, level, len(points))
    corners = np.concatenate([mesh.corners[~crossing], pieces.corners])
    parent = np.concatenate([np.flatnonzero(~crossing), pieces.cell])
    halves = Mesh(
        mesh.element,
        points,
        corners,
        np.concatenate([mesh.origin[~crossing], pieces.origin]),
        mesh.sides[parent],
    )
    side = np.where(level[corners].sum(axis=1) < 0.0, -1, 1)
    if ELEMENTS[mesh.element].quadratic:
        halves = _with_middles(halves, mesh, pieces)
    halves = halves.with_side(side)
    used, cells = np.unique(halves.cells, return_inverse=True)
    return replace(halves, points=halves.points[used], cells=cells.reshape(halves.cells.shape))


def _crossing_edges(mesh: Mesh, cells: Ints, level: Floats, surface: CuttingSurface) -> tuple[_Edges, Floats]:
    """The edges that cross, and all points with the new ones last."""
    count = len(mesh.points)
    ends = mesh.corners[cells][:, _EDGES].reshape(-1, 2)
    quadratic = ELEMENTS[mesh.element].quadratic
    middle = mesh.points[mesh.cells[cells, 4:].ravel()] if quadratic else mesh.points[ends].mean(axis=1)
    across = level[ends[:, 0]] * level[ends[:, 1]] < 0.0
    ends, middle = np.sort(ends[across], axis=1), middle[across]
    key, first = np.unique(ends[:, 0] * count + ends[:, 1], return_index=True)
    nodes, middle = ends[first], middle[first]
    start, end = mesh.points[nodes[:, 0]], mesh.points[nodes[:, 1]]
    share = crossing_shares(surface, start, end, middle)
    turn = np.argsort(np.argsort(-np.linalg.norm(end - start, axis=1), kind="stable"))
    new = count + np.arange(len(key))
    return _Edges(key, nodes, share, new, turn), np.vstack([mesh.points, on_edges(share, start, end, middle)])


def _cut(pieces: _Pieces, edges: _Edges, level: Floats, count: int) -> _Pieces:
    """Cut pieces at their edge with the lowest turn until none is left that crosses."""
    done, size, by_turn = [], count - len(edges.new), np.argsort(edges.turn)
    while len(pieces.cell):
        ends = pieces.corners[:, _EDGES]
        across = level[ends[:, :, 0]] * level[ends[:, :, 1]] < 0.0
        turn = np.full(across.shape, len(edges.turn))
        lower = np.sort(ends[across], axis=1)
        number = np.searchsorted(edges.key, lower[:, 0] * size + lower[:, 1])
        turn[across] = edges.turn[number]
        first = np.argmin(turn, axis=1)
        crosses = np.asarray(across.any(axis=1))
        done.append(pieces.only(~crosses))
        edge = by_turn[turn[np.flatnonzero(crosses), first[crosses]]]

        # two tetrahedra of each, cut at the edge between its corners `local` (n, 2), the lower node first
        pieces, local = pieces.only(crosses), _EDGES[first[crosses]]
        row = np.arange(len(local))
        is_lower = pieces.corners[row, local[:, 0]] == edges.nodes[edge, 0]
        local = np.where(is_lower[:, None], local, local[:, ::-1])
        share = edges.share[edge][:, None]
        within = (1.0 - share) * pieces.within[row, local[:, 0]] + share * pieces.within[row, local[:, 1]]
        halves = []
        for side in (0, 1):
            corners, inner, origin = pieces.corners.copy(), pieces.within.copy(), pieces.origin.copy()
            away, stays = local[:, 1 - side], local[:, side]
            corners[row, away], inner[row, away] = edges.new[edge], within
            origin[row, _OPPOSITE[stays]] = -1  # the facet between the halves
            halves.append(_Pieces(corners, inner, pieces.cell, origin))
        pieces = _Pieces.joined(halves)
    return _Pieces.joined(done) if done else pieces


def _with_middles(linear: Mesh, before: Mesh, pieces: _Pieces) -> Mesh:
    """Mid-edge nodes of all cells: of whole cells as they were, of pieces in their cell's shape."""
    element = ELEMENTS[before.element]
    points, cells = with_middle_nodes(linear.points, linear.cells, element)
    whole = len(cells) - len(pieces.cell)
    middle = pieces.within[:, _EDGES].mean(axis=2)
    shape = element.shape(middle.reshape(-1, 4)[:, 1:]).reshape(len(middle), 6, len(element.nodes))
    at = np.einsum("cea,cak->cek", shape, before.points[before.cells[pieces.cell]], optimize=True)
    points[cells[whole:, 4:]] = at
    old = before.cells[np.setdiff1d(np.arange(len(before.cells)), pieces.cell)]
    points[cells[:whole, 4:]] = before.points[old[:, 4:]]
    return Mesh(linear.element, points, cells, linear.origin, linear.sides)
