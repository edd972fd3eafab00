"""A file of rock wedges for `romdam wedges`: planes by dip and dip direction, water, thrust of the dam."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Self

from pydantic import Field, Tag, ValidationError, model_validator

from romdam.config.base import Model, by_shape
from romdam.config.explain import explain
from romdam.config.names import Name
from romdam.config.quantities import Degrees, Density, Dimensionless, Force, Length, Pressure
from romdam.config.sections.places import Direction, Vector
from romdam.config.yaml_text import line_of, read_yaml
from romdam.core.errors import ConfigError

_WATER = 1000.0  # [kg/m3]


class WaterLevelConfig(Model):
    """Water pressure that grows from a level downwards."""

    level: Length
    """Elevation at which the pressure is zero."""
    share: Annotated[Dimensionless, Field(ge=0.0, le=1.0)] = 1.0
    """Share of the hydrostatic pressure that acts, such as 0.67 where drains work."""


Water = Annotated[
    Annotated[Annotated[Pressure, Field(ge=0.0)], Tag("number")]
    | Annotated[WaterLevelConfig, Tag("mapping")],
    by_shape("a mean pressure such as 0.2 MPa, or {level: 80 m}"),
]


class WedgeSurfaceConfig(Model):
    """A plane that bounds a wedge."""

    dip: Annotated[Degrees, Field(ge=0.0, le=90.0)]
    """Angle of the plane below the horizontal."""
    dip_direction: Annotated[Degrees, Field(ge=-360.0, le=360.0)] = 0.0
    """Azimuth in which it dips, clockwise from north."""
    through: Vector
    """A point of the plane."""
    water: Water | None = None
    """Water that presses on the plane, into the wedge."""


class WedgePlaneConfig(WedgeSurfaceConfig):
    """A discontinuity on which a wedge can slide, and its strength."""

    friction: Annotated[Dimensionless, Field(ge=0.0, le=5.0)] = 0.0
    """Coefficient of friction, tan phi."""
    cohesion: Annotated[Pressure, Field(ge=0.0)] = 0.0
    """Cohesion over the whole plane, while it is in contact."""


class ThrustConfig(Model):
    """What presses on a wedge besides its weight and water: a force, and forces out of a result."""

    force: tuple[Force, Force, Force] | None = None
    """Constant force."""
    joints: Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    """Joints whose forces act on `on`, shear and water in the joints included."""
    on: str | None = None
    """The block of these joints that the wedge is part of."""
    sections: Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    """Sections (`outputs.stress.sections`) whose forces act on it; normals point away from the wedge."""

    @model_validator(mode="after")
    def _on_a_block(self) -> Self:
        if (self.joints is None) != (self.on is None):
            raise ValueError("`joints` and `on` belong together; on: the block that the wedge is part of")
        return self

    @property
    def needs_result(self) -> bool:
        """True if it is taken out of a result."""
        return bool(self.joints or self.sections)


class WedgeConfig(Model):
    """A rigid block of rock between planes that can slide and surfaces that are free."""

    inside: Vector
    """A point in the wedge: it tells on which side of its planes the wedge is."""
    planes: Annotated[dict[Name, WedgePlaneConfig], Field(min_length=1, max_length=3)]
    """Discontinuities by name, one to three."""
    surfaces: Annotated[dict[Name, WedgeSurfaceConfig], Field(min_length=1)]
    """Free surfaces by name: the ground, a cut, a joint without strength such as a crack behind the wedge."""
    density: Annotated[Density, Field(gt=0.0)]
    """Density of the rock."""
    thrust: ThrustConfig = ThrustConfig()
    inertia: bool = True
    """Whether the wedge is shaken by the ground acceleration of the result."""


class WedgesConfig(Model):
    """Rock wedges, with what they have in common."""

    north: Direction = (0.0, 1.0, 0.0)
    """Direction of north in the model, horizontal; dip directions count from it."""
    gravity: Annotated[float, Field(gt=0.0)] = 9.81
    """Along -z, m/s2."""
    water_density: Annotated[Density, Field(gt=0.0)] = _WATER
    wedges: Annotated[dict[Name, WedgeConfig], Field(min_length=1)]

    @model_validator(mode="after")
    def _north_is_level(self) -> Self:
        x, y, z = self.north
        if z != 0.0 or (x, y) == (0.0, 0.0):
            raise ValueError(
                f"`north` must be horizontal and not zero, got {list(self.north)}; give [0, 1, 0]"
            )
        return self


def read_wedges(path: Path) -> WedgesConfig:
    """Read a file of wedges.

    Raises
    ------
    ConfigError
        for a file that cannot be read, and for unknown, missing or wrong keys, with their lines.
    """
    raw = read_yaml(path)
    if not isinstance(raw, dict):
        raise ConfigError(f"{path}: expected a mapping of keys at the top level, such as `wedges:`")
    try:
        return WedgesConfig.model_validate(raw)
    except ValidationError as error:
        raise ConfigError(explain(error, str(path), WedgesConfig, partial(line_of, path))) from None
