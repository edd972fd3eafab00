"""The ground: rock that goes on beyond the mesh, and the motion that comes through it."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, Tag, model_validator

from romdam.config.base import Model, by_shape
from romdam.config.quantities import Degrees, Length
from romdam.config.sections.geometry.arch_dam import ArchDamConfig
from romdam.config.sections.motion_along import MotionAlongConfig
from romdam.config.sections.places import Direction, FaceRef


class ViscousConfig(Model):
    """Faces of a block of rock that take waves up, in place of supports: dashpots, and springs.

    The springs stand for the rock that is left out, and are the stiffer the nearer the faces are to the dam.
    """

    block: str
    """A name of `blocks`, with mass, or a pattern such as `rock.*` for all that have the faces."""
    faces: Annotated[tuple[FaceRef, ...], Field(min_length=1)]
    """Names of faces of the block, or planes."""
    distance: Annotated[Length, Field(gt=0.0)] | None = None
    """Distance of the faces from the dam; if not given, from the middle of the foot of what stands on the
    rock."""


class IncidenceConfig(Model):
    """Waves of a free field that come up at an angle, all of one apparent velocity along the surface.

    SV and P in the plane of travel and SH across it together make the record at one place of the level
    surface, and ahead of it the same later.
    """

    angle: Annotated[Degrees, Field(gt=0.0, lt=90.0)]
    """Angle of incidence in the lowest layer, between the ray and the vertical."""
    wave: Literal["s", "p"] = "s"
    """Kind of wave that the angle is of; of S waves it is below that at which P waves would graze."""
    axis: Annotated[
        Annotated[Literal["x", "y"], Tag("number")] | Annotated[Direction, Tag("list")],
        by_shape("x or y, or a direction such as [1, 0.5, 0]"),
    ]
    """Level direction in which the waves travel."""
    at: Length | None = None
    """Coordinate along `axis` where the surface moves as the record; the middle of the rock if not given."""

    @model_validator(mode="after")
    def _level(self) -> Self:
        if not isinstance(self.axis, str) and (self.axis[2] != 0.0 or not any(self.axis[:2])):
            raise ValueError(f"`axis` is a level direction such as [1, 0.5, 0], got {list(self.axis)}")
        return self


class GroundConfig(Model):
    """Motion that rock with viscous faces is shaken by.

    `uniform`: the record is the motion all along the contact, and acts on the dam's mass alone. `free_field`:
    the record is that of the rock's level surface far from the dam, and comes up through the rock as vertical
    waves; displacement is relative to that surface.
    """

    input: Literal["uniform", "free_field"] = "uniform"
    """Way in which the record reaches the dam: as the motion all along the contact, or as waves through the
    rock."""
    viscous: tuple[ViscousConfig, ...] = ()
    """Faces that waves leave through, and a free field comes through."""
    rock: tuple[str, ...] = ()
    """Names of blocks of rock besides those with viscous faces."""
    surface: Length | None = None
    """Elevation of the level surface; the highest point of the rock at its sides if not given."""
    incidence: IncidenceConfig | None = None
    """Angle at which the waves of `input: free_field` come up; straight up if not given."""
    along: MotionAlongConfig | None = None
    """Motion of all supports by their position, where it is not the record everywhere."""

    @model_validator(mode="after")
    def _surface_of_a_field(self) -> Self:
        if self.surface is not None and self.input == "uniform":
            raise ValueError("`surface` is that of `input: free_field`; leave it out, or give that input")
        if self.incidence is not None and self.input == "uniform":
            raise ValueError("`incidence` is that of `input: free_field`; leave it out, or give that input")
        return self

    @property
    def named(self) -> dict[str, str]:
        """Key of every block named, below `ground`, and its name."""
        viscous = {f"viscous[{i}].block": face.block for i, face in enumerate(self.viscous)}
        return viscous | {f"rock[{i}]": name for i, name in enumerate(self.rock)}


def refuse_wrong_ground(ground: GroundConfig, dam: ArchDamConfig | None) -> None:
    """Raise where waves have no viscous faces to come through.

    Raises
    ------
    ValueError
    """
    key = "rock" if ground.rock else "input: free_field" if ground.input == "free_field" else ""
    of_dam = dam is not None and dam.rock is not None and dam.rock.boundary == "viscous"
    if key and not (of_dam or ground.viscous):
        raise ValueError(
            f"ground.{key} is of rock with viscous faces, and there are 0; name the rock's bottom and sides "
            "in ground.viscous (of an arch dam: arch_dam.rock.boundary: viscous)"
        )
