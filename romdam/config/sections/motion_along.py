"""Motion of the supports that follows from their position: a table of stations, or a wave that passes."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, Tag, model_validator

from romdam.config.base import Model, by_shape
from romdam.config.quantities import Dimensionless, Frequency, Length, Time, Velocity, Whole
from romdam.config.sections.motions.records import RecordConfig
from romdam.config.sections.places import Axis, Direction, Vector

_Factor = Annotated[Dimensionless, Field(gt=0.0, le=100.0)]
CUTOFF = 25.0  # Hz: joints and concrete dams answer little above
MOST_STATIONS = 40  # of a wave or a table: each takes three static answers of the mesh


class StationConfig(Model):
    """A place whose motion is known: the record's, `delay` and `factor` of it, or a `record`."""

    at: Annotated[
        Annotated[Length, Tag("number")] | Annotated[Vector, Tag("list")],
        by_shape("a coordinate along `axis` such as 40 m, or a point such as [40 m, 0, 10 m]"),
    ]
    """Coordinate along `axis`, or without one a point."""
    delay: Annotated[Time, Field(ge=0.0, le=100.0)] = 0.0
    """Delay of the station's motion behind the record."""
    factor: Annotated[
        Annotated[_Factor, Tag("number")] | Annotated[tuple[_Factor, _Factor, _Factor], Tag("list")],
        by_shape("a factor such as 1.2, or three of x, y and z"),
    ] = 1.0
    """Factor on the record's motion, of all components or of x, y and z."""
    record: RecordConfig | None = None
    """The station's own motion, as an entry of `records`; it begins with the job's one record."""

    @model_validator(mode="after")
    def _record_alone(self) -> Self:
        if self.record is not None and (self.delay, self.factor) != (0.0, 1.0):
            raise ValueError("give `record`, or `delay` and `factor`; `record.scale` multiplies a record")
        return self


class IncoherenceConfig(Model):
    """Loss of coherency with distance along `axis`: exp(-(alpha omega d / shear_velocity)^2)."""

    alpha: Annotated[Dimensionless, Field(ge=0.0, le=2.0)] = 0.2
    """Incoherence parameter of Luco and Wong, 0.1 to 0.5; 0 keeps the motion coherent."""
    shear_velocity: Annotated[Velocity, Field(gt=0.0)]
    """Velocity of shear waves in the rock."""
    seed: Annotated[Whole, Field(ge=0, le=2**31 - 1)] = 0
    """Number that the random motions follow from; another makes another realisation."""


class MotionAlongConfig(Model):
    """Motion of all supports by their position: `stations`, or `velocity` and `incoherence` along `axis`."""

    axis: (
        Annotated[
            Annotated[Axis, Tag("number")] | Annotated[Direction, Tag("list")],
            by_shape("x, y or z, or a direction such as [1, 0.5, 0]"),
        ]
        | None
    ) = None
    """Direction along which positions count; of a wave that which it travels in. Stations without it are
    points of a line from the first to the last."""
    stations: tuple[StationConfig, ...] = ()
    """Places whose motion is known, in their order along the line; it is linear between them."""
    beyond: Literal["refuse", "hold"] = "refuse"
    """Supports beyond the first and the last station: refused, or moved as that station."""
    velocity: Annotated[Velocity, Field(gt=0.0)] | None = None
    """Apparent velocity of the wave along `axis`."""
    start: Length | None = None
    """Coordinate along `axis` where the motion is the record; where the wave meets the first support if not
    given."""
    incoherence: IncoherenceConfig | None = None
    cutoff: Annotated[Frequency, Field(gt=0.0)] = CUTOFF
    """Frequency up to which the motion between the stations of a wave is within 1 %."""

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        wave = self.velocity is not None or self.incoherence is not None
        if wave == bool(self.stations):
            raise ValueError("give `stations`, or `axis` with `velocity`, `incoherence` or both")
        if wave and self.axis is None:
            raise ValueError("`axis` is missing, along which the wave travels; give x, or a direction")
        if wave and self.beyond != "refuse":
            raise ValueError("`beyond` is of `stations`, and a wave is known everywhere; leave it out")
        if isinstance(self.axis, tuple) and not any(self.axis):
            raise ValueError("axis: [0, 0, 0] has no direction; give x, or a direction")
        if self.stations:
            self._refuse_wrong_stations()
        return self

    def _refuse_wrong_stations(self) -> None:
        if self.start is not None or self.cutoff != CUTOFF:
            extra = "cutoff" if self.start is None else "start"
            raise ValueError(f"`{extra}` is of a wave, and `stations` are a table; leave it out")
        if not 2 <= len(self.stations) <= MOST_STATIONS:
            raise ValueError(f"stations: must be 2 to {MOST_STATIONS}, got {len(self.stations)}")
        for k, station in enumerate(self.stations):
            if isinstance(station.at, tuple) == (self.axis is not None):
                wanted = (
                    "a point, as there is no `axis`" if self.axis is None else "a coordinate along `axis`"
                )
                raise ValueError(f"stations[{k}].at: must be {wanted}")
            before = self.stations[k - 1].at if k else None
            if isinstance(station.at, float) and isinstance(before, float) and station.at <= before:
                raise ValueError(
                    f"stations[{k}].at: must rise, got {station.at:g} m after {before:g} m; sort the stations"
                )
            if isinstance(station.at, tuple) and station.at == before:
                raise ValueError(f"stations[{k}].at: is the point of the station before; leave one out")
