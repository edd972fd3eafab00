"""The state that the joints do not see: weight that acts before they are grouted.

Each cantilever stands free under its weight, on ground that its neighbours' weight has deformed too; then the
joints are grouted as they are. The system being linear with its joints open, what follows is measured from
there, and the staged displacement is only added where stress is wanted.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from romdam.errors import ConfigError
from romdam.fem.assembly import assemble
from romdam.fem.loads import weight_force
from romdam.fem.parts import assemble_part, gather
from romdam.fem.stress import stress_operator, thermal_stress
from romdam.linalg.factor import Factor
from romdam.scene.elements import Floats
from romdam.scene.held import held_rigidly
from romdam.scene.model import Scene
from romdam.scene.ties import scene_parts


def staged_displacement(scene: Scene) -> dict[str, Floats]:
    """Displacement of every block under weight with the joints open, (n, 3) [m]; zero unless staged.

    Raises
    ------
    ConfigError
        where nothing but joints holds a part: it cannot stand free.
    """
    found = {name: np.zeros_like(block.points) for name, block in scene.blocks.items()}
    if not scene.staged_weight or not scene.gravity.any():
        return found
    for part in scene_parts(scene).values():
        fixed = part.fixed(scene.fixed)
        if not held_rigidly(part.mesh(scene.blocks), fixed):
            raise ConfigError(
                f"loads.weight: staged needs parts that stand free, but {part.name!r} is held by joints "
                "only; add a support, or set loads.weight: monolithic"
            )
        free = ~fixed.ravel()
        weight = gather(
            part,
            {n: weight_force(scene, n, assemble(scene.blocks[n])[1]).ravel() for n in part.blocks},
        )
        K = csr_matrix(assemble_part(part, scene.blocks)[0][free][:, free])
        whole = np.zeros(len(free))
        whole[free] = Factor(K).solve(weight[free])
        for name in part.blocks:
            found[name] = whole.reshape(-1, 3)[part.number[name]]
    return found


def initial_stress(scene: Scene) -> dict[str, Floats]:
    """Stress that the joints' structure does not make: block name -> (k, 6) at its stress nodes [Pa].

    That of thermal expansion held back, and of weight that acted before the joints were grouted.
    """
    found = thermal_stress(scene)
    if scene.stress is None or not scene.staged_weight:
        return found
    displacement = staged_displacement(scene)
    return {
        name: offset
        + (
            stress_operator(scene.blocks[name], scene.stress.blocks[name].nodes) @ displacement[name].ravel()
        ).reshape(offset.shape)
        for name, offset in found.items()
    }
