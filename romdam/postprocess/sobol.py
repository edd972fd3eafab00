"""Sobol' indices of a suite's responses: shares of their variance that the parameters make.

The samples are groups of rows: A and B, independent of each other, and for each parameter AB_i, which is A
with the column of that parameter from B. The first-order index of a parameter is the share of the variance
that it makes alone, the total index that which it makes with all others:

    V_i = mean(f_B (f_ABi - f_A)),    V_Ti = mean((f_A - f_ABi)^2) / 2

Of several records the variances are added before they are divided: the index of a scale is that of all its
records together, each with its own mean.

References
----------
Saltelli et al. (2010), Variance based sensitivity analysis of model output, Computer Physics Communications
181(2), 259-270, table 2 (b) and (f); Jansen (1999), Analysis of variance designs for model output, ibid. 117,
35-43; Gamboa, Janon, Klein, Lagnoux (2014), Sensitivity analysis for multidimensional and functional outputs,
Electronic Journal of Statistics 8, 575-603: several outputs.
"""

from __future__ import annotations

import numpy as np
import xarray as xr

from romdam.core.arrays import Floats
from romdam.postprocess.responses import RUNS, each_once, parameters, response_of, responses, turned

BASE_SAMPLES = "sobol_base_samples"  # attribute of a design and a summary: rows of A
RESAMPLES = 1000  # of the bootstrap
CONFIDENCE = 0.95  # of the bounds
_MOST_LOST = 0.1  # of the base samples: without more of them the parameters are not independent any longer
_FEWEST = 8  # base samples
_WIDE = 0.25  # of the variance: bounds farther apart are told of
_SAME = 1e-12  # relative: a response that varies less does not vary
_CHUNK = 4e6  # numbers of the resamples that are in memory together


def sobol_estimates(f_A: Floats, f_B: Floats, f_AB: Floats, weights: Floats) -> tuple[Floats, Floats]:
    """First-order and total indices (w, k) of weighted base samples.

    Parameters
    ----------
    f_A, f_B : (m, n) of m records, n base samples; NaN where one is left out
    f_AB : (k, m, n) of the parameters
    weights : (w, n) of the base samples, for each of w estimates; ones for that of all

    Returns
    -------
    NaN where a record has no base sample, and where nothing varies
    """
    center = np.nanmean(np.stack([f_A, f_B]), axis=(0, -1))[:, None]
    there = np.isfinite(f_A + f_B + f_AB.sum(axis=0))
    a, b, ab = (np.where(there, f - center, 0.0) for f in (f_A, f_B, f_AB))
    count = weights @ there.T  # (w, m)
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = weights @ (0.5 * (a + b)).T / count
        variance = (weights @ (0.5 * (a**2 + b**2)).T / count - mean**2).sum(axis=1)
        first = np.stack([(weights @ (b * (f - a)).T / count).sum(axis=1) for f in ab], axis=1)
        total = np.stack([(weights @ (0.5 * (a - f) ** 2).T / count).sum(axis=1) for f in ab], axis=1)
        return first / variance[:, None], total / variance[:, None]


def sobol_indices(summary: xr.Dataset, response: str, seed: int = 1) -> xr.Dataset:
    """First-order and total Sobol' indices of a response, the largest over joints, nodes and so on.

    Returns
    -------
    Dataset with dims scale, parameter, bound : `first`, `total`, their `_bounds` by a bootstrap over base
        samples, `count` (scale), base samples of all records of which every run is there

    Raises
    ------
    ResultError
        for a response that the suite does not have.
    """
    summary = each_once(summary)
    return _indices(summary, response_of(summary, response), seed)


def with_sobol_indices(summary: xr.Dataset) -> xr.Dataset:
    """Add the indices of every response, for each joint, node and so on, if the samples are made for them."""
    if BASE_SAMPLES not in summary.attrs:
        return summary
    added, population = dict[str, xr.DataArray](), each_once(summary)
    for name in responses(summary):
        values = turned(population[name])
        found = _indices(population, values, seed=1)
        about = str(values.attrs.get("long_name", name))
        for order, title in (("first", "first-order"), ("total", "total")):
            attrs = {"units": "1", "long_name": f"{title} Sobol' index of: {about}"}
            added[f"sobol_{order}_{name}"] = found[order].assign_attrs(attrs, **found.attrs)
            bounds = f"{100 * CONFIDENCE:g} % bounds of the {title} Sobol' index of: {about}"
            attrs = {"units": "1", "long_name": bounds, "method": f"bootstrap, {RESAMPLES} resamples"}
            added[f"sobol_{order}_{name}_bounds"] = found[f"{order}_bounds"].assign_attrs(attrs)
        attrs = {"units": "1", "long_name": f"base samples of all records, every run of which has: {about}"}
        added[f"sobol_count_{name}"] = found["count"].assign_attrs(attrs)
    return summary.assign(added)


