"""The state that the joints do not see: weight that acts before they are grouted.

Each cantilever stands free under its weight, on ground that its neighbours' weight has deformed too; then the
joints are grouted as they are. The system being linear with its joints open, what follows is measured from
there, and the staged displacement is only added where stress is wanted.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.basis import BlockBasis
from romdam.core.errors import ConfigError
from romdam.core.scene import Bools, Scene
from romdam.fem.assembly import assemble_mass
from romdam.fem.loads import weight_force
from romdam.fem.parts import assemble_part, gather
from romdam.fem.sections import initial_section_forces
from romdam.fem.stress import thermal_stress
from romdam.geometry.elements import Floats
from romdam.linalg.factor import Factor
from romdam.scene.ties import Part, scene_parts


def staged_displacement(scene: Scene, basis: Mapping[str, BlockBasis] | None = None) -> dict[str, Floats]:
    """Displacement of every block under weight with the joints open, (n, 3) [m]; zero unless staged.

    Parameters
    ----------
    basis : of a reduced model; that of a part with merged interfaces answers weight exactly, which
        saves factoring them again

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
        if not part.stands_free(scene):
            raise ConfigError(
                f"loads.weight: staged needs parts that stand free, but {part.name!r} is held by joints "
                "only; add a support, or set loads.weight: monolithic"
            )
        weight = {n: weight_force(scene, n, assemble_mass(scene.blocks[n])).ravel() for n in part.blocks}
        if basis is not None and len(part.blocks) > 1:
            found |= _from_basis({name: basis[name] for name in part.blocks}, weight)
        else:
            found |= _from_mesh(part, scene, ~fixed.ravel(), gather(part, weight))
    return found


def _from_basis(basis: dict[str, BlockBasis], weight: dict[str, Floats]) -> dict[str, Floats]:
    force = np.zeros(max(block.columns.stop for block in basis.values()))
    stiffness = np.ones_like(force)
    for name, block in basis.items():
        if weight[name].any():  # rock may have none
            force[block.columns] += block.vectors.project(weight[name])
        stiffness[block.columns] = block.omega2
    q = force / stiffness
    return {name: block.vectors.apply(q[block.columns]).reshape(-1, 3) for name, block in basis.items()}


def _from_mesh(part: Part, scene: Scene, free: Bools, weight: Floats) -> dict[str, Floats]:
    K = csr_matrix(assemble_part(part, scene.blocks)[0][free][:, free])
    whole = np.zeros(len(free))
    whole[free] = Factor(K).solve(weight[free])
    return {name: (part.spread(name) @ whole).reshape(-1, 3) for name in part.blocks}


def initial_forces(scene: Scene, basis: Mapping[str, BlockBasis] | None = None) -> dict[str, Floats]:
    """Forces on sections that the joints' structure does not make: block name -> (sections, 6) [N], [N m]."""
    if scene.stress is None or not scene.stress.sections:
        none = {name: np.zeros_like(block.points) for name, block in scene.blocks.items()}
        return initial_section_forces(scene, none)
    return initial_section_forces(scene, staged_displacement(scene, basis))


def initial_stress(
    scene: Scene, operators: Mapping[str, csr_matrix], basis: Mapping[str, BlockBasis] | None = None
) -> dict[str, Floats]:
    """Stress that the joints' structure does not make: block name -> (k, 6) at its stress nodes [Pa].

    That of thermal expansion held back, and of weight that acted before the joints were grouted.

    Parameters
    ----------
    operators : see `romdam.fem.stress.stress_operators`
    basis : as in `staged_displacement`
    """
    found = thermal_stress(scene)
    if not scene.staged_weight:
        return found
    displacement = staged_displacement(scene, basis)
    return {
        name: offset + (operators[name] @ displacement[name].ravel()).reshape(offset.shape)
        for name, offset in found.items()
    }
