"""Facets of a block: which are on the boundary, and integrals over them (area, normal, tributary weights)."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.sparse import csr_matrix, eye_array

from romdam.core.scene import Bools, Ints
from romdam.geometry.cells import COLLAPSED
from romdam.geometry.elements import ELEMENTS, Floats, facet_element
from romdam.geometry.meshes.kinds import facets_by_kind, frame, kinds_of


def boundary_facets(cells: Ints, element: str) -> Ints:
    """Facets that belong to one cell only, outward, in the VTK order.

    Parameters
    ----------
    cells : (nc, nodes per cell)
    element : name of a solid

    Returns
    -------
    (nf, nodes per facet), in the order of the cells
    """
    facets = all_facets(cells, element)[0]
    keys = row_numbers(facet_keys(facets[:, : ELEMENTS[frame(element).facet].corners]))
    _, inverse, counts = np.unique(keys, return_inverse=True, return_counts=True)
    return facets[counts[inverse] == 1]


def all_facets(cells: Ints, element: str) -> tuple[Ints, Ints]:
    """Facets of every cell, (nf, nodes per facet) in the order of kinds and cells, and their cells (nf,)."""
    facets, owner = [], []
    for kind, rows, cell_nodes in kinds_of(element, cells):
        table = np.array(kind.facets)
        if kind.facet != frame(element).facet:  # tetrahedra among others
            table = table[:, next(iter(COLLAPSED[2, 4 if table.shape[1] == 3 else 8].values()))]
        facets.append(cell_nodes[:, table].reshape(-1, table.shape[1]))
        owner.append(np.repeat(rows, len(table)))
    return np.concatenate(facets), np.concatenate(owner)


def facet_keys(facets: Ints) -> Ints:
    """Rows that are equal where facets have the same nodes; those that stand twice count once."""
    keys = np.sort(facets, axis=1)
    twice = keys[:, 1:] == keys[:, :-1]
    if twice.any():
        keys[:, 1:] = np.where(twice, keys[:, -1:], keys[:, 1:])
        keys.sort(axis=1)
    return keys


def row_numbers(rows: Ints) -> Ints:
    """One number for every row of numbers from 0 on, in the rows' order and equal where they are.

    NumPy sorts rows by comparing them as bytes, which takes much longer than sorting numbers.
    """
    size = int(rows.max(initial=0)) + 1
    number, most = np.zeros(len(rows), dtype=np.int64), 1
    for column in rows.T:
        if most * size > np.iinfo(np.int64).max:  # as many numbers as there are different rows so far
            number = np.unique(number, return_inverse=True)[1]
            most = len(rows)
        number, most = number * size + column, most * size
    return number


def area_vectors(points: Floats, facets: Ints) -> Floats:
    """Consistent nodal area vectors int N_j n dA of every facet, (nf, nodes per facet, 3) [m2]."""
    vectors = np.zeros((*facets.shape, 3))
    for rows, facet_nodes, columns in facets_by_kind(facets):
        element = facet_element(facet_nodes)
        xi, weight = element.rule
        normal = area_elements(points, facet_nodes, xi)
        vectors[rows[:, None], columns] = np.einsum(
            "q,qj,fqk->fjk", weight, element.shape(xi), normal, optimize=True
        )
    return vectors


def facet_areas(points: Floats, facets: Ints) -> Floats:
    """Area of every facet (nf,) [m2]."""
    areas = np.zeros(len(facets))
    for rows, facet_nodes, _ in facets_by_kind(facets):
        xi, weight = facet_element(facet_nodes).rule
        areas[rows] = np.linalg.norm(area_elements(points, facet_nodes, xi), axis=2) @ weight
    return areas


def second_moments(points: Floats, facets: Ints) -> tuple[Floats, Floats]:
    """Second moments of a face's area about its centroid (3, 3) [m4], and the centroid (3,) [m]."""
    areas, places = [], []
    for _, facet_nodes, _ in facets_by_kind(facets):
        element = facet_element(facet_nodes)
        xi, weight = element.rule
        areas.append((weight * np.linalg.norm(area_elements(points, facet_nodes, xi), axis=2)).ravel())
        at = np.einsum("qa,fak->fqk", element.shape(xi), points[facet_nodes], optimize=True)
        places.append(at.reshape(-1, 3))
    dA, at = np.concatenate(areas), np.concatenate(places)
    middle = dA @ at / dA.sum()
    return np.einsum("q,qk,ql->kl", dA, at - middle, at - middle, optimize=True), middle


def facet_normals(points: Floats, facets: Ints) -> Floats:
    """Mean unit normal of every facet (nf, 3), to the side from which the nodes run counterclockwise."""
    vectors = area_vectors(points, facets).sum(axis=1)
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def node_normals(points: Floats, facets: Ints) -> Floats:
    """Area-weighted mean of the facet normals around every node (n, 3); zero off the facets."""
    vectors = area_vectors(points, facets).sum(axis=1)
    total = np.zeros_like(points)
    np.add.at(total, facets, vectors[:, None, :])
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.divide(total, length, out=np.zeros_like(total), where=length > 0.0)


def area_elements(points: Floats, facets: Ints, xi: Floats) -> Floats:
    """Normal times dA/dxi at xi (nq, 2), as (nf, nq, 3) [m2]."""
    gradient = facet_element(facets).gradient(xi)
    tangents = np.einsum("qda,fak->fqdk", gradient, points[facets], optimize=True)
    return np.cross(tangents[:, :, 0], tangents[:, :, 1])


