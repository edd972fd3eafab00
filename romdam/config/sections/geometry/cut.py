"""One mesh that becomes several blocks: what stands in the configuration for its cuts."""

from __future__ import annotations

from collections.abc import Collection
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, field_validator, model_validator

from romdam.config.base import Model
from romdam.config.names import Name
from romdam.config.quantities import Dimensionless, Length, Whole
from romdam.config.sections.joints import JointProperties
from romdam.config.sections.places import Direction, LengthUnit, Vector
from romdam.core.errors import listed


def _some_direction(value: Direction) -> Direction:
    if not any(value):
        raise ValueError("must not be zero; give a direction such as [0, 1, 0]")
    return value


class PlaneConfig(Model):
    """A plane; its positive side is that to which `normal` points."""

    point: Vector
    """Any point of it."""
    normal: Direction
    """Normal vector of the plane, of any length."""

    _direction = field_validator("normal")(_some_direction)


class CylinderConfig(Model):
    """A cylinder; its positive side is outside of it."""

    point: Vector
    """Any point of its axis."""
    axis: Direction = (0.0, 0.0, 1.0)
    """Direction of its axis; vertical if not given."""
    radius: Annotated[Length, Field(gt=0.0)]
    """Distance of the surface from the axis."""

    _direction = field_validator("axis")(_some_direction)


class SurfaceFileConfig(Model):
    """A triangulated surface; its positive side is that from which its triangles run counterclockwise.

    It must reach through the block. Quadrilaterals are cut into two triangles.
    """

    file: Path
    """STL, or the facets of a mesh file, of any format that `blocks.<name>.mesh.file` has."""
    group: str | Whole | None = None
    """Physical group (or its number) of the facets; all of them if not given."""
    unit: LengthUnit = "m"
    """Unit of the coordinates."""


class CutSurfaceConfig(Model):
    """Exactly one of a plane, a cylinder and the surface of a file."""

    plane: PlaneConfig | None = None
    cylinder: CylinderConfig | None = None
    surface: SurfaceFileConfig | None = None

    @model_validator(mode="after")
    def _one_surface(self) -> Self:
        if sum(surface is not None for surface in (self.plane, self.cylinder, self.surface)) != 1:
            raise ValueError("give exactly one of `plane`, `cylinder` and `surface`")
        return self


class CutConfig(Model):
    """Surfaces that cut a block, or a block that another cut makes, into blocks.

    The first name of `into` is what lies on the negative side of the first surface, the second what of the
    rest lies on the negative side of the second, and so on; the last one is what then remains. Materials,
    mass, weight and named faces are those of the block that is cut.
    """

    along: Annotated[tuple[CutSurfaceConfig, ...], Field(min_length=1, max_length=99)]
    """Surfaces, in the order of the blocks."""
    into: tuple[Name, ...]
    """Names of the blocks, one more than surfaces."""
    through: Literal["faces", "elements"] = "faces"
    """Way of the cut: along faces of elements that are there, or through elements, which are cut in two."""
    teeth: Annotated[Dimensionless, Field(gt=0.0, le=0.5)] = 0.05
    """Largest distance of a joint's faces from the surface, as a share of their edges; nearer nodes are moved
    onto it."""
    joints: JointProperties | None = None
    """A joint A-B between each two neighbours A, B in `into`; if not given, joints stand in `joints`."""

    @model_validator(mode="after")
    def _a_name_for_each_block(self) -> Self:
        surfaces, names = len(self.along), len(self.into)
        if names != surfaces + 1:
            raise ValueError(
                f"`into` names {names} blocks, and `along` has {surfaces} surface{'s' * (surfaces > 1)}, "
                f"which make {surfaces + 1}; give one name more than surfaces, from the negative side of the "
                "first one on"
            )
        return self

    @property
    def joint_pairs(self) -> dict[str, tuple[str, str]]:
        """Names of the joints it makes, and the blocks that they part."""
        return {f"{a}-{b}": (a, b) for a, b in pairwise(self.into)} if self.joints is not None else {}


def refuse_wrong_cuts(cuts: dict[str, CutConfig], blocks: Collection[str], others: Collection[str]) -> None:
    """Raise if a cut is of no block, a name is taken, or a joint is of a block that is cut again.

    Parameters
    ----------
    blocks, others : names of the blocks that can be cut, and of those that cannot

    Raises
    ------
    ValueError
    """
    taken, joints = {*blocks, *others}, set[str]()
    for key, cut in cuts.items():
        for name in cut.into:
            if name in taken:
                raise ValueError(f"cut.{key}.into: there is a block {name!r} already; rename one of the two")
            taken.add(name)
        again = [name for pair in cut.joint_pairs.values() for name in pair if name in cuts]
        if again:
            raise ValueError(
                f"cut.{key}.joints: block {again[0]!r} is cut again, so that no joint can have it; leave "
                "`joints` out here, and write those between the blocks that are made into `joints`"
            )
        if len(cut.joint_pairs.keys() - joints) < (len(cut.into) - 1) * (cut.joints is not None):
            raise ValueError(f"cut.{key}.into: two joints get the same name; rename a block that holds a -")
        joints |= cut.joint_pairs.keys()
    known = [name for block in blocks for name in _every_name(block, cuts)]
    for key in cuts:
        if key not in known:
            what = "is made by arch_dam, which cuts it itself" if key in others else "is not defined"
            raise ValueError(f"cut.{key}: block {key!r} {what}; blocks to be cut are {listed(known)}")


def _every_name(name: str, cuts: dict[str, CutConfig]) -> list[str]:
    """A block and all blocks that cuts make of it, those cut again among them."""
    inner = cuts[name].into if name in cuts else ()
    return [name, *(piece_name for piece in inner for piece_name in _every_name(piece, cuts))]


def pieces_of(name: str, cuts: dict[str, CutConfig]) -> tuple[str, ...]:
    """The blocks that a block becomes; itself where nothing cuts it."""
    return tuple(piece for piece in _every_name(name, cuts) if piece not in cuts)