def sobol_rows(indices: xr.Dataset) -> list[tuple[str, str, str, str, str]]:
    """Scale, parameter, first-order and total index with bounds, and base samples, as a table shows them."""
    rows = []
    for at in indices["first"].stack(row=("scale", "parameter")).row.values:
        index, cells = indices.sel(scale=at[0], parameter=at[1]), list[str]()
        for order in ("first", "total"):
            low, high = index[f"{order}_bounds"].values
            text = f"{float(index[order]):.3f} ({low:.3f} to {high:.3f})"
            cells.append(text if np.isfinite(index[order]) else "-")
        rows.append((f"{float(at[0]):.4g}", str(at[1]), cells[0], cells[1], f"{int(index['count'])}"))
    return rows


def _indices(summary: xr.Dataset, values: xr.DataArray, seed: int) -> xr.Dataset:
    """Indices of a response (record, scale, sample, ...) with the dims after these."""
    n, names = int(summary.attrs[BASE_SAMPLES]), list(parameters(summary))
    if "parameter" in summary.coords:  # a file may have its coordinates in another order
        names = [str(name) for name in summary.parameter.values]
    k, rest = len(names), [str(dim) for dim in values.dims if dim not in RUNS]
    y = values.transpose(*RUNS, *rest).values.astype(float)
    shape = y.shape[1:2] + y.shape[3:]
    y = y.reshape(*y.shape[:3], -1)
    table = np.full((y.shape[1], y.shape[3], 2, 3, k), np.nan)
    count, lost = np.zeros((y.shape[1], y.shape[3])), 0.0
    for at in np.ndindex(count.shape):
        f = y[:, at[0], :, at[1]].reshape(-1, k + 2, n)
        f = np.where(np.isfinite(f).all(axis=1, keepdims=True), f, np.nan)
        f = f[np.isfinite(f[:, 0]).any(axis=-1)]  # records that have run at all
        there = np.isfinite(f[:, 0])
        count[at] = there.sum()
        if not len(f):
            continue
        lost = max(lost, 1.0 - float(there.mean()))
        few = there.sum(axis=1).min() < _FEWEST or 1.0 - there.mean() > _MOST_LOST
        if not few and np.nanmax(f) - np.nanmin(f) > _SAME * np.nanmax(np.abs(f)):
            table[at] = _with_bounds(f, seed)
    dims = ("scale", *rest, "parameter")
    data: dict[str, object] = {"count": (dims[:-1], count.reshape(shape))}
    for i, order in enumerate(("first", "total")):
        data[order] = (dims, table[:, :, i, 0].reshape(*shape, k))
        bounds = np.moveaxis(table[:, :, i, 1:], -2, -1).reshape(*shape, k, 2)
        data[f"{order}_bounds"] = ((*dims, "bound"), bounds)
    about: dict[str, object] = {
        "estimator": "Saltelli 2010 (first order), Jansen 1999 (total)",
        "confidence_level": CONFIDENCE,
        "statement": "; ".join(text for text in (_failures(lost), _spread(table)) if text),
    }
    coords: dict[str, object] = {
        name: summary.coords[name] for name in ("scale", *rest) if name in summary.coords
    }
    coords |= {"parameter": np.array(names, dtype=str), "bound": np.array(["lower", "upper"])}
    return xr.Dataset(data, coords, about)


def _spread(table: Floats) -> str:
    """Tell of bounds too far apart to order parameters by; `table` has the bounds as (..., 3, k)."""
    widths = table[..., 2, :] - table[..., 1, :]
    if not (widths > _WIDE).any():
        return ""
    widest = float(widths[np.isfinite(widths)].max())
    return f"bounds are up to {widest:.2g} apart; four times as many base samples halve that"


def _failures(lost: float) -> str:
    """Tell of base samples that are left out as a run failed; empty where there are none."""
    if lost == 0.0:
        return ""
    left_out = f"up to {100 * lost:.2g} % of the base samples are left out, as one of their runs failed"
    if lost > _MOST_LOST:
        return f"{left_out}: no indices where it is more than {100 * _MOST_LOST:g} %"
    return f"{left_out}: indices are those of parameters with which no run fails"


def _with_bounds(f: Floats, seed: int) -> Floats:
    """(2, 3, k) first-order and total indices, each with its bounds, of runs (m, k + 2, n)."""
    n = f.shape[-1]
    f_A, f_B, f_AB = f[:, 0], f[:, 1], f[:, 2:].swapaxes(0, 1)
    whole = np.stack(sobol_estimates(f_A, f_B, f_AB, np.ones((1, n))))[:, 0]
    random, drawn = np.random.default_rng(seed), list[Floats]()
    for part in np.array_split(np.arange(RESAMPLES), max(1, round(RESAMPLES * n / _CHUNK))):
        picks = random.integers(0, n, (len(part), n)) + n * np.arange(len(part))[:, None]
        weights = np.bincount(picks.ravel(), minlength=len(part) * n).reshape(len(part), n).astype(float)
        drawn.append(np.stack(sobol_estimates(f_A, f_B, f_AB, weights)))
    ends = [0.5 - 0.5 * CONFIDENCE, 0.5 + 0.5 * CONFIDENCE]
    tails = np.quantile(np.concatenate(drawn, axis=1), ends, axis=1)
    return np.stack([whole, tails[0], tails[1]], axis=1)
