"""The elements and their facets as tables: an element is what files call it, its nodes and a quadrature rule.

Everything that is known of an element stands in its line of `ELEMENTS`; readers, checks, facets, stress and
export ask it. A new one is a line here and its name in `romdam.config.sections.places.ElementName`.

Node orders are VTK's. Shape functions follow from the tables alone, N = p(xi) V^-1
with V the monomials at the nodes, so there is one code for every element.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from romdam.core.arrays import Floats
from romdam.core.errors import MeshError
from romdam.geometry.cells import COLLAPSED, OTHER_CELLS, Cell
from romdam.geometry.meshes.quadrature import Rule, gauss_rule, pyramid_rule, simplex_rule, wedge_rule

_HEX_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
_HEX_FACETS = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
_HEX_INNER = (*(_HEX_FACETS[k] for k in (5, 3, 2, 4, 0, 1)), tuple(range(8)))  # x, y, z faces, the middle
_TET_EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
_TET_FACETS = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))
_WEDGE_EDGES = ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5))
_WEDGE_FACETS = ((0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5), (0, 2, 1), (3, 4, 5))
_PYRAMID_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4))
_PYRAMID_FACETS = ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4))
_QUAD_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0))
_TRI_EDGES = ((0, 1), (1, 2), (2, 0))

_QUAD_CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float)
_HEX_CORNERS = np.vstack([np.c_[_QUAD_CORNERS, np.full(4, z)] for z in (-1.0, 1.0)])
_TRI_CORNERS = np.array([[0, 0], [1, 0], [0, 1]], dtype=float)
_TET_CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)

_WEDGE_CORNERS = np.vstack([np.c_[_TRI_CORNERS, np.full(3, z)] for z in (0.0, 1.0)])
_PYRAMID_CORNERS = np.vstack([np.c_[_QUAD_CORNERS, np.zeros(4)], [[0.0, 0.0, 1.0]]])

Corners = tuple[int, ...]


@dataclass(frozen=True)
class Element:
    """An element of dimension d with nn nodes: its corners, then those in the middle of some corners.

    Attributes
    ----------
    name : of its shape and number of nodes, such as hex20
    cell : what mesh files call it
    nodes : (nn, d) reference coordinates; hexahedra and quadrilaterals live on [-1, 1]^d, wedges on the unit
        triangle times [0, 1], pyramids on [-1, 1]^2 below their tip (0, 0, 1)
    exponents : (nn, d) of the monomials that span the shape functions; pyramids have one more, of 1/(1 - z)
    edges : corner pairs, in the order of the mid-edge nodes
    middles : of every node that is no corner, the corners it is in the middle of; edges first
    facets : node numbers of each facet as `facet` numbers them, seen from outside counterclockwise; triangles
        among quadrilaterals are collapsed ones, see `romdam.geometry.cells.COLLAPSED`
    corners : number of corner nodes
    order : Gauss points per direction, or degree of the rule of simplices and wedges, of `rule`
    linear, facet : names of the elements of its corners and of its facets
    pieces : of a facet: corners of the linear facets that its nodes cut it into
    bytes_per_node : of a solid: memory that meshing and assembling take, measured on cubes of 32,000 to
        69,000 nodes
    """

    name: str
    cell: Cell
    nodes: Floats
    exponents: NDArray[np.int64]
    edges: tuple[Corners, ...]
    middles: tuple[Corners, ...]
    facets: tuple[Corners, ...]
    corners: int
    order: int
    linear: str
    facet: str = ""
    pieces: tuple[Corners, ...] = ()
    bytes_per_node: float = 0.0

    @property
    def quadratic(self) -> bool:
        """True where the element has mid-edge nodes."""
        return len(self.nodes) > self.corners

    @property
    def on_edges(self) -> bool:
        """True where its nodes are corners and middles of edges, no others."""
        return len(self.middles) == len(self.edges)

    @property
    def skeleton(self) -> Element:
        """The element of its shape with nodes on edges only."""
        return next(e for e in ELEMENTS.values() if e.linear == self.linear and e.on_edges)

    @property
    def box(self) -> bool:
        """True for a hexahedron or a quadrilateral."""
        return bool(self.corners == 2 ** self.nodes.shape[1])

    @property
    def rule(self) -> Rule:
        """Points (nq, d) and weights (nq,) that integrate stiffness and mass of a straight element."""
        return self.rule_of(self.order)

    def rule_of(self, order: int) -> Rule:
        """Points (nq, d) and weights (nq,) of so many Gauss points per direction, or of that degree."""
        rules = {"wedge6": wedge_rule, "pyramid5": pyramid_rule}
        if self.linear in rules:
            return rules[self.linear](order)
        return (gauss_rule if self.box else simplex_rule)(order, self.nodes.shape[1])

    def shape(self, xi: Floats) -> Floats:
        """Shape functions at xi (nq, d), as (nq, nn)."""
        return _monomials(_lifted(xi, self), self.exponents) @ _coefficients(self.name)

    def gradient(self, xi: Floats) -> Floats:
        """Derivatives of the shape functions along the reference axes at xi (nq, d), as (nq, d, nn)."""
        at, slopes = _lifted(xi, self), []
        for axis in range(self.nodes.shape[1]):
            lowered = self.exponents.copy()
            lowered[:, axis] = np.maximum(lowered[:, axis] - 1, 0)
            slopes.append(_monomials(at, lowered) * self.exponents[:, axis])
        if at.shape[1] > len(slopes):  # of 1/(1 - z) along z
            raised = self.exponents + np.array([0, 0, 0, 1])
            slopes[2] += _monomials(at, raised) * self.exponents[:, 3]
        return np.stack([slope @ _coefficients(self.name) for slope in slopes], axis=1)


def _lifted(xi: Floats, element: Element) -> Floats:
    """Coordinates and, of a pyramid, 1/(1 - z) behind them, which plays no role at its tip, as x = y = 0."""
    xi = np.asarray(xi)
    if element.exponents.shape[1] == element.nodes.shape[1]:
        return xi
    below = 1.0 - xi[:, 2]
    return np.c_[xi, np.divide(1.0, below, out=np.zeros_like(below), where=below != 0.0)]


def _monomials(xi: Floats, exponents: NDArray[np.int64]) -> Floats:
    """Products of powers (nq, terms) of coordinates xi (nq, d), with exponents (terms, d) from 0 on."""
    powers = [np.ones_like(xi)]
    for _ in range(int(exponents.max(initial=0))):
        powers.append(powers[-1] * xi)
    by_axis = np.stack(powers)[exponents, :, np.arange(exponents.shape[1])]  # (terms, d, nq)
    return np.multiply.reduce(by_axis, axis=1).T


@cache
def _coefficients(name: str) -> Floats:
    element = ELEMENTS[name]
    values = _monomials(_lifted(element.nodes, element), element.exponents)
    return np.asarray(np.linalg.inv(values), dtype=float)


@dataclass(frozen=True)
class _Shape:
    """Corners, edges and facets that elements share; `inner` are the middles of facets and of the whole."""

    corners: Floats
    edges: tuple[Corners, ...]
    facets: tuple[Corners, ...] = ()
    inner: tuple[Corners, ...] = ()


_SHAPES = {
    "hex": _Shape(_HEX_CORNERS, _HEX_EDGES, _HEX_FACETS, _HEX_INNER),
    "tet": _Shape(_TET_CORNERS, _TET_EDGES, _TET_FACETS),
    "wedge": _Shape(_WEDGE_CORNERS, _WEDGE_EDGES, _WEDGE_FACETS),
    "pyramid": _Shape(_PYRAMID_CORNERS, _PYRAMID_EDGES, _PYRAMID_FACETS),
    "quad": _Shape(_QUAD_CORNERS, _QUAD_EDGES, inner=((0, 1, 2, 3),)),
    "tri": _Shape(_TRI_CORNERS, _TRI_EDGES),
}


# By corners: of wedges, those of the triangle along its axis; of pyramids, Bedrosian's (1992), with the
# exponent of 1/(1 - z) at the end. The linear element's come first.
_MONOMIALS: dict[int, list[tuple[int, ...]]] = {
    6: [
        *((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)),
        *((2, 0, 0), (1, 1, 0), (0, 2, 0), (2, 0, 1), (1, 1, 1), (0, 2, 1), (0, 0, 2), (1, 0, 2), (0, 1, 2)),
    ],
    5: [
        *((0, 0, 0, 0), (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (1, 1, 0, 1)),
        *((2, 0, 0, 0), (0, 2, 0, 0), (0, 0, 2, 0), (1, 1, 0, 0), (1, 0, 1, 0), (0, 1, 1, 0)),
        *((2, 1, 0, 1), (1, 2, 0, 1)),
    ],
}


def _monomials_of(shape: _Shape, nodes: int) -> NDArray[np.int64]:
    """Exponents of as many monomials as an element of the shape has nodes."""
    count, d = shape.corners.shape
    linear = list(product((0, 1), repeat=d))
    if count == d + 1:  # a simplex
        degree = 1 if nodes == count else 2
        return np.array([e for e in product(range(degree + 1), repeat=d) if sum(e) <= degree])
    if count in _MONOMIALS:
        return np.array(_MONOMIALS[count][:nodes])
    if nodes == 3**d:
        return np.array(list(product((0, 1, 2), repeat=d)))
    if nodes == count:
        return np.array(linear)
    squares = [(*e[:a], 2, *e[a + 1 :]) for a in range(d) for e in linear if e[a] == 0]
    return np.array(linear + squares)


def _with_middles(
    facets: tuple[Corners, ...], middles: tuple[Corners, ...], corners: int
) -> tuple[Corners, ...]:
    """Append to each facet's corners the nodes in the middle of its edges, and its own where there is one."""
    number = {frozenset(edge): corners + k for k, edge in enumerate(middles)}
    rings = [[(f[k], f[(k + 1) % len(f)]) for k in range(len(f))] for f in facets]
    whole = [
        (*f, *(number[frozenset(edge)] for edge in (*ring, f) if frozenset(edge) in number))
        for f, ring in zip(facets, rings, strict=True)
    ]
    widest = max(map(len, whole), default=0)
    triangle = COLLAPSED.get((2, widest), {}).get("triangle" if widest == 4 else "triangle6", ())
    return tuple(f if len(f) == widest else tuple(f[k] for k in triangle) for f in whole)


