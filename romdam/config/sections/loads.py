"""The `loads:` of a configuration: what acts before and during the shaking."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from romdam.config.base import Model
from romdam.config.quantities import Acceleration, Density, Force, Length, Pressure, TemperatureChange
from romdam.config.sections.joint_water import JointWaterConfig
from romdam.config.sections.places import BlockFace, FaceRef, Tolerance, Vector
from romdam.core.errors import quote

Positive = Field(gt=0.0)


class PressureConfig(Model):
    """Pressure on a face, positive into the block."""

    block: str
    """A name of `blocks`."""
    face: FaceRef
    """Name of a face of the block, or a plane."""
    value: Pressure
    """Pressure, positive into the block."""


class ForceConfig(Model):
    """A force on the node nearest to a point."""

    block: str
    """A name of `blocks`."""
    at: Vector
    """Position of the node."""
    force: tuple[Force, Force, Force]
    """Force along x, y and z."""
    tolerance: Tolerance = 1e-3
    """Distance up to which the nearest node counts."""


class HydrostaticConfig(Model):
    """Pressure rho g (level - z) of still water below `level`; g is vertical gravity, else 9.81 m/s2."""

    level: Length
    """Elevation of the water, along z."""
    faces: Annotated[tuple[BlockFace, ...], Field(min_length=1)]
    density: Annotated[Density, Positive] = 1000.0
    """Density of the water."""


class TemperatureConfig(Model):
    """A uniform change of temperature of blocks (all those whose material expands, if not named)."""

    change: Annotated[TemperatureChange, Field(ge=-300.0, le=1500.0)]
    """Change from the temperature without stress; negative cools."""
    blocks: Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    """Names of `blocks`."""


class LoadsConfig(Model):
    """Static loads; `gravity` is the acceleration that makes weight, for example [0, 0, -9.81].

    `weight` acts before the joints are grouted (`staged`: they carry none of it) or on the finished dam.
    """

    gravity: tuple[Acceleration, Acceleration, Acceleration] | None = None
    """Acceleration that makes weight, for example [0, 0, -9.81]."""
    weight: Literal["monolithic", "staged"] = "monolithic"
    """Structure that weight acts on: the finished dam, or the blocks before the joints are grouted (staged:
    joints carry none of it)."""
    hydrostatic: tuple[HydrostaticConfig, ...] = ()
    temperature: tuple[TemperatureConfig, ...] = ()
    pressure: tuple[PressureConfig, ...] = ()
    force: tuple[ForceConfig, ...] = ()
    joint_water: tuple[JointWaterConfig, ...] = ()
    initial_state: Literal["static", "undeformed"] = "static"
    """State that a run starts from: equilibrium of the static loads, or no displacement at all."""

    @model_validator(mode="after")
    def _wet_once(self) -> Self:
        seen: dict[str, int] = {}
        for k, water in enumerate(self.joint_water):
            for name in water.joints:
                if seen.setdefault(name, k) != k or water.joints.count(name) > 1:
                    raise ValueError(
                        f"joint_water[{k}].joints: joint {quote(name)} stands in joint_water[{seen[name]}] "
                        "already; name it once"
                    )
        return self

    @property
    def gravity_of_water(self) -> float:
        """Gravity that water weighs with: the vertical part, 9.81 where there is none [m/s2].

        Gravity of zero leaves out the weight of the blocks, where another analysis has it; water that is
        named by its level presses all the same.
        """
        return (0.0 if self.gravity is None else abs(self.gravity[2])) or 9.81
