"""The ground: rock that goes on beyond the mesh, and the motion that comes through it."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from romdam.config.base import Model
from romdam.config.quantities import Length
from romdam.config.sections.geometry.arch_dam import ArchDamConfig
from romdam.config.sections.motion_along import MotionAlongConfig
from romdam.config.sections.places import FaceRef


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
    along: MotionAlongConfig | None = None
    """Motion of all supports by their position, where it is not the record everywhere."""

    @model_validator(mode="after")
    def _surface_of_a_field(self) -> Self:
        if self.surface is not None and self.input == "uniform":
            raise ValueError("`surface` is that of `input: free_field`; leave it out, or give that input")
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
