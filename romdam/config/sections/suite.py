"""The `suite:` part of a configuration: one job's records at many scales, with many joint parameters."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, Tag, model_validator

from romdam.config.base import Model, by_key, by_shape
from romdam.config.quantities import Dimensionless, GroundAcceleration, NumberOrText, Time, Whole
from romdam.config.sections.motions.target import Of
from romdam.core.errors import quote

MOST_RUNS = 1_000_000
Parameter = Annotated[str, Field(pattern=r"^[A-Za-z]\w*$", max_length=60)]
Positive = Field(gt=0.0)
Weight = Annotated[Dimensionless, Field(ge=0.0, le=1e9)]


class IntensityConfig(Model):
    """Scale every record to target values of a measure of its components, instead of by factors."""

    measure: Literal["pga", "sa"]
    """Peak ground acceleration or pseudo-spectral acceleration."""
    of: Of = "largest"
    """Combination of the components that the measure is taken of."""
    period: Annotated[Time, Positive] | None = None
    """Period of the spectral acceleration."""
    damping: Annotated[Dimensionless, Field(ge=0.0, lt=1.0)] = 0.05
    """Damping ratio of the spectral acceleration."""
    values: Annotated[tuple[Annotated[GroundAcceleration, Positive], ...], Field(min_length=1)]
    """Targets, one scale each."""

    @model_validator(mode="after")
    def _period_of_sa(self) -> Self:
        if (self.measure == "sa") != (self.period is not None):
            raise ValueError("`measure: sa` and `period` belong together")
        return self


KeyPath = Annotated[str, Field(min_length=1)]


class ParameterConfig(Model):
    """A number that varies: the values, a range to sample from, or a distribution.

    `path` is where it stands in this file, such as joints.J3.friction, joints.base_*.friction (all that
    match), gravity_dam.joints.base.friction (all that the dam makes of it) or damping.rayleigh.ratio; of a
    list all places have one value. `count` makes a range a row of values for the full grid. A normal or
    lognormal distribution has a `mean` or a `median`, and `std`, `cov` or `beta`, those of the distribution
    before `low` and `high` cut it.
    """

    path: Annotated[
        Annotated[KeyPath, Tag("number")]
        | Annotated[tuple[KeyPath, ...], Field(min_length=1, max_length=1000), Tag("list")],
        by_shape("a path such as joints.J3.friction or joints.*.friction, or a list of them"),
    ]
    """Path of the number in this file, such as joints.J3.friction, joints.base_*.friction for all joints that
    match, or gravity_dam.joints.base.friction; or a list of paths, which all have the value."""
    values: Annotated[tuple[NumberOrText, ...], Field(min_length=1)] | None = None
    """All values, for the grid."""
    low: NumberOrText | None = None
    """Least value of a range, or bound at which a distribution is cut."""
    high: NumberOrText | None = None
    """Largest value of a range, or bound at which a distribution is cut."""
    count: Annotated[Whole, Field(ge=2, le=MOST_RUNS)] | None = None
    """Number of values from `low` to `high` in the full grid, at equal distances or ratios."""
    distribution: Literal["uniform", "loguniform", "normal", "lognormal"] = "uniform"
    """Distribution of random samples."""
    mean: NumberOrText | None = None
    """Mean of a normal or lognormal distribution."""
    median: NumberOrText | None = None
    """Median of a normal or lognormal distribution, instead of the mean."""
    std: NumberOrText | None = None
    """Standard deviation."""
    cov: Annotated[Dimensionless, Field(ge=0.0, le=10.0)] | None = None
    """Coefficient of variation, standard deviation over mean, instead of `std`."""
    beta: Annotated[Dimensionless, Field(ge=0.0, le=10.0)] | None = None
    """Standard deviation of the natural logarithm of a lognormal distribution, instead of `std`."""

    @property
    def paths(self) -> tuple[str, ...]:
        """Every path, as it is written."""
        return (self.path,) if isinstance(self.path, str) else self.path

    @property
    def has_moments(self) -> bool:
        """Tell whether the distribution is one of a mean and a spread."""
        return self.distribution in ("normal", "lognormal")

    @model_validator(mode="after")
    def _values_or_range(self) -> Self:
        self._refuse_odd_moments()
        if (self.low is None) != (self.high is None) and not self.has_moments:
            raise ValueError("`low` and `high` belong together")
        if self.values is not None and self.low is not None:
            raise ValueError("give `values`, or `low` and `high`, not both")
        if self.count is not None and (self.low is None or self.has_moments):
            raise ValueError("`count` belongs to `low` and `high` of a range")
        return self

    def _refuse_odd_moments(self) -> None:
        centers = [key for key in ("mean", "median") if getattr(self, key) is not None]
        spreads = [key for key in ("std", "cov", "beta") if getattr(self, key) is not None]
        if not self.has_moments:
            if centers or spreads:
                raise ValueError(
                    f"`{(centers + spreads)[0]}` belongs to `distribution: normal` or `lognormal`, got "
                    f"{self.distribution}"
                )
            return
        if self.values is not None:
            raise ValueError("give `values`, or a distribution, not both")
        if len(centers) != 1 or len(spreads) != 1:
            raise ValueError(
                f"a {self.distribution} distribution has one of `mean` and `median`, and one of `std`, `cov` "
                f"and `beta`, got {', '.join(centers + spreads) or 'none'}"
            )
        if self.beta is not None and self.distribution == "normal":
            raise ValueError("`beta` is of a lognormal distribution; give `std` or `cov`")


class LatinHypercubeConfig(Model):
    """A Latin hypercube of so many samples."""

    latin_hypercube: Annotated[Whole, Field(ge=1, le=MOST_RUNS)]
    """Number of samples."""
    seed: Annotated[Whole, Field(ge=0, lt=2**63)] = 1
    """Seed of the random numbers."""

    def samples(self, parameters: int) -> int:
        """Count the samples for so many parameters."""
        return self.latin_hypercube


class MonteCarloConfig(Model):
    """So many independent samples."""

    monte_carlo: Annotated[Whole, Field(ge=1, le=MOST_RUNS)]
    """Number of samples."""
    seed: Annotated[Whole, Field(ge=0, lt=2**63)] = 1
    """Seed of the random numbers."""

    def samples(self, parameters: int) -> int:
        """Count the samples for so many parameters."""
        return self.monte_carlo


class SobolIndicesConfig(Model):
    """Samples that Sobol' indices are computed from: n (k + 2) of them for k parameters."""

    sobol_indices: Annotated[Whole, Field(ge=16, le=2**17)]
    """Number n of base samples, a power of 2."""
    seed: Annotated[Whole, Field(ge=0, lt=2**63)] = 1
    """Seed of the random numbers."""

    def samples(self, parameters: int) -> int:
        """Count the samples for so many parameters."""
        return self.sobol_indices * (parameters + 2)

    @model_validator(mode="after")
    def _power_of_two(self) -> Self:
        n = self.sobol_indices
        if n & (n - 1):
            below = 1 << (n.bit_length() - 1)
            raise ValueError(
                f"`sobol_indices` is a power of 2, else Sobol's sequence is not balanced, got {n}; take "
                f"{below} or {2 * below}"
            )
        return self


