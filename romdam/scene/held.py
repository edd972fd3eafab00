"""Whether supports and joints hold every block: rank of the rigid-body motions they see."""

from __future__ import annotations

import numpy as np

from romdam.errors import ConfigError
from romdam.scene.elements import Floats
from romdam.scene.model import Block, Bools, Ints, Joint

_RANK = 1e-8  # relative singular value; the motions are scaled to be of order one
_MOTIONS = tuple(f"{kind} {axis}" for kind in ("translation along", "rotation about") for axis in "xyz")


def refuse_free_blocks(
    blocks: dict[str, Block], joints: dict[str, Joint], fixed: dict[str, Bools], source: str
) -> None:
    """Raise if a rigid motion of some blocks meets no support and no joint.

    A joint counts with all its components, as if closed and stuck: a block that nothing but joints
    hold may slide or lift off, and its motion is then the joint's to decide.

    Raises
    ------
    ConfigError
        naming the free blocks and their free motions.
    """
    names = list(blocks)
    first = {name: 6 * k for k, name in enumerate(names)}
    rows = [np.zeros((1, 6 * len(names)))]
    for name, held in fixed.items():
        seen = _rigid(blocks[name], np.arange(len(held)))[held]
        rows.append(_embed({first[name]: seen}, 6 * len(names)))
    for joint in joints.values():
        sides = zip(joint.blocks, joint.nodes, (-1.0, 1.0), strict=True)
        seen_by = {first[b]: sign * _rigid(blocks[b], nodes).reshape(-1, 6) for b, nodes, sign in sides}
        rows.append(_embed(seen_by, 6 * len(names)))
    free = _null_space(np.vstack(rows))
    if free.shape[1]:
        raise ConfigError(_explain(names, free, joints, source))


def _rigid(block: Block, nodes: Ints) -> Floats:
    """Displacement of nodes in the six rigid motions about the block's centre, (n, 3, 6).

    Rotations are scaled by the block's half diagonal, so that all six are of order one.
    """
    low, high = block.points.min(axis=0), block.points.max(axis=0)
    arm = (block.points[nodes] - (low + high) / 2) / (np.linalg.norm(high - low) / 2)
    motion = np.zeros((len(arm), 3, 6))
    motion[:, :, :3] = np.eye(3)
    motion[:, :, 3:] = np.cross(np.eye(3)[None], arm[:, None, :]).transpose(0, 2, 1)
    return motion


def _embed(parts: dict[int, Floats], width: int) -> Floats:
    """A triangle (QR) with the same row space as the parts set side by side at their columns."""
    triangle: Floats = np.asarray(np.linalg.qr(np.hstack(list(parts.values())), mode="r"), dtype=float)
    rows = np.zeros((len(triangle), width))
    for k, start in enumerate(parts):
        rows[:, start : start + 6] = triangle[:, 6 * k : 6 * k + 6]
    return rows


def _null_space(rows: Floats) -> Floats:
    _, singular, V = np.linalg.svd(rows)
    rank = int(np.count_nonzero(singular > _RANK * max(singular.max(), 1e-300)))
    return V[rank:].T


def _explain(names: list[str], free: Floats, joints: dict[str, Joint], source: str) -> str:
    share = np.linalg.norm(free.reshape(len(names), 6, -1), axis=2)
    loose = [k for k in range(len(names)) if share[k].max() > 1e-6]
    parts = []
    for k in loose:
        own = free.reshape(len(names), 6, -1)[k]
        parts.append(f"block {names[k]!r} ({_motions(own)})")
    joined = {b for joint in joints.values() for b in joint.blocks}
    alone = all(names[k] not in joined for k in loose)
    why = "no support and no joint holds" if alone else "neither supports nor joints hold"
    return (
        f"{source}: supports: {why} {', '.join(parts)}; {free.shape[1]} rigid motions are free, limit 0; "
        "add a support to the block, or a joint to a block that is held"
    )


def _motions(own: Floats) -> str:
    """Names of the unit motions that a block can make, out of its free ones (6, m)."""
    U, singular, _ = np.linalg.svd(own, full_matrices=False)
    rank = int(np.count_nonzero(singular > 1e-6))
    if rank == 6:
        return "free to move in every way"
    reach = np.linalg.norm(U[:, :rank], axis=1)
    able = [name for name, r in zip(_MOTIONS, reach, strict=True) if r > 1.0 - 1e-6]
    return "free in " + ", ".join(able) if able else f"{rank} free rigid motions"
