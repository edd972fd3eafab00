"""Target spectra, which records are scaled to, matched with and chosen by, and the measure of components."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from romdam.config.base import Model
from romdam.config.quantities import Dimensionless, GroundAcceleration, Time

Of = Literal["largest", "larger_horizontal", "geometric_mean", "rotd50", "rotd100", "x", "y", "z"]
NAMED: dict[str, str] = {  # as tables and files say it
    "largest": "largest of x, y, z",
    "larger_horizontal": "larger of x, y",
    "geometric_mean": "geometric mean of x, y",
    "rotd50": "RotD50 of x, y",
    "rotd100": "RotD100 of x, y",
    "x": "x",
    "y": "y",
    "z": "z",
}
Positive = Field(gt=0.0)
Ratio = Annotated[Dimensionless, Field(ge=0.0, lt=1.0)]
MOST_POINTS = 10_000  # of a spectrum


class Asce7Spectrum(Model):
    """Two-period design spectrum of ASCE/SEI 7-16 and 7-22, 11.4.6 (7-22: 11.4.5.2); 5 % damping."""

    SDS: Annotated[GroundAcceleration, Positive]
    """Spectral acceleration at short periods."""
    SD1: Annotated[GroundAcceleration, Positive]
    """Spectral acceleration at 1 s."""
    TL: Annotated[Time, Positive]
    """Long-period transition."""


class Eurocode8Spectrum(Model):
    """Horizontal elastic spectrum of EN 1998-1:2004, 3.2.2.2, up to 4 s.

    By `type` and `ground` with the recommended values of tables 3.2 and 3.3, or by `S`, `TB`, `TC` and `TD`
    of a national annex.
    """

    ag: Annotated[GroundAcceleration, Positive]
    """Design ground acceleration on ground A, times the factor of importance."""
    type: Literal[1, 2] | None = None
    """Type of the spectrum."""
    ground: Literal["A", "B", "C", "D", "E"] | None = None
    """Type of ground."""
    S: Annotated[Dimensionless, Positive] | None = None
    """Soil factor."""
    TB: Annotated[Time, Positive] | None = None
    """Period at which the plateau begins."""
    TC: Annotated[Time, Positive] | None = None
    """Period at which the plateau ends."""
    TD: Annotated[Time, Positive] | None = None
    """Period at which constant displacement begins."""

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        tables, constants = (self.type, self.ground), (self.S, self.TB, self.TC, self.TD)
        if (
            (None in tables) == (None in constants)
            or (None in constants and any(constants))
            or (None in tables and any(tables))
        ):
            raise ValueError("give `type` and `ground`, or all of `S`, `TB`, `TC` and `TD`")
        if None not in constants and not self.TB < self.TC < self.TD:  # type: ignore[operator]
            raise ValueError(f"TB, TC, TD must rise, got {self.TB:g}, {self.TC:g} and {self.TD:g} s")
        return self


class SpectrumConfig(Model):
    """A spectrum of pseudo-acceleration, straight in the logarithms between points.

    One of `points`, a `table` of a file, and the spectra of codes.
    """

    points: Annotated[
        tuple[tuple[Annotated[Time, Positive], Annotated[GroundAcceleration, Positive]], ...] | None,
        Field(min_length=2, max_length=MOST_POINTS),
    ] = None
    """Pairs of period and spectral acceleration, by rising period."""
    table: Path | None = None
    """CSV file: period in s, spectral acceleration in `unit`; a line at period 0 is passed over."""
    unit: str | None = None
    """Unit of the table's spectral acceleration."""
    asce7: Asce7Spectrum | None = None
    """Two-period design spectrum of ASCE 7."""
    eurocode8: Eurocode8Spectrum | None = None
    """Elastic spectrum of Eurocode 8."""

    @model_validator(mode="after")
    def _one_spectrum(self) -> Self:
        if [self.points, self.table, self.asce7, self.eurocode8].count(None) != 3:
            raise ValueError("give exactly one of `points`, `table`, `asce7` and `eurocode8`")
        if (self.table is None) != (self.unit is None):
            raise ValueError("`table` and `unit` (of its spectral acceleration, such as g) belong together")
        for period_before, other in itertools.pairwise(period for period, _ in self.points or ()):
            if other <= period_before:
                raise ValueError(f"points: periods must rise, {other:g} s comes after {period_before:g} s")
        return self


class TargetConfig(Model):
    """Spectrum that `scale: target`, `match` and `select` aim at over a range of periods."""

    spectrum: SpectrumConfig
    """Target spectrum of pseudo-acceleration."""
    periods: tuple[Annotated[Time, Positive], Annotated[Time, Positive]]
    """First and last period of the range that counts."""
    of: Of
    """Combination of the components that is compared with the target."""
    damping: Ratio = 0.05
    """Damping ratio of the spectrum."""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        first, last = self.periods
        if not first < last:
            raise ValueError(f"periods: the first ({first:g} s) must lie below the last ({last:g} s)")
        if self.spectrum.asce7 and self.damping != 0.05:
            raise ValueError(
                f"damping: the spectrum of ASCE 7 is of 5 %, got {100 * self.damping:g} %; give a table"
            )
        if self.spectrum.eurocode8 and last > 4.0:
            raise ValueError(f"periods: the spectrum of Eurocode 8 ends at 4 s, got {last:g} s")
        return self


class MatchConfig(Model):
    """Add wavelets until the spectrum of each component is the target's (Al Atik and Abrahamson 2010).

    x and y are matched, or the one component of `target.of`; what is not matched is scaled with them.
    """

    tolerance: Annotated[Dimensionless, Field(ge=0.005, le=0.3)] = 0.05
    """Largest departure from the target over its periods."""