RandomDesign = LatinHypercubeConfig | MonteCarloConfig | SobolIndicesConfig
_DESIGNS: dict[type, str] = {  # as messages name them
    LatinHypercubeConfig: "a Latin hypercube",
    MonteCarloConfig: "Monte Carlo",
    SobolIndicesConfig: "a design for Sobol' indices",
}


class CorrelationPairConfig(Model):
    """Correlation of two parameters."""

    between: tuple[Parameter, Parameter]
    """Names of two of `parameters`."""
    value: Annotated[Dimensionless, Field(gt=-1.0, lt=1.0)]
    """Coefficient of correlation."""


class CorrelationConfig(Model):
    """Correlation of parameters with a distribution; those of no pair are not correlated.

    The samples have a Gaussian copula. `of: values` is Pearson's coefficient of the values themselves
    (Nataf's model), `of: scores` that of their normal scores.
    """

    pairs: Annotated[tuple[CorrelationPairConfig, ...], Field(min_length=1, max_length=1000)]
    of: Literal["values", "scores"] = "values"
    """Quantities that the coefficients are of: the values, or their normal scores."""

    @model_validator(mode="after")
    def _each_once(self) -> Self:
        seen = set[frozenset[str]]()
        for k, pair in enumerate(self.pairs):
            names = frozenset(pair.between)
            if len(names) < 2:
                raise ValueError(f"pairs[{k}].between: two different parameters, got {quote(pair.between)}")
            if names in seen:
                raise ValueError(f"pairs[{k}].between: {quote(pair.between)} are given twice; remove one")
            seen.add(names)
        return self


