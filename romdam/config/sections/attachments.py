"""What is attached to blocks: anchors and dampers between two points, and masses of gates and equipment."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, Tag, model_validator

from romdam.config.base import Model, by_shape
from romdam.config.quantities import (
    Area,
    DashpotDamping,
    Dimensionless,
    Force,
    Length,
    Mass,
    Pressure,
    SpringStiffness,
)
from romdam.config.sections.places import FaceRef, Tolerance, Vector

Positive = Field(gt=0.0)


class PointConfig(Model):
    """A point of a block, wherever it lies in an element."""

    block: str
    """A name of `blocks`."""
    at: Vector
    """Position of the point."""
    tolerance: Tolerance = 0.05
    """Distance up to which the point may lie outside the block's elements, as on a curved face."""


Place = Annotated[
    Annotated[PointConfig, Tag("mapping")] | Annotated[Vector, Tag("list")],
    by_shape(
        "a point of a block such as {block: dam, at: [0 m, 2 m, 40 m]}, or a place [x, y, z] of the base"
    ),
]


class AnchorConfig(Model):
    """A bar or tendon between two points, straight and elastic, that is stressed before the run.

    Its force is (1 - loss) pretension + stiffness times what its length has grown since the unloaded mesh, so
    that loads which act with it at rest change it; its force at rest stands in the result. A tendon that goes
    slack, or is loaded above its `strength`, goes on as a spring, and a warning says so.
    """

    head: PointConfig
    """Point that it is stressed from."""
    foot: Place
    """Other end: a point of a block, or a place that moves with the base."""
    stiffness: Annotated[SpringStiffness, Positive] | None = None
    """Force for one metre of elongation; or give `E` and `area`."""
    E: Annotated[Pressure, Positive] | None = None
    """Young's modulus of the steel."""
    area: Annotated[Area, Positive] | None = None
    """Cross-section of the steel."""
    free_length: Annotated[Length, Positive] | None = None
    """Length over which it stretches, with `E` and `area`; the distance of its ends if not given."""
    pretension: Annotated[Force, Field(ge=0.0)] = 0.0
    """Tension to which it was locked off."""
    loss: Annotated[Dimensionless, Field(ge=0.0, lt=1.0)] = 0.0
    """Share of the pretension that is lost to relaxation, creep and slip of its wedges."""
    strength: Annotated[Force, Positive] | None = None
    """Tension that it bears; a run in which it is exceeded is warned of."""

    @model_validator(mode="after")
    def _refuse_two_stiffnesses(self) -> Self:
        of_bar = self.E is not None and self.area is not None
        count = sum(value is not None for value in (self.stiffness, self.E, self.area))
        if count != (2 if of_bar else 1) or (not of_bar and self.stiffness is None):
            raise ValueError("give either `stiffness`, or `E` and `area`")
        if self.free_length is not None and not of_bar:
            raise ValueError(
                "`free_length` goes with `E` and `area`; `stiffness` is that of the whole anchor"
            )
        return self

    def stiffness_over(self, length: float) -> float:
        """Its stiffness where its ends are so far apart [m], [N/m]."""
        if self.stiffness is not None:
            return self.stiffness
        assert self.E is not None and self.area is not None
        return self.E * self.area / (self.free_length or length)


class DamperConfig(Model):
    """A linear viscous damper between two points.

    Its force is damping times the rate at which the distance of its ends grows, so it has none at rest.
    """

    head: PointConfig
    """Point of a block."""
    foot: Place
    """Other end: a point of a block, or a place that moves with the base."""
    damping: Annotated[DashpotDamping, Positive]
    """Force for one metre per second along its axis."""


class MassConfig(Model):
    """A mass on a point of a block, or on the mean motion of a face, without an inertia of rotation.

    It is shaken as the blocks are, and gravity acts on it together with their weight.
    """

    block: str
    """A name of `blocks`."""
    at: Vector | None = None
    """Point of the block that it is on."""
    face: FaceRef | None = None
    """Face of the block that it is on, in place of `at`."""
    mass: Annotated[Mass, Positive]
    """Mass of what is there."""
    tolerance: Tolerance = 0.05
    """Distance up to which the point may lie outside the block's elements."""

    @model_validator(mode="after")
    def _refuse_two_places(self) -> Self:
        if (self.at is None) == (self.face is None):
            raise ValueError("give exactly one of `at` and `face`")
        return self
