"""Check that the elements of a block fill a body without overlap, and without cracks that no joint knows of.

In a sound mesh every face of an element is of one of two kinds. Either exactly one other element has the same
nodes on it, from its other side (the two faces pair), or no element is across it (it is free, a part of the
body's surface). So three things are checked:

1. No face belongs to more than two elements, and two that pair are seen from opposite sides, with the same
   mid-edge nodes.
2. No element is across a free face: points slightly outside of it lie in no element of the block.
3. The free faces close: the volume that they enclose is that of the elements.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from romdam.core.errors import MeshError
from romdam.core.scene import Block, Bools, Ints
from romdam.geometry.elements import ELEMENTS, Element, Floats
from romdam.geometry.facets import (
    all_facets,
    area_elements,
    area_vectors,
    facet_element,
    facet_keys,
    row_numbers,
)
from romdam.geometry.meshes.kinds import facets_by_kind, frame, kinds_of
from romdam.geometry.nearest import tree

_AWAY = 1e-3  # of a face's size: how far outside of a free one no element may be
_NEAR_CORNER = 0.9  # of the way from a face's centre to its corners: where that is looked at
_INSIDE = 1e-6  # of the reference element: a point is inside from this depth on
_PAIRS = 1_000_000  # of a point and an element, at a time
# how far out of the reference element each Newton step may lead, for the point to be followed any further
_FOLLOWED = (1.0, 0.3, 0.1, *[0.03] * 9)
_CONVERGED = 1e-9  # step in the reference element
_STRAIGHT = 1e-6  # of the longest edge: nodes so near to the middle of their corners leave edges straight
_BULGE = 3.0  # the 12 functions of a hex20's middle nodes add up to it in its middle; others to less
_LOST = 9.0  # a reference coordinate far out
_VOLUME = 1e-8  # relative difference of the volume by elements and by faces that rounding explains


def refuse_bad_faces(block: Block, volume: float, location: str) -> int:
    """Raise unless all faces of a block's elements pair or are free, and the free ones close.

    Parameters
    ----------
    volume : of the elements [m3]
    location : start of the message

    Returns
    -------
    number of pieces that hang together by faces

    Raises
    ------
    MeshError
        for what the module lists, with how many faces and where the first is.
    """
    faces = _Faces(block)
    faces.refuse_unpaired(location)
    free = faces.free
    inside = np.zeros(len(free), dtype=bool)
    for rows, facet_nodes, _ in facets_by_kind(free):
        outside = _just_outside(block.points, facet_nodes)
        samples = outside.shape[1]
        inside[rows] = _any_cell_has(block, outside.reshape(-1, 3)).reshape(-1, samples).any(axis=1)
    if inside.any():
        what = (
            f"have an element across them that does not share them, within {_AWAY:g} of their size "
            "(a crack, nodes that hang, or elements that overlap)"
        )
        at = block.points[free[np.argmax(inside)]].mean(axis=0)
        raise _error(block, at, int(inside.sum()), what, location)
    # V = 1/3 int x . n dA; the rules of curved elements integrate neither volume nor faces exactly
    arms = block.points[free] - block.points.mean(axis=0)
    flux = float(np.einsum("fjk,fjk->", area_vectors(block.points, free), arms))
    if abs(flux / 3.0 - volume) > _VOLUME * volume and not frame(block.element).quadratic:
        raise MeshError(
            f"{location}: the faces of block {block.name!r} enclose {flux / 3.0:.6g} m3 and its elements "
            f"hold {volume:.6g} m3: its faces do not close; export the mesh anew"
        )
    return faces.pieces


class _Faces:
    """All faces of a block's elements, and which of them coincide.

    Attributes
    ----------
    block : the block
    rows : (nf, nodes per facet) of every element's faces, one element after another
    cell : (nf,) their elements
    order : (nf,) numbers of the faces, those that coincide side by side
    start, count : where in `order` each set of coinciding faces begins, and how many it has
    """

    def __init__(self, block: Block) -> None:
        self.block = block
        self.rows, self.cell = all_facets(block.cells, block.element)
        keys = row_numbers(facet_keys(self.rows[:, : ELEMENTS[frame(block.element).facet].corners]))
        self.order = np.argsort(keys, kind="stable")
        _, self.start, self.count = np.unique(keys[self.order], return_index=True, return_counts=True)

    @property
    def free(self) -> Ints:
        """Faces of one element, (nf, nodes per facet), in the order of the cells."""
        return self.rows[np.sort(self.order[self.start[self.count == 1]])]

    @property
    def pairs(self) -> tuple[Ints, Ints]:
        """Numbers of the faces that pair, (np,) and (np,)."""
        first = self.start[self.count == 2]
        return self.order[first], self.order[first + 1]

    @property
    def pieces(self) -> int:
        """Number of parts that hang together by faces."""
        a, b = (self.cell[side] for side in self.pairs)
        size = len(self.block.cells)
        return int(connected_components(coo_array((np.ones(len(a)), (a, b)), shape=(size, size)), False)[0])

    def refuse_unpaired(self, location: str) -> None:
        """Raise if a face is shared by more than two elements, by two on the same side, or not as a whole."""
        many = self.order[self.start[self.count > 2]]
        if len(many):
            raise self._error(many, "belong to more than two elements: elements overlap", location)
        a, b = self.pairs
        for rows, facet_nodes, columns in facets_by_kind(self.rows[a]):
            self._refuse_same_side(a[rows], facet_nodes, self.rows[b[rows]][:, columns], location)

    def _refuse_same_side(self, faces: Ints, of_first: Ints, of_other: Ints, location: str) -> None:
        """Raise unless pairs of faces have their nodes in opposite order.

        Seen from outside of its element, a face has its c corners counterclockwise: v0 v1 v2 v3. Its partner
        has them as v0 v3 v2 v1, and the middles of its edges in reverse order.

        Parameters
        ----------
        faces : (np,) numbers of the first of each pair
        of_first, of_other : (np, nodes) corners, middles of edges, middle, as far as there are any
        """
        c = facet_element(of_first).corners
        turned = []  # both begin with their lowest corner; the ring of mid-edge nodes turns along
        for rows in (of_first, of_other):
            turn = (np.argmin(rows[:, :c], axis=1)[:, None] + np.arange(c)) % c
            rings = range(0, rows.shape[1] - c + 1, c)
            nodes = [np.take_along_axis(rows[:, k : k + c], turn, 1) for k in rings]
            turned.append(np.hstack([*nodes, rows[:, c * len(rings) :]]))
        first, other = turned
        opposed = (first[:, 1:c] == other[:, c - 1 : 0 : -1]).all(axis=1)
        if not opposed.all():
            what = "have both their elements on the same side, or are cut otherwise by them"
            raise self._error(faces[~opposed], what, location)
        agree = (first[:, c : 2 * c] == other[:, c : 2 * c][:, ::-1]).all(axis=1)
        agree &= (first[:, 2 * c :] == other[:, 2 * c :]).all(axis=1)
        if not agree.all():
            raise self._error(faces[~agree], "have other mid-edge nodes in each of their elements", location)

    def _error(self, faces: Ints, what: str, location: str) -> MeshError:
        return _error(
            self.block, self.block.points[self.rows[faces[0]]].mean(axis=0), len(faces), what, location
        )


def _error(block: Block, at: Floats, count: int, what: str, location: str) -> MeshError:
    where = ", ".join(f"{x:.6g}" for x in at)
    return MeshError(
        f"{location}: {count} faces of elements of block {block.name!r} {what}, limit 0 (the first around "
        f"({where}) m); repair the mesh: merge duplicate nodes and elements, or make it blocks with a "
        "joint or tie"
    )


def _just_outside(points: Floats, facets: Ints) -> Floats:
    """Points slightly outside of every facet, at its middle and near its corners, (nf, corners + 1, 3)."""
    element = facet_element(facets)
    corner = element.nodes[: element.corners]
    centre = corner.mean(axis=0)
    xi = np.vstack([centre, centre + _NEAR_CORNER * (corner - centre)])
    vectors = area_elements(points, facets, xi)
    size = np.linalg.norm(vectors, axis=2, keepdims=True)
    normal = np.divide(vectors, size, out=np.zeros_like(vectors), where=size > 0.0)
    on = np.einsum("qa,fak->fqk", element.shape(xi), points[facets], optimize=True)
    return on + _AWAY * np.sqrt(size[:, :1]) * normal


def _any_cell_has(block: Block, points: Floats) -> Bools:
    """True for each point inside an element.

    Points meet the elements whose boxes they are in. Boxes of like size are searched together: a point is no
    farther from the middle of its box than half the diagonal.
    """
    inside = np.zeros(len(points), dtype=bool)
    low, high = block.points.min(axis=0), block.points.max(axis=0)
    near = np.flatnonzero(((points > low) & (points < high)).all(axis=1))
    if not len(near):
        return inside
    for element, _, cells in kinds_of(block.element, block.cells):
        # straight cells have the geometry of their corners, which takes fewer nodes
        nodes, linear = block.points[cells], ELEMENTS[element.linear]
        corners = nodes[:, : element.corners]
        off = nodes[:, element.corners :] - linear.shape(element.nodes[element.corners :]) @ corners
        longest = np.abs(np.diff(nodes[:, np.array(element.edges)], axis=2)).max()
        if np.abs(off).max(initial=0.0) <= _STRAIGHT * longest:
            nodes, element = corners, linear
        # curved cells bulge beyond the box of their corners: by what middle nodes are off, times what their
        # shape functions add up to
        bulge = _BULGE * np.abs(off).max(axis=1, initial=0.0) if element.quadratic else 0.0
        lowest, highest = corners.min(axis=1) - bulge, corners.max(axis=1) + bulge
        middle, reach = (lowest + highest) / 2.0, np.linalg.norm(highest - lowest, axis=1) / 2.0
        scale = np.ceil(np.log2(reach))  # powers of two, by which boxes are of like size
        for size in np.unique(scale):
            cells_of_size = np.flatnonzero(scale == size)
            by_middle = tree(middle[cells_of_size])
            # groups of points, each of as many pairs of a point and a cell as memory takes
            count = by_middle.query_ball_point(points[near], 2.0**size, return_length=True)
            ends = np.flatnonzero(np.diff(np.cumsum(count) // _PAIRS)) + 1
            for group in np.split(near, ends):
                pairs = tree(points[group]).sparse_distance_matrix(
                    by_middle, 2.0**size, output_type="ndarray"
                )
                p, c = group[pairs["i"]], cells_of_size[pairs["j"]]
                boxed = ((points[p] > lowest[c]) & (points[p] < highest[c])).all(axis=1) & ~inside[p]
                p, c = p[boxed], c[boxed]
                inside[p[_inside(points[p], nodes[c], element)]] = True
    return inside


def _inside(points: Floats, nodes: Floats, element: Element) -> Bools:
    """True for each point (p, 3) in its element with nodes (p, nn, 3).

    Newton's method solves x(xi) = point for the coordinates xi in the reference element. The first step is
    exact for a straight tetrahedron. Points that a step takes far out of the reference element are not
    followed any further.
    """
    inside = np.zeros(len(points), dtype=bool)
    left = np.arange(len(points))
    # one row: all start from the same xi
    xi = np.tile(element.nodes[: element.corners].mean(axis=0), (min(len(points), 1), 1))
    for far in _FOLLOWED:
        at = np.matmul(element.shape(xi)[:, None], nodes[left])[:, 0]
        J = np.matmul(element.gradient(xi), nodes[left])
        # the inverse of J = dx/dxi (axes of xi in rows) by cross products of its rows
        cross = np.cross(J[:, [1, 2, 0]], J[:, [2, 0, 1]])
        away = (points[left] - at)[:, :, None]
        with np.errstate(all="ignore"):
            step = np.matmul(cross, away)[:, :, 0] / (J[:, 0] * cross[:, 0]).sum(axis=1)[:, None]
        better = np.clip(np.nan_to_num(xi + step, nan=_LOST), -_LOST, _LOST)
        moved, depth = np.abs(better - xi).max(axis=1), _depth(better, element)
        moved *= element.name != "tet4"  # where a step is exact
        inside[left[(moved < _CONVERGED) & (depth > _INSIDE)]] = True
        on = (moved >= _CONVERGED) & (depth > -far)
        left, xi = left[on], better[on]
        if not len(left):
            break
    return inside


def _depth(xi: Floats, element: Element) -> Floats:
    """Depth (p,) of points of the reference element in it; negative outside."""
    if element.box:
        return 1.0 - np.abs(xi).max(axis=1)
    if element.linear == "pyramid5":
        return np.minimum(xi[:, 2], 1.0 - xi[:, 2] - np.abs(xi[:, :2]).max(axis=1))
    if element.linear == "wedge6":
        return np.minimum(np.minimum(xi.min(axis=1), 1.0 - xi[:, 2]), 1.0 - xi[:, 0] - xi[:, 1])
    return np.minimum(xi.min(axis=1), 1.0 - xi.sum(axis=1))
