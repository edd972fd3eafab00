"""Static loads: weight, pressures, hydrostatic pressure, temperature, nodal forces, and water in joints.

They act all the time. To a state at rest they are applied kind by kind, in the order of the scene
(`System.load_steps`). Weight of staged construction has acted before the joints were grouted and is left out
(`romdam.fem.loads.weight_acts`); the pressure of grouting acts before a run (`romdam.timestepping.grouting`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Floats
from romdam.core.scene import LOAD_KINDS, Scene
from romdam.core.system import PseudoStatic, System
from romdam.effects.effect import EffectCoordinates, ModalCoordinates
from romdam.fem.assembly import assemble_mass
from romdam.fem.gaps import water_force
from romdam.fem.loads import surface_forces, weight_acts, weight_force


@dataclass(frozen=True)
class StaticLoads:
    """Static loads of a scene as an effect.

    Attributes
    ----------
    scene : the scene
    kinds : block name -> kind of load -> (3 nodes,) its force but for weight [N]
    """

    scene: Scene
    kinds: Mapping[str, Mapping[str, Floats]]

    @property
    def surface(self) -> dict[str, Floats]:
        """Block name -> (3 nodes,) all but its weight [N]."""
        blocks = self.scene.blocks
        none = {name: np.zeros(blocks[name].points.size) for name in blocks}
        return {name: np.asarray(sum(kinds.values(), none[name])) for name, kinds in self.kinds.items()}

    def static_loads(self, moving: PseudoStatic | None) -> dict[str, Floats]:
        """Each kind but the first; with their sum, and inertia for weight, they span all."""
        acting = [kind for kind in LOAD_KINDS if any(kind in of for of in self.kinds.values())]
        blocks = self.scene.blocks
        return {
            name: np.column_stack(
                [np.zeros((blocks[name].points.size, 0))]
                + [of.get(kind, np.zeros(blocks[name].points.size)) for kind in acting[1:]]
            )
            for name, of in self.kinds.items()
        }

    def add(self, system: System, coordinates: EffectCoordinates) -> tuple[System, EffectCoordinates]:
        """Add the forces, and their parts in the order in which they are applied to the state at rest."""
        order = self.scene.loads.order or LOAD_KINDS
        steps = {kind: np.asarray(self._pressed(kind, coordinates)) for kind in order}
        steps["water"] = steps["water"] + system.B[:: system.law.directions].T @ water_force(self.scene)
        steps = {kind: np.asarray(force) for kind, force in steps.items() if force.any()}
        force = system.force + sum(steps.values(), np.zeros(system.size))
        steps = steps if self.scene.loads.order else {}
        return replace(system, force=np.asarray(force), load_steps=steps), coordinates

    def _pressed(self, kind: str, coordinates: EffectCoordinates) -> Floats:
        """A kind of load on the unknowns; of a basis on disk only the loaded rows are read."""
        scene = self.scene
        if not isinstance(coordinates, ModalCoordinates):
            every = {name: of.get(kind, np.zeros(0)) for name, of in self.kinds.items()}
            for name, block in scene.blocks.items():
                if not every[name].size:
                    every[name] = np.zeros(block.points.size)
                if kind == "weight" and scene.loads.gravity.any() and weight_acts(scene, name):
                    every[name] = every[name] + weight_force(scene, name, assemble_mass(block)).ravel()
            pressed = coordinates.press({name: force[:, None] for name, force in every.items()})
            return np.asarray(pressed)[:, 0]
        total = np.zeros(coordinates.size)
        for name, part in coordinates.basis.items():
            if kind in self.kinds[name]:
                total[part.columns] += part.vectors.under(csr_matrix(self.kinds[name][kind][None]))[0]
            if kind == "weight" and weight_acts(scene, name):
                total[part.columns] += part.participation @ scene.loads.gravity
        return total


def static_loads(scene: Scene) -> StaticLoads:
    """The effect of a scene's static loads."""
    kinds = {name: surface_forces(scene, name) for name in scene.blocks}
    return StaticLoads(
        scene, {name: {kind: force.ravel() for kind, force in of.items()} for name, of in kinds.items()}
    )
