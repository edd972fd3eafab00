"""Joints and ties between blocks: what stands in the configuration for them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, Tag, model_validator

from romdam.config.base import Model, by_shape
from romdam.config.quantities import Length, Stiffness, StiffnessPerArea
from romdam.config.sections.joint_laws import Friction, JointLaws
from romdam.config.sections.places import Direction, Tolerance

NonNegative = Field(ge=0.0)


class PerGap(Model):
    """A stiffness of each gap, whatever its tributary area."""

    per_gap: Annotated[Stiffness, NonNegative]


class GapTable(Model):
    """Initial gap from a CSV file with columns x, y, z, gap in metres, linear between its points."""

    table: Path


StiffnessNumber = Annotated[StiffnessPerArea, NonNegative, Tag("number")]
StiffnessTable = Annotated[PerGap, Tag("mapping")]
SurfaceStiffness = Annotated[
    StiffnessNumber | StiffnessTable,
    by_shape("a stiffness per area such as 16 GPa/m, or {per_gap: 1 GN/m}"),
]
NormalStiffness = Annotated[
    StiffnessNumber | StiffnessTable | Annotated[Literal["rigid"], Tag("word")],
    by_shape('a stiffness per area such as 16 GPa/m, {per_gap: 1 GN/m}, or "rigid"', "rigid"),
]
InitialGap = Annotated[
    Annotated[Length, Tag("number")] | Annotated[GapTable, Tag("mapping")],
    by_shape("a length such as 2 mm, or {table: gaps.csv}"),
]
NormalRule = Annotated[
    Annotated[Literal["face", "nodes"], Tag("number")] | Annotated[Direction, Tag("list")],
    by_shape('"face", "nodes", or a vector such as [0, 1, 0]'),
]


class JointProperties(JointLaws):
    """What gap elements do, wherever they stand.

    `normal_stiffness` K_n acts when closed ("rigid": exactly unilateral), `tension_stiffness` K_nz
    when open, `shear_stiffness` K_s while stuck; `friction` is mu, or [mu_y, mu_z] along the local
    axes j and k (equal: Coulomb on the resultant; unequal: per direction). `gaps` stand at every face node,
    or at the corners of quadratic facets only. Further laws: `JointLaws`.
    """

    normal_stiffness: NormalStiffness
    tension_stiffness: SurfaceStiffness = 0.0
    shear_stiffness: SurfaceStiffness = 0.0
    friction: Friction = (0.0, 0.0)
    gap: InitialGap = 0.0
    gaps: Literal["nodes", "corners"] = "nodes"
    normal: NormalRule = "face"
    tolerance: Tolerance = 1e-3

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        shear = self.shear_stiffness
        wrong = self.inconsistent(
            self.friction,
            shear.per_gap if isinstance(shear, PerGap) else shear,
            self.normal_stiffness == "rigid",
        )
        if wrong is not None:
            raise ValueError(wrong)
        return self

    @property
    def has_friction(self) -> bool:
        """Whether the tangential directions carry force."""
        return max(self.friction) > 0.0


class JointConfig(JointProperties):
    """Gap elements between the coinciding faces of two blocks."""

    between: tuple[str, str]

    @model_validator(mode="after")
    def _two_blocks(self) -> Self:
        refuse_twice(self.between)
        return self


class TieConfig(Model):
    """Two blocks whose coinciding faces are one: their meshes grow together there."""

    between: tuple[str, str]
    tolerance: Tolerance = 1e-3

    @model_validator(mode="after")
    def _two_blocks(self) -> Self:
        refuse_twice(self.between)
        return self


def refuse_twice(between: tuple[str, str]) -> None:
    """Raise if both blocks are the same one.

    Raises
    ------
    ValueError
    """
    if between[0] == between[1]:
        raise ValueError(f"`between` names block {between[0]!r} twice")
