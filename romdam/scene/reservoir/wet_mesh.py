"""The wetted part of a dam's faces as triangles and quadrilaterals cut off at the water level.

Where wet faces of two blocks meet and do not share their nodes, along a seam, the pressure is that of the
side with fewer nodes: nodes of the other one follow the edges that they lie on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix, diags_array

from romdam.core.scene import Block, Bools, Ints, Reservoir
from romdam.geometry.elements import ELEMENTS, Element, Floats, facet_element
from romdam.geometry.meshes.kinds import facets_by_kind
from romdam.geometry.nearest import merge_near, tree

_SAME = 1e-3  # of a piece's size, and metres: nodes so near are the same, across joints too
_ASIDE = 0.05  # of an edge, how far aside of another it may be to lie on it
_LEVEL = 1e-9  # of the depth: nodes so near to the level are on it


@dataclass(frozen=True)
class WetPieces:
    """Pieces of one face with the same number of corners, each inside one facet.

    Attributes
    ----------
    block : name
    facets : (n, nodes per facet) the facet of each piece
    xi : (n, c, 2) its corners in the facet's coordinates
    nodes : (n, c) its corners' numbers in the wet mesh
    """

    block: str
    facets: Ints
    xi: Floats
    nodes: Ints

    @property
    def element(self) -> Element:
        """Linear shape functions over a piece."""
        return ELEMENTS["tri3" if self.xi.shape[1] == 3 else "quad4"]

    def quadrature(self, points: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Linear shape functions (nq, c), the facet's (n, nq, nn), area vectors (n, nq, 3) [m2], positions.

        The area vectors are the outward normal times the weight of each point, on the facet's own, perhaps
        curved, geometry.
        """
        eta, weight = self.element.rule_of(4 if self.element.box else 6)
        linear, parent = self.element.shape(eta), facet_element(self.facets)
        xi = np.einsum("qc,ncd->nqd", linear, self.xi)
        flat = xi.reshape(-1, 2)
        shape = parent.shape(flat).reshape(*xi.shape[:2], -1)
        gradient = parent.gradient(flat).reshape(*xi.shape[:2], 2, -1)
        x = points[self.facets]
        tangents = np.einsum("nqda,nak->nqdk", gradient, x)
        stretch = np.linalg.det(np.einsum("qec,ncd->nqed", self.element.gradient(eta), self.xi))
        area = np.cross(tangents[:, :, 0], tangents[:, :, 1]) * (stretch * weight)[..., None]
        return linear, shape, area, np.einsum("nqa,nak->nqk", shape, x)


@dataclass(frozen=True)
class WetMesh:
    """Pieces of all wet faces; nodes where faces or blocks meet are one.

    Attributes
    ----------
    points : (k, 3) [m]
    surface : (k,) True on the water's surface
    pieces : of every face
    seams : (n, 2) edges along which faces meet without sharing their nodes
    follow : (k, k) pressure at all nodes from that at those which do not follow others; the identity
        without seams
    """

    points: Floats
    surface: np.ndarray
    pieces: tuple[WetPieces, ...]
    seams: Ints
    follow: csr_matrix

    @property
    def independent(self) -> Ints:
        """Nodes below the surface whose pressure is an unknown."""
        return np.flatnonzero(~self.surface & (np.diff(self.follow.tocsc().indptr) > 0))

    @property
    def rim(self) -> Ints:
        """(n, 2) edges, below the surface, that one piece alone has."""
        return _rim(self.pieces, self.surface)[0]


def wet_mesh(blocks: dict[str, Block], reservoir: Reservoir) -> WetMesh:
    """Cut the wet faces off at the level and number their corners."""
    raw = [
        (face.block, *part)
        for face in reservoir.faces
        for _, facets, _ in facets_by_kind(face.facets)
        for part in _below(blocks[face.block].points, facets, reservoir)
    ]
    corners = np.concatenate([x.reshape(-1, 3) for *_, x in raw])
    size = min(float(np.linalg.norm(x[:, 1] - x[:, 0], axis=1).min()) for *_, x in raw)
    number = merge_near(corners, min(_SAME, _SAME * size))
    points = corners[np.unique(number, return_index=True)[1]]
    ends = np.cumsum([x.shape[0] * x.shape[1] for *_, x in raw])[:-1]
    pieces = tuple(
        WetPieces(block, facets, xi, nodes.reshape(xi.shape[:2]))
        for (block, facets, xi, _), nodes in zip(raw, np.split(number, ends), strict=True)
    )
    surface = points[:, 2] >= reservoir.level - _LEVEL * reservoir.depth
    return WetMesh(points, surface, pieces, *_seams(points, surface, pieces))


