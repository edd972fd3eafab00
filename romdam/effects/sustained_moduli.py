"""Moduli by duration: stiffness under loads that last beside that of what the record adds.

All of a system but its state at rest is of the record's modulus (`Material.E`). With r_b the ratio of the
sustained modulus to it in block b, the stiffness at rest is sum_b r_b K_b; what that is more than K is added
here (`romdam.core.system.SustainedStiffness`). Springs of viscous faces follow their rock.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import block_diag, csr_matrix, diags_array

from romdam.core.arrays import Floats
from romdam.core.scene import Scene
from romdam.core.system import PseudoStatic, SustainedStiffness, System
from romdam.effects.effect import EffectCoordinates, MeshCoordinates, ModalCoordinates
from romdam.fem.assembly import assemble
from romdam.scene.ties import Part, scene_parts


@dataclass(frozen=True)
class SustainedModuli:
    """The sustained moduli of a scene as an effect; it acts before effects that change the unknowns.

    Attributes
    ----------
    scene : the scene
    ratios : block name -> sustained modulus over that of the record
    """

    scene: Scene
    ratios: Mapping[str, float]

    def static_loads(self, moving: PseudoStatic | None) -> dict[str, Floats]:
        """None here: a part of several ratios answers its loads with both moduli, see `merged_part`."""
        return {}

    def add(self, system: System, coordinates: EffectCoordinates) -> tuple[System, EffectCoordinates]:
        """Add what the stiffness under loads that last is more than K."""
        if isinstance(coordinates, ModalCoordinates):
            more = self._of_modes(system, coordinates)
        else:
            assert isinstance(coordinates, MeshCoordinates)
            more = csr_matrix(system.K.shape)
            for name, ratio in self.ratios.items():
                if ratio != 1.0:
                    spread, stiffness = coordinates.maps[name], assemble(self.scene.blocks[name])[0]
                    more = more + (ratio - 1.0) * (spread.T @ stiffness @ spread)
        return replace(system, sustained=SustainedStiffness(csr_matrix(more))), coordinates

    def _of_modes(self, system: System, modes: ModalCoordinates) -> csr_matrix:
        """Parts of one ratio stay diagonal."""
        omega2, blocks = system.K.diagonal(), list[csr_matrix | Floats]()
        parts = scene_parts(self.scene)
        for key, columns in system.parts.items():
            most, others = _ratios(parts[key], self.scene, self.ratios)
            of_part: csr_matrix | Floats = csr_matrix(diags_array((most - 1.0) * omega2[columns]))
            if others:
                total = np.diag((most - 1.0) * omega2[columns])
                for name in others:
                    vectors = modes.basis[name].vectors
                    stiffness = vectors.project(vectors.under(assemble(self.scene.blocks[name])[0]))
                    total += (self.ratios[name] - most) * 0.5 * (stiffness + stiffness.T)
                of_part = total
            blocks.append(of_part)
        return csr_matrix(block_diag(blocks))


def _ratios(part: Part, scene: Scene, ratios: Mapping[str, float]) -> tuple[float, list[str]]:
    """Ratio of most nodes of a part, and its blocks of other ratios."""
    nodes = dict[float, int]()
    for name in part.blocks:
        nodes[ratios[name]] = nodes.get(ratios[name], 0) + len(scene.blocks[name].points)
    most = max(nodes, key=lambda ratio: nodes[ratio])
    return most, [name for name in part.blocks if ratios[name] != most]


def sustained_moduli(scene: Scene) -> SustainedModuli | None:
    """The effect of a scene's sustained moduli; None where all are those of the record."""
    ratios = scene.sustained_ratios
    return SustainedModuli(scene, ratios) if ratios else None
