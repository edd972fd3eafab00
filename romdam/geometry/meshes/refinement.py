"""Uniform refinement of a block's mesh: every cell is cut into eight of its kind, every facet into four.

The shape functions of a cell give the positions of the new nodes, so the shape of quadratic blocks stays.
There their values are multiples of a power of two, so weights and node numbers say exactly which new nodes
of neighbouring cells coincide, whatever else lies at the same position. Nodes keep their numbers; others
follow.
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
from romdam.geometry.elements import ELEMENTS
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
                "cannot cut into cells of their kind; mesh the part with hexahedra, wedges or tetrahedra"
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
        table = children[:, numbers].reshape(-1, numbers.shape[1])
        if kind.name != block.element:  # in a block of several kinds some nodes stand twice
            table = table[:, list(COLLAPSED[3, frame(block.element).cell.nodes][kind.cell.name])]
        tables.append(table)
        start += count * width

    def refined_facets(facets: Ints) -> Ints:
        kinds = []
        for _, table, _ in facets_by_kind(facets):
            kind = next(e for e in ELEMENTS.values() if e.cell.dim == 2 and e.cell.nodes == table.shape[1])
            _, weights, numbers = _children(kind.name)
            children = rank[np.searchsorted(known, _keys(labels, table, weights))]
            pieces = children[:, numbers].reshape(-1, numbers.shape[1])
            if pieces.shape[1] < facets.shape[1]:
                (columns,) = (
                    f for f in COLLAPSED[2, facets.shape[1]].values() if len(set(f)) == pieces.shape[1]
                )
                pieces = pieces[:, list(columns)]
            kinds.append(pieces)
        return np.concatenate(kinds) if kinds else facets

    faces = {name: refined_facets(facets) for name, facets in block.faces.items()}
    return replace(block, points=points, cells=np.concatenate(tables), faces=faces)


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


def _child_corners() -> dict[str, list[Floats]]:
    """Corners of the children of every linear cell, (corners, d) each."""
    a, b, c = ELEMENTS["tri3"].nodes
    ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
    triangles = [np.array(corners) for corners in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    wedges = []
    for low in (0.0, 0.5):
        for triangle in triangles:
            wedges.append(np.vstack([np.c_[triangle, np.full(3, z)] for z in (low, low + 0.5)]))

    # four tetrahedra at the corners, and four around the diagonal ac to bd of the octahedron between them
    a, b, c, d = ELEMENTS["tet4"].nodes
    ab, ac, ad, bc, bd, cd = (0.5 * (p + q) for p, q in ((a, b), (a, c), (a, d), (b, c), (b, d), (c, d)))
    inner = [(ac, bd, ab, bc), (ac, bd, bc, cd), (ac, bd, cd, ad), (ac, bd, ad, ab)]
    tetrahedra = []
    for tet in [(a, ab, ac, ad), (ab, b, bc, bd), (ac, bc, c, cd), (ad, bd, cd, d), *inner]:
        turned = np.linalg.det(np.array(tet[1:]) - tet[0]) <= 0.0
        tetrahedra.append(np.array((tet[1], tet[0], *tet[2:]) if turned else tet))

    hexahedron, quadrilateral = ELEMENTS["hex8"].nodes, ELEMENTS["quad4"].nodes
    return {
        "hex8": [0.5 * (hexahedron + octant) for octant in hexahedron],
        "wedge6": wedges,
        "tet4": tetrahedra,
        "quad4": [0.5 * (quadrilateral + quadrant) for quadrant in quadrilateral],
        "tri3": triangles,
    }


_CHILDREN = _child_corners()
