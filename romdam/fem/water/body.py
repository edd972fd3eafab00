"""A body of water by finite elements: what a reservoir is to the dam, whatever it was meshed from."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.scene import Ints
from romdam.geometry.elements import Element, Floats

_ALONG = {  # of nodes on a straight edge of unit length: int N N dl, and what it is to be divided by
    2: (np.array([[2.0, 1.0], [1.0, 2.0]]), 6.0),
    3: (np.array([[4.0, -1.0, 2.0], [-1.0, 4.0, 2.0], [2.0, 2.0, 16.0]]), 30.0),
}


@dataclass(frozen=True)
class WaterSection:
    """Integrals over an upright plane across a channel, per unit length of it.

    Attributes
    ----------
    H, G : (k, k) Laplacian [1] and int N N dA [m2]
    floor : (k, k) int N N dl over the walls that take waves up [m]
    rigid : (k, 3) flux of the walls' unit rigid motions [m]
    rock : (k, k) int N N / (rho c_p) dl over the walls that lie on rock, which a pressure pushes in at that
        velocity where the rock is a half-space [m3 s/kg]
    """

    H: csr_matrix
    G: csr_matrix
    floor: csr_matrix
    rigid: Floats
    rock: csr_matrix

    def of(self, nodes: Ints) -> WaterSection:
        """Of some nodes alone: the pressure of others is zero."""
        H, G, floor, rock = (csr_matrix(m[nodes][:, nodes]) for m in (self.H, self.G, self.floor, self.rock))
        return WaterSection(H, G, floor, self.rigid[nodes], rock)

    def following(self, T: csr_matrix) -> WaterSection:
        """Over other unknowns, which give the pressure at the nodes by a (k, m) matrix."""
        H, G, floor, rock = (csr_matrix(T.T @ m @ T) for m in (self.H, self.G, self.floor, self.rock))
        return WaterSection(H, G, floor, T.T @ self.rigid, rock)


@dataclass(frozen=True)
class WaterBody:
    """Integrals over a reservoir, of the n nodes below its surface.

    Attributes
    ----------
    H, G : (n, n) Laplacian [m] and int N N dV [m3]
    floor : (n, n) int N N dA over the walls that take waves up [m2]
    rigid : (n, 3) flux of the walls' unit rigid motions [m2]
    wet : (w,) nodes on the dam, and on rock that the walls move with
    coupling : block -> (w, 3 * nodes) int N n . N_u dA, with n into the water [m2]
    end : (k,) nodes beyond which a channel goes on
    section : of that channel, over these
    """

    H: csr_matrix
    G: csr_matrix
    floor: csr_matrix
    rigid: Floats
    wet: Ints
    coupling: dict[str, csr_matrix]
    end: Ints
    section: WaterSection


def section_of(
    flat: Floats,
    axes: Floats,
    faces: Iterable[tuple[Element, Ints]],
    edges: Ints,
    absorbs: Floats,
    yields: Floats,
) -> WaterSection:
    """Integrate over a plane.

    Parameters
    ----------
    flat : (k, 2) positions of its nodes [m]
    axes : (2, 3) unit vectors of the plane
    faces : elements and nodes of the plane's facets
    edges : (n, nodes per edge) on the walls, taken for straight
    absorbs : (n,) 1 where a wall takes waves up, else 0
    yields : (n,) 1 / (rho c_p) of the rock that it lies on, 0 where on none [m2 s/kg]
    """
    k = len(flat)
    H, G, rigid = csr_matrix((k, k)), csr_matrix((k, k)), np.zeros((k, 3))
    for element, nodes in faces:
        xi, weight = element.rule
        shape, slope = element.shape(xi), element.gradient(xi)
        jacobian = np.einsum("qda,nak->nqdk", slope, flat[nodes])
        area = np.abs(np.linalg.det(jacobian)) * weight
        gradient = np.linalg.solve(jacobian, slope[None])
        H = H + scattered(np.einsum("nqka,nqkb,nq->nab", gradient, gradient, area), nodes, k)
        G = G + scattered(np.einsum("qa,qb,nq->nab", shape, shape, area), nodes, k)
        np.add.at(rigid, nodes, -np.einsum("nqda,nq,dk->nak", gradient, area, axes))
    length = np.linalg.norm(flat[edges[:, 1]] - flat[edges[:, 0]], axis=1)
    along, whole = _ALONG[edges.shape[1]]
    floor, rock = (
        scattered((share * length)[:, None, None] * along / whole, edges, k) for share in (absorbs, yields)
    )
    return WaterSection(csr_matrix(H), csr_matrix(G), floor, rigid, rock)


def scattered(local: Floats, nodes: Ints, size: int) -> csr_matrix:
    """Sum of local matrices (n, c, c) of nodes (n, c)."""
    rows, columns = (np.broadcast_to(n, local.shape).ravel() for n in (nodes[:, :, None], nodes[:, None]))
    return csr_matrix((local.ravel(), (rows, columns)), shape=(size, size))


def vector_operator(rows: Ints, nodes: Ints, values: Floats, shape: tuple[int, int]) -> csr_matrix:
    """(shape[0], 3 * shape[1]) sparse matrix of values (..., 3) at rows and nodes."""
    row = np.broadcast_to(rows[..., None], values.shape)
    column = np.broadcast_to(3 * nodes[..., None] + np.arange(3), values.shape)
    return csr_matrix((values.ravel(), (row.ravel(), column.ravel())), shape=(shape[0], 3 * shape[1]))
