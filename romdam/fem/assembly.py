"""Stiffness and consistent mass of a block of solid elements."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from romdam.core.scene import Block, Ints
from romdam.fem.absorbing import boundary_springs
from romdam.fem.material import lame
from romdam.geometry.elements import Element, Floats, jacobians
from romdam.geometry.meshes.kinds import chunks_of
from romdam.geometry.meshes.quality import refuse_inverted

_CHUNK = 512  # cells at a time: element matrices that stay in the cache, 4 MB for tet10


class Assembly:
    """Stiffness and mass of blocks: each block is assembled once, when its matrices are first asked for.

    Parameters
    ----------
    blocks : block name -> block
    """

    def __init__(self, blocks: Mapping[str, Block]) -> None:
        self._blocks = blocks
        self._matrices: dict[str, tuple[csr_matrix, csr_matrix]] = {}

    def matrices(self, name: str) -> tuple[csr_matrix, csr_matrix]:
        """Return K [N/m] and M [kg] of a block, see `assemble`."""
        if name not in self._matrices:
            self._matrices[name] = assemble(self._blocks[name])
        return self._matrices[name]

    def inertia(self, name: str) -> Floats:
        """Return M r of a block for unit translations r, (3 n, 3) [kg]."""
        return inertia(self._blocks[name], self.matrices(name)[1])

    def release(self, names: Iterable[str]) -> None:
        """Free the memory of blocks whose matrices are not needed any more."""
        for name in names:
            self._matrices.pop(name, None)


def assemble(block: Block) -> tuple[csr_matrix, csr_matrix]:
    """Stiffness and mass of a block over dof = 3 * node + component, supports not applied.

    They are those that the block brings, else of its elements, the mass consistent. The springs of
    absorbing faces are part of the stiffness.

    Element matrices come from the scalar gradients: with G_ab,kl = int dN_a/dx_k dN_b/dx_l,
    K_ab = lambda G + mu G^T + mu tr(G) I (3 by 3 for each pair of nodes a, b). They are added where they
    stand in the finished matrices, whose pattern the cells give beforehand, so that assembling takes 1.2
    times the matrices' own memory. (A compiled loop would take longer to compile than it saves.)

    Returns
    -------
    K : (3 n, 3 n) [N/m], exactly symmetric
    M : (3 n, 3 n) [kg], exactly symmetric

    Raises
    ------
    MeshError
        when an element has a zero or negative Jacobian determinant.
    """
    if block.matrices is not None:
        stiffness, mass = block.matrices.K, block.matrices.M
    else:
        lam, mu = lame(block.material)
        pattern = _NodePairs(block.cells, len(block.points))
        K, M = np.zeros(9 * pattern.size), np.zeros(pattern.size)
        for element, numbers, cells in chunks_of(block, _CHUNK):
            gradient, shape, volume = cell_geometry(block, element, cells, numbers)
            nc, nq, _, nn = gradient.shape
            rows = gradient.transpose(0, 3, 2, 1).reshape(nc, nn * 3, nq)
            G = (rows * volume[:, None, :]) @ rows.transpose(0, 2, 1)
            G = ((G + G.transpose(0, 2, 1)) / 2).reshape(nc, nn, 3, nn, 3)
            local = lam * G + mu * G.swapaxes(2, 4)  # (nc, a, k, b, l)
            trace = mu * np.einsum("cakbk->cab", G)
            for k in range(3):
                local[:, :, k, :, k] += trace
            pair = pattern.pairs(cells)
            np.add.at(M, pair.ravel(), _mass(shape, volume, block.material.rho).ravel())
            np.add.at(K, pattern.entries(cells, pair).ravel(), local.ravel())
        stiffness, mass = pattern.stiffness(K), pattern.mass(M)
    if block.absorbing:
        stiffness = csr_matrix(stiffness + boundary_springs(block))
    return stiffness, mass


def assemble_mass(block: Block) -> csr_matrix:
    """The mass of `assemble` to the bit, in a third of the time."""
    if block.matrices is not None:
        return block.matrices.M
    pattern = _NodePairs(block.cells, len(block.points))
    M = np.zeros(pattern.size)
    for element, rows, cells in chunks_of(block, _CHUNK):
        xi, weight = element.rule
        volume = _inverses(block, element, cells, rows)[1] * weight
        mass = _mass(element.shape(xi), volume, block.material.rho)
        np.add.at(M, pattern.pairs(cells).ravel(), mass.ravel())
    return pattern.mass(M)


def inertia(block: Block, mass: csr_matrix) -> Floats:
    """M r of a block for unit translations r along x, y, z, (3 n, 3) [kg]."""
    if block.matrices is None:
        return np.asarray(mass @ np.tile(np.eye(3), (len(block.points), 1)))
    brought = block.matrices.inertia
    return np.asarray(mass @ block.matrices.translations) if brought is None else brought


class _NodePairs:
    """The pairs of nodes that share a cell, row by row: the block pattern of K and M."""

    def __init__(self, cells: Ints, nodes: int) -> None:
        self.nodes = nodes
        ends = np.arange(0, cells.size + 1, cells.shape[1])
        at = csr_matrix((np.ones(cells.size, dtype=bool), cells.ravel(), ends), shape=(len(cells), nodes))
        together = csr_matrix(at.T) @ at
        together.sort_indices()
        self.start, self.columns = together.indptr, together.indices
        self.size = len(self.columns)
        self.degree = np.diff(self.start)
        self._key = np.repeat(np.arange(nodes), self.degree) * nodes + self.columns

    def pairs(self, cells: Ints) -> Ints:
        """Number of the pair (a, b) of every cell, (cells, a, b)."""
        return np.searchsorted(self._key, cells[:, :, None] * self.nodes + cells[:, None, :])

    def entries(self, cells: Ints, pair: Ints) -> Ints:
        """Positions in K of the 3 by 3 of every pair, (cells, a, k, b, l): its rows are 3 to a node."""
        first, degree = self.start[cells].astype(np.int64), self.degree[cells].astype(np.int64)
        row = 9 * first[..., None] + 3 * degree[..., None] * np.arange(3)
        column = 3 * (pair - first[..., None])[..., None] + np.arange(3)
        return row[..., None, None] + column[:, :, None]

    def mass(self, M: Floats) -> csr_matrix:
        """The sparse matrix of entries of one component each."""
        start, pair = self._rows()
        component = np.repeat(np.tile(np.arange(3, dtype=start.dtype), self.nodes), np.repeat(self.degree, 3))
        column = 3 * self.columns[pair].astype(start.dtype) + component
        return csr_matrix((M[pair], column, start), shape=(3 * self.nodes, 3 * self.nodes))

    def stiffness(self, K: Floats) -> csr_matrix:
        """The sparse matrix of the entries of every 3 by 3."""
        start, pair = self._rows()
        column = 3 * self.columns[pair].astype(start.dtype)
        columns = (column[:, None] + np.arange(3, dtype=start.dtype)).ravel()
        return csr_matrix((K, columns, 3 * start), shape=(3 * self.nodes, 3 * self.nodes))

    def _rows(self) -> tuple[NDArray[np.integer[Any]], NDArray[np.integer[Any]]]:
        """Start of each row of M, and the pair of every entry."""
        index: Any = np.int32 if 9 * self.size < np.iinfo(np.int32).max else np.int64
        start = np.concatenate([[0], np.cumsum(np.repeat(self.degree, 3), dtype=index)]).astype(index)
        back = start[:-1] - np.repeat(self.start[:-1], 3).astype(index)
        return start, np.arange(start[-1], dtype=index) - np.repeat(back, np.repeat(self.degree, 3))


def cell_geometry(block: Block, element: Element, cells: Ints, rows: Ints) -> tuple[Floats, Floats, Floats]:
    """Gradients (nc, nq, 3, nn) [1/m], shape functions (nq, nn), volumes of the points (nc, nq) [m3].

    Parameters
    ----------
    cells : (nc, nn) of one kind
    rows : (nc,) their numbers in the block, for messages
    """
    xi, weight = element.rule
    adjugate, determinant = _inverses(block, element, cells, rows)
    gradient = adjugate.swapaxes(-1, -2) @ element.gradient(xi)[None] / determinant[..., None, None]
    return gradient, element.shape(xi), determinant * weight


def _inverses(block: Block, element: Element, cells: Ints, rows: Ints) -> tuple[Floats, Floats]:
    """Adjugates of the Jacobians (nc, nq, 3, 3) [m2] and their determinants (nc, nq) [m3]."""
    jacobian = jacobians(block.points, cells, element, element.rule[0])
    adjugate = np.cross(jacobian[..., [1, 2, 0], :], jacobian[..., [2, 0, 1], :])
    determinant = (jacobian[..., 0, :] * adjugate[..., 0, :]).sum(axis=-1)
    refuse_inverted(block, determinant, rows)
    return adjugate, determinant


def _mass(shape: Floats, volume: Floats, rho: float) -> Floats:
    """Element mass per component (nc, a, b) [kg]."""
    mass = rho * np.einsum("cq,qa,qb->cab", volume, shape, shape, optimize=True)
    return (mass + mass.transpose(0, 2, 1)) / 2
