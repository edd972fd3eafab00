"""Mortar weights of faces that are grids of rectangles, made without the library.

Dual shape functions of a grid are products of those of a line, so that the weights are a Kronecker product.

References
----------
Wohlmuth, SIAM J. Numer. Anal. 38 (2000) 989.
"""

import dataclasses

import numpy as np
from scipy.sparse import csr_matrix, kron

from romdam.core.arrays import Floats
from romdam.core.scene import Block, Scene, Tie


def distinct(x: Floats) -> Floats:
    """Ascending numbers, those that rounding makes two once."""
    return np.asarray(x[np.unique(x.round(9), return_index=True)[1]])


def line_weights(slave: Floats, master: Floats) -> tuple[Floats, Floats]:
    """D^-1 M (k, m) of an ascending line of nodes within another one, and D (k,)."""
    cuts = distinct(np.concatenate([slave, master]))
    cuts = cuts[(cuts > slave[0] - 1e-9) & (cuts < slave[-1] + 1e-9)]
    x, w = np.polynomial.legendre.leggauss(3)
    half = np.diff(cuts)[:, None] / 2
    points, weights = ((cuts[:-1, None] + half) + half * x).ravel(), (half * w).ravel()
    e = np.clip(np.searchsorted(slave, points) - 1, 0, len(slave) - 2)
    t = (points - slave[e]) / np.diff(slave)[e]
    dual = np.zeros((len(slave), len(points)))
    dual[e, np.arange(len(points))] = 2 - 3 * t
    dual[e + 1, np.arange(len(points))] = 3 * t - 1
    shape = np.array([np.interp(points, master, row) for row in np.eye(len(master))])
    D = dual @ weights
    return (dual * weights) @ shape.T / D[:, None], D


def grid_tie(name: str, slave: Block, master: Block, axis: int, at: float) -> Tie:
    """The mortar tie of two blocks whose nodes at x[axis] = at are grids, the slave's within the master's."""
    across = [k for k in range(3) if k != axis]
    nodes = []
    for block in (slave, master):
        on = np.flatnonzero(np.isclose(block.points[:, axis], at))
        nodes.append(on[np.lexsort(block.points[on][:, across[::-1]].T)])
    (W, D), (V, E) = (
        line_weights(*(distinct(b.points[n, k]) for b, n in zip((slave, master), nodes, strict=True)))
        for k in across
    )
    weights = kron(csr_matrix(W), csr_matrix(V), format="csr")
    return Tie(
        name, (slave.name, master.name), (nodes[0], nodes[1]), weights, np.asarray(np.kron(D, E), dtype=float)
    )


def tied(scene: Scene, *ties: Tie) -> Scene:
    """A scene with more ties."""
    return dataclasses.replace(scene, ties=(*scene.ties, *ties))
