"""Gap elements of the whole scene: their parameters and the operator from displacement to jump."""

from __future__ import annotations

import numpy as np
from scipy.sparse import bsr_matrix, csr_matrix, vstack

from romdam.contact.laws.catalogue import find_law, law_order
from romdam.core.arrays import Floats
from romdam.core.scene import Joint, Scene
from romdam.core.system import GapLaw, LawRows


def gap_law(scene: Scene) -> GapLaw:
    """Parameters of every gap, joints one after another in the scene's order."""
    joints = list(scene.joints.values())
    ends = np.cumsum([0] + [len(joint.gap) for joint in joints])

    def stacked(name: str, shape: tuple[int, ...] = (0,)) -> Floats:
        return np.concatenate([np.zeros(shape)] + [getattr(joint, name) for joint in joints])

    # the further laws in the order in which they apply, off at joints that have not got them
    laws, size = list[LawRows](), int(ends[-1])
    names = {rows.law for joint in joints for rows in joint.laws}
    for law in sorted(names, key=lambda law: law_order(find_law(law))):
        on, values, shear = np.zeros(size, dtype=np.bool_), np.zeros((size, 0)), False
        for joint, start, end in zip(joints, ends[:-1], ends[1:], strict=True):
            for rows in joint.laws:
                if rows.law == law:
                    values = values if values.size else np.zeros((size, rows.values.shape[1]))
                    on[start:end], values[start:end] = True, rows.values
                    shear = shear or rows.shear
        laws.append(LawRows(law, values, on, shear))
    return GapLaw(
        K_n=stacked("K_n"),
        K_nz=stacked("K_nz"),
        K_s=stacked("K_s"),
        mu=stacked("mu", (0, 2)),
        gap=stacked("gap"),
        joints={joint.name: slice(a, b) for joint, a, b in zip(joints, ends[:-1], ends[1:], strict=True)},
        laws=tuple(laws),
        viscosity=stacked("viscosity"),
        grout=stacked("grout"),
        uplift={joint.name: joint.uplift for joint in joints if joint.uplift is not None},
    )


def water_force(scene: Scene) -> Floats:
    """Force of the water in the joints along the gaps' normals, pushing them apart, (ng,) [N]."""
    return np.concatenate([np.zeros(0), *(joint.water for joint in scene.joints.values())])


def gap_operators(scene: Scene, directions: int) -> dict[str, csr_matrix]:
    """Jump of every gap, as joint forces see it, from each block's displacement, without the initial gap.

    Parameters
    ----------
    scene : the scene
    directions : 1 (normal only) or 3 (normal, j, k)

    Returns
    -------
    dict of block name -> (directions * ng, 3 * nodes) sparse; the jump is the sum over the blocks,
    rows of gap m are directions*m + direction
    """
    weights = {name: joint.weights for name, joint in scene.joints.items()}
    return _operators(scene, weights, directions)


def point_operators(scene: Scene, directions: int) -> dict[str, csr_matrix] | None:
    """As `gap_operators`, of what the jump at the gaps' positions is more; None where it is the same."""
    joints = scene.joints.values()
    if all(joint.at_point is None for joint in joints):
        return None
    weights: dict[str, tuple[csr_matrix, csr_matrix]] = {}
    for joint in joints:
        (I, J), (point_I, point_J) = joint.weights, joint.at_point or joint.weights
        weights[joint.name] = csr_matrix(point_I - I), csr_matrix(point_J - J)
    return _operators(scene, weights, directions)


def _operators(
    scene: Scene, weights: dict[str, tuple[csr_matrix, csr_matrix]], directions: int
) -> dict[str, csr_matrix]:
    """Operators of weights (gaps, nodes) on both sides of every joint: block name -> (d ng, 3 nodes)."""
    operators = {}
    for name, block in scene.blocks.items():
        size = 3 * len(block.points)
        by_joint = [csr_matrix((0, size))]
        for joint in scene.joints.values():
            gaps = len(joint.gap)
            total, axes = csr_matrix((directions * gaps, size)), gap_axes(joint, directions)
            for side, sign in ((0, -1.0), (1, 1.0)):
                if joint.blocks[side] != name:
                    continue
                of_side = csr_matrix(weights[joint.name][side]).tocoo()
                nodes = joint.nodes[side][of_side.col]
                values = np.tile(sign * of_side.data, 3)
                rows = np.concatenate([3 * of_side.row + c for c in range(3)])
                columns = np.concatenate([3 * nodes + c for c in range(3)])
                total = total + axes @ csr_matrix((values, (rows, columns)), shape=(3 * gaps, size))
            by_joint.append(csr_matrix(total))
        operators[name] = csr_matrix(vstack(by_joint))
    return operators


def gap_axes(joint: Joint, directions: int) -> csr_matrix:
    """Vectors at a joint's gaps in the first of the gaps' axes, (directions * gaps, 3 * gaps)."""
    gaps = len(joint.gap)
    frames = (joint.axes[:, :directions], np.arange(gaps), np.arange(gaps + 1))
    return bsr_matrix(frames, shape=(directions * gaps, 3 * gaps)).tocsr()
