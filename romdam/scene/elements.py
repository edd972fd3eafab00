"""The elements and their facets as tables: an element is its nodes, its monomials and a quadrature rule.

Node orders are VTK's (and meshio's). Shape functions follow from the tables alone, N = p(xi) V^-1
with V the monomials at the nodes, so there is one code for every element.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from romdam.core.arrays import Floats

Rule = tuple[Floats, Floats]

_HEX_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
_HEX_FACETS = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
_TET_EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
_TET_FACETS = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))
_QUAD_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0))
_TRI_EDGES = ((0, 1), (1, 2), (2, 0))

_QUAD_CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float)
_HEX_CORNERS = np.vstack([np.c_[_QUAD_CORNERS, np.full(4, z)] for z in (-1.0, 1.0)])
_TRI_CORNERS = np.array([[0, 0], [1, 0], [0, 1]], dtype=float)
_TET_CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)


@dataclass(frozen=True)
class Element:
    """An element of dimension d with nn nodes, of which the first are its corners.

    Attributes
    ----------
    name : hex8, hex20, tet4, tet10, quad4, quad8, tri3 or tri6
    nodes : (nn, d) reference coordinates; hexahedra and quadrilaterals live on [-1, 1]^d
    exponents : (nn, d) of the monomials that span the shape functions
    edges : corner pairs, in the order of the mid-edge nodes
    facets : node numbers of each facet, seen from outside counterclockwise, then its mid-edge nodes
    corners : number of corner nodes
    order : Gauss points per direction, or degree of the simplex rule, of `rule`
    """

    name: str
    nodes: Floats
    exponents: NDArray[np.int64]
    edges: tuple[tuple[int, int], ...]
    facets: tuple[tuple[int, ...], ...]
    corners: int
    order: int

    @property
    def quadratic(self) -> bool:
        """Whether the element has mid-edge nodes."""
        return len(self.nodes) > self.corners

    @property
    def rule(self) -> Rule:
        """Points (nq, d) and weights (nq,) that integrate stiffness and mass of a straight element."""
        dimension = self.nodes.shape[1]
        if self.corners == 2**dimension:
            return gauss_rule(self.order, dimension)
        return simplex_rule(self.order, dimension)

    def shape(self, xi: Floats) -> Floats:
        """Shape functions at xi (nq, d), as (nq, nn)."""
        return _monomials(xi, self.exponents) @ _coefficients(self.name)

    def gradient(self, xi: Floats) -> Floats:
        """Derivatives of the shape functions along the reference axes at xi (nq, d), as (nq, d, nn)."""
        d = self.nodes.shape[1]
        columns = []
        for axis in range(d):
            lowered = self.exponents.copy()
            lowered[:, axis] = np.maximum(lowered[:, axis] - 1, 0)
            columns.append(_monomials(xi, lowered) * self.exponents[:, axis] @ _coefficients(self.name))
        return np.stack(columns, axis=1)


def _monomials(xi: Floats, exponents: NDArray[np.int64]) -> Floats:
    return np.prod(np.asarray(xi)[:, None, :] ** exponents[None], axis=2)


@cache
def _coefficients(name: str) -> Floats:
    element = ELEMENTS[name]
    return np.asarray(np.linalg.inv(_monomials(element.nodes, element.exponents)), dtype=float)


@cache
def gauss_rule(n: int, dimension: int) -> Rule:
    """Tensor-product Gauss rule with n points per direction on [-1, 1]^dimension."""
    x, w = np.polynomial.legendre.leggauss(n)
    points = np.array(list(product(x, repeat=dimension)))
    weights = np.prod(np.array(list(product(w, repeat=dimension))), axis=1)
    return points, weights


@cache
def simplex_rule(order: int, dimension: int) -> Rule:
    """Rule of scikit-fem on the unit triangle or tetrahedron, exact to `order`, all weights positive."""
    from skfem.quadrature import get_quadrature
    from skfem.refdom import RefTet, RefTri

    points, weights = get_quadrature(RefTri if dimension == 2 else RefTet, order)
    assert np.all(weights > 0.0), "choose a rule with positive weights"
    return np.ascontiguousarray(points.T), weights


def _box_monomials(dimension: int, serendipity: bool) -> NDArray[np.int64]:
    linear = list(product((0, 1), repeat=dimension))
    if not serendipity:
        return np.array(linear)
    squares = [(*e[:a], 2, *e[a + 1 :]) for a in range(dimension) for e in linear if e[a] == 0]
    return np.array(linear + squares)


def _simplex_monomials(dimension: int, degree: int) -> NDArray[np.int64]:
    return np.array([e for e in product(range(degree + 1), repeat=dimension) if sum(e) <= degree])


def _with_midsides(corners: Floats, edges: tuple[tuple[int, int], ...]) -> Floats:
    return np.vstack([corners, [(corners[a] + corners[b]) / 2 for a, b in edges]])


def _with_edge_nodes(
    facets: tuple[tuple[int, ...], ...], edges: tuple[tuple[int, int], ...], corners: int
) -> tuple[tuple[int, ...], ...]:
    """Append to each facet's corners the mid-edge nodes of its ring."""
    number = {frozenset(edge): corners + k for k, edge in enumerate(edges)}
    rings = [[number[frozenset((f[k], f[(k + 1) % len(f)]))] for k in range(len(f))] for f in facets]
    return tuple((*f, *ring) for f, ring in zip(facets, rings, strict=True))


