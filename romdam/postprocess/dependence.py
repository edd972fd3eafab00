"""Dependence of a suite's response on the records' measures, the samples' parameters."""

from __future__ import annotations

import numpy as np
import xarray as xr

from romdam.core.arrays import Floats
from romdam.postprocess.responses import (
    about_runs,
    intensity_of,
    measures,
    parameters,
    response_of,
)
from romdam.postprocess.sobol import BASE_SAMPLES

RESAMPLES = 1000
_RELATIONS = ("spearman", "pearson", "slope", "dispersion", "count")
_FEWEST = 3  # records of which two can be correlated at all


def correlation(summary: xr.Dataset, response: str = "peak_opening") -> xr.Dataset:
    """Correlate a response with each measure of the records, scale by scale.

    A record counts once at each scale, by the median of its samples: runs of one record at other scales or of
    other samples are no further records, and scaling correlates any response with any measure.

    Returns
    -------
    Dataset with dims measure, scale : `spearman_at_scale`, rank correlation; `pearson_at_scale`, of the
        logarithms; `slope_at_scale` and `dispersion_at_scale` of ln(response) against ln(measure), the latter
        their efficiency: the standard deviation about the line; `count_at_scale`, records; NaN where one of
        the two does not vary. Without `_at_scale`: their medians over the scales, with dim measure.

    Raises
    ------
    ResultError
        for a response that the suite does not have.
    """
    values = response_of(summary, response)
    middle = values.median("sample").transpose("record", "scale").values
    names = measures(summary)
    table = np.array(
        [
            [_related(x, y) for x, y in zip(intensity_of(summary, name).values.T, middle.T, strict=True)]
            for name in names
        ]
    )
    data: dict[str, object] = {}
    for name, column in zip(_RELATIONS, np.moveaxis(table, 2, 0), strict=True):
        finite = [row[np.isfinite(row)] for row in column]
        medians = np.array([np.median(row) if len(row) else np.nan for row in finite])
        data[name] = ("measure", medians, {"units": "1"})
        data[f"{name}_at_scale"] = (("measure", "scale"), column, {"units": "1"})
    statement = "neither response nor measures vary among the records of one scale"
    if np.isfinite(table[..., 0]).any():
        statement = ""
    elif 1 < (most := table[..., -1].max(initial=0.0)) < _FEWEST:
        statement = f"{most:.0f} records are too few; at least {_FEWEST} are needed"
    return xr.Dataset(
        data,
        {"measure": np.array(names), "scale": summary.scale},
        about_runs(summary, values) | {"statement": statement},
    )


def _related(x: Floats, y: Floats) -> tuple[float, float, float, float, float]:
    """Relate two variables: see `_RELATIONS` for what is returned, and `correlation` for what it means."""
    from scipy.stats import rankdata

    kept = np.isfinite(x) & np.isfinite(y)
    x, y = x[kept], y[kept]
    # differences within round-off are none
    if len(x) < _FEWEST or any(np.ptp(values) <= 1e-12 * np.abs(values).max() for values in (x, y)):
        return (np.nan, np.nan, np.nan, np.nan, float(len(x)))
    spearman = float(np.corrcoef(rankdata(x), rankdata(y))[0, 1])
    if x.min() <= 0.0 or y.min() <= 0.0:
        return (spearman, np.nan, np.nan, np.nan, float(len(x)))
    x, y = np.log(x), np.log(y)
    slope, level = np.polyfit(x - x.mean(), y, 1)
    left = y - level - slope * (x - x.mean())
    dispersion = float(np.sqrt(left @ left / max(len(x) - 2, 1)))
    return (spearman, float(np.corrcoef(x, y)[0, 1]), float(slope), dispersion, float(len(x)))


