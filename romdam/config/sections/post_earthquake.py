"""The `post_earthquake:` of a configuration: what an earthquake leaves of a dam that is judged after it."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from romdam.config.base import Model
from romdam.config.quantities import Dimensionless


class PostEarthquakeConfig(Model):
    """Static stability after an earthquake, with residual strength, uplift in damaged joints, drains failed.

    `romdam stability` finds the equilibrium under the static loads from what the joints of a result remember.
    """

    changes: dict[str, Any] = Field(default_factory=dict)
    """Dotted path -> value of what the earthquake changed, such as joints.base.friction: 0.6,
    loads.joint_water.0.crack: redrawn, loads.joint_water.0.drains: null."""
    required_factor: Annotated[Dimensionless, Field(gt=0.0)]
    """Least factor of safety against sliding of each joint that is judged."""
    joints: Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    """Joints that are judged, or patterns such as base_*; all that carry shear if not given."""
