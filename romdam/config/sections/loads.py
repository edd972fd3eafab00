"""The `loads:` of a configuration: what acts before and during the shaking."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, Tag, field_validator, model_validator

from romdam.config.base import Model, by_shape
from romdam.config.quantities import (
    Acceleration,
    Density,
    Diffusivity,
    Dimensionless,
    Force,
    ForcePerLength,
    Length,
    Pressure,
    Temperature,
    TemperatureChange,
    TemperatureUnit,
    Time,
    Whole,
    to_si,
)
from romdam.config.sections.joint_water import JointWaterConfig
from romdam.config.sections.places import BlockFace, Direction, FaceRef, LengthUnit, Tolerance, Vector
from romdam.core.errors import quote

Positive = Field(gt=0.0)


class PressureConfig(Model):
    """Pressure on a face, positive into the block."""

    block: str
    """A name of `blocks`, or a pattern such as `dam.*` for all that have the face."""
    face: FaceRef
    """Name of a face of the block, or a plane."""
    value: Pressure
    """Pressure, positive into the block."""


class ForceConfig(Model):
    """A force on the node nearest to a point."""

    block: str
    """A name of `blocks`."""
    at: Vector
    """Position of the node."""
    force: tuple[Force, Force, Force]
    """Force along x, y and z."""
    tolerance: Tolerance = 1e-3
    """Distance up to which the nearest node counts."""


def _force_unit(value: str) -> str:
    for unit in ("N", "Pa"):
        try:
            size = to_si(f"1 {value}", unit)
        except ValueError:
            continue
        if size > 0.0:
            return value
    raise ValueError(f"must be a unit of force such as kN, or of pressure such as kPa, got {quote(value)}")


ForceUnit = Annotated[str, AfterValidator(_force_unit)]


class ForceHistoryConfig(Model):
    """A force on a node or a face that varies in time, by a table; it acts with each record.

    On the node nearest to `at` along `direction`; on a `face` along `direction` evenly over its area, or
    without a direction as a pressure into the block. Between its rows it is straight, and before the first
    it is zero. The scale of a record, or of a suite, leaves it as it is.
    """

    table: Path
    """CSV file with columns time (s) and force."""
    unit: ForceUnit
    """Unit of the column force: of a force, or of a pressure on a face without direction."""
    block: str
    """A name of `blocks`."""
    at: Vector | None = None
    """Position of the node."""
    tolerance: Tolerance = 1e-3
    """Distance up to which the nearest node counts."""
    face: FaceRef | None = None
    """Name of a face of the block, or a plane."""
    direction: Direction | None = None
    """Direction of the force; its length does not count."""
    start: Annotated[Time, Field(ge=0.0)] = 0.0
    """Time of the record at which the table's zero is."""
    scale: Dimensionless = 1.0
    """Factor on the force."""
    after: Literal["zero", "hold"] = "zero"
    """Force after the table's last row: none, or its value."""

    @model_validator(mode="after")
    def _one_place(self) -> Self:
        if (self.at is None) == (self.face is None):
            raise ValueError("give exactly one of `at`, a node, and `face`")
        if self.at is not None and self.direction is None:
            raise ValueError("`direction` of the force at a node is missing, such as [0, 1, 0]")
        if self.direction is not None and not any(self.direction):
            raise ValueError("`direction` must not be zero, got [0, 0, 0]")
        wanted = "Pa" if self.direction is None else "N"
        try:
            to_si(f"1 {self.unit}", wanted)
        except ValueError:
            said = "pressure, as the face has no `direction`" if wanted == "Pa" else "force"
            raise ValueError(f"`unit` must be one of {said}, got {quote(self.unit)}") from None
        return self


class HydrostaticConfig(Model):
    """Pressure rho g (level - z) of still water below `level`; g is vertical gravity, else 9.81 m/s2."""

    level: Length
    """Elevation of the water, along z."""
    faces: Annotated[tuple[BlockFace, ...], Field(min_length=1)]
    density: Annotated[Density, Positive] = 1000.0
    """Density of the water."""


class IceConfig(Model):
    """Thrust of a sheet of ice on faces, horizontal and into the blocks, evenly over its thickness."""

    level: Length
    """Elevation of the top of the ice."""
    thickness: Annotated[Length, Positive]
    """Thickness of the ice, below the level."""
    thrust: Annotated[ForcePerLength, Positive]
    """Horizontal force for each metre of the face's length."""
    faces: Annotated[tuple[BlockFace, ...], Field(min_length=1)]


class SiltConfig(Model):
    """Weight and horizontal pressure of silt that lies before faces; the pressure of its water comes apart.

    On a face with outward normal n the traction is -gamma d (K n_x, K n_y, n_z), with d the depth below the
    level and gamma the weight under water, density times vertical gravity.
    """

    level: Length
    """Elevation of the top of the silt."""
    density: Annotated[Density, Positive]
    """Density under water: of the saturated silt less that of water, such as 900 kg/m3."""
    pressure_ratio: Annotated[Dimensionless, Field(gt=0.0, le=2.0)]
    """Horizontal over vertical pressure K; at rest 1 - sin of the friction angle."""
    faces: Annotated[tuple[BlockFace, ...], Field(min_length=1)]


