"""Solid elements read from a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, Tag, model_validator

from romdam.config.base import Model, by_shape
from romdam.config.names import Name
from romdam.config.quantities import Whole
from romdam.config.sections.geometry.refinement import Refinements
from romdam.config.sections.places import LengthUnit


class MeshFileConfig(Model):
    """A block read from a mesh file; the physical groups of its facets become its faces."""

    file: Path
    """Mesh file: gmsh .msh, MED .med, I-deas .unv, code_aster .mail, ANSYS .cdb, Nastran .bdf, Abaqus .inp or
    .vtu."""
    group: str | Whole | None = None
    """Group, set or component (or a number) of the cells; all of them where it is left out."""
    body: Annotated[Whole, Field(ge=1)] | None = None
    """Number of the one body among those that share no node, counted along x, then y, then z."""
    unit: LengthUnit = "m"
    """Unit of the coordinates."""
    refine: Refinements = 0
    """Number of times that every cell is cut into eight; edges of quadratic cells stay curved."""


class BlockMeshConfig(MeshFileConfig):
    """A block read from a mesh file, or a block for each body of it.

    With `bodies: auto` the bodies of block `dam` are the blocks `dam.1`, `dam.2`, ... along x, then y, then
    z; with a list they have its names. A body shares no node with the rest; elements of one order make it.
    """

    bodies: (
        Annotated[
            Annotated[Literal["auto"], Tag("word")]
            | Annotated[tuple[Name, ...], Field(min_length=1), Tag("list")],
            by_shape('"auto", or the names of the bodies such as [left, right]', "auto"),
        ]
        | None
    ) = None
    """Blocks for all bodies that share no node: auto, `<block>.1`, `<block>.2`, ...; or their names."""

    @model_validator(mode="after")
    def _one_or_all(self) -> Self:
        if self.bodies is not None and self.body is not None:
            raise ValueError("`body` takes one body and `bodies` takes all; leave one of the two out")
        return self

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the bodies that become blocks; empty where the whole is one, or they are not found yet."""
        return self.bodies if isinstance(self.bodies, tuple) else ()
