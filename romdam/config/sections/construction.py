"""The `construction:` of a configuration: how the dam was built before its loads act together."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from romdam.config.base import Model
from romdam.config.names import Name
from romdam.config.quantities import Length
from romdam.config.sections.loads import TemperatureConfig


class GroutConfig(Model):
    """Joints that are grouted, over their whole height or between two elevations (z)."""

    joints: Annotated[tuple[str, ...], Field(min_length=1)]
    """Names of joints, or patterns such as contraction_*."""
    above: Length | None = None
    """Elevation of the zone's lower end, which belongs to it."""
    below: Length | None = None
    """Elevation of the zone's upper end, which belongs to the zone above."""

    @model_validator(mode="after")
    def _upright(self) -> Self:
        if self.above is not None and self.below is not None and self.above >= self.below:
            raise ValueError(
                f"`above` must be lower than `below`, got {self.above:g} m and {self.below:g} m; swap them"
            )
        return self


class ConstructionStageConfig(Model):
    """A stage of construction.

    Blocks are poured and temperatures and still water come to act; then joints are grouted in the state in
    which this leaves them.
    """

    name: Name
    """Name of the stage, in results."""
    pour: tuple[str, ...] = ()
    """Blocks whose weight and stiffness begin; those that no stage pours are there before."""
    temperature: tuple[TemperatureConfig, ...] = ()
    """Changes of temperature as in `loads`, until another stage or `loads.temperature` changes them."""
    level: Length | None = None
    """Level of the still water of `loads.hydrostatic`, each at most at its own level there."""
    grout: tuple[GroutConfig, ...] = ()
    """Joints that are grouted; before that they carry compression only."""

    @model_validator(mode="after")
    def _does_something(self) -> Self:
        if not (self.pour or self.temperature or self.grout) and self.level is None:
            raise ValueError("does nothing; give `pour`, `temperature`, `level` or `grout`")
        return self