class LineLoadConfig(Model):
    """A force spread evenly over a straight line in or on a block, such as the weight of a bridge."""

    block: str
    """A name of `blocks`."""
    start: Vector
    """One end of the line."""
    end: Vector
    """The other end."""
    force: tuple[ForcePerLength, ForcePerLength, ForcePerLength]
    """Force along x, y and z for each metre of the line."""
    tolerance: Tolerance = 0.05
    """Distance up to which the line may lie outside the block's elements, as on a curved face."""

    @model_validator(mode="after")
    def _has_length(self) -> Self:
        if self.start == self.end:
            raise ValueError("`start` and `end` are one point; name both ends, or take loads.force")
        if not any(self.force):
            raise ValueError("`force` must not be zero, got [0, 0, 0]")
        return self


class FaceTemperaturesConfig(Model):
    """Temperatures of the upstream and the downstream face by elevation, and by month if need be.

    A node stands between the two where the horizontal plane through it cuts them: `linear` between the
    temperatures of the month at its elevation; or as heat is conducted through a slab of the thickness there
    whose faces have the temperatures of twelve months, year after year: `equivalent` has the mean and the
    linear part of that over the thickness (Stucky and Derron), `harmonic` all of it.
    """

    table: Path
    """CSV file with columns elevation, upstream, downstream and, if need be, month (1 to 12)."""
    unit: TemperatureUnit
    """Unit of the temperatures."""
    length: LengthUnit = "m"
    """Unit of the elevations."""
    upstream: FaceRef = "upstream"
    """Upstream face of each of the blocks: its name, or a plane."""
    downstream: FaceRef = "downstream"
    """Downstream face of each of the blocks: its name, or a plane."""
    through: Literal["linear", "equivalent", "harmonic"] = "linear"
    """Temperature through the thickness: straight between the faces, the equivalent mean and linear part of
    conduction of heat, or conduction of heat itself."""
    diffusivity: Annotated[Diffusivity, Positive] | None = None
    """Thermal diffusivity of `equivalent` and `harmonic`; concrete has about 1e-6 m2/s."""

    @model_validator(mode="after")
    def _diffusing(self) -> Self:
        if (self.through != "linear") != (self.diffusivity is not None):
            raise ValueError(
                "`diffusivity` belongs to `through: equivalent` and `through: harmonic`, which need it; "
                "concrete has about 1e-6 m2/s"
            )
        return self


class PointTemperaturesConfig(Model):
    """Temperatures of scattered points; between them linear in the tetrahedra that the points span."""

    table: Path
    """CSV file with columns x, y, z, temperature and, if need be, month (1 to 12)."""
    unit: TemperatureUnit
    """Unit of the temperatures."""
    length: LengthUnit = "m"
    """Unit of the coordinates."""
    tolerance: Tolerance = 1e-3
    """Distance up to which a node outside of all tetrahedra has the temperature of the nearest point."""


class NodeTemperaturesConfig(Model):
    """Temperatures of the nodes of a mesh file, by their numbers there."""

    table: Path
    """CSV file with columns node, temperature and, if need be, month (1 to 12)."""
    unit: TemperatureUnit
    """Unit of the temperatures."""


class TemperatureConfig(Model):
    """A change of temperature of blocks (all those whose material expands, if not named).

    It is the same everywhere (`change`), or that of a table less `reference`, at which the joints closed.
    """

    change: Annotated[TemperatureChange, Field(ge=-300.0, le=1500.0)] | None = None
    """Change from the temperature without stress; negative cools."""
    faces: FaceTemperaturesConfig | None = None
    points: PointTemperaturesConfig | None = None
    nodes: NodeTemperaturesConfig | None = None
    month: Annotated[Whole, Field(ge=1, le=12)] | None = None
    """Month of a table that has several, from 1 for January."""
    reference: (
        Annotated[
            Annotated[Temperature, Tag("number")] | Annotated[dict[str, Temperature], Tag("mapping")],
            by_shape("a temperature such as 8 degC, or one for each block: {C1: 8 degC, C2: 7 degC}"),
        ]
        | None
    ) = None
    """Temperature without stress, that of the blocks when their joints were grouted; one, or one for each
    block."""
    blocks: Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    """Names of `blocks`, or patterns of them."""

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        keys = ("change", "faces", "points", "nodes")
        if sum(getattr(self, key) is not None for key in keys) != 1:
            raise ValueError("give exactly one of `change`, `faces`, `points` and `nodes`")
        if self.change is not None:
            for key in ("month", "reference"):
                if getattr(self, key) is not None:
                    raise ValueError(
                        f"`{key}` belongs to a table, and `change` is a difference; leave it out"
                    )
        elif self.reference is None:
            raise ValueError(
                "`reference` is missing: the temperature at which the joints closed, such as 8 degC"
            )
        if isinstance(self.reference, dict):
            if self.blocks is None:
                raise ValueError("`reference` of each block needs `blocks`, their names")
            if lacking := [name for name in self.blocks if name not in self.reference]:
                raise ValueError(f"`reference` has no temperature of block {quote(lacking[0])}; give it")
            if spare := [name for name in self.reference if name not in self.blocks]:
                raise ValueError(
                    f"`reference` names {quote(spare[0])}, which is none of `blocks`; take it out"
                )
        return self

    def reference_of(self, block: str) -> float:
        """Temperature without stress of a block [degC], of a load by a table."""
        reference = self.reference[block] if isinstance(self.reference, dict) else self.reference
        assert reference is not None  # of tables it is required
        return reference


