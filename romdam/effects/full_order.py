"""The unreduced mesh of a scene, with its effects, as one sparse system over its free DOFs."""

from __future__ import annotations

import numpy as np
from scipy.sparse import block_diag, csr_matrix, hstack, vstack

from romdam.config.sections.job import DampingConfig
from romdam.core.errors import ConfigError
from romdam.core.final_state import InitialState
from romdam.core.scene import Scene
from romdam.core.system import System
from romdam.effects.effect import EffectCoordinates, MeshCoordinates
from romdam.effects.scene_effects import scene_effects
from romdam.fem.assembly import Assembly
from romdam.fem.damping import sliding_motions
from romdam.fem.gaps import gap_law, gap_operators, point_operators
from romdam.fem.parts import assemble_inertia, assemble_part, part_operator, unknowns
from romdam.scene.ties import scene_parts


def assemble_full(scene: Scene, damping: DampingConfig) -> System:
    """Build the unreduced system.

    Parameters
    ----------
    scene : the scene
    damping : none or Rayleigh; modal ratios would make C dense

    Raises
    ------
    ConfigError
        for modal damping.
    """
    if damping.modal is not None:
        raise ConfigError(
            "damping.modal: a full-order model takes `rayleigh` damping only (modal ratios would make C "
            "dense); give damping.rayleigh, or use model.order: reduced"
        )
    law, numbered, parts = gap_law(scene), unknowns(scene), scene_parts(scene)
    operators = gap_operators(scene, law.directions)
    more = point_operators(scene, law.directions)
    assembly = Assembly(scene.blocks)
    effects = scene_effects(scene, damping, law.directions, assembly)
    K, M, B, load, at_point, rigid = [], [], [], [], [], []
    for name, part in parts.items():
        free = numbered.free[name]
        stiffness, mass = assemble_part(part, assembly)
        K.append(stiffness[free][:, free])
        M.append(mass[free][:, free])
        B.append(part_operator(part, operators)[:, free])
        at_point += [] if more is None else [part_operator(part, more)[:, free]]
        load.append(assemble_inertia(part, scene, assembly)[free])
        assembly.release(part.blocks)
        rigid.append(sliding_motions(part, scene, K[-1], M[-1], free))
    held = [part.stands_free(scene) for part in parts.values()]
    mass, jumps = csr_matrix(block_diag(M)), csr_matrix(hstack(B))
    shaken, size = np.vstack(load), mass.shape[0]
    probes = [numbered.of_block[probe.block][3 * probe.node : 3 * probe.node + 3] for probe in scene.probes]
    system = System(
        M=mass,
        C=csr_matrix(mass.shape),
        K=csr_matrix(block_diag(K)),
        B=jumps,
        load=shaken,
        force=np.zeros(len(shaken)),
        observe=csr_matrix(vstack([csr_matrix((0, size)), *probes])),
        law=law,
        parts=numbered.parts,
        diagonal=False,
        floating=not all(held),
        at_point=csr_matrix(hstack(at_point)) if at_point else None,
        initial=scene.find(InitialState),
        extent=scene.extent,
    )
    coordinates: EffectCoordinates = MeshCoordinates(numbered.of_block, csr_matrix(block_diag(rigid)))
    for effect in effects:
        system, coordinates = effect.add(system, coordinates)
    return system
