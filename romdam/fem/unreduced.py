"""The unreduced mesh of a scene as one sparse system over its free DOFs."""

from __future__ import annotations

import numpy as np
from scipy.sparse import block_diag, csr_matrix, hstack, vstack

from romdam.config.sections.job import DampingConfig
from romdam.core.arrays import Floats
from romdam.core.errors import ConfigError
from romdam.core.scene import FreeField, Scene
from romdam.core.system import PseudoStatic, System
from romdam.fem.damping import further_damping, rayleigh_coefficients, rigid_drag, sliding_motions
from romdam.fem.free_field import boundary_load, deconvolution
from romdam.fem.gaps import gap_law, gap_operators, point_operators, water_force
from romdam.fem.loads import static_force
from romdam.fem.parts import Unknowns, part_inertia, part_matrices, part_operator, unknowns
from romdam.fem.pseudo_static import applied, pseudo_static, support_inertia
from romdam.fem.water.added_mass import AddedMass, added_mass, sparse_added_mass
from romdam.fem.water.compressible import reservoir_waves, with_waves
from romdam.scene.ties import scene_parts

MOST_WET = 40_000_000  # entries of incompressible water's added mass: 0.5 GB, and as much in its factors


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
    K, M, B, load, at_point, rigid = [], [], [], [], [], []
    for name, part in parts.items():
        free = numbered.free[name]
        stiffness, mass, inertia = part_matrices(part, scene.blocks)
        K.append(stiffness[free][:, free])
        M.append(mass[free][:, free])
        B.append(part_operator(part, operators)[:, free])
        at_point += [] if more is None else [part_operator(part, more)[:, free]]
        load.append(part_inertia(part, scene, inertia)[free])
        rigid.append(sliding_motions(part, scene, K[-1], M[-1], free))
    held = [part.stands_free(scene) for part in parts.values()]
    alpha, beta = rayleigh_coefficients(damping.rayleigh)
    mass, stiffness, shaken = csr_matrix(block_diag(M)), csr_matrix(block_diag(K)), np.vstack(load)
    water = added_mass(scene)
    added, wet = (mass * 0.0, 0.0) if water is None else sparse_added_mass(water, numbered.of_block, MOST_WET)
    mass, jumps = csr_matrix(mass + added), csr_matrix(hstack(B))
    driven: Floats | csr_matrix = shaken + wet
    moving = pseudo_static(scene, law.directions)
    if moving is not None:
        driven = np.hstack([driven, _support_load(scene, moving, numbered, water)])
    if scene.free_field is not None:
        driven = csr_matrix(hstack([driven, -_free_field_load(scene, scene.free_field, numbered)]))
    system = System(
        M=mass,
        C=csr_matrix(alpha * mass + beta * stiffness + _dashpots(scene, numbered, damping)),
        K=stiffness,
        B=jumps,
        load=driven,
        force=_force(scene, numbered, len(shaken)) + jumps[:: law.directions].T @ water_force(scene),
        observe=_observe(scene, numbered),
        law=law,
        parts=numbered.parts,
        diagonal=False,
        floating=not all(held),
        at_point=csr_matrix(hstack(at_point)) if at_point else None,
        drive=deconvolution(scene.free_field, damping),
        pseudo_static=moving,
        drag=_drag(scene, numbered, mass, alpha, rigid),
    )
    waves = reservoir_waves(scene)
    return system if waves is None else with_waves(system, waves, waves.on(numbered.of_block))


def _dashpots(scene: Scene, numbered: Unknowns, damping: DampingConfig) -> csr_matrix:
    """Damping of the blocks besides Rayleigh damping, over the unknowns."""
    size = next(iter(numbered.of_block.values())).shape[1]
    total = csr_matrix((size, size))
    for name, matrix in numbered.of_block.items():
        own = further_damping(scene.blocks[name], damping.rayleigh)
        if own is not None:
            total = total + matrix.T @ own @ matrix
    return csr_matrix(total)


def _drag(
    scene: Scene, numbered: Unknowns, M: csr_matrix, alpha: float, rigid: list[Floats]
) -> Floats | None:
    """Factor D (n, k) of what is taken off the damping, see `romdam.fem.damping`; None where nothing is.

    Parameters
    ----------
    M : (n, n) with the water's mass
    rigid : of every part its motions that joints alone hold
    """
    R = csr_matrix(block_diag(rigid))
    if alpha == 0.0 or not R.shape[1]:
        return None
    braked = M @ R
    for name, matrix in numbered.of_block.items():
        own = scene.blocks[name].matrices
        if own is not None and own.C is not None:  # which stands in the place of Rayleigh's damping
            braked = braked - matrix.T @ (own.M @ (matrix @ R))
    return rigid_drag(alpha * braked.toarray(), R.toarray())


def _support_load(scene: Scene, moving: PseudoStatic, numbered: Unknowns, water: AddedMass | None) -> Floats:
    """Inertia of what moving supports displace, with the water's, on the unknowns."""
    inertia = support_inertia(scene, moving)
    total = sum(matrix.T @ inertia[name] for name, matrix in numbered.of_block.items())
    if water is not None:
        pressed = water.times(applied(water.coupling, moving.shapes))
        total = total + csr_matrix(water.on(numbered.of_block)).T @ pressed
    return np.asarray(total)


def _free_field_load(scene: Scene, field: FreeField, numbered: Unknowns) -> csr_matrix:
    """Effective forces of the free field on the unknowns."""
    blocks = [(scene.blocks[name], matrix) for name, matrix in numbered.of_block.items()]
    return csr_matrix(sum(m.T @ boundary_load(block, field) for block, m in blocks if block.absorbing))


def _force(scene: Scene, numbered: Unknowns, size: int) -> Floats:
    """Static force on the unknowns."""
    force = np.zeros(size)
    for name, matrix in numbered.of_block.items():
        force = force + matrix.T @ static_force(scene, name).ravel()
    return np.asarray(force)


def _observe(scene: Scene, numbered: Unknowns) -> csr_matrix:
    """Displacement of the probes from the unknowns, (3 * probes, unknowns)."""
    size = max((part.stop for part in numbered.parts.values()), default=0)
    rows = [numbered.of_block[probe.block][3 * probe.node : 3 * probe.node + 3] for probe in scene.probes]
    return csr_matrix(vstack([csr_matrix((0, size)), *rows]))
