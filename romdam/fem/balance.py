"""Balance of the forces at rest: the six resultants of loads, joints and supports, for each body and the dam.

They are summed over the mesh, whatever unknowns the equilibrium was found in, so that they tell whether a
reduced basis, or a solver, has lost some of a force. A body is a block, or several that are tied. What
supports and springs of a body hold is what the others leave in the motions that they stop; in those that
joints alone stop nothing may be left.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.attachment import Attachment, of_all, stacked_rows
from romdam.core.errors import ConvergenceError
from romdam.core.round_off import without_round_off
from romdam.core.scene import Scene
from romdam.core.system import RestBalance
from romdam.fem.assembly import assemble_mass
from romdam.fem.gaps import gap_operators
from romdam.fem.loads import surface_forces, weight_acts, weight_force
from romdam.scene.supports import rigid_motions, sprung
from romdam.scene.ties import Part, scene_parts

DAM = "whole dam"
LIMIT = 1e-6  # of the forces on a body, what may be left of them
_FREE = 1e-9  # of the largest, a motion that supports leave


def balance_at_rest(
    scene: Scene, joint_force: Floats, water: Floats, dam: Collection[str], attached: Floats
) -> RestBalance:
    """Sum up the forces on every body.

    Parameters
    ----------
    joint_force : (ng, d) contact force on side J at rest [N]
    water : (ng,) force of the water in the gaps [N]
    dam : its blocks
    attached : (k,) force of each row of attachments that bears, see `romdam.core.attachment.BearingRows` [N]
    """
    force = joint_force.copy()
    force[:, 0] += water
    operators = gap_operators(scene, force.shape[1]) if len(force) else {}
    bodies = list(scene_parts(scene).values())
    names, about = [DAM], [_middle(scene, dam or list(scene.blocks))]
    loads, joints, supports = (np.zeros((1 + len(bodies), 6)) for _ in range(3))
    left = np.zeros(1 + len(bodies))
    by_attachments = _by_attachments(scene, attached)
    for k, body in enumerate(bodies, start=1):
        middle, size = _middle(scene, body.blocks), 0.0
        of_dam = set(body.blocks) <= set(dam)
        for name in body.blocks:
            load = _load(scene, name) + by_attachments.get(name, 0.0)
            on_joints = operators[name].T @ force.ravel() if name in operators else np.zeros_like(load)
            loads[k] += _resultant(scene, name, load, middle)
            joints[k] += _resultant(scene, name, on_joints, middle)
            size += float(np.linalg.norm(load.reshape(-1, 3), axis=1).sum())
            size += float(np.linalg.norm(on_joints.reshape(-1, 3), axis=1).sum())
            if name in dam:
                loads[0] += _resultant(scene, name, load, about[0])
                joints[0] += _resultant(scene, name, on_joints, about[0])
        points = np.concatenate([scene.blocks[name].points for name in body.blocks])
        radius = float(np.linalg.norm(np.ptp(points, axis=0)) / 2.0)
        units = np.repeat([1.0, radius], 3)
        rest = (loads[k] + joints[k]) / units
        free = _free_motions(scene, body, middle, radius)
        unheld = free @ (free.T @ rest)
        supports[k] = (unheld - rest) * units
        if of_dam:
            supports[0] += _moved(supports[k], middle, about[0])
        # what a mortar tie makes of a rotation is no rotation where its faces do not fit
        checked = unheld if body.slaves is None else unheld[:3]
        left[k] = float(np.abs(checked).max() / size) if size > 0.0 else 0.0
        left[0] = max(left[0], left[k]) if of_dam else left[0]
        names.append(body.name)
        about.append(middle)
    return RestBalance(tuple(names), np.array(about), loads, joints, supports, left)


def load_resultants(scene: Scene) -> dict[str, Floats]:
    """Kind of load -> (3,) resultant of what acts on all blocks at rest [N].

    The water in joints acts on both sides of them, and has none.
    """
    kinds = dict[str, Floats]()
    for name, block in scene.blocks.items():
        forces = surface_forces(scene, name, thermal=False)
        if scene.loads.gravity.any() and weight_acts(scene, name):
            weight = weight_force(scene, name, assemble_mass(block)).reshape(-1, 3)
            forces["weight"] = weight + forces.get("weight", 0.0)
        for kind, force in forces.items():
            kinds[kind] = kinds.get(kind, np.zeros(3)) + force.sum(axis=0)
    largest = max((float(np.abs(force).max()) for force in kinds.values()), default=0.0)
    return {kind: without_round_off(force, largest) for kind, force in kinds.items()}


def refuse_unbalanced(balance: RestBalance) -> None:
    """Refuse a state that is no equilibrium.

    Raises
    ------
    ConvergenceError
        with the body, what is left, and the limit.
    """
    k = int(np.argmax(balance.left[1:])) + 1 if len(balance.left) > 1 else 0
    if balance.left[k] <= LIMIT:
        return
    rest = balance.loads[k] + balance.joints[k] + balance.supports[k]
    forces = ", ".join(f"{value:.4g}" for value in rest[:3])
    moments = ", ".join(f"{value:.4g}" for value in rest[3:])
    raise ConvergenceError(
        f"initial state: the forces on {balance.names[k]!r} do not balance: ({forces}) N and ({moments}) N m "
        f"about its middle are left, {balance.left[k]:.2g} of the forces on it, limit {LIMIT:g}; take more "
        "model.modes, a smaller transient.tolerance, or model.order: full"
    )


def _load(scene: Scene, name: str) -> Floats:
    """(3 n,) static forces on a block; those of temperature have no resultant."""
    block = scene.blocks[name]
    total = np.zeros_like(block.points)
    for force in surface_forces(scene, name, thermal=False).values():
        total += force
    if scene.loads.gravity.any() and weight_acts(scene, name):
        total += weight_force(scene, name, assemble_mass(block))
    return total.ravel()


def _by_attachments(scene: Scene, attached: Floats) -> dict[str, Floats]:
    """Block name -> (3 n,) static forces of what is attached to it, its weight and the force at rest."""
    some = scene.every(Attachment)
    bearing = np.concatenate([np.zeros(0, dtype=bool), *(np.full(len(one), one.bears) for one in some)])
    along = of_all(some, "weight")
    along[bearing] -= attached
    sizes = {name: block.points.size for name, block in scene.blocks.items()}
    return {name: np.asarray(rows.T @ along) for name, rows in stacked_rows(some, sizes).items()}


def _middle(scene: Scene, blocks: Collection[str]) -> Floats:
    points = np.concatenate([scene.blocks[name].points for name in blocks])
    return np.asarray((points.min(axis=0) + points.max(axis=0)) / 2.0)


def _resultant(scene: Scene, name: str, force: Floats, about: Floats) -> Floats:
    """(6,) force and moment of nodal forces (3 n,) on a block."""
    block = scene.blocks[name]
    low, high = block.points.min(axis=0), block.points.max(axis=0)
    loaded = np.unique(np.flatnonzero(force) // 3)
    if not len(loaded):
        return np.zeros(6)
    motions = rigid_motions(block, loaded).reshape(-1, 6)
    total = motions.T @ force.reshape(-1, 3)[loaded].ravel()
    total[3:] *= np.linalg.norm(high - low) / 2.0
    return _moved(total, (low + high) / 2.0, about)


def _moved(resultant: Floats, about: Floats, other: Floats) -> Floats:
    """The resultant about another point."""
    return np.append(resultant[:3], resultant[3:] + np.cross(about - other, resultant[:3]))


def _free_motions(scene: Scene, body: Part, middle: Floats, radius: float) -> Floats:
    """(6, r) orthonormal rigid motions that supports leave, rotations about the middle over the radius."""
    blocks = [scene.blocks[name] for name in body.blocks]
    held = [(block.points, scene.fixed[block.name] | sprung(block)) for block in blocks]
    if body.stands_free(scene) or any(scene.blocks[name].matrices is not None for name in body.blocks):
        return np.zeros((6, 0))
    rows = [np.zeros((1, 6))]
    for points, fixed in held:
        node, component = np.nonzero(fixed)
        arm = (points[node] - middle) / radius
        unit = np.eye(3)[component]
        rows.append(np.hstack([unit, np.cross(arm, unit)]))
    _, size, V = np.linalg.svd(np.concatenate(rows), full_matrices=True)
    stopped = int((size > _FREE * max(size.max(), 1.0)).sum())
    return np.asarray(V[stopped:].T)
