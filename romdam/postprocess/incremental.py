"""Incremental dynamic analysis of a suite: response against intensity."""

from __future__ import annotations

import numpy as np
import xarray as xr

from romdam.postprocess.responses import RUNS, about_runs, curves_of, intensity_of, response_of
from romdam.postprocess.weights import weighted_quantiles

FRACTILES = (0.16, 0.5, 0.84)
LEVELS = 25  # points of a curve against intensity


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
    # besides even levels, intensities at which all records stand, as where they are scaled to targets
    low, high = measured.min("record").values, measured.max("record").values
    common = low[np.isfinite(low) & (low > 0.0) & (high - low <= 1e-9 * high)]
    levels = np.unique(np.concatenate([np.geomspace(ends.min(), ends.max(), LEVELS), common]))
    at = np.array([curve.at(levels) for curve in curves])
    count = np.isfinite(at).sum(axis=0)
    table = np.full((len(FRACTILES), len(levels)), np.nan)
    enough = 5 * count >= 4 * len(curves)
    weights = np.array([curve.weight for curve in curves])
    for k in np.flatnonzero(enough):
        there = np.isfinite(at[:, k])
        table[:, k] = weighted_quantiles(at[there, k], FRACTILES, weights[there])
    data["fractiles"] = xr.DataArray(table, dims=("fractile", "level"), attrs=dict(values.attrs))
    data["count"] = xr.DataArray(
        count, dims="level", attrs={"units": "1", "long_name": "curves at the level"}
    )
    coords = {"fractile": np.array(FRACTILES), "level": ("level", levels, dict(measured.attrs))}
    return xr.Dataset(data, attrs=about).assign_coords(coords)
