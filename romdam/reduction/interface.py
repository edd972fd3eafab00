"""DOFs of a block that the joints need: the retained, physical DOFs of its reduction.

A joint with a gap on every node pair needs the nodes themselves. Mortar joints, and gaps at the corners of
quadratic faces, see more nodes than they have gaps: retained, those would be unknowns that no gap asks for.
Static answers to the gaps' forces and the block's free modes serve such blocks (free-interface reduction).

On two cantilevers of 1,704 unknowns in hex20 with 27 gaps with friction at the corners of their faces, 40
modes a block leave 0.11 % of the jumps in L2 with the nodes retained (464 unknowns), 0.11 % with the gaps'
own motion retained and fixed-interface modes (242), 0.016 % with static answers and free modes (242).
"""

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


def sees_more_nodes_than_gaps(operator: csr_matrix, interface: Interface, directions: int) -> bool:
    """Tell whether the gaps of a block need less than the nodes that they see.

    Parameters
    ----------
    operator : (directions * gaps, 3 n) gap operator of the block
    interface : what would be retained
    """
    gaps = np.unique(np.flatnonzero(np.diff(operator.indptr)) // directions)
    return int(interface.retained.reshape(-1, 3).any(axis=1).sum()) > len(gaps)


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
