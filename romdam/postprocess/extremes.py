"""The worst runs of a suite, and the openings of its gaps over all runs."""

from __future__ import annotations

import numpy as np
import xarray as xr

from romdam.core.errors import ResultError
from romdam.postprocess.responses import RUNS, about_runs, response_of
from romdam.postprocess.weights import weighted_quantiles, weights_of

MEMORY = 20_000_000  # numbers held at once


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
    peaks, weights = summary.gap_peak_opening.transpose(*RUNS, "gap"), weights_of(summary)
    each = np.repeat(np.ones(peaks.sizes["record"]) if weights is None else weights, peaks.sizes["sample"])
    runs, gaps = peaks.sizes["record"] * peaks.sizes["sample"], peaks.sizes["gap"]
    envelopes = np.full((len(fractiles), peaks.sizes["scale"], gaps), np.nan)
    count = np.zeros(peaks.sizes["scale"])
    together = max(1, MEMORY // max(runs, 1))
    for k in range(peaks.sizes["scale"]):
        for first in range(0, gaps, together):
            chunk = slice(first, first + together)
            complete = peaks.isel(scale=k, gap=chunk).values.reshape(runs, -1).astype(float)
            there = np.isfinite(complete).all(axis=1) & (each > 0.0)
            count[k] = there.sum()
            if there.any():
                envelopes[:, k, chunk] = weighted_quantiles(complete[there], fractiles, each[there])
    kept = ("scale", "gap_joint", "gap_position", "gap_area", "joint", "component")
    coords = {name: summary[name] for name in kept if name in summary.coords}
    data = {
        "opening": (("fractile", "scale", "gap"), envelopes, dict(peaks.attrs)),
        "count": ("scale", count),
    }
    return xr.Dataset(data, coords | {"fractile": list(fractiles)}, {"title": summary.attrs.get("title", "")})
