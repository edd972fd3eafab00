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

    # shape functions N~ = change @ N with positive integrals
    middles = list(enumerate(element.middles, start=element.corners))
    change = np.eye(len(element.nodes))
    if element.quadratic and element.on_edges:
        for k, corners in middles:
            change[list(corners), k] += _ALPHA
            change[k, k] -= 2.0 * _ALPHA
    whole = coupling(slave, master, at, element, change)

    nodes = np.unique(slave.facets)
    nodes = nodes[np.intersect1d(interface.opposite(nodes)[0], np.flatnonzero(whole.area[nodes] != 0.0))]
    # a middle follows only where its corners do
    follows, lacks = np.isin(slave.facets, nodes), np.zeros(0, dtype=np.int64)
    for k, corners in middles:
        lacks = np.append(lacks, slave.facets[~follows[:, list(corners)].all(axis=1), k])
    nodes = np.setdiff1d(nodes, lacks)

    # nodal displacements from the coefficients of N~; facets that share a pair of nodes agree on its entry
    entries = list(zip(*np.nonzero(change), strict=True))
    rows = np.concatenate([slave.facets[:, k] for _, k in entries])
    columns = np.concatenate([slave.facets[:, j] for j, _ in entries])
    values = np.concatenate([np.full(len(slave.facets), change[j, k]) for j, k in entries])
    pairs, first = np.unique(np.column_stack([rows, columns]), axis=0, return_index=True)
    size = len(slave.points)
    nodal = csr_matrix((values[first], (pairs[:, 0], pairs[:, 1])), shape=(size, size))

    weights = nodal[nodes][:, nodes] @ csr_matrix(diags_array(1.0 / whole.area[nodes]) @ whole.master[nodes])
    seen = np.unique(weights.indices)
    return TieWeights(
        nodes, seen, without_round_off(weights[:, seen], np.ones(len(nodes))), whole.area[nodes]
    )