def _rim(pieces: tuple[WetPieces, ...], surface: Bools) -> tuple[Ints, Ints]:
    """Edges (n, 2), below the surface, that one piece alone has, and the number of the piece."""
    pairs = [np.stack([p.nodes, np.roll(p.nodes, -1, axis=1)], axis=2).reshape(-1, 2) for p in pieces]
    owner = np.repeat(np.arange(len(pieces)), [len(nodes_of) for nodes_of in pairs])
    edges, first, count = np.unique(
        np.sort(np.concatenate(pairs), axis=1), axis=0, return_index=True, return_counts=True
    )
    alone = (count == 1) & ~surface[edges].all(axis=1)
    return edges[alone], owner[first[alone]]


def _seams(points: Floats, surface: Bools, pieces: tuple[WetPieces, ...]) -> tuple[Ints, csr_matrix]:
    """Edges on seams, and what follows what, see `WetMesh`."""
    edges, piece = _rim(pieces, surface)
    block = np.array([part_of_dam.block for part_of_dam in pieces])[piece]
    opposite = _opposite(points, edges, block)  # pairs of edges (i, j), the middle of i on j
    seams, follow = np.unique(opposite), diags_array(np.ones(len(points))).tolil()
    nodes = {(a, b): set(edges[opposite[(block[opposite] == (a, b)).all(axis=1)][:, 0]].ravel().tolist())
             for a, b in {tuple(pair) for pair in block[opposite].tolist()}}  # fmt: skip
    for (piece_nodes, other), candidates in nodes.items():
        fewer = nodes.get((other, piece_nodes), set())
        if (len(candidates), piece_nodes) <= (len(fewer), other):  # of as many, one of the two
            continue
        masters = edges[np.unique(opposite[(block[opposite] == (piece_nodes, other)).all(axis=1)][:, 1])]
        free = [node for node in candidates - set(masters.ravel().tolist()) if not surface[node]]
        for node in free:
            start, along = points[masters[:, 0]], points[masters[:, 1]] - points[masters[:, 0]]
            share = np.clip(((points[node] - start) * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
            nearest = int(np.linalg.norm(start + share[:, None] * along - points[node], axis=1).argmin())
            follow[node, node] = 0.0
            follow[node, masters[nearest, 0]] = 1.0 - share[nearest]
            follow[node, masters[nearest, 1]] += share[nearest]
    whole = csr_matrix(follow)
    for _ in range(len(nodes)):  # where seams meet, a node may follow one that follows
        whole = csr_matrix(whole @ csr_matrix(follow))
    whole.eliminate_zeros()
    return edges[seams], whole


def _opposite(points: Floats, edges: Ints, block: np.ndarray) -> Ints:
    """Pairs (n, 2) of edges of two blocks, the middle of the first on the second."""
    ends = points[edges]
    middle, length = ends.mean(axis=1), np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    meetings = [np.zeros((0, 2), dtype=np.int64)]
    reach = 0.5 * (length + length.max(initial=0.0))
    for i, near in enumerate(tree(middle).query_ball_point(middle, reach) if len(edges) else ()):
        others = np.array([j for j in near if block[j] != block[i]], dtype=np.int64)
        start, along = ends[others, 0], ends[others, 1] - ends[others, 0]
        share = np.einsum("nk,nk->n", middle[i] - start, along) / np.maximum(length[others] ** 2, 1e-300)
        apart = np.linalg.norm(start + np.clip(share, 0.0, 1.0)[:, None] * along - middle[i], axis=1)
        neighbours = others[(apart < _ASIDE * length[i]) & (share > 0.0) & (share < 1.0)]
        meetings.append(np.stack([np.full(len(neighbours), i), neighbours], axis=1))
    return np.concatenate(meetings)


def _below(points: Floats, facets: Ints, reservoir: Reservoir) -> list[tuple[Ints, Floats, Floats]]:
    """(facets, xi, positions) of pieces below the level: whole facets, then triangles of those it cuts."""
    element, slack = facet_element(facets), _LEVEL * reservoir.depth
    c, level = element.corners, reservoir.level
    height = points[facets[:, :c], 2]
    whole = (height <= level + slack).all(axis=1)
    cut = ~whole & (height < level - slack).any(axis=1)
    pieces_below = []
    if whole.any():
        xi = np.broadcast_to(element.nodes[:c], (int(whole.sum()), c, 2))
        pieces_below.append((facets[whole], xi, points[facets[whole][:, :c]]))
    cut_facets, triangles = [], []
    for facet in facets[cut]:
        ring = np.hstack([element.nodes[:c], points[facet[:c]]])  # corners (c, 5): xi, x, y, z
        kept: list[Floats] = []
        for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
            if a[4] <= level:
                kept.append(a)
            if (a[4] - level) * (b[4] - level) < 0.0:
                kept.append(a + (level - a[4]) / (b[4] - a[4]) * (b - a))
        for k in range(1, len(kept) - 1):
            cut_facets.append(facet)
            triangles.append(np.array([kept[0], kept[k], kept[k + 1]]))
    if triangles:
        corner = np.array(triangles)
        pieces_below.append((np.array(cut_facets), corner[..., :2], corner[..., 2:]))
    return pieces_below
