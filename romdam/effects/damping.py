"""Damping of the solids: Rayleigh's or modal ratios, dashpots of viscous faces, matrices that blocks bring.

Rayleigh damping does not act on rigid motions that joints alone hold, see `romdam.fem.damping`. The springs
of viscous faces are part of a block's stiffness (`romdam.fem.assembly`), their dashpots stand here. Where
supports move by themselves, dashpots act on what these displace too; the solids' damping does not.
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
from romdam.fem.damping import (
    further_damping,
    modal_coefficients,
    rayleigh_coefficients,
    rigid_drag,
)


@dataclass(frozen=True)
class SolidDamping:
    """Damping of a scene's solids as an effect; it acts on the mass of incompressible water too.

    Attributes
    ----------
    scene : the scene
    damping : the ratios
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
        rayleigh = self.damping.rayleigh
        alpha, beta = rayleigh_coefficients(rayleigh)
        further, braked = csr_matrix(system.M.shape), system.M @ mesh.rigid
        for name, matrix in mesh.maps.items():
            block = self.scene.blocks[name]
            of_block = further_damping(block, rayleigh)
            if of_block is not None:
                further = further + matrix.T @ of_block @ matrix
            if block.matrices is not None and block.matrices.C is not None:  # in place of Rayleigh's damping
                braked = braked - matrix.T @ (block.matrices.M @ (matrix @ mesh.rigid))
        C = csr_matrix(alpha * system.M + beta * system.K + csr_matrix(further))
        if alpha == 0.0 or not mesh.rigid.shape[1]:
            return replace(system, C=C)
        return replace(system, C=C, drag=rigid_drag(alpha * braked.toarray(), mesh.rigid.toarray()))

    def _of_modes(self, system: System, modes: ModalCoordinates) -> System:
        """Dashpots and matrices couple the modes: C is not diagonal then."""
        C = np.diag(modal_coefficients(self.damping, system.K.diagonal()))
        further = {
            name: further_damping(block, self.damping.rayleigh) for name, block in self.scene.blocks.items()
        }
        if all(of_block is None for of_block in further.values()):
            return replace(system, C=csr_matrix(diags_array(C.diagonal())))
        mass = system.M.toarray()  # that Rayleigh's alpha acts on
        rigid = (system.K.diagonal() == 0.0) & (system.M.diagonal() > 0.0)
        free = rigid.copy()
        for name, of_block in further.items():
            part, block = modes.basis[name], self.scene.blocks[name]
            if of_block is not None:
                C[part.columns, part.columns] += part.vectors.project(part.vectors.under(of_block))
            if block.matrices is not None and block.matrices.C is not None:
                mass[part.columns, part.columns] -= part.vectors.project(part.vectors.under(block.matrices.M))
            if block.absorbing:  # its boundary holds it, and so not its joints alone
                free[part.columns] = False
        alpha, _ = rayleigh_coefficients(self.damping.rayleigh)
        if alpha > 0.0 and rigid.any():
            C += alpha * np.diag(rigid)
            D = rigid_drag(alpha * mass[:, free], np.eye(len(free))[:, free])
            C -= D @ D.T
        return replace(system, C=csr_matrix(0.5 * (C + C.T)), diagonal=False)
