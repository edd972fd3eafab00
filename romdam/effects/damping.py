"""Damping of the solids: Rayleigh's, of the scene or of each material, or modal ratios; dashpots of viscous
faces, and matrices that blocks bring.

With alpha and beta those of the whole scene, the damping matrix over the mesh is (`romdam.fem.damping`)

    C = alpha M + beta K + sum_b C_b - D D^T.

C_b is the further damping of a block: the dashpots of its viscous faces, and what its material's Rayleigh
damping, or a matrix that it brings, differs from the scene's. D D^T takes the mass terms off the rigid
motions that joints alone hold. Over open-joint modes the first two terms are diagonal, 2 xi omega where
damping is by ratios. A C_b couples the modes, except where a part has one damping of its own throughout:
there alpha_b + beta_b omega^2 is diagonal too, and the system stays uncoupled.

The springs of viscous faces are part of a block's stiffness (`romdam.fem.assembly`), their dashpots stand
here. Where supports move by themselves, dashpots act on what these displace too; the solids' damping does
not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix, diags_array

from romdam.config.sections.job import DampingConfig
from romdam.core.arrays import Floats
from romdam.core.motion import Motion
from romdam.core.scene import Scene
from romdam.core.system import PseudoStatic, System
from romdam.effects.effect import EffectCoordinates, MeshCoordinates, ModalCoordinates
from romdam.fem.absorbing import boundary_dashpots
from romdam.fem.assembly import assemble_mass
from romdam.fem.damping import (
    brings_damping,
    further_damping,
    further_drag,
    material_coefficients,
    modal_coefficients,
    rayleigh_coefficients,
    rigid_drag,
)
from romdam.scene.ties import scene_parts


@dataclass(frozen=True)
class SolidDamping:
    """Damping of a scene's solids as an effect; it acts on the mass of incompressible water too.

    Attributes
    ----------
    scene : the scene
    damping : Rayleigh coefficients, or ratios of modes
    """

    scene: Scene
    damping: DampingConfig

    def static_loads(self, moving: PseudoStatic | None) -> dict[str, Floats]:
        """None here: a part with a viscous boundary answers tractions on it, see `merged_part`."""
        return {}

    def add(self, system: System, coordinates: EffectCoordinates) -> tuple[System, EffectCoordinates]:
        """Add the damping."""
        if isinstance(coordinates, ModalCoordinates):
            system = self._of_modes(system, coordinates)
        elif isinstance(coordinates, MeshCoordinates):
            system = self._of_mesh(system, coordinates)
        moving = system.pseudo_static
        viscous = {name: block for name, block in self.scene.blocks.items() if block.absorbing}
        if moving is not None and viscous:
            carried = {
                name: boundary_dashpots(block) @ moving.shapes[name] for name, block in viscous.items()
            }
            system = system.loaded({Motion.SUPPORTS_VELOCITY: np.asarray(coordinates.press(carried))})
        return system, coordinates

    def _of_mesh(self, system: System, mesh: MeshCoordinates) -> System:
        """Sparse C, and D apart because D D^T would be full."""
        rayleigh = self.damping.rayleigh
        alpha, beta = rayleigh_coefficients(rayleigh)
        # sum of C_b; forces of the mass terms on rigid motions at unit velocity
        further, braked = csr_matrix(system.M.shape), alpha * (system.M @ mesh.rigid)
        for name, matrix in mesh.maps.items():
            block = self.scene.blocks[name]
            of_block = further_damping(block, rayleigh)
            if of_block is not None:
                further = further + matrix.T @ of_block @ matrix
            if (drag := further_drag(block, rayleigh)) and mesh.rigid.shape[1]:
                braked = braked + drag * matrix.T @ (assemble_mass(block) @ (matrix @ mesh.rigid))
        C = csr_matrix(alpha * system.M + beta * system.K + csr_matrix(further))
        if not braked.count_nonzero():
            return replace(system, C=C)
        return replace(system, C=C, drag=rigid_drag(braked.toarray(), mesh.rigid.toarray()))

    def _of_modes(self, system: System, modes: ModalCoordinates) -> System:
        """C over the modes: diagonal, unless a block whose modes cannot be damped apart has a C_b."""
        rayleigh, omega2 = self.damping.rayleigh, system.K.diagonal()
        coefficients = modal_coefficients(self.damping, omega2)
        # turned coordinates are no modes of one part any more
        apart = set[str]() if modes.turns else self._of_one_damping()
        for name in apart:
            columns = modes.basis[name].columns
            alpha, beta = material_coefficients(self.scene.blocks[name], rayleigh)
            coefficients[columns] = np.where(omega2[columns] > 0.0, alpha + beta * omega2[columns], 0.0)
        others = {name: block for name, block in self.scene.blocks.items() if name not in apart}
        further = {name: further_damping(block, rayleigh) for name, block in others.items()}
        C = np.diag(coefficients)
        if all(of_block is None for of_block in further.values()):
            return replace(system, C=csr_matrix(diags_array(coefficients)))
        alpha, _ = rayleigh_coefficients(rayleigh)
        braked = alpha * system.M.toarray()  # the mass terms of all C_b and of the scene
        rigid = (system.K.diagonal() == 0.0) & (system.M.diagonal() > 0.0)
        free = rigid.copy()  # of these, the ones that joints alone hold
        for name, of_block in further.items():
            part, block = modes.basis[name], others[name]
            if of_block is not None:
                C[part.columns, part.columns] += part.vectors.project(part.vectors.under(of_block))
            if rigid.any() and (drag := further_drag(block, rayleigh)):
                of_mass = part.vectors.project(part.vectors.under(assemble_mass(block)))
                braked[part.columns, part.columns] += drag * of_mass
            if block.absorbing:  # its boundary holds it, and so not its joints alone
                free[part.columns] = False
        if rigid.any():
            # `modal_coefficients` leaves alpha off all rigid motions, D off those that joints alone hold
            C += alpha * np.diag(rigid)
            D = rigid_drag(braked[:, free], np.eye(len(free))[:, free])
            C -= D @ D.T
        return replace(system, C=csr_matrix(0.5 * (C + C.T)), diagonal=False)

    def _of_one_damping(self) -> set[str]:
        """Blocks of parts all of whose materials have one damping of their own, and no other C_b."""
        apart = set[str]()
        for part in scene_parts(self.scene).values():
            blocks = [self.scene.blocks[name] for name in part.blocks]
            alike = len({block.material.damping for block in blocks}) == 1
            if alike and not any(block.absorbing or brings_damping(block) for block in blocks):
                apart |= {*part.blocks} if blocks[0].material.damping is not None else set()
        return apart
