"""Two cubes that meet in a plane tilted to the axes, of any two elements, for tests of mortar coupling."""

from dataclasses import replace

import numpy as np

from romdam.config.sections.job import BoxConfig
from romdam.core.scene import Block, Material
from romdam.geometry.boxes import box_block

CONCRETE = Material(30e9, 0.18, 2440.0)
PAIRS = [
    (("hex8", 3), ("hex8", 4)),
    (("hex8", 4), ("hex8", 3)),
    (("hex20", 2), ("hex20", 3)),
    (("hex27", 3), ("hex27", 2)),
    (("tet10", 2), ("tet10", 3)),
    (("tet4", 3), ("tet4", 2)),
    (("hex8", 3), ("tet10", 2)),
    (("tet10", 2), ("hex20", 2)),
    (("tet10", 2), ("tet10", 2)),
    (("hex20", 2), ("hex20", 2)),
]
IDS = [f"{a}/{m}-{b}/{n}" for (a, m), (b, n) in PAIRS]
SIZE, FACE = 12.0, 144.0


def turn(angle: float = 0.7) -> np.ndarray:
    """A rotation about a skew axis."""
    axis = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)
    K = np.cross(np.eye(3), axis)
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


def cube(name: str, element: str, count: int, start: float) -> Block:
    """A cube that meets y = 12 m."""
    sizes = {"origin": (0.0, start, 0.0), "size": (SIZE,) * 3, "element_size": SIZE / count}
    config = BoxConfig.model_validate(sizes | {"element": element})
    block = box_block(name, config, CONCRETE, "")
    return replace(block, points=block.points @ turn().T)


def pair(left: tuple[str, int], right: tuple[str, int]) -> tuple[Block, Block]:
    """Two cubes that meet in a plane tilted to the axes."""
    return cube("left", *left, 0.0), cube("right", *right, SIZE)
