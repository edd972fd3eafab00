"""Places of a scene that a configuration names: axes, faces, nodes."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, Tag

from romdam.config.base import Model, by_shape
from romdam.config.quantities import Dimensionless, Length, to_si
from romdam.core.errors import quote

Axis = Literal["x", "y", "z"]
GridElement = Literal["hex8", "hex20", "hex27", "tet4", "tet10"]
ElementName = Literal[
    GridElement, "wedge6", "wedge15", "pyramid5", "pyramid13"
]  # see romdam.geometry.elements
Vector = tuple[Length, Length, Length]
Direction = tuple[Dimensionless, Dimensionless, Dimensionless]
Tolerance = Annotated[Length, Field(gt=0.0, le=10.0)]


def _length_unit(value: str) -> str:
    if to_si(f"1 {value}", "m") <= 0.0:
        raise ValueError(f"one unit must be more than 0 m, got {quote(value)}")
    return value


LengthUnit = Annotated[str, AfterValidator(_length_unit)]


class PlaneRef(Model):
    """All boundary facets of a block in the plane `axis` = `at`."""

    axis: Axis
    """Axis that the plane is normal to."""
    at: Length
    """Coordinate of the plane along that axis."""
    tolerance: Tolerance = 1e-6
    """Distance from the plane that counts as on it."""


FaceRef = Annotated[
    Annotated[str, Tag("number")] | Annotated[PlaneRef, Tag("mapping")],
    by_shape("the name of a face, or a plane such as {axis: z, at: 0 m}"),
]


class BlockFace(Model):
    """A face of a block."""

    block: str
    """A name of `blocks`, or a pattern such as `dam.*` for all that have the face."""
    face: FaceRef
    """Name of a face of the block, or a plane."""


class NodeConfig(Model):
    """A node whose motion is written, found by its position."""

    block: str
    """A name of `blocks`."""
    at: Vector
    """Position of the node."""
    tolerance: Tolerance = 1e-3
    """Distance up to which the nearest node counts."""
