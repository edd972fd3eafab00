"""Floor spectra of several runs together."""

from __future__ import annotations

import json

import numpy as np
import xarray as xr

from romdam.postprocess.floor_spectra import broadened
from romdam.postprocess.weights import weighted_quantiles, weights_of

STATISTICS = {"median": 0.5, "84 %": 0.84, "largest": 1.0}  # of several runs: their quantiles


def spectra_over_runs(summary: xr.Dataset) -> xr.Dataset:
    """Combine the floor spectra of a suite: median, 84th percentile and largest of the runs of each scale.

    Records count by their weights, samples of parameters alike; runs that failed are left out.

    Returns
    -------
    Dataset of `floor_spectrum`, and of `floor_spectrum_broadened` where the job broadens, with dimensions
    (statistic, scale, floor_place, component, floor_damping, floor_frequency); empty without floor spectra
    """
    if "floor_spectrum" not in summary:
        return xr.Dataset()
    values = summary.floor_spectrum.stack(run=("record", "sample")).reset_index("run", drop=True)
    values = values.dropna("run", how="all")
    dims = ("scale", "floor_place", "component", "floor_damping", "floor_frequency")
    values = values.transpose("run", *dims)
    quantiles = np.full((len(STATISTICS), *values.shape[1:]), np.nan)
    weights = weights_of(values)
    for k in range(values.sizes["scale"]):  # of a run all values are there, or none
        there = np.isfinite(values.values[:, k]).reshape(values.sizes["run"], -1).all(axis=1)
        there &= True if weights is None else weights > 0.0
        if there.any():
            of_scale = weighted_quantiles(
                values.values[there, k],
                list(STATISTICS.values()),
                None if weights is None else weights[there],
            )
            quantiles[:, k] = of_scale
    kept = {name: summary.coords[name] for name in dims if name in summary.coords}
    over = xr.DataArray(quantiles, dims=("statistic", *dims), coords=kept | {"statistic": list(STATISTICS)})
    combined = xr.Dataset({"floor_spectrum": over.assign_attrs(summary.floor_spectrum.attrs)})
    combined.attrs["runs"] = int(values.sizes["run"])
    outputs = json.loads(str(summary.attrs.get("configuration", "{}"))).get("outputs", {})
    share = (outputs.get("floor_spectra") or {}).get("broadening")
    if share:
        wide = broadened(over.values, summary.floor_frequency.values, share)
        combined["floor_spectrum_broadened"] = over.copy(data=wide)
    return combined
