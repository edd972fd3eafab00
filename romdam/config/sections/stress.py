"""Nodes and faces where stress is wanted, and the strength it is compared with."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, Tag, model_validator

from romdam.config.base import Model, by_shape
from romdam.config.names import Name
from romdam.config.quantities import Length, Pressure
from romdam.config.sections.places import BlockFace, Direction, NodeConfig, Vector

BlockNames = Annotated[
    Annotated[tuple[str, ...], Tag("list")] | Annotated[Literal["all"], Tag("word")],
    by_shape('a list of block names, or "all"', "all"),
]


class RingConfig(Model):
    """Regions that headlines of stress leave out, because stress there is that of the mesh."""

    edges: Annotated[Length, Field(ge=0.0)] | None = None
    """Distance from re-entrant edges, and from where supports or other materials meet a free face; one
    element where it is not given, which moves with the mesh."""
    contacts: Annotated[Length, Field(ge=0.0)] = 0.0
    """Distance from the contact faces of joints; 0 leaves out their own nodes."""


class SectionConfig(Model):
    """A plane through blocks on which normal force, shear, moment and linearised stress are written."""

    blocks: BlockNames
    """Blocks that count: those on one side of a joint that the plane lies in, all that stand side by side."""
    point: Vector
    """A point of the plane."""
    normal: Direction = (0.0, 0.0, 1.0)
    """Towards the side whose loads the section bears."""


class StressConfig(Model):
    """Envelopes and worst fields at every node of `blocks` and `faces`, histories at `nodes`.

    `strength` is the tensile strength of the concrete; with it come demand-capacity ratios, the
    duration of stresses above it and, for each face, the area where it is exceeded.
    """

    blocks: BlockNames = ()
    """Names of `blocks`, or patterns, at whose nodes envelopes and worst fields are written, or all."""
    faces: tuple[BlockFace, ...] = ()
    nodes: dict[Name, NodeConfig] = Field(default_factory=dict)
    sections: dict[Name, SectionConfig] = Field(default_factory=dict)
    strength: Annotated[Pressure, Field(gt=0.0)] | None = None
    """Tensile strength of the concrete, which stresses are compared with."""
    ring: RingConfig = RingConfig()

    @model_validator(mode="after")
    def _somewhere(self) -> Self:
        if not (self.blocks or self.faces or self.nodes):
            raise ValueError("name at least one of `blocks`, `faces` and `nodes`, for example `blocks: all`")
        return self
