"""Gap elements of the whole scene: their parameters and the operator from displacement to jump."""

from __future__ import annotations

import numpy as np
from scipy.sparse import bsr_matrix, csr_matrix, vstack

from romdam.contact.laws.catalogue import find_law, law_order
from romdam.core.arrays import Floats
from romdam.core.scene import Joint, Scene
from romdam.core.system import GapLaw, LawRows, LawSource


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
        laws=_laws(joints),
        viscosity=stacked("viscosity"),
        grout=stacked("grout"),
    )


def _laws(joints: list[Joint]) -> tuple[LawRows, ...]:
    """The further laws of all gaps, in the order in which they apply."""
    names = {rows.law for joint in joints for rows in joint.laws}
    return tuple(_law(joints, law) for law in sorted(names, key=lambda law: law_order(find_law(law))))


def _law(joints: list[Joint], law: LawSource) -> LawRows:
    """One further law of all gaps, off at joints that have not got it."""
    size, start = sum(len(joint.gap) for joint in joints), 0
    on, values, shear = np.zeros(size, dtype=np.bool_), np.zeros((size, 0)), False
    for joint in joints:
        gaps = slice(start, start := start + len(joint.gap))
        for rows in joint.laws:
            if rows.law == law:
                values = values if values.size else np.zeros((size, rows.values.shape[1]))
                on[gaps], values[gaps], shear = True, rows.values, shear or rows.shear
    return LawRows(law, values, on, shear)


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
    return _operators(scene, {joint.name: _more_at_point(joint) for joint in joints}, directions)


def _more_at_point(joint: Joint) -> tuple[csr_matrix, csr_matrix]:
    I, J = (csr_matrix(p - w) for p, w in zip(joint.at_point or joint.weights, joint.weights, strict=True))
    return I, J


def _operators(
    scene: Scene, weights: dict[str, tuple[csr_matrix, csr_matrix]], directions: int
) -> dict[str, csr_matrix]:
    operators = {}
    for name, block in scene.blocks.items():
        parts = [
            _one_side(joint, weights[joint.name], name, len(block.points), directions)
            for joint in scene.joints.values()
        ]
        empty = csr_matrix((0, 3 * len(block.points)))
        operators[name] = csr_matrix(vstack([empty, *parts]))
    return operators


def gap_axes(joint: Joint, directions: int) -> csr_matrix:
    """Vectors at a joint's gaps in the first of their own axes, (directions * gaps, 3 * gaps)."""
    gaps = len(joint.gap)
    frames = (joint.axes[:, :directions], np.arange(gaps), np.arange(gaps + 1))
    return bsr_matrix(frames, shape=(directions * gaps, 3 * gaps)).tocsr()


def _one_side(
    joint: Joint, both: tuple[csr_matrix, csr_matrix], block: str, nodes: int, directions: int
) -> csr_matrix:
    total, axes = csr_matrix((directions * len(joint.gap), 3 * nodes)), gap_axes(joint, directions)
    for side, sign in ((0, -1.0), (1, 1.0)):
        if joint.blocks[side] != block:
            continue
        weights = csr_matrix(both[side]).tocoo()
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
