"""What a suite runs: its samples, by a grid, at random or from a table, and factors on its records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from romdam.config.load import Job
from romdam.config.parameters import VariedKey, find_varied_key, si_value
from romdam.config.sections.suite import (
    MOST_RUNS,
    DesignTableConfig,
    LatinHypercubeConfig,
    MonteCarloConfig,
    ParameterConfig,
    RandomDesign,
    SobolIndicesConfig,
    SuiteConfig,
)
from romdam.core.arrays import Floats
from romdam.core.csv_table import read_table
from romdam.core.errors import ConfigError, RecordError, quote
from romdam.core.fingerprint import fingerprint
from romdam.core.machine import memory_limit, shown_size
from romdam.core.motion import GroundMotion
from romdam.postprocess.record_measures import intensity
from romdam.postprocess.responses import PARAMETER
from romdam.postprocess.sobol import BASE_SAMPLES
from romdam.results.suite.sampling import (
    Marginal,
    correlated,
    correlation_matrix,
    latin_hypercube,
    least_eigenvalue,
    lognormal_spread,
    monte_carlo,
    score_correlation,
    sobol_matrices,
)

_MOST_TABLE = 1e9  # bytes
_COPIES = 10.0  # of the numbers of random samples while they are drawn and correlated


def varied_keys(job: Job, suite: SuiteConfig) -> dict[str, VariedKey]:
    """Find where each parameter of a suite stands.

    Raises
    ------
    ConfigError
        for a path that cannot be varied, or two that name the same place.
    """
    return keys_at(job, {name: parameter.paths for name, parameter in suite.parameters.items()})


def keys_at(job: Job, paths: Mapping[str, Sequence[str]]) -> dict[str, VariedKey]:
    """Find where each of some parameters stands, by the paths that have its value.

    Raises
    ------
    ConfigError
        as `varied_keys`.
    """
    source = str(job.path)
    places = {name: find_varied_key(job.config, each, name, source) for name, each in paths.items()}
    taken: dict[tuple[str, str], str] = {}
    for name, key in places.items():
        for place in key.structure:
            other = taken.setdefault((place, ""), name)
            if other != name:
                raise ConfigError(
                    f"{source}: suite.parameters.{name}.path: {place} is varied by parameter {other!r} too; "
                    "remove one of the two"
                )
        if key.structure:
            continue
        for joint in key.joints or ("",):
            other = taken.setdefault((joint, key.keys[0]), name)
            # two keys of one section can vary together, as damping.rayleigh.alpha and .beta
            together = len(key.keys) == len(places[other].keys) == 2
            if other != name and (key.keys == places[other].keys or not together):
                raise ConfigError(
                    f"{source}: suite.parameters.{name}.path: {key.path} varies what parameter "
                    f"{other!r} "
                    f"({places[other].path}) does; remove one of the two"
                )
    return places


def design_dataset(job: Job, suite: SuiteConfig, places: Mapping[str, VariedKey]) -> xr.Dataset:
    """The samples of a suite: dims sample, a variable `parameter_<name>` for each parameter, SI.

    Raises
    ------
    ConfigError
        for values that a key would not take, and tables that do not fit.
    """
    source, design = str(job.path), suite.design
    _refuse_large(suite, source)
    if isinstance(design, DesignTableConfig):
        values = _table(job.folder / design.table, places)
        kind = f"table {design.table.name}"
    elif isinstance(design, LatinHypercubeConfig):
        unit = latin_hypercube(design.latin_hypercube, len(places), design.seed)
        values = _random_samples(unit, suite, places, source, strata=True)
        kind = f"Latin hypercube, seed {design.seed}"
    elif isinstance(design, MonteCarloConfig):
        unit = monte_carlo(design.monte_carlo, len(places), design.seed)
        values = _random_samples(unit, suite, places, source, strata=False)
        kind = f"Monte Carlo, seed {design.seed}"
    elif isinstance(design, SobolIndicesConfig):
        unit = sobol_matrices(design.sobol_indices, len(places), design.seed)
        values = _random_samples(unit, suite, places, source, strata=False)
        kind = f"Sobol' indices, {design.sobol_indices} base samples, seed {design.seed}"
    else:
        levels = [_levels(name, each, places[name], source) for name, each in suite.parameters.items()]
        grid = np.meshgrid(*levels, indexing="ij")
        values = {name: column.ravel() for name, column in zip(suite.parameters, grid, strict=True)}
        kind = "full grid"
    title = f"Samples of {job.config.title or job.path.stem}"
    attributes: dict[str, object] = {"title": title, "design": kind, "content_sha256": fingerprint(values)}
    if isinstance(design, SobolIndicesConfig):
        attributes[BASE_SAMPLES] = design.sobol_indices
    return samples_dataset(places, values).assign_attrs(attributes)


def samples_dataset(places: Mapping[str, VariedKey], values: Mapping[str, Floats]) -> xr.Dataset:
    """Samples as a Dataset with the dim sample; one that varies nothing where there are no values.

    Parameters
    ----------
    values : (samples,) of each parameter, SI
    """
    count = len(next(iter(values.values()))) if values else 1
    data = {
        PARAMETER + name: ("sample", column, {"units": places[name].units, "long_name": places[name].path})
        for name, column in values.items()
    }
    sample = ("sample", np.arange(count), {"units": "1", "long_name": "number of the sample"})
    return xr.Dataset(data, coords={"sample": sample})


def stated_samples(
    places: Mapping[str, VariedKey],
    values: Mapping[str, float | str | Sequence[float | str] | Floats],
    source: str,
) -> dict[str, Floats]:
    """Values (samples,) of parameters in SI, from one value or several of each.

    Raises
    ------
    ConfigError
        for values that a key would not take, and for other numbers of values.
    """
    columns = dict[str, Floats]()
    for name, stated in values.items():
        several = np.ravel(np.asarray(stated, dtype=object)).tolist()
        plain = [value.item() if isinstance(value, np.generic) else value for value in several]
        columns[name] = np.array([si_value(places[name], value, name, source) for value in plain])
    counts = {name: len(column) for name, column in columns.items()}
    if len({*counts.values()}) > 1 or 0 in counts.values():
        raise ConfigError(
            f"{source}: every key has one value for each sample, and at least one; got "
            f"{', '.join(f'{count} of {name}' for name, count in counts.items())}"
        )
    return columns


def _refuse_large(suite: SuiteConfig, source: str) -> None:
    """Refuse random samples that do not fit in memory while they are drawn."""
    if not isinstance(suite.design, RandomDesign):
        return
    parameters = len(suite.parameters)
    samples = suite.design.samples(parameters)
    need, limit = _COPIES * 8.0 * samples * parameters, memory_limit(None)
    if need > limit:
        raise ConfigError(
            f"{source}: suite.design: {samples} samples of {parameters} parameters take about "
            f"{shown_size(need)} of memory, limit {shown_size(limit)} (four fifths of this machine's); take "
            f"{samples * limit / need:.2g} samples at most, or vary fewer parameters"
        )


def _levels(name: str, parameter: ParameterConfig, key: VariedKey, source: str) -> Floats:
    """The values of a parameter in the full grid."""
    if parameter.values is not None:
        return np.array([si_value(key, value, name, source) for value in parameter.values])
    low, high = _range(name, parameter, key, source)
    if parameter.distribution == "loguniform":
        return np.geomspace(low, high, parameter.count or 2)
    return np.linspace(low, high, parameter.count or 2)


def _range(name: str, parameter: ParameterConfig, key: VariedKey, source: str) -> tuple[float, float]:
    low, high = (si_value(key, v, name, source) for v in (parameter.low, parameter.high) if v is not None)
    least = 0.0 if parameter.distribution == "loguniform" else -np.inf
    if not least < low < high < np.inf:
        raise ConfigError(
            f"{source}: suite.parameters.{name}: `low` must be below `high`"
            f"{' and above 0 for loguniform' if least == 0.0 else ''}, got {parameter.low} and "
            f"{parameter.high}"
        )
    return low, high


def _random_samples(
    unit: Floats, suite: SuiteConfig, places: Mapping[str, VariedKey], source: str, *, strata: bool
) -> dict[str, Floats]:
    """Values of the parameters at samples (n, k) between 0 and 1."""
    parameters = suite.parameters
    marginals = {
        name: marginal_of(name, parameter, places[name], source)
        for name, parameter in parameters.items()
        if parameter.values is None
    }
    if suite.correlation is not None:
        unit = correlated(unit, _score_correlations(suite, marginals, source), strata=strata)
    columns = {}
    for column, (name, parameter) in enumerate(parameters.items()):
        u = unit[:, column]
        if parameter.values is not None:
            levels = _levels(name, parameter, places[name], source)
            columns[name] = levels[np.minimum((u * len(levels)).astype(int), len(levels) - 1)]
            continue
        columns[name] = values = marginals[name].value(u)
        for extreme in dict.fromkeys((float(values.min()), float(values.max()))):
            try:
                si_value(places[name], extreme, name, source)
            except ConfigError as error:
                raise ConfigError(
                    f"{error}: its {parameter.distribution} distribution reaches that; give `low` and "
                    "`high`, at which it is cut, or another distribution"
                ) from None
    return columns


def marginal_of(name: str, parameter: ParameterConfig, key: VariedKey, source: str) -> Marginal:
    """The distribution of a parameter, SI.

    Raises
    ------
    ConfigError
        for bounds that are no range, or leave nothing of it, and for a mean that a lognormal one cannot have.
    """
    where = f"{source}: suite.parameters.{name}"
    if parameter.distribution in ("uniform", "loguniform"):
        return Marginal(parameter.distribution, 0.0, 0.0, *_range(name, parameter, key, source))
    low, high = (
        end if bound is None else si_value(key, bound, name, source)
        for bound, end in ((parameter.low, -np.inf), (parameter.high, np.inf))
    )
    if not low < high:
        raise ConfigError(f"{where}: `low` must be below `high`, got {parameter.low} and {parameter.high}")
    given = "median" if parameter.mean is None else "mean"
    center = si_value(key, getattr(parameter, given), name, source)
    std = None if parameter.std is None else _size(key, parameter.std, name, source)
    if parameter.distribution == "normal":
        spread = std if std is not None else abs(center) * (parameter.cov or 0.0)
    else:
        if not 0.0 < center < np.inf:
            raise ConfigError(f"{where}.{given}: of a lognormal distribution is above 0, got {center:g}")
        if parameter.beta is not None:
            spread = parameter.beta
        elif std is not None and given == "median":
            spread = lognormal_spread(std_of_median=std / center)
        else:
            spread = lognormal_spread(cov=std / center if std is not None else parameter.cov)
        center = float(np.log(center)) - (0.5 * spread**2 if given == "mean" else 0.0)
    marginal = Marginal(parameter.distribution, center, float(spread), low, high)
    if marginal.problem:
        raise ConfigError(f"{where}: {marginal.problem}")
    return marginal


def _size(key: VariedKey, value: float | str, name: str, source: str) -> float:
    """A standard deviation in SI; of zero or above."""
    size = si_value(key, value, name, source)
    if not 0.0 <= size < np.inf:
        raise ConfigError(f"{source}: suite.parameters.{name}.std: must be 0 or above, got {quote(value)}")
    return size


def _score_correlations(suite: SuiteConfig, marginals: Mapping[str, Marginal], source: str) -> Floats:
    """(k, k) correlation of the parameters' normal scores.

    Raises
    ------
    ConfigError
        for a pair that no Gaussian copula gives, and for a matrix that is not positive definite.
    """
    asked = suite.correlation
    assert asked is not None
    pairs = []
    for k, pair in enumerate(asked.pairs):
        (a, b), value = pair.between, pair.value
        where = f"{source}: suite.correlation.pairs[{k}]"
        for name in (a, b):
            if name not in marginals or marginals[name].value(np.array([0.1, 0.9])).std() == 0.0:
                raise ConfigError(
                    f"{where}: parameter {name!r} has `values`, or does not vary; correlation is of "
                    "parameters with a distribution"
                )
        if asked.of == "values":
            try:
                value = score_correlation(marginals[a], marginals[b], value)
            except ValueError as error:
                raise ConfigError(f"{where}.value: {error} for {a} and {b}, got {pair.value:g}") from None
        pairs.append((a, b, value))
    matrix = correlation_matrix(list(suite.parameters), pairs)
    if least_eigenvalue(matrix) == 0.0:
        least = float(np.linalg.eigvalsh(matrix)[0])
        raise ConfigError(
            f"{source}: suite.correlation.pairs: the correlation matrix is not positive definite (least "
            f"eigenvalue {least:.3g}): no parameters are correlated like that; lower the correlations, or "
            "give those of the pairs that are missing"
        )
    return matrix


def _table(path: Path, places: Mapping[str, VariedKey]) -> dict[str, Floats]:
    """Read the samples of a table: a line of names, then a line for each sample."""
    table = read_table(path, most=_MOST_TABLE)
    if not table.rows:
        raise ConfigError(f"{path}: holds no samples; expected a line of names, then a line for each sample")
    if len(table.rows) > MOST_RUNS:
        raise ConfigError(f"{path}: holds {len(table.rows)} samples, limit {MOST_RUNS}; split the table")
    if {*table.names} != {*places}:
        raise ConfigError(
            f"{path}: has the columns {quote(', '.join(table.names))}, expected one for each parameter: "
            f"{', '.join(places)}"
        )
    values = {}
    for name, key in places.items():
        texts = table.texts(name)
        if "" in texts:
            raise ConfigError(f"{table.at(texts.index(''))}: no value for {name}")
        values[name] = np.array([si_value(key, text, name, table.at(k)) for k, text in enumerate(texts)])
    return values


def some_samples(design: xr.Dataset, most: int) -> tuple[xr.Dataset, int]:
    """Samples of a design with the least and the largest value of each parameter, and others between.

    Returns
    -------
    the design of about `most` of its samples, and the number of samples that differ in all of it
    """
    values = np.stack([column.values for column in design.data_vars.values()], axis=1)
    extremes = [*values.argmin(axis=0), *values.argmax(axis=0)]
    between = np.linspace(0, len(values) - 1, max(2, most - len(extremes))).astype(int)
    chosen = np.unique([*extremes, *between])
    return design.isel(sample=chosen), len(np.unique(values, axis=0))


def scale_count(suite: SuiteConfig) -> int:
    """Count the scales that each record is run at."""
    return len(suite.scales if suite.intensities is None else suite.intensities.values)


def no_factors(suite: SuiteConfig) -> Floats:
    """Return (scales,) NaN for a record that cannot be used."""
    return np.full(scale_count(suite), np.nan)


def scale_factors(suite: SuiteConfig, motion: GroundMotion) -> tuple[Floats, str]:
    """Compute the multipliers (scales,) of a record, and say why it cannot be scaled; empty where it can."""
    target = suite.intensities
    if target is None:
        return np.array(suite.scales), ""
    try:
        measured = intensity(motion, target.period, target.damping, target.of)
    except RecordError as error:
        return no_factors(suite), f"{motion.name}: suite.intensities: {error}"
    if measured <= 0.0:
        return no_factors(suite), f"{motion.name}: cannot be scaled to {target.measure}, it does not move"
    with np.errstate(over="ignore"):
        factors = np.array(target.values) / measured
    if not np.isfinite(factors).all():
        why = f"{motion.name}: cannot be scaled to {target.measure}, it has {measured:g} m/s2"
        return no_factors(suite), why
    return factors, ""
