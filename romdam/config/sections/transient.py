"""The `transient:` part of a configuration: the integrator, and its step or the accuracy that picks it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Self

from pydantic import Field, GetCoreSchemaHandler, GetJsonSchemaHandler, Tag, model_validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from romdam.config.base import Model, by_shape
from romdam.config.quantities import Dimensionless, Time
from romdam.core.errors import listed, quote
from romdam.core.integrators import INTEGRATORS

Positive = Field(gt=0.0)


@dataclass(frozen=True)
class _Named:
    """A name of those that there are when it is read: a user's own integrator is one of them."""

    names: Callable[[], list[str]]

    def check(self, name: str) -> str:
        if name not in self.names():
            raise ValueError(f"must be one of {listed(self.names())}, got {quote(name)}")
        return name

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_after_validator_function(self.check, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return {**handler(schema), "enum": self.names()}


IntegratorName = Annotated[str, _Named(lambda: list(INTEGRATORS))]
ModalName = Annotated[str, _Named(lambda: [name for name, entry in INTEGRATORS.items() if entry.uncoupled])]


MOST_ACCURACY = 0.2  # relative error of steps or modes: with more, openings say nothing
MESH_SHARE = (
    0.8  # of a total error, for the mesh, which costs most to refine; modes and steps have what is left
)
REST_SHARE = 0.2  # for modes and for steps each, while the mesh is chosen


class TotalAccuracy(Model):
    """Accuracy of a run against a mesh without end: that of the mesh, of the modes and of the steps, added.

    The mesh is chosen for it on the strongest record: as given, coarser, of quadratic elements, or finer.
    """

    total: Annotated[Dimensionless, Field(ge=1e-3, le=0.5)]
    """Relative error in L2 that mesh, modes and steps together may leave."""
    of: Literal["opening"] = "opening"
    """Quantity that it is of."""


Accuracy = Annotated[
    Annotated[Dimensionless, Field(ge=1e-4, le=MOST_ACCURACY), Tag("number")]
    | Annotated[TotalAccuracy, Tag("mapping")],
    by_shape("an accuracy of the steps such as 1 %, or {total: 2 %} of mesh, modes and steps together"),
]


class TransientConfig(Model):
    """Time integration: the step where contact changes, or the accuracy that picks it.

    Without `integrator` the scene decides: "adaptive" (steps cut where contact changes) with damping,
    "conserving" without any, "generalized_alpha" at full order; "modal" is the fixed-step baseline.
    """

    finest_step: Annotated[Time, Positive] | None = None
    """The smallest step that the time stepping may take."""
    accuracy: Accuracy | None = None
    """Accuracy of the time stepping: the step is refined until its estimated error is below. With `total`
    that of mesh, modes and steps together, which chooses the mesh too."""
    duration: Annotated[Time, Positive] | None = None
    """Time at which a run ends, before its record does; refused where nothing but rest is left of it."""
    integrator: IntegratorName | None = None
    """Name of the time stepping; if not given adaptive with damping, conserving without any, and
    generalized_alpha at full order. modal has a fixed step."""
    rho_inf: Annotated[Dimensionless, Field(ge=0.0, le=1.0)] = 0.9
    """Spectral radius at infinite frequency (generalized_alpha)."""
    tolerance: Annotated[Dimensionless, Field(ge=1e-14, le=1e-6)] = 1e-8
    """Relative residual of the contact problem of a step."""

    @model_validator(mode="after")
    def _one_step(self) -> Self:
        if (self.finest_step is None) == (self.accuracy is None):
            raise ValueError(
                "give exactly one of `finest_step` (for example 2.5 ms) and `accuracy` (for example 1 %)"
            )
        entry = None if self.integrator is None else INTEGRATORS[self.integrator]
        if self.accuracy is not None and entry is not None and not entry.uncoupled:
            raise ValueError(
                f"`accuracy` chooses the step of a reduced model; give `finest_step` to {self.integrator}"
            )
        return self

    @property
    def total_accuracy(self) -> float | None:
        """Error in L2 that mesh, modes and steps together may leave, if one is asked for."""
        return self.accuracy.total if isinstance(self.accuracy, TotalAccuracy) else None

    @property
    def step_accuracy(self) -> float | None:
        """Error in L2 that the steps may leave, and the modes as much; None where a step is given."""
        return REST_SHARE * self.accuracy.total if isinstance(self.accuracy, TotalAccuracy) else self.accuracy
