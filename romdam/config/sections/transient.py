"""The `transient:` part of a configuration: the integrator, and its step or the accuracy that picks it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Self

from pydantic import Discriminator, Field, GetCoreSchemaHandler, GetJsonSchemaHandler, Tag, model_validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from romdam.config.base import Model, shape
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


class StepAccuracy(Model):
    """Accuracy of the time stepping, quantity by quantity: the step is refined until each of them is kept.

    Errors are relative to what moves: to openings and slips less those at the start.
    """

    openings: Annotated[Dimensionless, Field(ge=1e-4, le=MOST_ACCURACY)] | None = None
    """Relative error of the openings in L2; the largest of the other two if not given."""
    slips: Annotated[Dimensionless, Field(ge=1e-4, le=MOST_ACCURACY)] | None = None
    """Relative error of the slips in L2; for joints that carry shear."""
    residual_slips: Annotated[Dimensionless, Field(ge=1e-4, le=MOST_ACCURACY)] | None = None
    """Relative error of the slips at the end, over all gaps; for joints that carry shear."""

    @model_validator(mode="after")
    def _at_least_one(self) -> Self:
        if not self.values:
            raise ValueError("give at least one of `openings`, `slips` and `residual_slips`")
        return self

    @property
    def values(self) -> dict[str, float]:
        """Those that are given."""
        every = {"openings": self.openings, "slips": self.slips, "residual_slips": self.residual_slips}
        return {name: value for name, value in every.items() if value is not None}


def _kind(value: object) -> str:
    """Tell an accuracy of all, which names its `total`, from those of the steps and from a number."""
    if isinstance(value, TotalAccuracy) or (isinstance(value, dict) and {"total", "of"} & {*value}):
        return "mapping"
    return "quantities" if shape(value) == "mapping" else shape(value)


Accuracy = Annotated[
    Annotated[Dimensionless, Field(ge=1e-4, le=MOST_ACCURACY), Tag("number")]
    | Annotated[TotalAccuracy, Tag("mapping")]
    | Annotated[StepAccuracy, Tag("quantities")],
    Discriminator(
        _kind,
        custom_error_type="shape",
        custom_error_message="expected an accuracy of the openings such as 1 %, {openings: 1 %, slips: 2 %, "
        "residual_slips: 5 %}, or {total: 2 %} of mesh, modes and steps together",
    ),
]


class TransientConfig(Model):
    """Time integration: the step where contact changes, or the accuracy that picks it.

    Without `integrator` the scene decides: "adaptive" (steps cut where contact changes) with damping,
    "conserving" without any, "generalized_alpha" at full order; "modal" is the fixed-step baseline.
    """

    finest_step: Annotated[Time, Positive] | None = None
    """The smallest step that the time stepping may take."""
    accuracy: Accuracy | None = None
    """Accuracy of the time stepping, of the openings or quantity by quantity: the step is refined until its
    estimated error is below. With `total` that of mesh, modes and steps, which chooses the mesh too."""
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
        """Error of the openings in L2 that the steps may leave, and the modes as much; None with a step."""
        if isinstance(self.accuracy, TotalAccuracy):
            return REST_SHARE * self.accuracy.total
        if isinstance(self.accuracy, StepAccuracy):
            return self.accuracy.openings or max(self.accuracy.values.values())
        return self.accuracy

    @property
    def slip_accuracies(self) -> dict[str, float]:
        """Errors that the steps may leave of "slips" and "residual_slips", where they are asked for."""
        if not isinstance(self.accuracy, StepAccuracy):
            return {}
        return {name: value for name, value in self.accuracy.values.items() if name != "openings"}