def sensitivity(
    summary: xr.Dataset, response: str = "peak_opening", confidence: float = 0.95, seed: int = 1
) -> xr.Dataset:
    """Measure the dependence of a response on the parameters that the samples vary.

    What a record and its scale do is taken out first: the effect of a sample is the mean over records and
    scales of its response less the mean of all samples there, in logarithms where all responses are positive.

    Returns
    -------
    Dataset with dim parameter : `spearman`, rank correlation of effect and parameter; `regression`,
        standardised coefficients of all parameters together, on ranks (a parameter may be infinite, as the
        stiffness of a rigid joint); their bounds by a bootstrap over samples; `effect` (sample).

    Raises
    ------
    ResultError
        for a response that the suite does not have.
    """
    if BASE_SAMPLES in summary.attrs:  # only A and B are independent of each other
        summary = summary.isel(sample=slice(2 * int(summary.attrs[BASE_SAMPLES])))
    values, sampled = response_of(summary, response), parameters(summary)
    names = list(sampled)
    effect, logarithmic = _effects(values)
    there = np.isfinite(effect)
    varied = {n: v.values[there] for n, v in sampled.items() if len(np.unique(v.values[there])) > 1}
    count = int(there.sum())
    if not names:
        statement = "the suite varies no parameters"
    elif not varied:
        statement = "no parameter takes two values among the samples that ran"
    elif count < len(varied) + 3:
        needed = len(varied) + 3
        statement = f"{count} samples are too few for {len(varied)} parameters; at least {needed} are needed"
    elif np.ptp(effect[there]) <= 1e-12:
        statement = "the response does not vary with the samples"
    else:
        statement = ""
    about = about_runs(summary, values) | {
        "samples": count,
        "effect": "of the logarithm" if logarithmic else "of the value",
        "bounds": f"bootstrap over samples, {RESAMPLES} resamples",
        "statement": statement,
    }
    table = np.full((2, 3, len(names)), np.nan)
    r_squared = np.nan
    if not statement:
        columns = [names.index(n) for n in varied]
        strength, r_squared = _dependence(list(varied.values()), effect[there], confidence, seed)
        table[:, :, columns] = strength
    data: dict[str, object] = {"effect": ("sample", effect, {"units": "1"}), "r_squared": ((), r_squared)}
    for name, (value, low, high) in zip(("spearman", "regression"), table, strict=True):
        data[name] = ("parameter", value, {"units": "1"})
        data[f"{name}_bounds"] = (("parameter", "bound"), np.column_stack([low, high]), {"units": "1"})
    return xr.Dataset(data, {"parameter": np.array(names, dtype=str), "bound": ["lower", "upper"]}, about)


def _effects(values: xr.DataArray) -> tuple[Floats, bool]:
    """(samples,) what each sample does to the response, and whether to its logarithm."""
    y = values.transpose("sample", "record", "scale").values
    y = y.reshape(len(y), -1)
    logarithmic = bool((y[np.isfinite(y)] > 0.0).all())
    y = np.log(y) if logarithmic else y
    y = y[:, np.isfinite(y).any(axis=0)]
    if not y.size:
        return np.full(len(y), np.nan), logarithmic
    y = y - np.nanmean(y, axis=0)
    there = np.isfinite(y)
    total, count = np.where(there, y, 0.0).sum(axis=1), there.sum(axis=1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan), logarithmic


def _dependence(columns: list[Floats], effect: Floats, confidence: float, seed: int) -> tuple[Floats, float]:
    """(2, 3, p) rank correlation and standardised regression on ranks with bounds, and its R²."""
    from scipy.stats import rankdata

    ranks = np.column_stack([rankdata(column) for column in [*columns, effect]])
    whole = _coefficients(ranks[None])[:, 0]
    picks = np.random.default_rng(seed).integers(0, len(ranks), (RESAMPLES, len(ranks)))
    chunks = np.array_split(picks, max(1, picks.size // 200_000))
    drawn = np.concatenate([_coefficients(ranks[chunk]) for chunk in chunks], axis=1)
    tails = np.quantile(drawn, [0.5 - 0.5 * confidence, 0.5 + 0.5 * confidence], axis=1)
    explained = float(whole[0] @ whole[1])  # R² of a standardised regression
    return np.stack([whole, tails[0], tails[1]], axis=1), explained


def _coefficients(ranks: Floats) -> Floats:
    """(2, resamples, p) correlations and standardised coefficients; ranks are (resamples, samples, p + 1)."""
    centred = ranks - ranks.mean(axis=1, keepdims=True)
    size = np.sqrt((centred**2).sum(axis=1, keepdims=True))
    unit = centred / np.where(size > 0.0, size, 1.0)
    products = np.einsum("bsi,bsj->bij", unit, unit)
    between, along = products[:, :-1, :-1], products[:, :-1, -1:]
    return np.stack([along[..., 0], (np.linalg.pinv(between, hermitian=True) @ along)[..., 0]])
