"""Dual multipliers on a slave face: biorthogonal to its shape functions, integrated over the segments.

On every slave facet psi = D M^-1 phi with M_jk = int phi_j phi_k and D_j = int phi_j over what the master
covers of it, so that int psi_j phi_k = 0 for j != k. The jump of the displacement,

    w_j = 1/A_j int psi_j (u_master - u_slave) dA,    A_j = int psi_j dA = int phi_j dA,

is a mean of the master's around a node less the node's own, where the slave is linear. As the psi_j sum to
one, pressure that is uniform is carried exactly; as both sides are integrated at the same points, a rigid
motion has no jump.

References
----------
Wohlmuth, SIAM J. Numer. Anal. 38 (2000) 989; Popp, Wohlmuth, Gee, Wall, SIAM J. Sci. Comput. 34 (2012) B421
(quadratic faces); Cichosz, Bischoff, Comput. Methods Appl. Mech. Eng. 200 (2011) 1317 (covered in part).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Floats
from romdam.geometry.elements import Element
from romdam.scene.mortar.segments import SegmentPoints
from romdam.scene.mortar.surface import MortarSurface

_ROUND_OFF = 1e-13  # weight relative to its row's largest, which is of order one
_CHUNK = 20_000  # triangles at a time


@dataclass(frozen=True)
class DualCoupling:
    """Integrals of multipliers times the shape functions of both faces.

    Attributes
    ----------
    area : (nodes of the slave,) A_j = int psi_j [m2], zero where there is no multiplier
    slave : (nodes of the slave, same) int psi_j N_k [m2]
    master : (nodes of the slave, nodes of the master) int psi_j N_k [m2]
    """

    area: Floats
    slave: csr_matrix
    master: csr_matrix


def coupling(
    slave: MortarSurface, master: MortarSurface, at: SegmentPoints, basis: Element, change: Floats
) -> DualCoupling:
    """Integrate the multipliers of a slave face.

    Parameters
    ----------
    basis : whose shape functions the multipliers are dual to, after
    change : (m, m), phi = change @ N of the basis
    """
    m, count = len(change), len(slave.facets)
    chunks = [slice(k, k + _CHUNK) for k in range(0, len(at.slave), _CHUNK)]
    mass = np.zeros((count, m, m))
    for chunk in chunks:
        phi = _values(basis, at.xi_slave[chunk]) @ change.T
        np.add.at(
            mass, at.slave[chunk], np.einsum("tq,tqi,tqj->tij", at.weight[chunk], phi, phi, optimize=True)
        )
    area = mass @ np.linalg.solve(change.T, np.ones(m)) if m else np.zeros((count, 0))

    # D M^-1 of every facet, scaled to a unit diagonal; zero where nothing covers the facet
    size = np.einsum("fii->fi", mass)
    scale = np.divide(1.0, np.sqrt(np.abs(size)), out=np.zeros_like(size), where=size > 0.0)
    scaled = mass * scale[:, :, None] * scale[:, None, :]
    inverse = np.linalg.pinv(scaled, rcond=1e-12, hermitian=True)
    dual = (area[:, :, None] * scale[:, :, None] * inverse * scale[:, None, :]) @ change

    rows, sides = slave.facets[:, :m], ((slave, at.slave, at.xi_slave), (master, at.master, at.xi_master))
    sums = []
    for face, facet, xi in sides:
        total = csr_matrix((len(slave.points), len(face.points)))
        for chunk in chunks:
            psi = np.einsum(
                "tij,tqj->tqi", dual[at.slave[chunk]], _values(basis, at.xi_slave[chunk]), optimize=True
            )
            block = np.einsum(
                "tq,tqi,tqk->tik", at.weight[chunk], psi, _values(face.element, xi[chunk]), optimize=True
            )
            i = np.broadcast_to(rows[at.slave[chunk]][:, :, None], block.shape)
            k = np.broadcast_to(face.facets[facet[chunk]][:, None, :], block.shape)
            total = total + csr_matrix((block.ravel(), (i.ravel(), k.ravel())), shape=total.shape)
        sums.append(total)
    whole = np.zeros(len(slave.points))
    np.add.at(whole, rows, area)
    return DualCoupling(whole, *(without_round_off(weights_sum, whole) for weights_sum in sums))


def _values(element: Element, xi: Floats) -> Floats:
    """Shape functions at xi (n, q, 2), as (n, q, nodes)."""
    return element.shape(xi.reshape(-1, 2)).reshape(*xi.shape[:2], -1)


def without_round_off(matrix: csr_matrix, size: Floats) -> csr_matrix:
    """A matrix without entries that are nothing beside `size` of their row."""
    matrix = csr_matrix(matrix)
    matrix.sum_duplicates()
    limit = np.repeat(_ROUND_OFF * np.abs(size), np.diff(matrix.indptr))
    matrix.data[np.abs(matrix.data) <= limit] = 0.0
    matrix.eliminate_zeros()
    return matrix
