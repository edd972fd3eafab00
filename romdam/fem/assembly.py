"""Stiffness and consistent mass of a block of solid elements."""

from __future__ import annotations

import numpy as np
from scipy.sparse import bsr_matrix, csr_matrix

from romdam.fem.absorbing import boundary_springs
from romdam.fem.material import lame
from romdam.scene.elements import ELEMENTS, Floats, jacobians
from romdam.scene.model import Block, Ints, Material
from romdam.scene.quality import refuse_inverted

_CHUNK = 4096  # cells at a time: bounds the element matrices in memory at about 50 MB


def assemble(block: Block) -> tuple[csr_matrix, csr_matrix]:
    """Stiffness and consistent mass of a block over dof = 3 * node + component, supports not applied.

    The springs of absorbing faces are part of the stiffness.

    Element matrices come from the scalar gradients: with G_ab,kl = int dN_a/dx_k dN_b/dx_l,
    K_ab = lambda G + mu G^T + mu tr(G) I (3 by 3 for each pair of nodes a, b).

    Returns
    -------
    K : (3 n, 3 n) [N/m], exactly symmetric
    M : (3 n, 3 n) [kg], exactly symmetric

    Raises
    ------
    MeshError
        when an element has a zero or negative Jacobian determinant.
    """
    pattern = _NodePairs(block.cells, len(block.points))
    K = np.zeros((pattern.size, 3, 3))
    M = np.zeros(pattern.size)
    for first in range(0, len(block.cells), _CHUNK):
        cells = slice(first, first + _CHUNK)
        gradient, shape, volume = _geometry(block, cells, first)
        pattern.add(K, cells, _stiffness(gradient, volume, block.material))
        pattern.add(M, cells, _mass(shape, volume, block.material.rho))
    stiffness = pattern.matrix(K)
    if block.absorbing:
        stiffness = csr_matrix(stiffness + boundary_springs(block))
    return stiffness, pattern.matrix(M[:, None, None] * np.eye(3))


class _NodePairs:
    """The pairs of nodes that share a cell: the block pattern of K and M, and where each cell adds to it."""

    def __init__(self, cells: Ints, nodes: int) -> None:
        self.nodes = nodes
        self.shape = (len(cells), cells.shape[1], cells.shape[1])
        keys = (cells[:, :, None] * nodes + cells[:, None, :]).reshape(-1)
        pairs, slot = np.unique(keys, return_inverse=True)
        self.size = len(pairs)
        self.slot = slot.reshape(self.shape)
        self.columns = pairs % nodes
        self.start = np.searchsorted(pairs, np.arange(nodes + 1) * nodes)

    def add(self, total: Floats, cells: slice, values: Floats) -> None:
        """Add the values (cells, a, b, ...) of a range of cells to the total (size, ...), in place."""
        slot = self.slot[cells].ravel()
        touched, local = np.unique(slot, return_inverse=True)
        flat = values.reshape(len(slot), -1)
        target = total.reshape(len(total), -1)
        for column in range(flat.shape[1]):
            target[touched, column] += np.bincount(local, weights=flat[:, column])

    def matrix(self, total: Floats) -> csr_matrix:
        """The sparse matrix of blocks (size, 3, 3)."""
        size = 3 * self.nodes
        matrix = csr_matrix(bsr_matrix((total, self.columns, self.start), shape=(size, size)))
        matrix.eliminate_zeros()
        return matrix


def _geometry(block: Block, cells: slice, first: int) -> tuple[Floats, Floats, Floats]:
    """Gradients (nc, nq, 3, nn) [1/m], shape functions (nq, nn), volumes of the points (nc, nq) [m3]."""
    element = ELEMENTS[block.element]
    xi, weight = element.rule
    jacobian = jacobians(block.points, block.cells[cells], element, xi)
    determinant = np.linalg.det(jacobian)
    refuse_inverted(block, determinant, first)
    gradient = np.linalg.solve(jacobian, element.gradient(xi)[None])
    return np.asarray(gradient, dtype=float), element.shape(xi), determinant * weight


def _stiffness(gradient: Floats, volume: Floats, material: Material) -> Floats:
    """Element stiffness (nc, a, b, 3, 3) [N/m]."""
    lam, mu = lame(material)
    nc, nq, _, nn = gradient.shape
    rows = gradient.transpose(0, 3, 2, 1).reshape(nc, nn * 3, nq)
    G = (rows * volume[:, None, :]) @ rows.transpose(0, 2, 1)
    G = ((G + G.transpose(0, 2, 1)) / 2).reshape(nc, nn, 3, nn, 3).transpose(0, 1, 3, 2, 4)
    trace = np.einsum("cabkk->cab", G)
    return lam * G + mu * G.swapaxes(3, 4) + mu * trace[..., None, None] * np.eye(3)


def _mass(shape: Floats, volume: Floats, rho: float) -> Floats:
    """Element mass per component (nc, a, b) [kg]."""
    mass = rho * np.einsum("cq,qa,qb->cab", volume, shape, shape, optimize=True)
    return (mass + mass.transpose(0, 2, 1)) / 2
