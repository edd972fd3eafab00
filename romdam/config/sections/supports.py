"""Supports, and motions of their own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Self

from pydantic import Field, model_validator

from romdam.config.base import Model
from romdam.config.quantities import Dimensionless, Time
from romdam.config.sections.motion_along import MotionAlongConfig
from romdam.config.sections.motions.records import RecordConfig
from romdam.config.sections.places import Axis, FaceRef
from romdam.config.sections.transient import TransientConfig


class SupportMotionConfig(Model):
    """Motion of a support that does not move as the base does: `delay` and `factor`, or a `record`."""

    delay: Annotated[Time, Field(ge=0.0, le=100.0)] = 0.0
    """Delay of the support's motion behind the record, which is the motion that arrives first."""
    factor: Annotated[Dimensionless, Field(gt=0.0, le=100.0)] = 1.0
    """Factor on each record's motion, all components."""
    record: RecordConfig | None = None
    """The support's own motion, as an entry of `records`; it begins with the job's one record."""

    @model_validator(mode="after")
    def _says_something(self) -> Self:
        if self.record is None and self.delay == 0.0 and self.factor == 1.0:
            raise ValueError(
                "give `delay` above 0 s, a `factor` that is not 1, or a `record`; or leave it out"
            )
        if self.record is not None and (self.delay, self.factor) != (0.0, 1.0):
            raise ValueError("give `record`, or `delay` and `factor`; `record.scale` multiplies a record")
        return self


class SupportConfig(Model):
    """Components held on a face of a block: at zero relative displacement, or moved by a `motion`."""

    block: str
    """A name of `blocks`, or a pattern such as `dam.*` for all that have the face."""
    face: FaceRef
    """Name of a face of the block, or a plane."""
    fix: Annotated[tuple[Axis, ...], Field(min_length=1)] = ("x", "y", "z")
    """Components that do not move against the base."""
    motion: SupportMotionConfig | None = None
    """Motion of these components, where it is not the base's; displacement is the records' integrated
    twice."""


def refuse_wrong_motions(
    supports: Sequence[SupportConfig],
    along: MotionAlongConfig | None,
    transient: TransientConfig,
    several: bool,
) -> None:
    """Raise where supports of their own motion meet an integrator that knows one motion of the base only.

    Parameters
    ----------
    along : motion by position, of all supports
    several : whether there is more than one entry of records, or a suite

    Raises
    ------
    ValueError
    """
    has_record = {
        f"supports[{i}].motion": support.motion.record is not None
        for i, support in enumerate(supports)
        if support.motion is not None
    }
    if along is not None:
        has_record |= {"ground.along": False}
        has_record |= {
            f"ground.along.stations[{k}]": station.record is not None
            for k, station in enumerate(along.stations)
        }
    for key, with_record in has_record.items():
        if transient.integrator == "conserving":
            raise ValueError(
                f"{key}: transient.integrator: conserving knows one motion of the base; take adaptive, "
                "modal or generalized_alpha"
            )
        if with_record and several:
            raise ValueError(
                f"{key}.record: goes with one record, and there are several entries of `records`, or a "
                "suite; give one and pipeline: run, or `delay` and `factor`"
            )
