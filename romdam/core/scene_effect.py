"""What one physical effect has of a scene."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SceneEffect:
    """Base of the frozen dataclasses by which effects stand in a scene, such as its reservoir.

    A scene knows them by their kind alone (`Scene.find`, `Scene.every`): an effect adds a kind of its own.
    """
