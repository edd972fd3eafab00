"""Places of a scene that a configuration names: axes, faces, nodes."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, Tag

from romdam.config.base import Model, by_shape
from romdam.config.quantities import Dimensionless, Length

Axis = Literal["x", "y", "z"]
ElementName = Literal["hex8", "hex20", "hex27", "tet4", "tet10"]  # see romdam.scene.elements
Vector = tuple[Length, Length, Length]
Direction = tuple[Dimensionless, Dimensionless, Dimensionless]
Tolerance = Annotated[Length, Field(gt=0.0, le=10.0)]


class PlaneRef(Model):
    """All boundary facets of a block in the plane `axis` = `at`."""

    axis: Axis
    at: Length
    tolerance: Tolerance = 1e-6
    """Distance from the plane that counts as on it."""


FaceRef = Annotated[
    Annotated[str, Tag("number")] | Annotated[PlaneRef, Tag("mapping")],
    by_shape("the name of a face, or a plane such as {axis: z, at: 0 m}"),
]


class BlockFace(Model):
    """A face of a block."""

    block: str
    """A name of `blocks`."""
    face: FaceRef


class NodeConfig(Model):
    """A node whose motion is written, found by its position."""

    block: str
    """A name of `blocks`."""
    at: Vector
    """Position of the node."""
    tolerance: Tolerance = 1e-3
    """How far the nearest node may be."""
