"""A block's mesh with matrices from files in place of what its elements would have."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.sparse import csr_matrix

from romdam.config.sections.geometry.matrices import MatricesConfig
from romdam.core.arrays import Bools, Floats, Ints
from romdam.core.attachment import Attachment
from romdam.core.errors import ConfigError, MeshError
from romdam.core.final_state import InitialState
from romdam.core.known import refuse_unknown, refuse_unknown_kinds
from romdam.core.motion import MovingSupports
from romdam.core.scene import (
    Block,
    BlockMatrices,
    ConstructionStage,
    ForceHistory,
    FreeField,
    Reservoir,
    Scene,
)
from romdam.geometry.matrices.checks import Checked, check_matrices
from romdam.geometry.matrices.data import MatrixUnknowns
from romdam.geometry.matrices.files import FileMatrices, read_matrices
from romdam.geometry.meshes.data import Numbered
from romdam.geometry.nearest import tree

log = logging.getLogger(__name__)

_NOTHING = 1e-12  # weights and cosines below it are rounding
# fields whose action on a block of matrices is known: by its matrices, or by the nodes of `_acted_on`
_OF_SCENE = {
    "blocks", "joints", "fixed", "loads", "probes", "stress", "ties", "radiating", "effects", "remarks",
}  # fmt: skip
_OF_LOADS = {
    "gravity", "pressures", "forces", "water", "warmed", "excluded_from_gravity", "staged_weight", "order",
}  # fmt: skip
_KINDS = {
    Attachment, ConstructionStage, ForceHistory, FreeField, InitialState, MovingSupports, Reservoir,
}  # fmt: skip
_OF_BLOCK = {
    "name", "element", "points", "cells", "material", "faces", "absorbing", "matrices", "unsound_faces",
}  # fmt: skip


def with_matrices(
    block: Block,
    config: MatricesConfig,
    folder: Path,
    mesh: Numbered | None,
    location: str,
    *,
    supported: bool = False,
) -> Block:
    """The block with the stiffness and mass of files; nodes are the same that lie within the tolerance.

    Parameters
    ----------
    folder : where relative paths start
    mesh : numbers and positions of the nodes in the block's mesh file, where it has one
    location : file and key, for messages
    supported : `supports` of the configuration name this block

    Raises
    ------
    MeshError, ResultError
        where a file cannot be read, they do not fit each other, no elastic body has them, or none of their
        nodes is one of the mesh.
    """
    file_matrices = read_matrices(config, folder, mesh, location)
    points, dof = _numbered(block, file_matrices.unknowns, config.tolerance, location)
    checked = check_matrices(
        file_matrices,
        location,
        config.total_mass,
        block,
        supported=supported or file_matrices.inertia is not None,
    )
    motion = np.full(3 * len(points), -1)
    motion[dof] = file_matrices.unknowns.motion
    matrices = _over_nodes(file_matrices, dof, motion.reshape(-1, 3), checked)
    lacking = matrices.absent[: len(block.points)].sum(axis=1)
    log.info(
        "%s: %d unknowns, in %s; of %d nodes of the mesh %d have all three displacements and %d none, which "
        "do not move in files and pictures",
        location, len(dof), config.units, len(lacking), (lacking == 0).sum(), (lacking == 3).sum(),
    )  # fmt: skip
    return replace(block, points=points, matrices=matrices)


def _numbered(block: Block, unknowns: MatrixUnknowns, tolerance: float, location: str) -> tuple[Floats, Ints]:
    """All nodes (n, 3), the mesh's first, and the DOF of every unknown."""
    shifted = unknowns.motion < 3
    numbers, first = np.unique(unknowns.node[shifted], return_index=True)
    position = unknowns.position[shifted][first]
    # the mesh's node that each node of the matrices is, -1 where it is none of them
    distance, node = tree(block.points).query(position)
    node = np.where(distance <= tolerance, node, -1).astype(np.int64)
    same = node[node >= 0]
    if not len(same):
        spans = []
        for points in (position, block.points):
            ends = zip("xyz", points.min(axis=0), points.max(axis=0), strict=True)
            spans.append(", ".join(f"{axis} {low:g} to {high:g}" for axis, low, high in ends))
        raise MeshError(
            f"{location}: none of the {len(numbers)} nodes of its matrices ({spans[0]} m) is within "
            f"{tolerance:g} m of one of the mesh ({spans[1]} m), the nearest is {distance.min():.3g} m off; "
            "correct `units`, the nodes, or `tolerance`"
        )
    twice = np.flatnonzero(np.bincount(same) > 1)
    if len(twice):
        pair = ", ".join(map(str, numbers[node == twice[0]][:2]))
        raise MeshError(
            f"{location}: {len(twice)} nodes of the mesh are two of the matrices' within {tolerance:g} m "
            f"(nodes {pair} are the first), limit one; lower `tolerance`, or merge nodes"
        )
    further = np.flatnonzero(node < 0)
    node[further] = len(block.points) + np.arange(len(further))
    others = np.flatnonzero(~shifted)
    slots = -(-len(others) // 3)
    middle = np.tile(block.points.mean(axis=0), (slots, 1))
    dof = np.zeros(len(unknowns), dtype=np.int64)
    dof[shifted] = 3 * node[np.searchsorted(numbers, unknowns.node[shifted])] + unknowns.motion[shifted]
    dof[others] = 3 * (len(block.points) + len(further)) + np.arange(len(others))
    return np.concatenate([block.points, position[further], middle]), dof


def _over_nodes(matrices: FileMatrices, dof: Ints, motion: Ints, checked: Checked) -> BlockMatrices:
    size = motion.size

    def spread(matrix: csr_matrix) -> csr_matrix:
        entries = matrix.tocoo()
        return csr_matrix((entries.data, (dof[entries.row], dof[entries.col])), shape=(size, size))

    force, inertia, translations = np.zeros(size), None, np.zeros((size, 3))
    force[dof] = matrices.force
    translations[dof] = checked.translations
    if matrices.inertia is not None:
        inertia = np.zeros((size, 3))
        inertia[dof] = matrices.inertia
    C = None if matrices.C is None else spread(matrices.C)
    return BlockMatrices(
        spread(matrices.K), spread(matrices.M), motion, translations, C, inertia, force, checked.warnings
    )


def held_by(blocks: dict[str, Block], fixed: dict[str, Bools]) -> dict[str, Bools]:
    """Components that supports hold, and those that are no unknowns of a block's matrices."""
    held_or_absent = dict(fixed)
    for name, held in fixed.items():
        matrices = blocks[name].matrices
        if matrices is not None:
            held_or_absent[name] = held | matrices.absent
    return held_or_absent


def refuse_unreached(scene: Scene, supported: dict[str, Bools], source: str) -> None:
    """Raise where joints or loads act on nodes whose motion is no unknown, or stress is asked for.

    Parameters
    ----------
    supported : block name -> (n, 3) components that `supports` hold
    source : name of the configuration file

    Raises
    ------
    ConfigError
        for these, and for what of a scene or a block is not known here.
    """
    for name, block in scene.blocks.items():
        if block.matrices is None:
            continue
        what = f"known of block {name!r}, which has matrices of its own"
        refuse_unknown(scene, _OF_SCENE, what)
        refuse_unknown(scene.loads, _OF_LOADS, what)
        refuse_unknown_kinds(scene.effects, _KINDS, what)
        refuse_unknown(block, _OF_BLOCK, what)
        field = scene.find(FreeField)
        if field is not None and name in field.blocks:
            raise ConfigError(
                f"{source}: ground.input: the waves of free_field in rock {name!r} are not {what}; mesh the "
                "block, or give ground.input: uniform"
            )
        stages = [stage.warmed.get(name, 0.0) for stage in scene.every(ConstructionStage)]
        warmed = name in scene.loads.warmed or any(np.any(change) for change in stages)
        if warmed or (scene.stress is not None and name in scene.stress.blocks):
            key = "loads.temperature: the change" if warmed else "outputs.stress: the stress"
            raise ConfigError(
                f"{source}: {key} of block {name!r} is not known, which has matrices of its own and no "
                "elements, limit 0 such blocks; name the other blocks, displacements are written for all"
            )
        lost = block.matrices.absent & ~supported[name]
        for key, nodes, components in _acted_on(scene, name):
            bad = np.unique(nodes[(lost[nodes] & components).any(axis=1)])
            if len(bad):
                at = ", ".join(f"{x:.6g}" for x in block.points[bad[0]])
                raise ConfigError(
                    f"{source}: {key}: {len(bad)} of its {len(np.unique(nodes))} nodes of block {name!r} "
                    f"are no unknowns of blocks.{name}.matrices, nor held by a support, limit 0; the first "
                    f"is at ({at}) m; write matrices with these nodes, or name the support that they were "
                    "made with"
                )


def _acted_on(scene: Scene, name: str) -> list[tuple[str, Ints, Bools]]:
    """Actions on nodes of a block: key, nodes, and (k, 3) which of their components."""
    pairs = [("loads.pressure", load.facets.ravel()) for load in scene.loads.pressures if load.block == name]
    pairs += [
        ("loads.hydrostatic", water.facets.ravel()) for water in scene.loads.water if water.block == name
    ]
    pairs += [(force.load, np.array([force.node])) for force in scene.loads.forces if force.block == name]
    pairs += [
        (one.signal.name, np.flatnonzero(one.nodal.any(axis=1)))
        for one in scene.every(ForceHistory)
        if one.block == name
    ]
    pairs += [
        (one.key, np.unique(one.rows[name].indices // 3))
        for one in scene.every(Attachment)
        if name in one.rows
    ]
    pairs += [("ground.viscous", face.facets.ravel()) for face in scene.blocks[name].absorbing]
    reservoir = scene.find(Reservoir)
    if reservoir is not None:
        wet = (*reservoir.faces, *reservoir.rock)
        pairs += [("water", face.facets.ravel()) for face in wet if face.block == name]
    actions = [(key, nodes, np.ones((len(nodes), 3), dtype=bool)) for key, nodes in pairs]
    shear = any(j.mu.any() or any(rows.shear for rows in j.laws) for j in scene.joints.values())
    for joint in scene.joints.values():
        for side in (0, 1):
            if joint.blocks[side] != name:
                continue
            weights = abs(joint.weights[side])
            if joint.at_point is not None:
                weights = weights + abs(joint.at_point[side])
            seen = weights.T @ np.abs(joint.axes[:, : 3 if shear else 1]).sum(axis=1) > _NOTHING
            actions.append((f"joints.{joint.name}", joint.nodes[side], np.asarray(seen)))
    return actions
