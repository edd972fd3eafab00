"""The `study:` part of a configuration: settings that are set against each other."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from romdam.config.base import Model
from romdam.config.quantities import Time, Whole
from romdam.config.sections.transient import ModalName

Positive = Field(gt=0.0)
Modes = Annotated[Whole, Field(ge=0, le=10_000)]  # beyond, nothing is reduced any more
ResidualVectors = Annotated[Whole, Field(ge=0, le=1000)]


class StudyConfig(Model):
    """Settings that `romdam study` sweeps, and what it compares with.

    Every combination of `modes` (a block), `residual_vectors`, `integrators` and `finest_steps` (1/4 to 1/32
    of the record's step if not given) is timed over the whole record and compared over `duration`, with all
    modes of the mesh or the full order at `reference_step` (1/16 of the finest step if not given).
    """

    modes: Annotated[tuple[Modes, ...], Field(min_length=1)] = (20, 60)
    """Numbers of modes of each block that are tried."""
    residual_vectors: Annotated[tuple[ResidualVectors, ...], Field(min_length=1)] = (0, 10)
    """Numbers of residual vectors that are tried."""
    integrators: Annotated[tuple[ModalName, ...], Field(min_length=1)] = ("modal", "adaptive")
    """Names of integrators that are tried."""
    finest_steps: Annotated[tuple[Annotated[Time, Positive], ...], Field(min_length=1)] | None = None
    """Steps that are tried; 1/4 to 1/32 of the record's if not given."""
    reference: Literal["auto", "all_modes", "full"] = "auto"
    """Model that is compared with: all modes of the mesh, or the full order."""
    reference_step: Annotated[Time, Positive] | None = None
    """Step of the reference; 1/16 of the finest step if not given."""
    duration: Annotated[Time, Positive] = 10.0
    """Time from the record's start over which is compared."""
    repeats: Annotated[Whole, Field(ge=1, le=99)] = 3
    """Runs of each setting; the median CPU time counts."""
