"""DOFs of a block that the joints need: the retained, physical DOFs of its reduction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix, eye_array

from romdam.core.arrays import Bools, Floats

_PARALLEL = 1e-10  # second singular value of the jump directions at a node, relative to the first
_ALIGNED = 1e-12  # distance of a unit normal from a coordinate axis


@dataclass(frozen=True)
class Interface:
    """Retained DOFs of a block in node frames turned so that a lone jump direction is one DOF.

    Attributes
    ----------
    turn : (3 n, 3 n) sparse orthogonal; u_turned = turn @ u
    retained : (3 n,) True for the turned DOFs that the gap operator sees
    """

    turn: csr_matrix
    retained: Bools


def joint_interface(operator: csr_matrix, fixed: Bools) -> Interface:
    """Find the retained DOFs of a block.

    A node that the gaps see in one direction only (normal gaps on a smooth face) gives one DOF, along
    that direction; any other node on a joint gives its three components.

    Parameters
    ----------
    operator : (rows, 3 n) gap operator of the block
    fixed : (n, 3) components held by supports
    """
    by_node = csr_matrix(operator.T)
    retained = np.zeros(fixed.size, dtype=bool)
    frames: dict[int, Floats] = {}
    for node in np.unique(np.flatnonzero(np.diff(by_node.indptr)) // 3):
        components = 3 * node + np.arange(3)
        directions = by_node[components].toarray()
        direction = _lone_direction(directions[:, np.abs(directions).any(axis=0)])
        axis = None if direction is None else int(np.argmax(np.abs(direction)))
        if direction is None or axis is None:
            retained[components] = True
        elif 1.0 - abs(direction[axis]) < _ALIGNED:
            retained[components[axis]] = True
        elif fixed[node].any():
            retained[components] = True
        else:
            frames[int(node)] = _frame(direction)
            retained[components[0]] = True
    return Interface(turn=_block_rotation(frames, len(fixed)), retained=retained & ~fixed.ravel())


def _lone_direction(directions: Floats) -> Floats | None:
    """The unit vector to which all columns (3, k) are parallel, if there is one."""
    U, singular, _ = np.linalg.svd(directions, full_matrices=False)
    if len(singular) > 1 and singular[1] > _PARALLEL * singular[0]:
        return None
    return np.asarray(U[:, 0])


def _frame(direction: Floats) -> Floats:
    """Rows: the direction and two tangents."""
    q, _ = np.linalg.qr(np.column_stack([direction, np.eye(3)]))
    return np.asarray(q.T)


def _block_rotation(frames: dict[int, Floats], nodes: int) -> csr_matrix:
    turn = eye_array(3 * nodes, format="lil")
    for node, frame in frames.items():
        turn[3 * node : 3 * node + 3, 3 * node : 3 * node + 3] = frame
    return csr_matrix(turn)
