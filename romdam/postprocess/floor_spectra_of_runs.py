"""Floor spectra of several runs together."""

from __future__ import annotations

import json

import xarray as xr

from romdam.postprocess.floor_spectra import broadened

STATISTICS = {"median": 0.5, "84 %": 0.84, "largest": 1.0}  # of several runs: their quantiles


def spectra_over_runs(summary: xr.Dataset) -> xr.Dataset:
    """Combine the floor spectra of a suite: median, 84th percentile and largest of the runs of each scale.

    Records and samples of parameters count alike; runs that failed are left out.

    Returns
    -------
    Dataset of `floor_spectrum`, and of `floor_spectrum_broadened` where the job broadens, with dimensions
    (statistic, scale, floor_place, component, floor_damping, floor_frequency); empty without floor spectra
    """
    if "floor_spectrum" not in summary:
        return xr.Dataset()
    values = summary.floor_spectrum.stack(run=("record", "sample")).reset_index("run", drop=True)
    values = values.dropna("run", how="all")
    over = values.quantile(list(STATISTICS.values()), "run").rename(quantile="statistic")
    over = over.assign_coords(statistic=list(STATISTICS)).transpose(
        "statistic", "scale", "floor_place", "component", "floor_damping", "floor_frequency"
    )
    combined = xr.Dataset({"floor_spectrum": over.assign_attrs(summary.floor_spectrum.attrs)})
    combined.attrs["runs"] = int(values.sizes["run"])
    outputs = json.loads(str(summary.attrs.get("configuration", "{}"))).get("outputs", {})
    share = (outputs.get("floor_spectra") or {}).get("broadening")
    if share:
        wide = broadened(over.values, summary.floor_frequency.values, share)
        combined["floor_spectrum_broadened"] = over.copy(data=wide)
    return combined
