"""Static loads: weight, pressures, hydrostatic pressure, temperature, nodal forces, and water in joints.

They act all the time. Weight of staged construction has acted before the joints were grouted and is left out
(`romdam.fem.loads.weight_acts`); the pressure of grouting acts before a run (`romdam.timestepping.grouting`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Floats
from romdam.core.scene import Scene
from romdam.core.system import PseudoStatic, System
from romdam.effects.effect import Coordinates, ModalCoordinates
from romdam.fem.gaps import water_force
from romdam.fem.loads import static_force, surface_force, weight_acts


@dataclass(frozen=True)
class StaticLoads:
    """Static loads of a scene as an effect.

    Attributes
    ----------
    scene : the scene
    surface : block name -> (3 nodes,) all but its weight [N]
    """

    scene: Scene
    surface: Mapping[str, Floats]

    def static_loads(self, moving: PseudoStatic | None) -> dict[str, Floats]:
        """All but weight, whose direction the inertia of the base has."""
        return {name: force[:, None] for name, force in self.surface.items()}

    def add(self, system: System, coordinates: Coordinates) -> tuple[System, Coordinates]:
        """Add the forces."""
        if isinstance(coordinates, ModalCoordinates):
            force = self._on_modes(coordinates)
        else:
            every = {name: static_force(self.scene, name).reshape(-1, 1) for name in self.scene.blocks}
            force = np.asarray(coordinates.press(every))[:, 0]
        opening = system.B[:: system.law.directions].T @ water_force(self.scene)
        return replace(system, force=system.force + force + opening), coordinates

    def _on_modes(self, modes: ModalCoordinates) -> Floats:
        """Weight follows from the participation; of a basis on disk only the loaded rows are read."""
        total = np.zeros(modes.size)
        for name, part in modes.basis.items():
            force = part.vectors.under(csr_matrix(self.surface[name][None]))[0]
            if weight_acts(self.scene, name):
                force = part.participation @ self.scene.gravity + force
            total[part.columns] += force
        return total


def static_loads(scene: Scene) -> StaticLoads:
    """The effect of a scene's static loads."""
    return StaticLoads(scene, {name: surface_force(scene, name).ravel() for name in scene.blocks})
