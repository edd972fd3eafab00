"""Names of earlier versions and what they are called now: their files still open, for one release.

They are renamed as a file is opened, be they of variables, coordinates, dimensions or attributes. To rename
something in files, add a line to RENAMED; to state a unit in another way, to UNITS.
"""

from __future__ import annotations

import xarray as xr

RENAMED = {
    "corrections": "residual_vectors",
    "dt": "solver_finest_step",
    "open_duration": "any_gap_open_duration",
    "sliding_duration": "any_gap_sliding_duration",
    "solver_held_gaps": "solver_condensed_contacts",
    "solver_state_modes": "solver_dynamic_modes",
    "solver_flexible_modes": "solver_quasi_static_modes",
    "solver_marched_gaps": "solver_integrated_gaps",
}

UNITS = {"m kg0.5": "m"}  # to UDUNITS half a metre; of modes whose modal mass is 1 kg it is a metre


def with_names_of_now(dataset: xr.Dataset) -> tuple[xr.Dataset, dict[str, str]]:
    """A dataset whose names and units are those of this version, and which were others: old -> new.

    Where a file has both, they say the same, and the old one goes.
    """
    names = {str(name): RENAMED[str(name)] for name in [*dataset.variables, *dataset.dims] if name in RENAMED}
    attributes = {str(name): RENAMED[str(name)] for name in dataset.attrs if name in RENAMED}
    twice = [old for old, new in names.items() if new in dataset.variables]
    now = dataset.drop_vars(twice).rename({old: new for old, new in names.items() if old not in twice})
    former = {new: dataset.attrs[old] for old, new in attributes.items()}
    now.attrs = former | {name: value for name, value in dataset.attrs.items() if name not in attributes}
    now.set_close(dataset.close)
    units = {name: str(variable.attrs.get("units")) for name, variable in now.variables.items()}
    units = {name: unit for name, unit in units.items() if unit in UNITS}
    for name, unit in units.items():
        now.variables[name].attrs["units"] = UNITS[unit]
    return now, names | attributes | {unit: UNITS[unit] for unit in units.values()}
