"""Nodes that move along axes of their own: their unknowns are turned into x, y, z.

Nastran writes a node's rows along the axes of its displacement coordinate system (field CD of GRID), and
rotations about them. With u = R u_local, R orthogonal, K = R K_local R^T, and M and C likewise; forces are
R f_local.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Floats
from romdam.core.errors import MeshError
from romdam.geometry.matrices.data import DIRECTIONS, INTERNAL, MatrixUnknowns
from romdam.geometry.meshes.data import Frame

_ALONG = 1e-6  # of a unit vector's component: a smaller one is rounding of the file's coordinates


def with_frames(unknowns: MatrixUnknowns, frames: Mapping[int, Frame], location: str) -> MatrixUnknowns:
    """The unknowns with the axes of the nodes that have some.

    Parameters
    ----------
    frames : number of a node -> its axes
    location : file and key, for messages

    Raises
    ------
    MeshError
        where the coordinate system of a node is not given.
    """
    axes = np.eye(3)[np.where(unknowns.motion == INTERNAL, 0, unknowns.motion % 3)]
    turned = np.isin(unknowns.node, [*frames]) & (unknowns.motion != INTERNAL)
    if not turned.any():
        return unknowns
    for k in np.flatnonzero(turned).tolist():
        frame = frames[int(unknowns.node[k])]
        if frame.axes is None:
            raise MeshError(
                f"{location}: GRID {unknowns.node[k]} moves in coordinate system {frame.system}, which is "
                "not given as CORD2R, CORD2C or CORD2S in that file; add it, or let Nastran write in the "
                "basic system"
            )
        axes[k] = frame.axes[unknowns.motion[k] % 3]
    return replace(unknowns, axes=axes)


def in_basic(unknowns: MatrixUnknowns, location: str) -> tuple[MatrixUnknowns, csr_matrix | None]:
    """The unknowns along x, y, z, and what turns motions into them.

    Returns
    -------
    unknowns along x, y, z, in the same rows; R (n, n), orthogonal, None where nothing is to be turned

    Raises
    ------
    MeshError
        where a node lacks a motion along one of its axes, and those it has are none along x, y and z.
    """
    if unknowns.axes is None:
        return unknowns, None
    motion, entries = unknowns.motion.copy(), list[tuple[int, int, float]]()
    groups = np.stack([unknowns.node, unknowns.motion // 3], axis=1)  # a node's displacement, or its rotation
    order = np.lexsort(groups.T)
    ends = np.flatnonzero((np.diff(groups[order], axis=0) != 0).any(axis=1)) + 1
    for rows in np.split(order, ends):
        if unknowns.motion[rows[0]] == INTERNAL:
            entries += [(row, row, 1.0) for row in rows]
            continue
        axes = unknowns.axes[rows]
        seen = np.flatnonzero((np.abs(axes) > _ALONG).any(axis=0))
        if len(seen) != len(rows):
            has = ", ".join(DIRECTIONS[k] for k in unknowns.motion[rows])
            raise MeshError(
                f"{location}: node {unknowns.node[rows[0]]} moves along {has} of its own coordinate system "
                "alone, which is none of x, y, z: what holds it cannot be written there; write all three, or "
                "let Nastran write in the basic system"
            )
        motion[rows] = 3 * (unknowns.motion[rows] // 3) + seen
        entries += [
            (rows[i], rows[j], axes[j, axis]) for i, axis in enumerate(seen) for j in range(len(rows))
        ]
    row, column, value = (np.array(part) for part in zip(*entries, strict=True))
    n = len(unknowns)
    return replace(unknowns, motion=motion, axes=None), csr_matrix((value, (row, column)), shape=(n, n))


def turned(matrix: csr_matrix, R: csr_matrix | None) -> csr_matrix:
    """R K R^T, symmetric to the last bit."""
    if R is None:
        return matrix
    matrix = R @ matrix @ R.T
    return csr_matrix(0.5 * (matrix + matrix.T))


def turned_vectors(vectors: Floats | None, R: csr_matrix | None) -> Floats | None:
    """Vectors (n, k) along x, y, z; None as they are."""
    return vectors if vectors is None or R is None else np.asarray(R @ vectors)
