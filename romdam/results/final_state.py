"""The state in which a run ended, as a group of its result file."""

from __future__ import annotations

import json
from typing import Any

import h5netcdf
import numpy as np
import xarray as xr
from numpy.typing import NDArray

from romdam.core.final_state import FinalState
from romdam.core.final_state_file import GROUP, MODEL, VARIABLES


def write_final_state(file: h5netcdf.File, final: FinalState, dataset: xr.Dataset) -> None:
    """Add the group to a result file.

    Parameters
    ----------
    dataset : of the result, whose joints and gaps are those of the state
    """
    group = file.create_group(GROUP)
    names = dataset["gap_joint"].values.astype(str) if "gap_joint" in dataset else np.zeros(0, dtype=str)
    arrays = {name: np.asarray(values) for name, values in final.arrays.items()}
    group.attrs["integrator"] = final.integrator
    group.attrs["joints"] = json.dumps({name: int((names == name).sum()) for name in dict.fromkeys(names)})
    group.attrs["laws"] = json.dumps(list(final.laws))
    group.attrs["empty"] = json.dumps({name: of.shape for name, of in arrays.items() if not of.size})
    group.attrs["long_name"] = (
        "state in which the run ended; loads.initial_state of another job begins with it"
    )
    for name, values in arrays.items():
        if values.size:
            dims, unit, long_name = VARIABLES[name]
            _write(group, name, dims, values, {"units": unit, "long_name": long_name})
    if final.laws:
        of_laws = {"units": "1", "long_name": "which gaps have each law of the memory"}
        _write(group, "law_on", ("law", "gap"), np.stack(list(final.laws.values())), of_laws)
    model = group.create_group(MODEL)
    model.attrs["long_name"] = "what tells the model of the state from others"
    for name, values in final.model.items():
        if values.size:
            dims = tuple(f"{name}_{axis}".replace(" ", "_") for axis in range(values.ndim))
            _write(model, name, dims, values, {})


def _write(
    group: h5netcdf.Group,
    name: str,
    dims: tuple[str, ...],
    values: NDArray[Any],
    attributes: dict[str, str],
) -> None:
    """Write one array; dimensions of the group above serve where they have the same length."""
    for dim, size in zip(dims, values.shape, strict=True):
        if dim not in group.dimensions or group.dimensions[dim].size != size:
            group.dimensions[dim] = size
    if values.dtype.kind in "bu":
        values = values.astype(np.int8)
    variable = group.create_variable(name, dims, values.dtype, data=values)
    for key, text in attributes.items():
        variable.attrs[key] = text