@dataclass(frozen=True)
class _Shape:
    corners: Floats
    edges: tuple[tuple[int, int], ...]
    facets: tuple[tuple[int, ...], ...]
    box: bool


_SHAPES = {
    "hex": _Shape(_HEX_CORNERS, _HEX_EDGES, _HEX_FACETS, True),
    "tet": _Shape(_TET_CORNERS, _TET_EDGES, _TET_FACETS, False),
    "quad": _Shape(_QUAD_CORNERS, _QUAD_EDGES, (), True),
    "tri": _Shape(_TRI_CORNERS, _TRI_EDGES, (), False),
}


def _element(name: str, order: int) -> Element:
    s = _SHAPES[name.rstrip("0123456789")]
    count, dimension = s.corners.shape
    quadratic = int(name.lstrip("hextquadri")) > count
    monomials = (
        _box_monomials(dimension, quadratic) if s.box else _simplex_monomials(dimension, 1 + quadratic)
    )
    nodes = _with_midsides(s.corners, s.edges) if quadratic else s.corners
    facets = _with_edge_nodes(s.facets, s.edges, count) if quadratic else s.facets
    return Element(name, nodes, monomials, s.edges, facets, count, order)


# tet10's mass needs degree 4 when straight; scikit-fem's rule of that degree has a negative weight.
ELEMENTS: dict[str, Element] = {
    element.name: element
    for element in (
        _element("hex8", 2),
        _element("hex20", 3),
        _element("tet4", 2),
        _element("tet10", 5),
        _element("quad4", 2),
        _element("quad8", 3),
        _element("tri3", 2),
        _element("tri6", 5),
    )
}

FACET_OF = {"hex8": "quad4", "hex20": "quad8", "tet4": "tri3", "tet10": "tri6"}
_FACET_BY_NODES = {3: "tri3", 4: "quad4", 6: "tri6", 8: "quad8"}


def facet_element(facets: NDArray[np.int64]) -> Element:
    """The facet element that has as many nodes as the rows of `facets`."""
    return ELEMENTS[_FACET_BY_NODES[facets.shape[1]]]


def jacobians(points: Floats, cells: NDArray[np.int64], element: Element, xi: Floats) -> Floats:
    """dx/dxi of every cell at xi (nq, 3), as (nc, nq, 3 reference, 3 space) [m]."""
    return np.einsum("qda,cak->cqdk", element.gradient(xi), points[cells], optimize=True)
