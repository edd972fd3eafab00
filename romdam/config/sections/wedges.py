"""A file of rock wedges for `romdam wedges`: planes by dip and dip direction, water, thrust, motion."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from pydantic import Field, Tag, ValidationError, model_validator

from romdam.config.base import Model, by_key, by_shape
from romdam.config.explain import explain
from romdam.config.names import Name
from romdam.config.quantities import Degrees, Density, Dimensionless, Force, Length, Pressure, to_si
from romdam.config.sections.places import Direction, LengthUnit, Vector
from romdam.config.yaml_text import line_of, read_yaml
from romdam.core.arrays import Floats
from romdam.core.csv_table import read_table
from romdam.core.errors import ConfigError

_WATER = 1000.0  # [kg/m3]


Share = Annotated[Dimensionless, Field(ge=0.0, le=1.0)]


class WaterLevelConfig(Model):
    """Water pressure that grows from a level downwards."""

    level: Length
    """Elevation at which the pressure is zero."""
    share: Share = 1.0
    """Share of the hydrostatic pressure that acts, such as 0.67 where drains work."""


class WaterTableConfig(Model):
    """Water pressure that grows from a level downwards, which a table states over time."""

    table: Path
    """CSV file with columns time (s) and level; relative paths start at the file of the wedges. Between its
    rows it is straight, before the first and after the last it stays."""
    unit: LengthUnit
    """Unit of the column level."""
    share: Share = 1.0
    """Share of the hydrostatic pressure that acts."""


class WaterOfJointConfig(Model):
    """The mean pressure of the water in a joint of a result, and in its cracks, at every time."""

    joint: str
    """Name of the joint."""
    share: Share = 1.0
    """Share of that pressure that acts."""


Water = Annotated[
    Annotated[Annotated[Pressure, Field(ge=0.0)], Tag("number")]
    | Annotated[
        Annotated[WaterLevelConfig, Tag("WaterLevelConfig")]
        | Annotated[WaterTableConfig, Tag("WaterTableConfig")]
        | Annotated[WaterOfJointConfig, Tag("WaterOfJointConfig")],
        by_key(
            "one of {level: 80 m}, {table: levels.csv, unit: m} and {joint: base}",
            WaterLevelConfig | WaterTableConfig | WaterOfJointConfig,
        ),
        Tag("mapping"),
    ],
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
    at: Vector | None = None
    """Point on its line of action, which rotation asks for; without one the centroid of the wedge."""
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
        if self.at is not None and self.force is None:
            raise ValueError("`at` is the point of a constant `force`, which is missing")
        return self

    @property
    def needs_result(self) -> bool:
        """True if it is taken out of a result."""
        return bool(self.joints or self.sections)


class MotionOfNodesConfig(Model):
    """The motion at a wedge's place: the mean of output nodes of a result."""

    nodes: Annotated[tuple[str, ...], Field(min_length=1)]
    """Names in `outputs.nodes` of the run, on the rock beside the wedge."""


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
    inertia: Annotated[
        Annotated[bool, Tag("number")] | Annotated[MotionOfNodesConfig, Tag("mapping")],
        by_shape("true, false, or {nodes: [left_bank]}"),
    ] = True
    """What shakes the wedge: the base of the result, nothing (false), or the motion at its place."""


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


def read_levels(wedges: WedgesConfig, folder: Path, source: str) -> dict[str, tuple[Floats, Floats]]:
    """Read the tables of water levels.

    Parameters
    ----------
    folder : where relative paths start
    source : the file of the wedges, for messages

    Returns
    -------
    key of the water, such as wedges.left.planes.base.water -> times [s] and levels [m]

    Raises
    ------
    ConfigError
        for tables that cannot be read, or whose times do not rise.
    """
    levels = dict[str, tuple[Floats, Floats]]()
    for name, wedge in wedges.wedges.items():
        for kind, sides in (("planes", wedge.planes), ("surfaces", wedge.surfaces)):
            for side, surface in sides.items():
                water, key = surface.water, f"wedges.{name}.{kind}.{side}.water"
                if not isinstance(water, WaterTableConfig):
                    continue
                table = read_table(folder / water.table, location=f"{source}: {key}.table")
                columns = table.columns(("time", "level"), f"one time in s and level in {water.unit} a line")
                falls = np.flatnonzero(np.diff(columns["time"]) <= 0.0)
                if len(falls):
                    before, after = columns["time"][falls[0] : falls[0] + 2]
                    raise ConfigError(
                        f"{table.at(int(falls[0]) + 1)}: the time {after:g} s does not rise over "
                        f"{before:g} s before it; sort the rows, and give a jump two times that differ"
                    )
                levels[key] = columns["time"], columns["level"] * to_si(f"1 {water.unit}", "m")
    return levels
