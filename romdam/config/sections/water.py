"""Water that moves with the dam."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from romdam.config.base import Model
from romdam.config.quantities import Density, Length
from romdam.config.sections.places import BlockFace, Direction

Positive = Field(gt=0.0)


class WaterConfig(Model):
    """Added mass of the reservoir on wet faces, up to `level` (elevation along z).

    `westergaard`: the pressure 7/8 rho sqrt(depth y) of the local normal acceleration at y below the level.
    `incompressible`: water in a prismatic reservoir that reaches `length` upstream (three depths if not
    given) from the wet faces, along `upstream` (the horizontal mean normal of the faces if not given).
    `bottom` is the elevation of the floor for Westergaard's depth, the lowest wet point if not given.
    """

    level: Length
    faces: Annotated[tuple[BlockFace, ...], Field(min_length=1)]
    model: Literal["westergaard", "incompressible"]
    """How the water answers."""
    density: Annotated[Density, Positive] = 1000.0
    """Of the water."""
    bottom: Length | None = None
    upstream: Direction | None = None
    length: Annotated[Length, Positive] | None = None
