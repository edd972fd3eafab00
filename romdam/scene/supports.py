"""Check that supports and joints hold every block, by the rank of the rigid motions that they prevent."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array, csr_matrix, diags_array
from scipy.sparse.csgraph import connected_components

from romdam.core.errors import ConfigError
from romdam.core.scene import Block, Bools, Ints, Joint, Tie
from romdam.geometry.elements import Floats
from romdam.linalg.factor import Factor

_RANK = 1e-8  # relative singular value; the motions are scaled to be of order one
_STRAINS = 1e-6  # force of a rigid motion on an unknown, relative to its stiffness, above round-off of text
_ALONE = 1e-12  # of the diagonal, by which coordinates that may move alone are held
_MOTIONS = tuple(f"{kind} {axis}" for kind in ("translation along", "rotation about") for axis in "xyz")


def refuse_free_blocks(
    blocks: dict[str, Block],
    joints: dict[str, Joint],
    fixed: dict[str, Bools],
    source: str,
    ties: tuple[Tie, ...] = (),
) -> None:
    """Raise if neither supports nor joints prevent a rigid motion of some blocks.

    Every joint counts as closed and stuck: a block that only joints hold may slide or lift off later,
    and the contact solver finds its motion. Ties count as joints do. Each unconnected piece of a block
    is a body of its own.

    Raises
    ------
    ConfigError
        naming the free blocks and their free motions.
    """
    bodies: list[str] = []
    columns = {}
    for name, block in blocks.items():
        count, piece = _pieces(block)
        columns[name] = 6 * (len(bodies) + piece)
        bodies += [
            f"block {name!r}" + (f" (piece {k + 1} of {count})" if count > 1 else "") for k in range(count)
        ]
    width = 6 * len(bodies)
    rows = [np.zeros((1, width))]
    for name, supported in fixed.items():
        rows.append(_stopped(blocks[name], supported, columns[name], width))
    pairs: list[Joint | Tie] = [*joints.values(), *ties]
    for joint in pairs:
        I, J = (
            _placed(blocks[b], nodes, columns[b], width).reshape(len(nodes), -1)
            for b, nodes in zip(joint.blocks, joint.nodes, strict=True)
        )
        if isinstance(joint, Joint):
            I, J = (weights @ side for weights, side in zip(joint.weights, (I, J), strict=True))
        elif joint.weights is not None:
            follows = ~fixed[joint.blocks[0]][joint.nodes[0]]
            I, J = (jump_rows.reshape(-1, 3, width)[follows] for jump_rows in (I, joint.weights @ J))
        rows.append(_triangle((J - I).reshape(-1, width)))  # the few rows that span them
    free = _null_space(_triangle(np.vstack(rows)))
    if free.shape[1]:
        raise ConfigError(_explain(bodies, free, bool(joints), source))


def refuse_massless_on_joints(
    whole: Block, names: tuple[str, ...], held: Bools, blocks: dict[str, Block], source: str
) -> None:
    """Raise if tied blocks without mass have a rigid motion while their joints are open.

    Such a motion is undetermined: neither inertia nor stiffness resists it.

    Parameters
    ----------
    whole, names : the tied blocks merged into one, and their names
    held : (n, 3) components that supports hold

    Raises
    ------
    ConfigError
    """
    massless = all(blocks[name].material.rho == 0.0 for name in names)
    if massless and not has_no_rigid_body_mode(whole, held):
        raise ConfigError(
            f"{source}: blocks.{names[0]}: block {names[0]!r} has no mass and only joints hold it, so that "
            "its motion is undetermined once they open, limit 0 rigid motions without supports; add a "
            "support, tie it to a block with mass, or leave out `mass: false`"
        )


def _pieces(block: Block) -> tuple[int, Ints]:
    """Number of connected pieces of a block, and the piece of every node."""
    if block.matrices is not None:
        return 1, np.zeros(len(block.points), dtype=np.int64)
    ring = block.cells, np.roll(block.cells, 1, axis=1)
    graph = coo_array(
        (np.ones(block.cells.size), (ring[0].ravel(), ring[1].ravel())), shape=(len(block.points),) * 2
    )
    count, piece = connected_components(graph, directed=False)
    return int(count), piece.astype(np.int64)


def rigid_motions(block: Block, nodes: Ints | None = None) -> Floats:
    """Displacement of nodes (all by default) in the six rigid motions of a block, (n, 3, 6).

    Rotations are about the block's centre and scaled by its half diagonal, so that all motions are
    of order one. For a block from matrices they are those of its unknowns, rotations included; internal
    unknowns follow with the least strain energy.
    """
    matrices = block.matrices
    follow = matrices is not None and bool((matrices.motion > 5).any())
    which = slice(None) if nodes is None or follow else nodes
    low, high = block.points.min(axis=0), block.points.max(axis=0)
    radius = np.linalg.norm(high - low) / 2
    arm = (block.points[which] - (low + high) / 2) / radius
    turns = np.cross(np.eye(3)[None], arm[:, None, :]).transpose(0, 2, 1)
    motions = np.concatenate([np.broadcast_to(np.eye(3), turns.shape), turns], axis=2)
    if matrices is None:
        return motions
    kind = matrices.motion[which]
    motions[(kind < 0) | (kind > 2)] = 0.0
    node, component = np.nonzero((kind > 2) & (kind < 6))
    motions[node, component, kind[node, component]] = 1.0 / radius
    if not follow:
        return motions

    inner = np.flatnonzero(matrices.motion.ravel() > 5)
    every = motions.reshape(-1, 6).copy()
    force = (matrices.K @ every)[inner]
    stiffness = csr_matrix(matrices.K[inner][:, inner])
    diagonal = stiffness.diagonal()
    # they may move alone without strain; the force is none there
    held = Factor(stiffness + diags_array(_ALONE * np.where(diagonal > 0.0, diagonal, 1.0)))
    answer = held.solve(force)
    every[inner] = -(answer + held.solve(force - stiffness @ answer))
    followed = every.reshape(motions.shape)
    return followed if nodes is None else followed[nodes]


def motions_of_pieces(block: Block, nodes: int) -> Floats:
    """Displacement (3 nodes, 6 pieces) of the first nodes in the rigid motions of each piece of a block."""
    count, piece = _pieces(block)
    return _placed(block, np.arange(nodes), 6 * piece, 6 * count).reshape(3 * nodes, 6 * count)


def _placed(block: Block, nodes: Ints, first: Ints, width: int) -> Floats:
    """Rigid motions of nodes (n, 3, width), each at the columns of its body (`first`, by node)."""
    motions = rigid_motions(block, nodes)
    columns = (first[nodes][:, None] + np.arange(6))[:, None, :]
    placed = np.zeros((len(nodes), 3, width))
    np.put_along_axis(placed, np.broadcast_to(columns, motions.shape), motions, axis=2)
    return placed


def _stopped(block: Block, held: Bools, first: Ints, width: int) -> Floats:
    """Rows that span the motions of a block which supports, springs or its stiffness matrix prevent."""
    matrices = block.matrices
    held = (held if matrices is None else held & ~matrices.absent) | sprung(block)
    nodes = np.flatnonzero(held.any(axis=1))
    rows = [_placed(block, nodes, first, width)[held[nodes]]]
    if matrices is not None:
        motions = _placed(block, np.arange(len(first)), first, width).reshape(-1, width)
        unknown, body = ~matrices.absent.ravel(), slice(first[0], first[0] + 6)
        # rigid motions that strain the block
        force = (matrices.K @ motions)[unknown] / matrices.K.diagonal()[unknown, None]
        rows.append(np.where(np.abs(force) > _STRAINS, force, 0.0))
        # a projector on motions in which no unknown moves
        unseen = np.zeros((width, width))
        free = _null_space(_triangle(motions[unknown, body]))
        unseen[body, body] = free @ free.T
        rows.append(unseen)
    return _triangle(np.vstack(rows))


def _null_space(rows: Floats) -> Floats:
    _, singular, V = np.linalg.svd(rows)
    rank = int(np.count_nonzero(singular > _RANK * max(singular.max(), 1e-300)))
    return V[rank:].T


def _explain(bodies: list[str], free: Floats, any_joint: bool, source: str) -> str:
    """Say which bodies are free to move how, from a basis of the free motions (6 bodies, m)."""
    by_body = free.reshape(len(bodies), 6, -1)
    loose = []
    for body, motions in zip(bodies, by_body, strict=True):
        if np.linalg.norm(motions, axis=0).max() <= 1e-6:
            continue
        U, singular, _ = np.linalg.svd(motions, full_matrices=False)
        rank = int(np.count_nonzero(singular > 1e-6))
        reach = np.linalg.norm(U[:, :rank], axis=1)
        able = [name for name, r in zip(_MOTIONS, reach, strict=True) if r > 1.0 - 1e-6]
        if len(able) < rank:
            able.append(f"{rank - len(able)} combined motions")
        how = "free to move in every way" if rank == 6 else "free in " + ", ".join(able)
        loose.append(f"{body} ({how})")
    why = "neither supports nor joints hold" if any_joint else "no support holds"
    return (
        f"{source}: supports: {why} {', '.join(loose)}; {free.shape[1]} rigid motions are free, limit 0; add "
        "a support, or a joint to a block that is held"
    )


def sprung(block: Block) -> Bools:
    """(n, 3) True where the springs of absorbing faces hold a component."""
    is_sprung = np.zeros((len(block.points), 3), dtype=bool)
    for face in block.absorbing:
        if np.isfinite(face.distance):
            is_sprung[np.unique(face.facets)] = True
    return is_sprung


def has_no_rigid_body_mode(block: Block, held: Bools, ties: csr_matrix | None = None) -> bool:
    """Whether held components and springs prevent every rigid motion of a block.

    Parameters
    ----------
    held : (n, 3) True for components at zero displacement
    ties : (r, 3 n) sparse; combinations of displacements that are zero too
    """
    count, piece = _pieces(block)
    seen = _stopped(block, held, 6 * piece, 6 * count)
    if ties is not None:
        tied = np.unique(ties.indices // 3)
        columns = (3 * tied[:, None] + np.arange(3)).ravel()
        motions = _placed(block, tied, 6 * piece, 6 * count).reshape(-1, 6 * count)
        seen = np.vstack([seen, _triangle(ties[:, columns] @ motions)])
    return _null_space(np.vstack([np.zeros((1, 6 * count)), seen])).shape[1] == 0


def _triangle(rows: Floats) -> Floats:
    """The few rows (QR) that span what many rows span."""
    return np.asarray(np.linalg.qr(rows, mode="r"), dtype=float)
