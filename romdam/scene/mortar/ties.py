"""Mortar ties: the slave face follows the master's, its nodes' displacements from the master's.

The constraint int psi_j (u_slave - u_master) dA = 0 with dual multipliers at every node of the slave gives
each node's displacement by itself. The integrals of a quadratic facet's shape functions at its corners are
zero or negative, so the multipliers there are dual to

    N~_corner = N_corner + alpha (N of the middles of its edges),    N~_middle = (1 - 2 alpha) N_middle,

which span the same displacements, with positive integrals for alpha = 1/5.

References
----------
Popp, Wohlmuth, Gee, Wall, SIAM J. Sci. Comput. 34 (2012) B421.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix, diags_array

from romdam.core.arrays import Floats, Ints
from romdam.geometry.elements import Element
from romdam.scene.mortar.dual import coupling, without_round_off
from romdam.scene.mortar.interface import MortarInterface
from romdam.scene.mortar.segments import integrand_degree, samples

_ALPHA = 0.2


@dataclass(frozen=True)
class TieWeights:
    """Displacements of the slave's nodes from the master's.

    Attributes
    ----------
    slave, master : (s,), (m,) ascending node numbers in their blocks
    weights : (s, m); rows sum to 1. A polynomial that both faces' elements represent is followed exactly
    area : (s,) integrals of the multipliers [m2]
    """

    slave: Ints
    master: Ints
    weights: csr_matrix
    area: Floats


def tie_weights(interface: MortarInterface) -> TieWeights:
    """Let the slave's nodes that have the master opposite follow it."""
    slave, master, element = interface.slave, interface.master, interface.slave.element
    at = samples(slave, master, interface.segments, integrand_degree(slave, master, element.name))
    change = _positive(element)
    whole = coupling(slave, master, at, element, change)
    nodes = np.unique(slave.facets)
    nodes = nodes[np.intersect1d(interface.opposite(nodes)[0], np.flatnonzero(whole.area[nodes] != 0.0))]
    nodes = _with_corners(slave.facets, element, nodes)
    rows = csr_matrix(diags_array(1.0 / whole.area[nodes]) @ whole.master[nodes])
    weights = _spread(slave.facets, change, len(slave.points))[nodes][:, nodes] @ rows
    seen = np.unique(weights.indices)
    return TieWeights(
        nodes, seen, without_round_off(weights[:, seen], np.ones(len(nodes))), whole.area[nodes]
    )


def _positive(element: Element) -> Floats:
    """(n, n) of the shape functions N~ = change @ N with positive integrals."""
    change = np.eye(len(element.nodes))
    if element.quadratic and element.on_edges:
        for k, corners in enumerate(element.middles, start=element.corners):
            change[list(corners), k] += _ALPHA
            change[k, k] -= 2.0 * _ALPHA
    return change


def _with_corners(facets: Ints, element: Element, nodes: Ints) -> Ints:
    """The nodes, without middles of which a corner is not among them."""
    follows, lacks = np.isin(facets, nodes), np.zeros(0, dtype=np.int64)
    for k, corners in enumerate(element.middles, start=element.corners):
        lacks = np.append(lacks, facets[~follows[:, list(corners)].all(axis=1), k])
    return np.setdiff1d(nodes, lacks)


def _spread(facets: Ints, change: Floats, size: int) -> csr_matrix:
    """(size, size) nodal displacements from the coefficients of N~."""
    local = [(j, k) for j, k in zip(*np.nonzero(change), strict=True)]
    rows = np.concatenate([facets[:, k] for _, k in local])
    columns = np.concatenate([facets[:, j] for j, _ in local])
    values = np.concatenate([np.full(len(facets), change[j, k]) for j, k in local])
    pairs, first = np.unique(np.column_stack([rows, columns]), axis=0, return_index=True)
    return csr_matrix((values[first], (pairs[:, 0], pairs[:, 1])), shape=(size, size))
