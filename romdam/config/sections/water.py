"""Water that moves with the dam."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from romdam.config.base import Model
from romdam.config.quantities import Density, Dimensionless, Frequency, Length, Velocity
from romdam.config.sections.geometry.mesh_file import MeshFileConfig
from romdam.config.sections.places import BlockFace, Direction, FaceRef

Positive = Field(gt=0.0)
_OF_SOUND = ("sound_speed", "bottom_reflection", "cutoff")
_OF_PRISM = {"length": "the mesh ends where it ends", "bottom": "name the floor's faces in water.mesh.bottom"}
CLOSED = "closed"


class ReservoirMeshConfig(MeshFileConfig):
    """The water's volume, up to the level, meshed by its user; facets that lie on the dam may be others.

    Its free surface is what lies at the level, and what lies on the dam's wet faces is found; walls that are
    neither these nor `bottom` nor `end` reflect all.
    """

    end: FaceRef
    """An upright plane across the valley, beyond which the channel goes on; `closed` within banks."""
    bottom: tuple[FaceRef, ...] | None = None
    """Faces that absorb waves; if not given, all walls more than 10 degrees off vertical."""
    overlap: Annotated[float, Field(gt=0.0, le=1.0)] = 0.95
    """Least share of each block's wet faces, below the level, that the mesh lies on."""


class WaterConfig(Model):
    """The reservoir on wet faces, up to `level` (elevation along z).

    `westergaard`: the pressure 7/8 rho sqrt(depth y) of the local normal acceleration at y below the level.
    `incompressible`: water in a prismatic reservoir that reaches `length` upstream (three depths if not
    given) from the wet faces, along `upstream` (the horizontal mean normal of the faces if not given).
    `compressible`: waves in the same reservoir, which leave it at its far end as in a channel that goes on
    without end, and are reflected by the floor and by banks that lean. A reduced model has its own modes up
    to `cutoff`; above, the water answers as incompressible.
    With `mesh` the reservoir is no prism, but what is meshed.
    `bottom` is the elevation of the floor for Westergaard's depth, the lowest wet point if not given.
    """

    level: Length
    """Elevation of the surface, along z."""
    faces: Annotated[tuple[BlockFace, ...], Field(min_length=1)]
    rock: tuple[BlockFace, ...] = ()
    """Faces of the ground under the reservoir: its floor and banks move with the rock and press on it."""
    model: Literal["westergaard", "incompressible", "compressible"]
    """Model of the water."""
    density: Annotated[Density, Positive] = 1000.0
    """Density of the water."""
    bottom: Length | None = None
    """Elevation of the floor, for Westergaard's depth; the lowest wet point if not given."""
    upstream: Direction | None = None
    """Horizontal direction in which the reservoir reaches; the mean normal of the wet faces if not given."""
    length: Annotated[Length, Positive] | None = None
    """Length of the reservoir upstream; three depths if not given."""
    sound_speed: Annotated[Velocity, Field(ge=20.0, le=5000.0)] = 1440.0
    """Speed of sound in compressible water; with bubbles it is less, and no less than some 20 m/s."""
    bottom_reflection: Annotated[Dimensionless, Field(ge=0.0, le=1.0)] = 1.0
    """Reflection coefficient of the floor for pressure waves (compressible): 1 rigid, 0 absorbs all."""
    cutoff: Annotated[Frequency, Positive] = 50.0
    """Frequency up to which the water has modes of its own in a reduced model."""
    mesh: ReservoirMeshConfig | None = None

    @model_validator(mode="after")
    def _sound_in_compressible_water(self) -> Self:
        idle = [key for key in _OF_SOUND if getattr(self, key) != type(self).model_fields[key].default]
        if idle and self.model != "compressible":
            raise ValueError(
                f"{idle[0]}: water that is {self.model!r} knows no waves; leave it out, or set "
                "model: compressible"
            )
        return self

    @model_validator(mode="after")
    def _mesh_of_its_own(self) -> Self:
        if self.rock and self.model == "westergaard":
            raise ValueError(
                "rock: Westergaard's pressure knows no floor that moves; leave it out, or set "
                "model: compressible"
            )
        if self.mesh is None:
            return self
        if self.model == "westergaard":
            raise ValueError(
                "mesh: Westergaard's pressure knows no reservoir; leave it out, or set model: compressible"
            )
        idle = [key for key in _OF_PRISM if getattr(self, key) is not None]
        if idle:
            raise ValueError(
                f"{idle[0]}: of a reservoir without `mesh`, {_OF_PRISM[idle[0]]}; leave the key out"
            )
        return self

    @property
    def has_waves(self) -> bool:
        """Tell whether the reservoir has motions of its own."""
        return self.model == "compressible"
