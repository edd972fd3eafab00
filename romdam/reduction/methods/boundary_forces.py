"""Forces of a rock's viscous boundary and free field that a basis answers statically right."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Floats
from romdam.core.scene import Scene
from romdam.effects.free_field import field_shapes
from romdam.fem.absorbing import boundary_dashpots
from romdam.fem.assembly import assemble
from romdam.scene.ties import Part


def boundary_tractions(part: Part, scene: Scene) -> Floats:
    """Forces of every absorbing face's dashpots when it moves rigidly, (3 nodes, 6 faces)."""
    columns = [np.zeros((3 * part.nodes, 0))]
    for name in part.blocks:
        block = scene.blocks[name]
        for face in block.absorbing:
            arm = block.points - block.points[face.facets].mean(axis=(0, 1))
            turned = [np.cross(axis, arm).ravel() for axis in np.eye(3)]
            rigid = np.column_stack([np.tile(np.eye(3), (len(arm), 1)), *turned])
            alone = replace(block, absorbing=(face,))
            columns.append(part.spread(name).T @ (boundary_dashpots(alone) @ rigid))
    return np.hstack(columns)


def free_field_forces(part: Part, scene: Scene) -> csr_matrix:
    """Static forces that move rock as each node of the free field's column, (3 nodes, 3 column nodes)."""
    field, total = scene.free_field, csr_matrix((3 * part.nodes, 0))
    if field is None or field.blocks.isdisjoint(part.blocks):
        return total
    rock = [(scene.blocks[name], part.spread(name).T) for name in part.blocks if name in field.blocks]
    return csr_matrix(sum(over @ (assemble(block)[0] @ field_shapes(block, field)) for block, over in rock))
