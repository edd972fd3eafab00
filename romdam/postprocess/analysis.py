"""What a suite says: incremental curves, fragility, correlation and sensitivity, as Datasets of its summary.

Every function takes the Dataset of `summary.nc` (or a part of it: `summary.sel(joint="J3")`) and the name
of a response. Runs that failed are NaN there; they are left out, never counted as exceedances, and
`attrs["failed"]` says how many. Where numbers cannot be had, `attrs["statement"]` says why and they are NaN.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from romdam.core.arrays import Floats
from romdam.core.errors import ResultError
from romdam.postprocess.lognormal import LognormalFit, Observations, fit_lognormal
from romdam.postprocess.responses import (
    RUNS,
    Curve,
    about_runs,
    curves_of,
    intensity_of,
    measures,
    parameters,
    response_of,
)

FRACTILES = (0.16, 0.5, 0.84)
LEVELS = 25  # points of a curve against intensity
RESAMPLES = 1000
GROUPS, FEWEST = 8, 5  # groups of runs set beside a fit, and the fewest runs in one
MEMORY = 20_000_000  # numbers held at once


def ida_curves(summary: xr.Dataset, response: str = "peak_opening", intensity: str = "sa") -> xr.Dataset:
    """Incremental dynamic analysis: response against intensity for each record, and its fractiles.

    Parameters
    ----------
    summary : of a suite with several scales or target intensities
    response, intensity : names of a response and of a measure

    Returns
    -------
    Dataset : `response` and `intensity` (record, scale, sample); `fractiles` (fractile, level), 16, 50 and
        84 % of the curves at an intensity, for which the curves are interpolated in logarithms and never
        continued past their ends; `count` (level), the curves that reach so far. Fractiles of fewer
        than four fifths of the curves are NaN: those that end early are not a random part of all.

    Raises
    ------
    ResultError
        for names that the suite does not have.

    References
    ----------
    Vamvatsikos and Cornell, Incremental dynamic analysis, Earthquake Engineering and Structural Dynamics 31
    (2002).
    """
    values, measured = response_of(summary, response), intensity_of(summary, intensity)
    curves = [c for c in curves_of(values, measured) if len(c.intensity) > 1 and np.ptp(c.intensity) > 0.0]
    data = {
        "response": values.transpose(*RUNS),
        "intensity": measured.broadcast_like(values).transpose(*RUNS).assign_attrs(measured.attrs),
    }
    about = about_runs(summary, values, measured) | {"curves": len(curves), "statement": ""}
    if not curves:
        about["statement"] = "no record has runs at two intensities; a curve needs `scales` or `intensities`"
        return xr.Dataset(data, attrs=about)
    ends = np.array([[c.intensity[0], c.intensity[-1]] for c in curves])
    levels = np.unique(np.concatenate([np.geomspace(ends.min(), ends.max(), LEVELS), _common(measured)]))
    at = np.array([curve.at(levels) for curve in curves])
    count = np.isfinite(at).sum(axis=0)
    table = np.full((len(FRACTILES), len(levels)), np.nan)
    enough = 5 * count >= 4 * len(curves)
    table[:, enough] = np.nanquantile(at[:, enough], FRACTILES, axis=0)
    data["fractiles"] = xr.DataArray(table, dims=("fractile", "level"), attrs=dict(values.attrs))
    data["count"] = xr.DataArray(
        count, dims="level", attrs={"units": "1", "long_name": "curves at the level"}
    )
    coords = {"fractile": np.array(FRACTILES), "level": ("level", levels, dict(measured.attrs))}
    return xr.Dataset(data, attrs=about).assign_coords(coords)


def _common(measured: xr.DataArray) -> Floats:
    """Intensities at which all records stand, as they do where they are scaled to targets."""
    low, high = measured.min("record").values, measured.max("record").values
    same = np.isfinite(low) & (low > 0.0) & (high - low <= 1e-9 * high)
    return np.asarray(low[same])


def fragility(
    summary: xr.Dataset,
    response: str,
    threshold: float,
    intensity: str = "sa",
    method: str = "auto",
    confidence: float = 0.95,
) -> xr.Dataset:
    """Fit a lognormal fragility by maximum likelihood: median theta and dispersion beta with their bounds.

    Parameters
    ----------
    summary : of a suite
    response, threshold : what must not exceed what [the response's unit]
    intensity : measure that the fragility is a function of
    method : `capacities`: each record (with each sample) counts once, by the intensity at which its curve
        first exceeds the threshold, interpolated in logarithms, or by the end that it does not leave (the
        reference's truncated analysis); `stripes`: each run counts, by whether it exceeds (a probit
        likelihood); `auto`: capacities where there are several scales; with one the two are the same
    confidence : of the bounds of the profile likelihood, which take observations as independent: with many
        runs of one record they are too narrow

    Returns
    -------
    Dataset : `theta`, `beta`; `theta_bounds`, `beta_bounds` (bound); `probability` (level) and
        `probability_bounds` (level, bound), pointwise; NaN with a statement where nothing can be fitted;
        `group_share` (group) against `group_intensity`, what the fit is set beside: the share of runs that
        exceed in groups of like intensity, or of records by the product-limit estimate.

    Raises
    ------
    ResultError
        for names that the suite does not have, and a method that does not exist.

    References
    ----------
    Baker, Efficient analytical fragility function fitting using dynamic structural analysis, Earthquake
    Spectra 31(1), 2015, 579-599.
    """
    values, measured = response_of(summary, response), intensity_of(summary, intensity)
    curves = curves_of(values, measured)
    method = _method(method, curves)
    about = about_runs(summary, values, measured) | {"method": method, "threshold": threshold}
    seen = _observations(curves, threshold, method)
    groups = _groups(curves, threshold) if method == "stripes" else _product_limit(seen)
    names = ("group_intensity", "group_share", "group_count")
    empirical = {n: ("group", row, {"units": "1"}) for n, row in zip(names, groups.T, strict=True)}
    fitted = _fragility_dataset(seen, confidence, measured)
    return fitted.assign(empirical).assign_attrs(about | fitted.attrs)


def _method(asked: str, curves: list[Curve]) -> str:
    if asked not in ("auto", "capacities", "stripes"):
        raise ResultError(f"{asked}: is no method of a fragility; use auto, capacities or stripes")
    if asked != "auto":
        return asked
    return "capacities" if any(len(curve.intensity) > 1 for curve in curves) else "stripes"


def _observations(curves: list[Curve], threshold: float, method: str) -> Observations:
    """What the curves say of the intensities at which the threshold is exceeded."""
    known, below, above = [], [], []
    for curve in curves:
        exceeds = curve.response > threshold
        if method == "stripes":
            below += list(curve.intensity[exceeds])
            above += list(curve.intensity[~exceeds])
        elif exceeds[0]:
            below.append(curve.intensity[0])
        elif exceeds.any():
            known.append(curve.reaches(threshold))
        else:
            above.append(curve.intensity[-1])
    return Observations(*(np.log(np.array(part, dtype=float)) for part in (known, below, above)))


def _product_limit(seen: Observations) -> Floats:
    """(n, 3) capacities, the share at or below each by the product-limit estimate, and how many are equal.

    A capacity that lies below a record's smallest intensity is taken to stand there.
    """
    reached = np.concatenate([seen.known, seen.below])
    levels, counts = np.unique(reached, return_counts=True)
    left = np.array([(reached >= one).sum() + (seen.above >= one).sum() for one in levels])
    share = 1.0 - np.cumprod(1.0 - counts / np.maximum(left, 1))
    return np.column_stack([np.exp(levels), share, counts])


def _groups(curves: list[Curve], threshold: float) -> Floats:
    """(n, 3) intensity, share of runs above the threshold, and runs, in groups of like intensity."""
    x = np.concatenate([c.intensity for c in curves]) if curves else np.empty(0)
    y = np.concatenate([c.response > threshold for c in curves]) if curves else np.empty(0)
    order = np.argsort(x, kind="stable")
    levels, where, counts = np.unique(np.round(np.log(x), 9), return_inverse=True, return_counts=True)
    if len(levels) and counts.min() >= FEWEST:
        parts = [np.flatnonzero(where == i) for i in range(len(levels))]
    else:
        parts = np.array_split(order, max(1, min(GROUPS, len(order) // FEWEST))) if len(order) else []
    rows = [[np.exp(np.log(x[i]).mean()), y[i].mean(), len(i)] for i in parts]
    return np.array(rows, dtype=float).reshape(-1, 3)


def _fragility_dataset(seen: Observations, confidence: float, measured: xr.DataArray) -> xr.Dataset:
    """The fit of what was seen, or why there is none."""
    about = {
        "observations": seen.count,
        "exceeding": len(seen.known) + len(seen.below),
        "interpolated": len(seen.known),
        "confidence": confidence,
        "bounds": "profile likelihood",
        "statement": "",
    }
    unit, nothing = {"units": measured.attrs.get("units", "1")}, (np.nan, np.nan)
    x = measured.values[np.isfinite(measured.values) & (measured.values > 0.0)]
    ends = (float(x.min()), 1.2 * float(x.max())) if x.size else (1.0, 1.0)
    levels = np.geomspace(*ends, LEVELS)
    (theta, beta), bounds = nothing, (nothing, nothing)
    try:
        fit = fit_lognormal(seen)
    except ValueError as error:
        about["statement"] = str(error)
        share, band = np.full(len(levels), np.nan), np.full((len(levels), 2), np.nan)
    else:
        levels = _where_it_rises(fit, ends)
        theta, beta = fit.theta, fit.beta
        bounds = (fit.theta_bounds(confidence), fit.beta_bounds(confidence))
        share, band = fit.probability(levels), fit.probability_bounds(levels, confidence)
    data = {
        "theta": ((), theta, unit | {"long_name": "median intensity at the threshold"}),
        "beta": ((), beta, {"units": "1", "long_name": "logarithmic standard deviation"}),
        "theta_bounds": ("bound", np.array(bounds[0]), unit),
        "beta_bounds": ("bound", np.array(bounds[1]), {"units": "1"}),
        "probability": ("level", share, {"units": "1", "long_name": "probability of exceedance"}),
        "probability_bounds": (("level", "bound"), band, {"units": "1"}),
    }
    coords = {"level": ("level", levels, dict(measured.attrs)), "bound": np.array(["lower", "upper"])}
    return xr.Dataset(data, coords, about)


def _where_it_rises(fit: LognormalFit, ends: tuple[float, float]) -> Floats:
    """Levels between two ends, most of them where the fit goes from 0 to 1."""
    rise = fit.theta * np.exp(fit.beta * np.linspace(-3.5, 3.5, LEVELS))
    return np.unique(np.concatenate([ends, rise[(rise > ends[0]) & (rise < ends[1])]]))


def correlation(summary: xr.Dataset, response: str = "peak_opening") -> xr.Dataset:
    """How a response goes with each measure of the records, over all runs.

    Returns
    -------
    Dataset with dim measure : `spearman`, rank correlation; `pearson`, of the logarithms; `slope` and
        `dispersion` of ln(response) against ln(measure), the latter their efficiency: the standard deviation
        about the line; `count`, runs; NaN where one of the two does not vary.

    Raises
    ------
    ResultError
        for a response that the suite does not have.
    """
    values = response_of(summary, response)
    names = measures(summary)
    rows = [_related(intensity_of(summary, name).broadcast_like(values), values) for name in names]
    columns = dict(
        zip(("spearman", "pearson", "slope", "dispersion", "count"), np.array(rows).T, strict=True)
    )
    data = {name: ("measure", column, {"units": "1"}) for name, column in columns.items()}
    statement = "" if np.isfinite(columns["spearman"]).any() else "neither response nor measures vary"
    return xr.Dataset(
        data, {"measure": np.array(names)}, about_runs(summary, values) | {"statement": statement}
    )


def _related(measured: xr.DataArray, values: xr.DataArray) -> tuple[float, float, float, float, float]:
    from scipy.stats import rankdata

    x, y = measured.transpose(*RUNS).values.ravel(), values.transpose(*RUNS).values.ravel()
    kept = np.isfinite(x) & np.isfinite(y)
    x, y = x[kept], y[kept]
    if len(x) < 3 or not _varies(x) or not _varies(y):
        return (np.nan, np.nan, np.nan, np.nan, float(len(x)))
    spearman = float(np.corrcoef(rankdata(x), rankdata(y))[0, 1])
    if x.min() <= 0.0 or y.min() <= 0.0:
        return (spearman, np.nan, np.nan, np.nan, float(len(x)))
    x, y = np.log(x), np.log(y)
    slope, level = np.polyfit(x - x.mean(), y, 1)
    left = y - level - slope * (x - x.mean())
    dispersion = float(np.sqrt(left @ left / max(len(x) - 2, 1)))
    return (spearman, float(np.corrcoef(x, y)[0, 1]), float(slope), dispersion, float(len(x)))


def _varies(values: Floats) -> bool:
    """Whether values differ by more than round-off."""
    return bool(np.ptp(values) > 1e-12 * np.abs(values).max())


def sensitivity(
    summary: xr.Dataset, response: str = "peak_opening", confidence: float = 0.95, seed: int = 1
) -> xr.Dataset:
    """How a response depends on the parameters that the samples vary.

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
    values, given = response_of(summary, response), parameters(summary)
    names = list(given)
    effect, logarithmic = _effects(values)
    there = np.isfinite(effect)
    varied = {n: v.values[there] for n, v in given.items() if len(np.unique(v.values[there])) > 1}
    count = int(there.sum())
    about = about_runs(summary, values) | {
        "samples": count,
        "effect": "of the logarithm" if logarithmic else "of the value",
        "bounds": f"bootstrap over samples, {RESAMPLES} resamples",
        "statement": _no_sensitivity(names, varied, effect[there]),
    }
    table = np.full((2, 3, len(names)), np.nan)
    r_squared = np.nan
    if not about["statement"]:
        columns = [names.index(n) for n in varied]
        found, r_squared = _dependence(list(varied.values()), effect[there], confidence, seed)
        table[:, :, columns] = found
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


def _no_sensitivity(names: list[str], varied: Mapping[str, Floats], effect: Floats) -> str:
    if not names:
        return "the suite varies no parameters"
    if not varied:
        return "no parameter takes two values among the samples that ran"
    if len(effect) < len(varied) + 3:
        needed = len(varied) + 3
        return f"{len(effect)} samples are too few for {len(varied)} parameters; at least {needed} are needed"
    return "" if np.ptp(effect) > 1e-12 else "the response does not vary with the samples"


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


def worst_runs(summary: xr.Dataset, response: str = "peak_opening", count: int = 10) -> xr.Dataset:
    """The runs with the largest response, largest first: dim run with record, scale and sample.

    Raises
    ------
    ResultError
        for a response that the suite does not have.
    """
    values = response_of(summary, response)
    runs = values.transpose(*RUNS).stack(run=RUNS).dropna("run")
    order = np.argsort(-runs.values, kind="stable")[:count]
    worst = runs.isel(run=order).reset_index("run")
    return worst.rename("response").to_dataset().assign_attrs(about_runs(summary, values))


def opening_envelopes(summary: xr.Dataset, fractiles: tuple[float, ...] = (0.5, 0.84, 1.0)) -> xr.Dataset:
    """Largest opening of every gap over the records and samples: `opening` (fractile, scale, gap) [m].

    `count` (scale) says how many runs each fractile is taken over.

    Raises
    ------
    ResultError
        for a suite without joints.
    """
    if "gap_peak_opening" not in summary:
        raise ResultError("gap_peak_opening: this suite has none; a model without joints has no openings")
    peaks = summary.gap_peak_opening.transpose(*RUNS, "gap")
    runs, gaps = peaks.sizes["record"] * peaks.sizes["sample"], peaks.sizes["gap"]
    found = np.full((len(fractiles), peaks.sizes["scale"], gaps), np.nan)
    count = np.zeros(peaks.sizes["scale"])
    together = max(1, MEMORY // max(runs, 1))
    for k in range(peaks.sizes["scale"]):
        for first in range(0, gaps, together):
            chunk = slice(first, first + together)
            part = peaks.isel(scale=k, gap=chunk).values.reshape(runs, -1).astype(float)
            part = part[np.isfinite(part).all(axis=1)]
            count[k] = len(part)
            if len(part):
                found[:, k, chunk] = np.quantile(part, fractiles, axis=0)
    coords = {name: summary[name] for name in ("scale", "gap_joint", "gap_position", "joint", "component")}
    data = {"opening": (("fractile", "scale", "gap"), found, dict(peaks.attrs)), "count": ("scale", count)}
    return xr.Dataset(data, coords | {"fractile": list(fractiles)}, {"title": summary.attrs.get("title", "")})
