"""Forces that vary in time, on nodes and faces: shakers, gates, ice, waves.

Each is a pattern of nodal forces times a size s(t), straight between the base steps. It is a column of the
load that follows its own row, so that every integrator takes it exactly, and its static answer is in the
basis. Its work is part of the ledger's input.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.motion import Motion
from romdam.core.scene import ForceHistory, Scene
from romdam.core.system import PseudoStatic, System
from romdam.effects.effect import EffectCoordinates


@dataclass(frozen=True)
class ForceHistories:
    """Forces of a scene that vary in time, as an effect.

    Attributes
    ----------
    scene : with `force_histories`
    patterns : block name -> (3 nodes, k) nodal forces per newton of each of the k histories [1]
    """

    scene: Scene
    patterns: dict[str, Floats]

    def add(self, system: System, coordinates: EffectCoordinates) -> tuple[System, EffectCoordinates]:
        """Add a column of the load for each; loads have the opposite sign."""
        pressed = np.asarray(coordinates.press(self.patterns))
        signals = tuple(one.signal for one in self.scene.every(ForceHistory))
        loaded = system.loaded({Motion.FORCES: -pressed})
        return replace(loaded, signals=signals), coordinates

    def static_loads(self, moving: PseudoStatic | None) -> dict[str, Floats]:
        """The patterns."""
        return self.patterns


def force_histories(scene: Scene) -> ForceHistories | None:
    """The effect of a scene's forces that vary in time; None without any."""
    histories = scene.every(ForceHistory)
    if not histories:
        return None
    patterns = {name: np.zeros((block.points.size, len(histories))) for name, block in scene.blocks.items()}
    for k, one in enumerate(histories):
        patterns[one.block][:, k] = one.nodal.ravel()
    return ForceHistories(scene, patterns)
