"""Stages of construction as an effect: the static loads of each, which a system goes through before its run.

See `romdam.timestepping.construction` for how. The loads of a stage are the weight of the blocks that are
there, changes of temperature and still water; all other loads act once the dam is built.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.scene import ConstructionStage, Scene
from romdam.core.system import ConstructionPlan, PseudoStatic, System
from romdam.effects.effect import EffectCoordinates
from romdam.fem.assembly import assemble_mass
from romdam.fem.loads import hydrostatic_force, thermal_force, weight_acts, weight_force

_SAME = 1e-12  # relative, of loads of two stages that are one but for a factor


@dataclass(frozen=True)
class StagesOfConstruction:
    """The stages of a scene as an effect.

    Attributes
    ----------
    scene : with `construction`
    surface : block name -> (3 nodes, stages) all but its weight [N]
    """

    scene: Scene
    surface: dict[str, Floats]

    def add(self, system: System, coordinates: EffectCoordinates) -> tuple[System, EffectCoordinates]:
        """Add the plan that the system is to go through."""
        scene, stages = self.scene, self.scene.every(ConstructionStage)
        force = {name: values.copy() for name, values in self.surface.items()}
        for name, block in scene.blocks.items():
            if scene.loads.gravity.any() and weight_acts(scene, name):
                weight = weight_force(scene, name, assemble_mass(block)).ravel()
                for k, stage in enumerate(stages):
                    if name in stage.blocks:
                        force[name][:, k] += weight
        present = [
            [stage.blocks.issuperset(joint.blocks) for joint in scene.joints.values()] for stage in stages
        ]
        sizes = [len(joint.gap) for joint in scene.joints.values()]
        plan = ConstructionPlan(
            names=tuple(stage.name for stage in stages),
            force=np.asarray(coordinates.press(force)),
            present=np.repeat(np.array(present, dtype=bool).reshape(len(stages), -1), sizes, axis=1),
            grouted=np.stack([stage.grouted for stage in stages]),
        )
        return replace(system, construction=plan), coordinates

    def static_loads(self, moving: PseudoStatic | None) -> dict[str, Floats]:
        """The loads of the stages but weight, each once."""
        names = list(self.surface)
        every = np.concatenate([self.surface[name] for name in names])
        sizes, kept = np.linalg.norm(every, axis=0), list[int]()
        for k in np.flatnonzero(sizes > 0.0):
            unit = every[:, k] / sizes[k]
            known = [abs(unit @ every[:, j]) / sizes[j] for j in kept]
            if all(1.0 - cosine > _SAME for cosine in known):
                kept.append(int(k))
        return {name: self.surface[name][:, kept] for name in names}


def construction(scene: Scene) -> StagesOfConstruction | None:
    """The effect of a scene's stages of construction; None without any."""
    if not scene.every(ConstructionStage):
        return None
    surface = {
        name: np.stack(
            [_surface_force(scene, stage, name) for stage in scene.every(ConstructionStage)], axis=1
        )
        for name in scene.blocks
    }
    return StagesOfConstruction(scene, surface)


def _surface_force(scene: Scene, stage: ConstructionStage, name: str) -> Floats:
    """Nodal force of everything but weight on a block in a stage, (3 nodes,) [N]."""
    block = scene.blocks[name]
    force = np.zeros_like(block.points)
    if np.any(change := stage.warmed.get(name, 0.0)):
        force += thermal_force(block, change)
    for water in scene.loads.water:
        if water.block == name and stage.level is not None:
            force += hydrostatic_force(block.points, replace(water, level=min(water.level, stage.level)))
    return force.ravel()