def _element(name: str, cell: Cell, order: int, **others: Any) -> Element:
    """An element; its nodes, facets and monomials follow from its shape and its number of nodes."""
    kind = name.rstrip("0123456789")
    shape = _SHAPES[kind]
    count = len(shape.corners)
    middles = (*shape.edges, *shape.inner)[: cell.nodes - count]
    return Element(
        name,
        cell,
        nodes=np.vstack([shape.corners, *(shape.corners[list(edge)].mean(axis=0) for edge in middles)]),
        exponents=_monomials_of(shape, cell.nodes),
        edges=shape.edges,
        middles=middles,
        facets=_with_middles(shape.facets, middles, count),
        corners=count,
        order=order,
        linear=f"{kind}{count}",
        **others,
    )


# Nastran has no hexahedron of 27 nodes. The mass of a straight tet10 needs degree 4.
ELEMENTS: dict[str, Element] = {
    element.name: element
    for element in (
        _element(
            "hex8",
            Cell("hexahedron", 3, 8, 12, 5, True, ("CHEXA",), "HE8", "HEXA8", (115,)),
            order=2,
            facet="quad4",
            bytes_per_node=5.1e3,
        ),
        _element(
            "hex20",
            Cell("hexahedron20", 3, 20, 25, 17, True, ("CHEXA",), "H20", "HEXA20", (116,)),
            order=3,
            facet="quad8",
            bytes_per_node=10.8e3,
        ),
        _element(
            "hex27",
            Cell("hexahedron27", 3, 27, 29, 12, True, (), "H27", "HEXA27"),
            order=3,
            facet="quad9",
            bytes_per_node=11.8e3,
        ),
        _element(
            "tet4",
            Cell("tetra", 3, 4, 10, 4, True, ("CTETRA",), "TE4", "TETRA4", (111,)),
            order=2,
            facet="tri3",
            bytes_per_node=3.4e3,
        ),
        _element(
            "tet10",
            Cell("tetra10", 3, 10, 24, 11, True, ("CTETRA",), "T10", "TETRA10", (118,)),
            order=4,
            facet="tri6",
            bytes_per_node=5.5e3,
        ),
        _element(
            "wedge6",
            Cell("wedge", 3, 6, 13, 6, True, ("CPENTA",), "PE6", "PENTA6", (112,)),
            order=2,
            facet="quad4",
            bytes_per_node=4.3e3,
        ),
        _element(
            "wedge15",
            Cell("wedge15", 3, 15, 26, 18, True, ("CPENTA",), "P15", "PENTA15", (113,)),
            order=5,
            facet="quad8",
            bytes_per_node=8.4e3,
        ),
        _element(
            "pyramid5",
            Cell("pyramid", 3, 5, 14, 7, True, ("CPYRAM", "CPYRA"), "PY5", "PYRAM5"),
            order=2,
            facet="quad4",
            bytes_per_node=3.9e3,
        ),
        _element(
            "pyramid13",
            Cell("pyramid13", 3, 13, 27, 19, False, ("CPYRAM", "CPYRA"), "P13", "PYRAM13"),
            order=3,
            facet="quad8",
            bytes_per_node=7.4e3,
        ),
        _element(
            "quad4",
            Cell("quad", 2, 4, 9, 3, True, ("CQUAD4", "CQUADR"), "QU4", "QUAD4", (44, 54, 64, 84, 94)),
            order=2,
            pieces=((0, 1, 2, 3),),
        ),
        _element(
            "quad8",
            Cell("quad8", 2, 8, 23, 16, True, ("CQUAD8",), "QU8", "QUAD8", (45, 55, 65, 85, 95)),
            order=3,
            pieces=((0, 4, 7), (1, 5, 4), (2, 6, 5), (3, 7, 6), (4, 5, 6, 7)),
        ),
        _element(
            "quad9",
            Cell("quad9", 2, 9, 28, 10, True, med="QU9", aster="QUAD9"),
            order=3,
            pieces=((0, 4, 8, 7), (1, 5, 8, 4), (2, 6, 8, 5), (3, 7, 8, 6)),
        ),
        _element(
            "tri3",
            Cell("triangle", 2, 3, 5, 2, True, ("CTRIA3", "CTRIAR"), "TR3", "TRIA3", (41, 51, 61, 81, 91)),
            order=2,
            pieces=((0, 1, 2),),
        ),
        _element(
            "tri6",
            Cell("triangle6", 2, 6, 22, 9, True, ("CTRIA6",), "TR6", "TRIA6", (42, 52, 62, 82, 92)),
            order=5,
            pieces=((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
        ),
    )
}  # fmt: skip
SOLIDS: dict[str, Element] = {name: element for name, element in ELEMENTS.items() if element.cell.dim == 3}
ELEMENT_OF_CELL: dict[str, Element] = {element.cell.name: element for element in ELEMENTS.values()}
CELLS: dict[str, Cell] = {
    cell.name: cell for cell in (*(element.cell for element in ELEMENTS.values()), *OTHER_CELLS)
}
_FACET_BY_NODES = {e.cell.nodes: e for e in ELEMENTS.values() if e.cell.dim == 2}


def facet_frame(facets: NDArray[np.int64]) -> Element:
    """The element that numbers corners and edges of facets, of triangles among quadrilaterals too."""
    return _FACET_BY_NODES[facets.shape[1]]


def facet_element(facets: NDArray[np.int64]) -> Element:
    """The facet element that has as many nodes as the rows of `facets`.

    Raises
    ------
    MeshError
        for triangles among quadrilaterals, which only `facets_by_kind` tells apart.
    """
    element = facet_frame(facets)
    if element.box and (facets[:, 2] == facets[:, 3]).any():
        raise MeshError(
            "a face of triangles and quadrilaterals, of wedges or pyramids, stands where facets must be of "
            "one kind (free fields, the water's own mesh); mesh it with facets of one kind"
        )
    return element


def jacobians(points: Floats, cells: NDArray[np.int64], element: Element, xi: Floats) -> Floats:
    """dx/dxi of every cell at xi (nq, 3), as (nc, nq, 3 reference, 3 space) [m]."""
    return np.einsum("qda,cak->cqdk", element.gradient(xi), points[cells], optimize=True)
