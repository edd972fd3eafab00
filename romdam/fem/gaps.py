"""Gap elements of the whole scene: their parameters and the operator from displacement to jump."""

from __future__ import annotations

import numpy as np
from scipy.sparse import block_diag, csr_matrix, vstack

from romdam.core.arrays import Floats
from romdam.core.scene import Joint, Scene
from romdam.core.system import GapLaw


def gap_law(scene: Scene) -> GapLaw:
    """Parameters of every gap, joints one after another in the scene's order."""
    joints = list(scene.joints.values())
    ends = np.cumsum([0] + [len(joint.gap) for joint in joints])

    def stacked(name: str, shape: tuple[int, ...] = (0,)) -> Floats:
        return np.concatenate([np.zeros(shape)] + [getattr(joint, name) for joint in joints])

    return GapLaw(
        K_n=stacked("K_n"),
        K_nz=stacked("K_nz"),
        K_s=stacked("K_s"),
        mu=stacked("mu", (0, 2)),
        gap=stacked("gap"),
        joints={joint.name: slice(a, b) for joint, a, b in zip(joints, ends[:-1], ends[1:], strict=True)},
        laws={name: _law(joints, name) for name in sorted({law for joint in joints for law in joint.laws})},
    )


def _law(joints: list[Joint], name: str) -> Floats:
    """One further law of all gaps, zero (off) at joints that have not got it."""
    shape = next(joint.laws[name].shape[1:] for joint in joints if name in joint.laws)
    return np.concatenate([joint.laws.get(name, np.zeros((len(joint.gap), *shape))) for joint in joints])


def gap_operators(scene: Scene, directions: int) -> dict[str, csr_matrix]:
    """Jump of every gap from each block's displacement, without the initial gap.

    Parameters
    ----------
    scene : the scene
    directions : 1 (normal only) or 3 (normal, j, k)

    Returns
    -------
    dict of block name -> (directions * ng, 3 * nodes) sparse; the jump is the sum over the blocks,
    rows of gap m are directions*m + direction
    """
    operators = {}
    for name, block in scene.blocks.items():
        parts = [_one_side(joint, name, len(block.points), directions) for joint in scene.joints.values()]
        empty = csr_matrix((0, 3 * len(block.points)))
        operators[name] = csr_matrix(vstack([empty, *parts]))
    return operators


def _one_side(joint: Joint, block: str, nodes: int, directions: int) -> csr_matrix:
    rows = directions * len(joint.gap)
    total = csr_matrix((rows, 3 * nodes))
    axes = block_diag([frame[:directions] for frame in joint.axes], format="csr")
    weights = csr_matrix(joint.weights).tocoo()
    for side, sign in ((0, -1.0), (1, 1.0)):
        if joint.blocks[side] != block:
            continue
        columns = joint.nodes[side][weights.col]
        entries = (
            np.tile(sign * weights.data, 3),
            (
                np.concatenate([3 * weights.row + c for c in range(3)]),
                np.concatenate([3 * columns + c for c in range(3)]),
            ),
        )
        total = total + axes @ csr_matrix(entries, shape=(3 * len(joint.gap), 3 * nodes))
    return csr_matrix(total)
