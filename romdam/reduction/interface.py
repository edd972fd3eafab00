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
from scipy.sparse import bsr_matrix, csr_matrix, eye_array

from romdam.core.arrays import Bools, Floats

_PARALLEL = 1e-10  # part of a jump direction across the longest one at the node, relative to that
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
    retained = np.zeros(fixed.shape, dtype=bool)
    frames: dict[int, Floats] = {}
    for node, direction in _lone_directions(operator):
        axis = None if direction is None else int(np.argmax(np.abs(direction)))
        if direction is None or axis is None:
            retained[node] = True
        elif 1.0 - abs(direction[axis]) < _ALIGNED:
            retained[node, axis] = True
        elif fixed[node].any():
            retained[node] = True
        else:
            # rows: the direction and two tangents
            frames[node] = np.linalg.qr(np.column_stack([direction, np.eye(3)]))[0].T
            retained[node, 0] = True
    turn = eye_array(fixed.size, format="lil" if frames else "csr")
    for node, frame in frames.items():
        turn[3 * node : 3 * node + 3, 3 * node : 3 * node + 3] = frame
    return Interface(turn=csr_matrix(turn), retained=(retained & ~fixed).ravel())


def sees_more_nodes_than_gaps(operator: csr_matrix, interface: Interface, directions: int) -> bool:
    """Tell whether the gaps of a block need less than the nodes that they see.

    Parameters
    ----------
    operator : (directions * gaps, 3 n) gap operator of the block
    interface : what would be retained
    """
    gaps = np.unique(np.flatnonzero(np.diff(operator.indptr)) // directions)
    return int(interface.retained.reshape(-1, 3).any(axis=1).sum()) > len(gaps)


def _lone_directions(operator: csr_matrix) -> list[tuple[int, Floats | None]]:
    """Every node that gaps see, and the unit vector parallel to all their directions, if there is one."""
    by_node = bsr_matrix(operator, blocksize=(1, 3))
    jumps, node = by_node.data[:, 0], by_node.indices
    length = np.linalg.norm(jumps, axis=1)
    order = np.lexsort((-length, node))
    jumps, node, length = (a[order][length[order] > 0.0] for a in (jumps, node, length))
    seen, first, which = np.unique(node, return_index=True, return_inverse=True)  # the longest is the first
    longest = jumps[first] / length[first, None]
    across = jumps - (jumps * longest[which]).sum(axis=1)[:, None] * longest[which]
    parallel = np.ones(len(seen), dtype=bool)
    parallel[which[np.linalg.norm(across, axis=1) > _PARALLEL * length[first][which]]] = False
    return [(int(n), d if lone else None) for n, d, lone in zip(seen, longest, parallel, strict=True)]
