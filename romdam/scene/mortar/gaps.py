"""Gaps of a mortar joint: where they stand, their areas, and what each sees of both faces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix, diags_array

from romdam.core.arrays import Floats, Ints
from romdam.geometry.nearest import tree
from romdam.scene.mortar.dual import coupling
from romdam.scene.mortar.interface import MortarInterface
from romdam.scene.mortar.segments import integrand_degree, samples


@dataclass(frozen=True)
class FaceGaps:
    """Gaps between two faces; of the two blocks, I is the first.

    The jump of gap m is sum_k weights[1][m, k] u_J[nodes[1][k]] - sum_k weights[0][m, k] u_I[nodes[0][k]].

    Attributes
    ----------
    nodes : of block I and of block J that the gaps see
    position, opposite : (n, 3) where they stand on block I's face and on block J's [m]
    normal : (n, 3) from I to J
    area : (n,) all positive [m2]
    corner : (n,) node of the face's block at which each stands
    weights : (n, nodes) of either side, rows sum to 1
    at_point : the same for the jump at the very position, or None where it is the same
    """

    nodes: tuple[Ints, Ints]
    position: Floats
    opposite: Floats
    normal: Floats
    area: Floats
    corner: Ints
    weights: tuple[csr_matrix, csr_matrix]
    at_point: tuple[csr_matrix, csr_matrix] | None


def mortar_gaps(interface: MortarInterface) -> FaceGaps:
    """Dual multipliers at the corners of the slave's facets that have the master opposite, a gap each.

    A corner without the master opposite gives its share to those of its facets that have: where a master ends
    within a facet no multiplier stands outside the joint.
    """
    slave, master = interface.slave, interface.master
    corner = slave.corner_element
    at = samples(slave, master, interface.segments, integrand_degree(slave, master, corner.name))
    whole = coupling(slave, master, at, corner, np.eye(corner.corners))
    row, facet, xi = interface.opposite(interface.nodes)
    nodes = interface.nodes[row]
    some = whole.area[nodes] > 0.0
    nodes, facet, xi = nodes[some], facet[some], xi[some]
    gather = shares(interface, nodes)
    area = gather @ whole.area
    scale = diags_array(1.0 / area)
    weights = [csr_matrix(scale @ (gather @ operator)) for operator in (whole.slave, whole.master)]
    # shape functions of the master at the point opposite to each gap
    values = master.element.shape(xi)
    rows = np.broadcast_to(np.arange(len(facet))[:, None], values.shape)
    shape = (len(facet), len(master.points))
    there = csr_matrix((values.ravel(), (rows.ravel(), master.facets[facet].ravel())), shape=shape)
    here = csr_matrix((np.ones(len(nodes)), (np.arange(len(nodes)), nodes)), shape=weights[0].shape)
    points = [here, there]
    seen = [np.unique(np.concatenate([w.indices, p.indices])) for w, p in zip(weights, points, strict=True)]
    order = (1, 0) if interface.slave_is_J else (0, 1)
    weights_seen = [csr_matrix(w[:, s]) for w, s in zip(weights, seen, strict=True)]
    exact = [csr_matrix(p[:, s]) for p, s in zip(points, seen, strict=True)]
    where = slave.points[nodes], there @ master.points
    same = all(abs(w - p).max() < 1e-12 for w, p in zip(weights_seen, exact, strict=True))
    sign = -1.0 if interface.slave_is_J else 1.0
    return FaceGaps(
        nodes=(seen[order[0]], seen[order[1]]),
        position=where[order[0]],
        opposite=where[order[1]],
        normal=sign * interface.normals[nodes],
        area=np.asarray(area),
        corner=nodes,
        weights=(weights_seen[order[0]], weights_seen[order[1]]),
        at_point=None if same else (exact[order[0]], exact[order[1]]),
    )


def shares(interface: MortarInterface, kept: Ints) -> csr_matrix:
    """(gaps, nodes of the slave's block): what each gap gets of a corner's multiplier, columns sum to 1.

    All of its own; of corners without a gap equal shares among those of their facets, else the nearest all.
    """
    slave = interface.slave
    corners = slave.facets[:, : slave.element.corners]
    number = np.full(len(slave.points), -1)
    number[kept] = np.arange(len(kept))
    without = interface.nodes[number[interface.nodes] < 0]
    i, k = np.repeat(corners, corners.shape[1], axis=1).ravel(), np.tile(corners, corners.shape[1]).ravel()
    pairs = np.unique(np.column_stack([i, k])[(number[i] >= 0) & (number[k] < 0)], axis=0)
    lonely = np.setdiff1d(without, pairs[:, 1])
    if len(lonely):
        nearest = kept[tree(slave.points[kept]).query(slave.points[lonely])[1]]
        pairs = np.vstack([pairs, np.column_stack([nearest, lonely])])
    count = np.bincount(pairs[:, 1], minlength=len(slave.points))
    rows = np.concatenate([np.arange(len(kept)), number[pairs[:, 0]]])
    columns = np.concatenate([kept, pairs[:, 1]])
    values = np.concatenate([np.ones(len(kept)), 1.0 / count[pairs[:, 1]]])
    return csr_matrix((values, (rows, columns)), shape=(len(kept), len(slave.points)))
