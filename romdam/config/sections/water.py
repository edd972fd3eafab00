"""Water that moves with the dam."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from romdam.config.base import Model
from romdam.config.quantities import Density, Dimensionless, Frequency, Length, Velocity
from romdam.config.sections.places import BlockFace, Direction

Positive = Field(gt=0.0)
_OF_SOUND = ("sound_speed", "bottom_reflection", "cutoff")


class WaterConfig(Model):
    """The reservoir on wet faces, up to `level` (elevation along z).

    `westergaard`: the pressure 7/8 rho sqrt(depth y) of the local normal acceleration at y below the level.
    `incompressible`: water in a prismatic reservoir that reaches `length` upstream (three depths if not
    given) from the wet faces, along `upstream` (the horizontal mean normal of the faces if not given).
    `compressible`: waves in the same reservoir, which leave it at its far end as in a channel that goes on
    without end, and are reflected by the floor and by banks that lean. A reduced model has its own modes up
    to `cutoff`; above, the water answers as incompressible.
    `bottom` is the elevation of the floor for Westergaard's depth, the lowest wet point if not given.
    """

    level: Length
    faces: Annotated[tuple[BlockFace, ...], Field(min_length=1)]
    model: Literal["westergaard", "incompressible", "compressible"]
    """How the water answers."""
    density: Annotated[Density, Positive] = 1000.0
    """Of the water."""
    bottom: Length | None = None
    upstream: Direction | None = None
    length: Annotated[Length, Positive] | None = None
    sound_speed: Annotated[Velocity, Positive] = 1440.0
    """Of compressible water."""
    bottom_reflection: Annotated[Dimensionless, Field(ge=0.0, le=1.0)] = 1.0
    """Share of a pressure wave that the floor sends back (compressible): 1 rigid, 0 takes all up."""
    cutoff: Annotated[Frequency, Positive] = 50.0

    @model_validator(mode="after")
    def _sound_in_compressible_water(self) -> Self:
        idle = [key for key in _OF_SOUND if getattr(self, key) != type(self).model_fields[key].default]
        if idle and self.model != "compressible":
            raise ValueError(
                f"{idle[0]}: water that is {self.model!r} knows no waves; leave it out, or set "
                "model: compressible"
            )
        return self

    @property
    def has_waves(self) -> bool:
        """Tell whether the reservoir has motions of its own."""
        return self.model == "compressible"
