"""The `study:` part of a configuration: settings that are set against each other."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from romdam.config.base import Model
from romdam.config.quantities import Frequency, Time, Whole
from romdam.config.sections.transient import ModalName

Positive = Field(gt=0.0)
Modes = Annotated[Whole, Field(ge=0, le=10_000)]  # beyond, nothing is reduced any more
ResidualVectors = Annotated[Whole, Field(ge=0, le=1000)]
StudiedMesh = Literal[
    "as_given", "twice", "half", "quadratic", "quadratic_twice",
    "finer_up", "finer_through", "finer_along", "finer_rock",
]  # fmt: skip
ContactPoints = Literal["as_given", "nodes", "corners", "mortar"]


class StudyConfig(Model):
    """Settings that `romdam study` sweeps, and what it compares with.

    Every combination of `meshes`, `contact_points`, `modes` (a block) or `cutoffs`, `residual_vectors`,
    `integrators` and `finest_steps` (1/4 to 1/32 of the record's step if not given) is timed over the whole
    record and compared over `duration`; so is the job's own setting. They are compared with all modes of the
    mesh or the full order at `reference_step` (1/16 of the finest step if not given). Where meshes or contact
    points are studied, it is a run on quadratic elements of half the size, with many modes.
    """

    meshes: Annotated[tuple[StudiedMesh, ...], Field(min_length=1)] | None = None
    """Meshes that are tried: as_given; elements of twice or of half the size; quadratic elements, as many as
    given, or of twice the size; of a generated dam on quadratic elements half again as many in one direction.
    The mesh as given if not given."""
    contact_points: Annotated[tuple[ContactPoints, ...], Field(min_length=1)] | None = None
    """Gaps of joints that are tried: as_given; between the nodes of coinciding faces, at every one or at the
    corners of quadratic ones; or by mortar."""
    modes: Annotated[tuple[Modes, ...], Field(min_length=1)] = (20, 60)
    """Numbers of modes of each block that are tried."""
    cutoffs: Annotated[tuple[Annotated[Frequency, Positive], ...], Field(min_length=1)] | None = None
    """Frequencies up to which modes are kept that are tried too; without `modes` they alone."""
    residual_vectors: Annotated[tuple[ResidualVectors, ...], Field(min_length=1)] = (0, 10)
    """Numbers of residual vectors that are tried."""
    integrators: Annotated[tuple[ModalName, ...], Field(min_length=1)] = ("modal", "adaptive")
    """Names of integrators that are tried."""
    finest_steps: Annotated[tuple[Annotated[Time, Positive], ...], Field(min_length=1)] | None = None
    """Steps that are tried; 1/4 to 1/32 of the record's if not given."""
    reference: Literal["auto", "all_modes", "full"] = "auto"
    """Model that is compared with: all modes of the mesh, or the full order; auto with meshes or contact
    points."""
    reference_step: Annotated[Time, Positive] | None = None
    """Step of the reference; if not given 1/16 of the finest step, on a finer mesh that of 0.2 %."""
    duration: Annotated[Time, Positive] = 10.0
    """Time from the record's start over which is compared."""
    repeats: Annotated[Whole, Field(ge=1, le=99)] = 3
    """Runs of each setting; the median CPU time counts."""

    @model_validator(mode="after")
    def _refuse_reference_on_the_same_mesh(self) -> Self:
        if self.varies_mesh and self.reference != "auto":
            raise ValueError(
                f"`reference: {self.reference}` is a run on the mesh as given, which cannot show the error "
                "of a mesh or of contact points; leave it out, and a run on a finer mesh is the reference"
            )
        return self

    @property
    def varies_mesh(self) -> bool:
        """Whether meshes or contact points are studied."""
        return self.meshes is not None or self.contact_points is not None

    @property
    def counts(self) -> tuple[int, ...]:
        """Numbers of modes that are tried."""
        return self.modes if self.cutoffs is None or "modes" in self.model_fields_set else ()
