"""The case that the variables of a result file are made from, and a variable itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from romdam.config.sections.job import Config
from romdam.core.arrays import Floats
from romdam.core.motion import GroundMotion
from romdam.core.scene import Joint, Scene
from romdam.core.system import History
from romdam.postprocess.stress.summary import StressSummary

Array = NDArray[Any]
Attributes = dict[str, object]

_OF_DAMS = np.array([0.0, -1.0, 0.0])  # `arch_dam` and `gravity_dam` have y downstream


def rock_blocks(scene: Scene) -> list[str]:
    """Blocks that no joint touches, that have no mass or whose weight has acted before, beside others."""
    dam = {name for joint in scene.joints.values() for name in joint.blocks} - scene.excluded_from_gravity
    dam -= {name for name, block in scene.blocks.items() if block.material.rho == 0.0}
    return [name for name in scene.blocks if name not in dam] if dam else []


def upstream_of(config: Config, scene: Scene) -> Floats | None:
    """Horizontal unit vector to the water's side, (3,); None where neither water nor a dam's keys tell it."""
    if scene.reservoir is not None:
        return scene.reservoir.upstream
    return None if config.dam is None else _OF_DAMS


@dataclass(frozen=True)
class Case:
    """One computed ground motion: what every variable is made from; no `stress` where none is asked for."""

    scene: Scene
    motion: GroundMotion
    history: History
    stress: StressSummary | None = None

    @property
    def joints(self) -> list[Joint]:
        """The joints in the order of their gaps."""
        return list(self.scene.joints.values())

    @property
    def frictional(self) -> bool:
        """True where slip and shear force exist."""
        return self.history.jump.shape[2] == 3

    def of_gaps(self, name: str) -> Array:
        """An attribute of `Joint` for all gaps, joint after joint."""
        return np.concatenate([getattr(joint, name) for joint in self.joints])

    def per_joint(self, of_gaps: Array, reduce: Callable[[Array], object]) -> Array:
        """`reduce` applied to the gaps of each joint."""
        stops = np.cumsum([len(joint.area) for joint in self.joints])[:-1]
        return np.array([reduce(gaps) for gaps in np.split(of_gaps, stops)])


@dataclass(frozen=True)
class Variable:
    """One variable of a result file.

    Attributes
    ----------
    dims : names of its dimensions
    units : UDUNITS text, "1" for numbers and "" for text
    long_name : what it is, with its sign
    get : Case -> array of that shape
    when : whether the case has it
    attributes : further CF attributes
    """

    dims: tuple[str, ...]
    units: str
    long_name: str
    get: Callable[[Case], Array]
    when: Callable[[Case], bool] = lambda case: True
    attributes: Attributes = field(default_factory=dict)

    @property
    def about(self) -> Attributes:
        """Its attributes in a file."""
        units: Attributes = {"units": self.units} if self.units else {}
        return {"long_name": self.long_name, **self.attributes, **units}