class InitialStateConfig(Model):
    """State in which another run ended, from its result file."""

    result: Path
    """Result file of that run."""
    take: Literal["all", "joints"] = "all"
    """All of the state, in the same model, so that the run goes on as if both records were one; or what the
    joints remember (slip, lost bonds, water), at rest under the static loads of this job."""


class LoadsConfig(Model):
    """Static loads; `gravity` is the acceleration that makes weight, for example [0, 0, -9.81].

    `weight` acts before the joints are grouted (`staged`: they carry none of it) or on the finished dam.
    """

    gravity: tuple[Acceleration, Acceleration, Acceleration] | None = None
    """Acceleration that makes weight, for example [0, 0, -9.81]."""
    weight: Literal["monolithic", "staged"] = "monolithic"
    """Structure that weight acts on: the finished dam, or the blocks before the joints are grouted (staged:
    joints carry none of it)."""
    hydrostatic: tuple[HydrostaticConfig, ...] = ()
    ice: tuple[IceConfig, ...] = ()
    silt: tuple[SiltConfig, ...] = ()
    line: tuple[LineLoadConfig, ...] = ()
    temperature: tuple[TemperatureConfig, ...] = ()
    pressure: tuple[PressureConfig, ...] = ()
    force: tuple[ForceConfig, ...] = ()
    force_history: tuple[ForceHistoryConfig, ...] = ()
    joint_water: tuple[JointWaterConfig, ...] = ()
    order: Annotated[
        Annotated[tuple[Literal["weight", "forces", "water", "temperature"], ...], Tag("list")]
        | Annotated[Literal["together"], Tag("word")],
        by_shape("an order such as [weight, forces, water, temperature], or together", "together"),
    ] = ("weight", "forces", "water", "temperature")
    """Order in which these loads are applied to the state at rest, on which slip and cracks depend; each is
    named once (forces: pressure, force, ice, silt and line; water: hydrostatic and joint_water), or all come
    together. Stages of construction and grouting come before them."""
    initial_state: Annotated[
        Annotated[Literal["static", "undeformed"], Tag("word")]
        | Annotated[InitialStateConfig, Tag("mapping")],
        by_shape("static, undeformed or {result: mainshock.nc}", "static", "undeformed"),
    ] = "static"
    """State that a run starts from: equilibrium of the static loads, no displacement at all, or the state in
    which another run ended."""

    @field_validator("order")
    @classmethod
    def _each_once(cls, order: tuple[str, ...] | str) -> tuple[str, ...] | str:
        if isinstance(order, str):
            return order
        kinds = ("weight", "forces", "water", "temperature")
        if sorted(order) != sorted(kinds):
            raise ValueError(f"name each of {', '.join(kinds)} once, got {quote(list(order))}")
        return order

    @model_validator(mode="after")
    def _wet_once(self) -> Self:
        seen: dict[str, int] = {}
        for k, water in enumerate(self.joint_water):
            for name in water.joints:
                if seen.setdefault(name, k) != k or water.joints.count(name) > 1:
                    raise ValueError(
                        f"joint_water[{k}].joints: joint {quote(name)} stands in joint_water[{seen[name]}] "
                        "already; name it once"
                    )
            if water.needs_rest and self.initial_state == "undeformed":
                key = (
                    f"crack: {water.crack}" if water.crack == "redrawn" else f"earthquake: {water.earthquake}"
                )
                raise ValueError(
                    f"joint_water[{k}].{key} follows the crack at rest, and initial_state: undeformed starts "
                    "without rest; set static, or leave the key out"
                )
        return self

    @property
    def begins(self) -> Literal["static", "undeformed"]:
        """How the joints and blocks are at the start, of a run that does not go on from another's end."""
        return self.initial_state if isinstance(self.initial_state, str) else "static"

    @property
    def gravity_of_water(self) -> float:
        """Gravity that water weighs with: the vertical part, 9.81 where there is none [m/s2].

        Gravity of zero leaves out the weight of the blocks, where another analysis has it; water that is
        named by its level presses all the same.
        """
        return (0.0 if self.gravity is None else abs(self.gravity[2])) or 9.81
