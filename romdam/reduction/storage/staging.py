"""The state that the joints do not see: weight that acts before they are grouted.

Each cantilever stands free under its weight, on ground that its neighbours' weight has deformed too; then the
joints are grouted as they are. The system being linear with its joints open, what follows is measured from
there, and the staged displacement is only added where stress is wanted.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Floats
from romdam.core.basis import BlockBasis
from romdam.core.errors import ConfigError
from romdam.core.scene import Scene
from romdam.fem.assembly import Assembly, assemble_mass
from romdam.fem.loads import weight_force
from romdam.fem.parts import assemble_part, gather, unknowns
from romdam.fem.sections import initial_section_forces
from romdam.fem.stress import thermal_stress
from romdam.linalg.factor import Factor
from romdam.scene.ties import scene_parts


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
    displacement = {name: np.zeros_like(block.points) for name, block in scene.blocks.items()}
    if not scene.loads.staged_weight or not scene.loads.gravity.any():
        return displacement
    for mesh_part in scene_parts(scene).values():
        if not mesh_part.stands_free(scene):
            raise ConfigError(
                f"loads.weight: staged needs parts that stand free, but {mesh_part.name!r} is held by joints "
                "only; add a support, or set loads.weight: monolithic"
            )
        if basis is not None and len(mesh_part.blocks) > 1:
            bases = {name: basis[name] for name in mesh_part.blocks}
            force = np.zeros(max(block.columns.stop for block in bases.values()))
            stiffness = np.ones_like(force)
            for name, block in bases.items():
                weight = weight_force(scene, name, assemble_mass(scene.blocks[name])).ravel()
                if weight.any():  # rock may have none
                    force[block.columns] += block.vectors.project(weight)
                stiffness[block.columns] = block.omega2
            q = force / stiffness
            for name, block in bases.items():
                displacement[name] = block.vectors.apply(q[block.columns]).reshape(-1, 3)
            continue
        assembly = Assembly(scene.blocks)
        weights = {
            name: weight_force(scene, name, assembly.matrices(name)[1]).ravel() for name in mesh_part.blocks
        }
        free = ~mesh_part.fixed(scene.fixed).ravel()
        K = csr_matrix(assemble_part(mesh_part, assembly)[0][free][:, free])
        u = np.zeros(len(free))
        u[free] = Factor(K).solve(gather(mesh_part, weights)[free])
        for name in mesh_part.blocks:
            displacement[name] = (mesh_part.spread(name) @ u).reshape(-1, 3)
    return displacement


def _stressing_displacement(
    scene: Scene, basis: Mapping[str, BlockBasis] | None, rest: Floats | None
) -> dict[str, Floats]:
    """Displacement of every block, (n, 3) [m], whose stress by the record's moduli is there beside that of u.

    That of weight that acted before the joints were grouted, and (r - 1) u_s where the sustained modulus is r
    times that of the record: D_s e(u_s) = D e(u_s) + D e((r - 1) u_s).
    """
    ratios = scene.sustained_ratios
    if not ratios:
        return staged_displacement(scene, basis)
    if rest is None:
        raise ValueError("stress with two moduli needs the displacement at rest, which `prepare` finds")
    lasting = {
        name: replace(block, material=block.material.sustained) for name, block in scene.blocks.items()
    }
    staged = staged_displacement(replace(scene, blocks=lasting))  # another basis answers it
    numbered = unknowns(scene).of_block if basis is None else {}
    for name, ratio in ratios.items():
        if basis is None:
            u = numbered[name] @ rest[: numbered[name].shape[1]]
        else:
            u = basis[name].vectors.apply(rest[basis[name].columns])
        staged[name] = ratio * staged[name] + (ratio - 1.0) * u.reshape(-1, 3)
    return staged


def initial_forces(
    scene: Scene, basis: Mapping[str, BlockBasis] | None = None, rest: Floats | None = None
) -> dict[str, Floats]:
    """Forces on sections that the joints' structure does not make: block name -> (sections, 6) [N], [N m].

    Parameters
    ----------
    basis, rest : as in `initial_stress`
    """
    if scene.stress is None or not scene.stress.sections:
        none = {name: np.zeros_like(block.points) for name, block in scene.blocks.items()}
        return initial_section_forces(scene, none)
    return initial_section_forces(scene, _stressing_displacement(scene, basis, rest))


def initial_stress(
    scene: Scene,
    operators: Mapping[str, csr_matrix],
    basis: Mapping[str, BlockBasis] | None = None,
    rest: Floats | None = None,
) -> dict[str, Floats]:
    """Stress that the joints' structure does not make: block name -> (k, 6) at its stress nodes [Pa].

    That of thermal expansion held back, of weight that acted before the joints were grouted, and what the
    sustained moduli change of the stress at rest.

    Parameters
    ----------
    operators : see `romdam.fem.stress.stress_operators`
    basis : as in `staged_displacement`
    rest : (n,) displacement of the unknowns at rest, where there are sustained moduli
    """
    stress = thermal_stress(scene)
    if not scene.loads.staged_weight and not scene.sustained_ratios:
        return stress
    displacement = _stressing_displacement(scene, basis, rest)
    return {
        name: offset + (operators[name] @ displacement[name].ravel()).reshape(offset.shape)
        for name, offset in stress.items()
    }
