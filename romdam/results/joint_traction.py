"""Traction across tied joints: stress of both sides on the joint's plane, at every gap it would have.

It is the mean of what the stress of the two blocks makes of it, each averaged over its own cells.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Floats, Ints
from romdam.core.scene import Joint, Scene, StressNodes, StressSites
from romdam.results.stress.file import StressFields

_PLACE = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])  # of a tensor's entries among xx yy zz xy yz xz


@dataclass(frozen=True)
class JointTraction:
    """Traction of the gaps (normal, tension positive, and along j and k), a joint after another.

    Attributes
    ----------
    rows : (ng, 3, n) for reduced coordinates of 1 [Pa kg-0.5]
    offset : (ng, 3) without displacement [Pa]
    """

    rows: Floats
    offset: Floats


def joint_sites(scene: Scene) -> StressSites:
    """The nodes of the joints' faces as places where stress is wanted."""
    nodes: dict[str, list[Ints]] = {}
    for joint in scene.joints.values():
        for side in (0, 1):
            nodes.setdefault(joint.blocks[side], []).append(joint.nodes[side])
    blocks = {}
    for name in scene.blocks:
        if name in nodes:
            every = np.unique(np.concatenate(nodes[name]))
            axes = np.zeros((len(every), 3))
            blocks[name] = StressNodes(every, axes, axes)
    return StressSites(blocks=blocks, faces=(), probes={}, strength=None)


def joint_traction(scene: Scene, fields: Mapping[str, StressFields], size: int) -> JointTraction:
    """Traction of every gap from the stress at the nodes of `joint_sites`.

    Parameters
    ----------
    fields : block name -> stress at those nodes
    size : number of reduced coordinates
    """
    rows, offset = [], []
    for joint in scene.joints.values():
        gaps = len(joint.gap)
        of_joint, constant = np.zeros((gaps, 3, size)), np.zeros((gaps, 3))
        for side in (0, 1):
            stress = fields[joint.blocks[side]]
            select = 0.5 * _on_plane(joint, side, stress)
            factors = select @ stress.fields.reshape(-1, stress.fields.shape[2])
            of_joint[:, :, stress.columns] += (factors @ stress.combinations).reshape(gaps, 3, -1)
            constant += (select @ stress.offset.ravel()).reshape(gaps, 3)
        rows.append(of_joint)
        offset.append(constant)
    return JointTraction(np.concatenate(rows), np.concatenate(offset))


def _on_plane(joint: Joint, side: int, stress: StressFields) -> csr_matrix:
    """(3 gaps, 6 k) that takes tractions in the gaps' axes from stress at k nodes of a block."""
    weights = csr_matrix((joint.at_point or joint.weights)[side]).tocoo()
    node = np.searchsorted(stress.nodes, joint.nodes[side][weights.col])
    rows, columns, values = [], [], []
    for axis in range(3):
        for i in range(3):
            for j in range(3):
                rows.append(3 * weights.row + axis)
                columns.append(6 * node + _PLACE[i, j])
                share = joint.axes[weights.row, axis, i] * joint.axes[weights.row, 0, j]
                values.append(weights.data * share)
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    return csr_matrix(entries, shape=(3 * len(joint.gap), 6 * len(stress.nodes)))
