"""The `comparison:` part of a configuration: variants of one job that are run and set side by side."""

from __future__ import annotations

from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from romdam.config.base import Model
from romdam.config.names import Name, OfFile, same_file
from romdam.config.sections.places import Axis
from romdam.core.errors import listed, quote


class ComparisonConfig(Model):
    """Variants of the job, each run into a folder of its own, and what of them is compared."""

    variants: Annotated[dict[Annotated[str, OfFile], dict[str, Any]], Field(min_length=2, max_length=50)]
    """Name -> what it changes: path -> value, such as `model: {order: full}` or
    `joints.J3.discretization: mortar`; `{}` is the job as it stands."""
    reference: str | None = None
    """The variant that all are measured against, the first if not given."""
    component: Axis = "y"
    """Component of the displacements that are compared and drawn."""
    relative: dict[Name, tuple[str, str]] = Field(default_factory=dict)
    """Name -> two of `outputs.nodes`; the second's displacement relative to the first is compared."""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.reference is not None and self.reference not in self.variants:
            known = listed(self.variants)
            raise ValueError(f"reference: no variant {quote(self.reference)} is defined; defined are {known}")
        first: dict[str, str] = {}
        for name in self.variants:
            if first.setdefault(same_file(name), name) != name:
                raise ValueError(
                    f"variants: {quote(name)} and {quote(first[same_file(name)])} are one folder"
                )
        return self

    @property
    def against(self) -> str:
        """The name of the reference."""
        return self.reference or next(iter(self.variants))