def gap_weights(points: Floats, facets: Ints, corners_only: bool = False) -> tuple[Ints, Floats, csr_matrix]:
    """Nodes of a face, their positive tributary areas and the face displacement each area sees.

    With phi_i >= 0 piecewise linear on the pieces of a quadratic facet (corner triangles and what they leave
    in its middle, or four quadrilaterals around its middle node), area_i = int phi_i dA and
    C_ij = int phi_i N_j dA / area_i. As the phi_i sum to one, a pressure p on all areas gives the nodes
    sum_i p area_i C_ij = p int N_j dA: the consistent force of a uniform traction, though the consistent
    weights of tri6 corners are zero, those of quad8 corners negative, and those of quad9 corners, 1/16 of
    their facet's middle, soon negative where it is distorted. Linear facets need none of it: int N_i dA is
    positive and C = I (the consistent matrix lumped) carries uniform pressure too.
    With `corners_only` phi_i is linear on the whole of a quadratic facet, and only its corners have an area.

    Returns
    -------
    nodes : (k,) sorted node numbers of the face
    area : (n,) of all of them, or of the corners [m2]
    C : (n, k) sparse, rows sum to 1
    """
    nodes = np.unique(facets)
    area, with_area = np.zeros(len(nodes)), np.zeros(len(nodes), dtype=bool)
    entries: list[tuple[Floats, Ints, Ints]] = []
    for _, facet_nodes, _ in facets_by_kind(facets):
        element, local = facet_element(facet_nodes), np.searchsorted(nodes, facet_nodes)
        xi, weight, phi = _tributary_rule(element.name, corners_only and element.quadratic)
        dA = weight * np.linalg.norm(area_elements(points, facet_nodes, xi), axis=2)
        np.add.at(area, local[:, : phi.shape[1]], dA @ phi)
        with_area[local[:, : phi.shape[1]]] = True
        if element.quadratic:
            blocks = np.einsum("fq,qi,qj->fij", dA, phi, element.shape(xi), optimize=True)
            rows = np.broadcast_to(local[:, : phi.shape[1], None], blocks.shape)
            columns = np.broadcast_to(local[:, None, :], blocks.shape)
            entries.append((blocks.ravel(), rows.ravel(), columns.ravel()))
    if not entries:
        return nodes, area, csr_matrix(eye_array(len(nodes)))
    values, *where = (np.concatenate(parts) for parts in zip(*entries, strict=True))
    total = csr_matrix((values, tuple(where)), shape=(len(nodes),) * 2)
    at = np.flatnonzero(with_area)
    return nodes, area[at], csr_matrix(total[at].multiply(1.0 / area[at][:, None]))


@cache
def _tributary_rule(name: str, corners_only: bool) -> tuple[Floats, Floats, Floats]:
    """Quadrature over the pieces of a facet, in its coordinates, and phi (nq, gaps) at its points.

    The degrees integrate phi_i N_j dA exactly on every flat facet, however distorted: 5 on tri6,
    8 on quad8 (phi 1, N 3, dA 4), and 6 along each direction on quad9 (phi 1, N 2, dA 3).
    """
    element = ELEMENTS[name]
    points, weights, values = [], [], []
    gaps = element.corners if corners_only else len(element.nodes)
    for sub in (tuple(range(element.corners)),) if corners_only else element.pieces:
        linear = facet_element(np.array([sub]))
        xi, weight = linear.rule_of(5 if linear.box else 8)
        corner = element.nodes[list(sub)]
        jacobian = np.einsum("qda,ak->qdk", linear.gradient(xi), corner)
        points.append(linear.shape(xi) @ corner)
        weights.append(weight * np.linalg.det(jacobian))
        phi = np.zeros((len(xi), gaps))
        phi[:, list(sub)] = linear.shape(xi)
        values.append(phi)
    return np.vstack(points), np.concatenate(weights), np.vstack(values)


def facets_in_plane(points: Floats, facets: Ints, axis: int, at: float, tolerance: float) -> Ints:
    """The facets whose nodes all lie in the plane x[axis] = at, within `tolerance` [m]."""
    inside: Bools = np.abs(points[facets, axis] - at) <= tolerance
    return facets[inside.all(axis=1)]


def below(triangle: Floats, above: Floats) -> list[Floats]:
    """Triangles that fill the part of a triangle where a linear function with corner values is negative."""
    if (above <= 0.0).all():
        return [triangle]
    ring: list[Floats] = []
    for k in range(3):
        a, b = above[k], above[(k + 1) % 3]
        if a <= 0.0:
            ring.append(triangle[k])
        if a * b < 0.0:
            ring.append(triangle[k] + a / (a - b) * (triangle[(k + 1) % 3] - triangle[k]))
    return [np.array([ring[0], ring[k], ring[k + 1]]) for k in range(1, len(ring) - 1)]


@cache
def small_triangles(name: str, cuts: int) -> tuple[Floats, Floats]:
    """Triangles (t, 3, 2) that fill a reference facet, and its functions at their corners (t, 3, n).

    Parameters
    ----------
    cuts : parts of each of the facet's edges
    """
    element = ELEMENTS[name]
    i, j = (k.ravel() for k in np.meshgrid(np.arange(cuts), np.arange(cuts), indexing="ij"))
    lower = np.stack([np.c_[i, j], np.c_[i + 1, j], np.c_[i, j + 1]], axis=1)
    upper = np.stack([np.c_[i + 1, j], np.c_[i + 1, j + 1], np.c_[i, j + 1]], axis=1)
    if element.box:
        triangles = 2.0 * np.vstack([lower, upper]) / cuts - 1.0
    else:
        triangles = np.vstack([lower[i + j < cuts], upper[i + j < cuts - 1]]) / cuts
    return triangles, element.shape(triangles.reshape(-1, 2)).reshape(len(triangles), 3, -1)
