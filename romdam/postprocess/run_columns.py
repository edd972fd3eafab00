"""The runs of a summary as a flat table: a row for each run, a column for each number of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from romdam.postprocess.responses import PARAMETER, RUNS

_MAPS = ("gap", "floor_frequency")  # dimensions of what has too many numbers for a row
_STATISTICS = ("sobol_", "annual_frequency", "hazard_")  # beginnings of names of what is of many runs
_FIRST = ("scale_factor", "entry_factor", "matched", "status", "message", "file")


@dataclass(frozen=True)
class Column:
    """One number, or text, of every run.

    Attributes
    ----------
    name : of the variable in the summary
    place : which of its numbers: a joint, a node and its component, and so on; empty where there is one
    units : UDUNITS text; "" and "1" for what has none
    long_name : what it is
    values : (runs,) record after record, in each scale after scale, in each sample after sample
    """

    name: str
    place: str
    units: str
    long_name: str
    values: NDArray[Any]

    @property
    def title(self) -> str:
        """Name, place and unit in one."""
        name = f"{self.name}.{self.place}" if self.place else self.name
        return name if self.units in ("", "1") else f"{name} [{self.units}]"


def run_columns(summary: xr.Dataset) -> list[Column]:
    """Every number of every run but maps over gaps: place, parameters, fate, measures, answers."""
    names = [*RUNS, *_FIRST]
    names += [str(name) for name in summary.coords if str(name).startswith(PARAMETER)]
    names += [str(name) for name in summary.data_vars if str(name) not in names]
    sizes, columns = [summary.sizes[dim] for dim in RUNS], []
    for name in names:
        if name not in summary:
            continue
        variable = summary[name]
        run_dims = [str(dim) for dim in variable.dims if dim in RUNS]
        rest = [str(dim) for dim in variable.dims if dim not in RUNS]
        if not run_dims or set(rest) & set(_MAPS) or name.startswith(_STATISTICS):
            continue
        values = variable.transpose(*run_dims, *rest).values
        shape = [summary.sizes[dim] if dim in run_dims else 1 for dim in RUNS]
        units, long_name = (str(variable.attrs.get(key, "")) for key in ("units", "long_name"))
        for at in np.ndindex(
            *(summary.sizes[dim] for dim in rest)
        ):  # a column for each joint, node and so on
            flat = np.broadcast_to(values[(..., *at)].reshape(shape), sizes).ravel()
            position = ".".join(str(summary[dim].values[k]) for dim, k in zip(rest, at, strict=True))
            columns.append(Column(name, position, units, long_name, flat))
    return columns
