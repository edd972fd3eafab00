"""Uniform refinement of a block's mesh: every cell is cut into eight of its kind, every facet into four.

The shape functions of a cell give the places of the new nodes, so the shape of quadratic blocks stays. At
these places their values are multiples of a power of two, so weights and node numbers say exactly which new
nodes of neighbouring cells are one, whatever lies at the same place. Nodes keep their numbers; others follow.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from romdam.core.arrays import Floats, Ints
from romdam.core.errors import MeshError
from romdam.core.scene import Block
from romdam.geometry.cells import COLLAPSED
from romdam.geometry.elements import ELEMENTS, Element
from romdam.geometry.meshes.kinds import facets_by_kind, frame, kinds_of

_WHOLE = 2**12  # shape functions at the new nodes are multiples of 1 / _WHOLE
_ROUND_OFF = 1e-6  # of that multiple


def refine(block: Block, location: str) -> Block:
    """Cut every cell of a block into eight.

    Parameters
    ----------
    location : file and key of the block, for messages

    Raises
    ------
    MeshError
        for pyramids, which cannot be cut into pyramids alone.
    """
    labels = np.random.default_rng(0).integers(2**63, size=len(block.points), dtype=np.uint64)
    cells, keys, places = [], [], []
    for kind, _, table in kinds_of(block.element, block.cells):
        if kind.linear not in _CHILDREN:
            raise MeshError(
                f"{location}: {len(table)} of {len(block.cells)} cells are {kind.name}, which refinement "
                "cannot "
                "cut into cells of their kind; mesh the part with hexahedra, wedges or tetrahedra"
            )
        _, weights, numbers = _children(kind.name)
        keys.append(_keys(labels, table, weights).ravel())
        places.append(np.einsum("ka,cai->cki", weights, block.points[table]).reshape(-1, 3))
        cells.append((kind, numbers, len(table), len(weights)))
    old = labels * np.uint64(_WHOLE)
    known, first, number = np.unique(np.concatenate([old, *keys]), return_index=True, return_inverse=True)
    rank = np.empty(len(known), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(known))  # old nodes first, then new ones as cells have them
    number = rank[number][len(old) :]
    points = np.vstack([block.points, *places])[np.sort(first)]
    tables, start = [], 0
    for kind, numbers, count, width in cells:
        children = number[start : start + count * width].reshape(count, width)
        tables.append(_in_frame(children[:, numbers].reshape(-1, numbers.shape[1]), kind, block.element))
        start += count * width

    def refined_facets(facets: Ints) -> Ints:
        kinds = []
        for _, table, _ in facets_by_kind(facets):
            kind = next(e for e in ELEMENTS.values() if e.cell.dim == 2 and e.cell.nodes == table.shape[1])
            _, weights, numbers = _children(kind.name)
            children = rank[np.searchsorted(known, _keys(labels, table, weights))]
            pieces = children[:, numbers].reshape(-1, numbers.shape[1])
            if pieces.shape[1] < facets.shape[1]:
                (frame,) = (
                    f for f in COLLAPSED[2, facets.shape[1]].values() if len(set(f)) == pieces.shape[1]
                )
                pieces = pieces[:, list(frame)]
            kinds.append(pieces)
        return np.concatenate(kinds) if kinds else facets

    faces = {name: refined_facets(facets) for name, facets in block.faces.items()}
    return replace(block, points=points, cells=np.concatenate(tables), faces=faces)


def _in_frame(cells: Ints, kind: Element, element: str) -> Ints:
    """Cells of a kind in the table of a block, where some of several kinds have nodes that stand twice."""
    if kind.name == element:
        return cells
    return cells[:, list(COLLAPSED[3, frame(element).cell.nodes][kind.cell.name])]


def _keys(labels: NDArray[np.uint64], cells: Ints, weights: Floats) -> NDArray[np.uint64]:
    """Number of every new node of every cell (nc, new nodes), equal where nodes and weights are."""
    whole = np.rint(weights * _WHOLE)
    assert np.abs(whole - weights * _WHOLE).max() < _ROUND_OFF
    factors = whole.astype(np.int64).astype(np.uint64)  # modulo 2^64, as the sum
    total = np.zeros((len(cells), len(weights)), dtype=np.uint64)
    for node in range(cells.shape[1]):
        total += labels[cells[:, node]][:, None] * factors[None, :, node]
    return total


@cache
def _children(name: str) -> tuple[Floats, Floats, Ints]:
    """New nodes of a cell: places (k, d), shape functions there (k, nn), and the children's nodes (c, nn)."""
    element = ELEMENTS[name]
    linear = ELEMENTS[element.linear]
    corners = np.array(_CHILDREN[element.linear])  # (c, corners, d)
    nodes = np.einsum("na,cad->cnd", linear.shape(element.nodes), corners)
    whole = np.rint(nodes.reshape(-1, nodes.shape[2]) * _WHOLE).astype(np.int64)
    places, number = np.unique(whole, axis=0, return_inverse=True)
    xi = places / _WHOLE
    return xi, element.shape(xi), number.reshape(nodes.shape[:2])


def _hexahedra() -> list[Floats]:
    corners = ELEMENTS["hex8"].nodes
    return [0.5 * (corners + octant) for octant in corners]


def _quadrilaterals() -> list[Floats]:
    corners = ELEMENTS["quad4"].nodes
    return [0.5 * (corners + quadrant) for quadrant in corners]


def _triangles() -> list[Floats]:
    a, b, c = ELEMENTS["tri3"].nodes
    ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
    return [np.array(t) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]


def _wedges() -> list[Floats]:
    return [
        np.vstack([np.c_[triangle, np.full(3, z)] for z in (low, low + 0.5)])
        for low in (0.0, 0.5)
        for triangle in _triangles()
    ]


def _tetrahedra() -> list[Floats]:
    """Four at the corners, and the octahedron between them in four around its diagonal from ac to bd."""
    a, b, c, d = ELEMENTS["tet4"].nodes
    ab, ac, ad, bc, bd, cd = (0.5 * (p + q) for p, q in ((a, b), (a, c), (a, d), (b, c), (b, d), (c, d)))
    inner = [(ac, bd, ab, bc), (ac, bd, bc, cd), (ac, bd, cd, ad), (ac, bd, ad, ab)]
    tetrahedra = [(a, ab, ac, ad), (ab, b, bc, bd), (ac, bc, c, cd), (ad, bd, cd, d), *inner]
    return [np.array(tet if _volume(tet) > 0.0 else (tet[1], tet[0], *tet[2:])) for tet in tetrahedra]


def _volume(tet: tuple[Floats, ...]) -> float:
    return float(np.linalg.det(np.array(tet[1:]) - tet[0]))


_CHILDREN = {
    "hex8": _hexahedra(),
    "wedge6": _wedges(),
    "tet4": _tetrahedra(),
    "quad4": _quadrilaterals(),
    "tri3": _triangles(),
}