class DesignTableConfig(Model):
    """Samples from a CSV file: a column for each parameter, a row for each sample, SI or with units."""

    table: Path
    """CSV file with a column for each parameter."""


class HazardConfig(Model):
    """Annual frequencies at which a response exceeds its levels, from the hazard at the site.

    The table has the columns `intensity [g]`, with its unit, and `annual frequency`. Each level gets a
    lognormal fragility in the measure of the records, which is integrated over the hazard.
    """

    table: Path
    """CSV file with the columns `intensity [g]`, with its unit, and `annual frequency`."""
    measure: Literal["sa", "pga", "pgv"] = "sa"
    """Measure of the records that the table is of; sa at `period`, of the components that `of` says."""
    response: Annotated[str, Field(min_length=1, max_length=60)] = "peak_opening"
    """Response, a variable of the summary; the largest over joints, nodes and so on."""
    levels: Annotated[tuple[NumberOrText, ...], Field(min_length=1, max_length=100)] | None = None
    """Levels of the response; twelve between the 5 and 95 % of the runs if not given."""


class KeepConfig(Model):
    """Histories at an interval, in single precision unless asked otherwise."""

    output_interval: Annotated[Time, Positive]
    """Interval between two rows of the histories."""
    precision: Literal["single", "double"] = "single"
    """Precision of the numbers of the histories."""


