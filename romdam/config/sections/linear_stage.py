"""The `linear_stage:` of a configuration: linear analyses with joints tied, before the nonlinear run."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from romdam.config.base import Model
from romdam.config.quantities import Frequency
from romdam.config.sections.motions.target import Ratio, SpectrumConfig


class GroundSpectraConfig(Model):
    """Response spectra of the ground along x, y and z; along an axis without one it does not shake."""

    x: SpectrumConfig | None = None
    """Spectrum along x."""
    y: SpectrumConfig | None = None
    """Spectrum along y."""
    z: SpectrumConfig | None = None
    """Spectrum along z."""
    damping: Ratio = 0.05
    """Damping ratio of the spectra, which is meant to be that of the dam's modes."""

    @property
    def by_axis(self) -> dict[str, SpectrumConfig]:
        """Axis -> its spectrum, of those that have one."""
        return {axis: one for axis in "xyz" if (one := getattr(self, axis)) is not None}

    @model_validator(mode="after")
    def _some(self) -> Self:
        if not self.by_axis:
            raise ValueError("give a spectrum along at least one of `x`, `y` and `z`")
        for axis, spectrum in self.by_axis.items():
            if spectrum.asce7 and self.damping != 0.05:
                raise ValueError(
                    f"damping: the spectrum of ASCE 7 along {axis} is of 5 %, got "
                    f"{100 * self.damping:g} %; give a table"
                )
        return self


class LinearStageConfig(Model):
    """Response-spectrum analysis and linear time history with all joints tied, before the nonlinear run."""

    spectra: GroundSpectraConfig | None = None
    """Spectra of the ground; those of each record, at the damping of each mode, if not given."""
    combination: Literal["cqc", "srss"] = "cqc"
    """Rule by which modes are combined."""
    damping: Literal["viscous", "hysteretic"] = "viscous"
    """Viscous as in runs, or hysteretic: a stiffness K (1 + 2 i xi) of each material's ratio xi, in the
    frequency domain."""
    directions: Literal["srss", "100-40-40", "100-30-30"] = "srss"
    """Rule by which the three components of the ground are combined."""
    cutoff: Annotated[Frequency, Field(gt=0.0)] = 33.0
    """Frequency up to which modes answer the spectrum; what is stiffer follows the ground statically."""
