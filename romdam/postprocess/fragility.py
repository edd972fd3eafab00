"""Fragility of a suite: the probability that a response exceeds a threshold, against intensity."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from romdam.core.arrays import Floats
from romdam.core.errors import ResultError
from romdam.postprocess.incremental import LEVELS
from romdam.postprocess.lognormal import Observations, fit_lognormal
from romdam.postprocess.responses import Curve, about_runs, curves_of, intensity_of, response_of

GROUPS, FEWEST = 8, 5  # groups of runs set beside a fit, and the fewest runs in one
_DOUBT = 0.05  # 95 % confidence


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
    method = _chosen(method, curves)
    seen = _observations(curves, threshold, method)
    about = about_runs(summary, values, measured) | {
        "method": method,
        "threshold": threshold,
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
        # most levels stand where the fit goes from 0 to 1
        rise = fit.theta * np.exp(fit.beta * np.linspace(-3.5, 3.5, LEVELS))
        levels = np.unique(np.concatenate([ends, rise[(rise > ends[0]) & (rise < ends[1])]]))
        theta, beta = fit.theta, fit.beta
        bounds = (fit.theta_bounds(confidence), fit.beta_bounds(confidence))
        share, band = fit.probability(levels), fit.probability_bounds(levels, confidence)
    data: dict[str, tuple[Any, ...]] = {
        "theta": ((), theta, unit | {"long_name": "median intensity at the threshold"}),
        "beta": ((), beta, {"units": "1", "long_name": "logarithmic standard deviation"}),
        "theta_bounds": ("bound", np.array(bounds[0]), unit),
        "beta_bounds": ("bound", np.array(bounds[1]), {"units": "1"}),
        "probability": ("level", share, {"units": "1", "long_name": "probability of exceedance"}),
        "probability_bounds": (("level", "bound"), band, {"units": "1"}),
    }
    coords = {"level": ("level", levels, dict(measured.attrs)), "bound": np.array(["lower", "upper"])}
    groups = _groups(curves, threshold) if method == "stripes" else product_limit(seen)
    names = ("group_intensity", "group_share", "group_count")
    data |= {n: ("group", row, {"units": "1"}) for n, row in zip(names, groups.T, strict=True)}
    return xr.Dataset(data, coords, about)


def _chosen(method: str, curves: list[Curve]) -> str:
    if method not in ("auto", "capacities", "stripes"):
        raise ResultError(f"{method}: is no method of a fragility; use auto, capacities or stripes")
    if method == "auto":
        method = "capacities" if any(len(curve.intensity) > 1 for curve in curves) else "stripes"
    return method


def resampled_fits(
    summary: xr.Dataset, response: str, threshold: float, intensity: str, count: int, seed: int = 1
) -> Floats:
    """Medians and dispersions (n, 2) of the fragility of records drawn with replacement.

    A record is drawn with all of its runs: the scatter is that between records. Draws that give no
    fragility are left out, so that n is at most `count`.

    References
    ----------
    Efron, Tibshirani, An introduction to the bootstrap (Chapman and Hall, 1993), 6 and 13.
    """
    values, measured = response_of(summary, response), intensity_of(summary, intensity)
    records = range(summary.sizes["record"])
    each = [curves_of(values.isel(record=[i]), measured.isel(record=[i])) for i in records]
    each = [curves for curves in each if curves]
    method = _chosen("auto", [curve for curves in each for curve in curves])
    random, fits = np.random.default_rng(seed), list[tuple[float, float]]()
    for _ in range(count):
        drawn = [curve for i in random.integers(0, len(each), len(each)) for curve in each[i]]
        try:
            fit = fit_lognormal(_observations(drawn, threshold, method))
        except ValueError:  # of records that all exceed, or none
            continue
        fits.append((fit.theta, fit.beta))
    return np.array(fits).reshape(-1, 2)


def none_exceeds(records: int) -> float:
    """Upper bound, with 95 % confidence, of the probability p of what none of n records did.

    None of n does with the probability (1 - p)^n, which is 5 % at p = 1 - 0.05^(1/n); 3/n comes near it for
    many records, and is far above it for few.

    It holds for exceeding the largest response of the records, too, whatever its distribution.

    References
    ----------
    Hanley, Lippman-Hand, If nothing goes wrong, is everything all right?, JAMA 249(13), 1983, 1743-1745.
    """
    return float(1.0 - _DOUBT ** (1.0 / records))


def _observations(curves: list[Curve], threshold: float, method: str) -> Observations:
    """Collect what the curves say of the intensities at which the threshold is exceeded."""
    known, below, above = (
        list[tuple[float, float]](),
        list[tuple[float, float]](),
        list[tuple[float, float]](),
    )
    for curve in curves:
        exceeds = curve.response > threshold
        if method == "stripes":
            below += [(x, curve.weight) for x in curve.intensity[exceeds]]
            above += [(x, curve.weight) for x in curve.intensity[~exceeds]]
        elif exceeds[0]:
            below.append((curve.intensity[0], curve.weight))
        elif exceeds.any():
            known.append((curve.reaches(threshold), curve.weight))
        else:
            above.append((curve.intensity[-1], curve.weight))
    weights = np.array([weight for _, weight in (*known, *below, *above)])
    of_known, of_below, of_above = (np.log([x for x, _ in members]) for members in (known, below, above))
    return Observations(of_known, of_below, of_above, weights if len({*weights}) > 1 else None)


def product_limit(seen: Observations) -> Floats:
    """(n, 3) capacities, the share at or below each by the product-limit estimate, and how many are equal.

    A capacity that lies below a record's smallest intensity is taken to stand there.
    """
    reached = np.concatenate([seen.known, seen.below])
    of_reached, of_above = np.split(seen.counts, [len(reached)])
    levels, counts = np.unique(reached, return_counts=True)
    gone = np.array([of_reached[reached == level].sum() for level in levels])
    left = np.array([of_reached[reached >= x].sum() + of_above[seen.above >= x].sum() for x in levels])
    share = 1.0 - np.cumprod(1.0 - gone / left)
    return np.column_stack([np.exp(levels), share, counts])


def _groups(curves: list[Curve], threshold: float) -> Floats:
    """(n, 3) intensity, share of runs above the threshold, and runs, in groups of like intensity."""
    x = np.concatenate([c.intensity for c in curves]) if curves else np.empty(0)
    y = np.concatenate([c.response > threshold for c in curves]) if curves else np.empty(0)
    weight = np.concatenate([np.full(len(c.intensity), c.weight) for c in curves]) if curves else np.empty(0)
    order = np.argsort(x, kind="stable")
    levels, where, counts = np.unique(np.round(np.log(x), 9), return_inverse=True, return_counts=True)
    if len(levels) and counts.min() >= FEWEST:
        groups = [np.flatnonzero(where == i) for i in range(len(levels))]
    else:
        groups = np.array_split(order, max(1, min(GROUPS, len(order) // FEWEST))) if len(order) else []
    rows = [[np.exp(np.log(x[i]).mean()), np.average(y[i], weights=weight[i]), len(i)] for i in groups]
    return np.array(rows, dtype=float).reshape(-1, 3)