class SuiteConfig(Model):
    """Variations of a suite, and what it keeps; a run is one record at one scale with one sample.

    `scales` are factors on the records, `intensities` target values instead. `parameters` and `design` make
    the samples: the full grid of values, random ones, or a table. `keep` says what lands beside the
    summary: nothing (`peaks`), whole results (`full`), or results at an interval. `period` is that of the
    spectral acceleration among the records' measures, `of` what of the components these are of, `batch` that
    of runs integrated together (from the memory if not given), `cache` the folder of reduced blocks
    (OUT/cache if not given).
    """

    scales: Annotated[tuple[Annotated[Dimensionless, Positive], ...], Field(min_length=1)] = (1.0,)
    """Factors on the records, each a run."""
    intensities: IntensityConfig | None = None
    parameters: Annotated[dict[Parameter, ParameterConfig], Field(max_length=100)] = Field(
        default_factory=dict
    )
    design: Annotated[
        Annotated[Literal["grid"], Tag("word")]
        | Annotated[LatinHypercubeConfig, Tag("LatinHypercubeConfig")]
        | Annotated[MonteCarloConfig, Tag("MonteCarloConfig")]
        | Annotated[SobolIndicesConfig, Tag("SobolIndicesConfig")]
        | Annotated[DesignTableConfig, Tag("DesignTableConfig")],
        by_key(
            'one of "grid", {latin_hypercube: 100, seed: 1}, {monte_carlo: 1000, seed: 1}, '
            "{sobol_indices: 256, seed: 1} and {table: samples.csv}",
            RandomDesign | DesignTableConfig,
            "grid",
        ),
    ] = "grid"
    """Design of the samples of the parameters: the full grid of values, a Latin hypercube, independent
    samples, those of Sobol' indices, or a table."""
    correlation: CorrelationConfig | None = None
    hazard: HazardConfig | None = None
    weights: (
        Annotated[dict[Annotated[str, Field(min_length=1, max_length=200)], Weight], Field(min_length=1)]
        | None
    ) = None
    """Weights of the records in statistics, by their names or patterns of names; every record has one. They
    count alike if not given."""
    keep: Annotated[
        Annotated[Literal["peaks", "full"], Tag("word")] | Annotated[KeepConfig, Tag("mapping")],
        by_shape('"peaks", "full", or {output_interval: 0.05 s}', "peaks", "full"),
    ] = "peaks"
    """Files written beside the summary: none, whole results, or histories at an interval."""
    period: Annotated[Time, Positive] = 0.3
    """Period of the spectral acceleration among the records' measures."""
    of: Of = "largest"
    """Combination of the components that the records' measures are of."""
    batch: Annotated[Whole, Field(ge=1, le=10_000)] | None = None
    """Runs that are integrated together; as the memory allows if not given."""
    cache: Path | None = None
    """Folder of reduced blocks; OUT/cache if not given."""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.intensities is not None and self.scales != type(self).model_fields["scales"].default:
            raise ValueError("give `scales` or `intensities`, not both")
        first: dict[str, str] = {}
        for name, parameter in self.parameters.items():
            for path in parameter.paths:
                if path in first:
                    raise ValueError(
                        f"parameters.{name}.path: {quote(path)} is varied twice; remove one of the two"
                    )
                first[path] = name
            self._has_what_the_design_needs(name, parameter)
        if isinstance(self.design, DesignTableConfig) and not self.parameters:
            raise ValueError("a design table needs `parameters`: name each column's path")
        if isinstance(self.design, RandomDesign) and not self.parameters:
            raise ValueError(f"{_DESIGNS[type(self.design)]} needs `parameters` with `low` and `high`")
        self._refuse_odd_correlation()
        self._refuse_too_many()
        for name, values in (("scales", self.scales), ("intensities.values", self._targets())):
            if len(set(values)) < len(values):
                raise ValueError(
                    f"{name}: a value is given twice, {quote(sorted(values))}; remove one of the two"
                )
        return self

    def _refuse_odd_correlation(self) -> None:
        if self.correlation is None:
            return
        if isinstance(self.design, SobolIndicesConfig):
            raise ValueError(
                "correlation: shares of the variance (Sobol' indices) are of independent parameters; leave "
                "it out, let one parameter vary all paths that go together, or set design: {monte_carlo: "
                "1000}"
            )
        if not isinstance(self.design, RandomDesign):
            raise ValueError(
                "correlation: is of random samples; set design: {latin_hypercube: 100} or {monte_carlo: "
                "1000}, or leave it out"
            )
        for k, pair in enumerate(self.correlation.pairs):
            for name in pair.between:
                if name not in self.parameters:
                    raise ValueError(
                        f"correlation.pairs[{k}].between: no parameter is {quote(name)}; there are "
                        f"{', '.join(self.parameters)}"
                    )

    def _refuse_too_many(self) -> None:
        scales = len(self._targets() or self.scales)
        levels = [
            len(parameter.values or ()) or parameter.count or 1 for parameter in self.parameters.values()
        ]
        samples = math.prod(levels)
        if self.design != "grid":
            samples = 1 if isinstance(self.design, DesignTableConfig) else self.design.samples(len(levels))
        if scales * samples > MOST_RUNS:
            raise ValueError(
                f"{scales} scales of {samples:.6g} samples are {scales * samples:.3g} runs of every record, "
                f"limit {MOST_RUNS}; give fewer values or base samples, or design: {{latin_hypercube: 1000}}"
            )

    def _targets(self) -> tuple[float, ...]:
        return () if self.intensities is None else self.intensities.values

    def _has_what_the_design_needs(self, name: str, parameter: ParameterConfig) -> None:
        if isinstance(self.design, DesignTableConfig):
            if parameter.values is not None or parameter.low is not None or parameter.has_moments:
                raise ValueError(f"parameters.{name}: the table gives the values; leave only `path`")
        elif isinstance(self.design, RandomDesign):
            if parameter.values is None and parameter.low is None and not parameter.has_moments:
                raise ValueError(
                    f"parameters.{name}: {_DESIGNS[type(self.design)]} needs `low` and `high`, "
                    "`values`, or a distribution"
                )
        elif parameter.values is None and parameter.count is None:
            raise ValueError(
                f"parameters.{name}: the full grid needs `values`, or `low`, `high` and `count`; "
                "or set design: {latin_hypercube: 100}"
            )
