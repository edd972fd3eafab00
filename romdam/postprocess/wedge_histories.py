"""Rock wedges under the forces of a result: histories of the factor of safety, and the table of them."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from romdam.config.sections.wedges import WedgesConfig
from romdam.core.arrays import Floats
from romdam.postprocess.sliding import row_seconds
from romdam.postprocess.wedge_displacement import permanent_displacement
from romdam.postprocess.wedge_loads import Levels, wedge_loads
from romdam.postprocess.wedge_rotation import (
    overturning_axes,
    overturning_factor,
    overturning_moments,
    turning_factor,
)
from romdam.postprocess.wedges import slide, trend_and_plunge, wedge_geometry

Array = NDArray[Any]
Row = tuple[str, ...]
HEAD: Row = (
    "wedge", "volume [m3]", "weight [MN]", "factor at rest", "moves on", "least factor", "at [s]", "moves on",
    "trend [deg]", "plunge [deg]", "x", "y", "z", "below 1 [s]", "slides [mm]",
)  # fmt: skip
ROTATION_HEAD: Row = (
    "wedge", "rotation", "factor at rest", "about", "least factor", "at [s]", "about", "below 1 [s]",
)  # fmt: skip
HELD, LIFTS = "held", "lifts off"
_SEVERAL = 1.5  # of the record's step, from which rows are fewer than its samples


def wedge_dataset(
    wedges: WedgesConfig, run: xr.Dataset | None, source: str, levels: Levels | None = None
) -> xr.Dataset:
    """Sliding and rotation of every wedge at every written time of a run, or at rest without one.

    Parameters
    ----------
    run : a result; None for constant forces alone, at the times of tables of water levels
    source : the file of the wedges, for messages
    levels : tables of water levels by their keys, see `romdam.config.sections.wedges.read_levels`

    Raises
    ------
    ConfigError
        for a wedge that is open, and for forces and motions that the result does not have.
    """
    levels = levels or {}
    if run is not None:
        time = np.asarray(run.time.values, dtype=float)
    else:
        time = np.unique(np.concatenate([np.zeros(1), *(times for times, _ in levels.values())]))
    computed = {
        name: _wedge_variables(name, wedges, time, run=run, levels=levels, source=source)
        for name in wedges.wedges
    }
    names = list(computed)
    dims = {
        "plane": max(len(wedge.planes) for wedge in wedges.wedges.values()),
        "edge": max(1, *(len(variables["wedge_edge"]) for variables in computed.values())),
    }
    data = dict[str, tuple[tuple[str, ...], Array, dict[str, str]]]()
    for key, (axes, unit, text) in _VARIABLES.items():
        width = dims[axes[-1]] if axes and axes[-1] in dims else None
        columns = [_padded(variables[key], width) for variables in computed.values()]
        over_time = axes[:1] == ("time",)
        values = np.stack(columns, axis=1 if over_time else 0)
        of_all = ("time", "wedge", *axes[1:]) if over_time else ("wedge", *axes)
        data[key] = of_all, values, {"long_name": text} | ({"units": unit} if unit else {})
    dataset = xr.Dataset(
        data,
        {
            "time": ("time", time, {"long_name": "time since the start of the record", "units": "s"}),
            "wedge": ("wedge", np.array(names, dtype=str), {"long_name": "name of the wedge"}),
            "component": ("component", np.array(["x", "y", "z"]), {"long_name": "global axis"}),
        },
    )
    dataset.attrs = {
        "wedges_file": source,
        "north": np.array(wedges.north),
        "wedge_warnings": json.dumps(_assumed(wedges, run, time)),
    }
    if run is not None:
        dataset.attrs |= {key: run.attrs[key] for key in ("title", "record", "configuration_sha256")}
    return dataset


def _wedge_variables(
    name: str, wedges: WedgesConfig, time: Floats, *, run: xr.Dataset | None, levels: Levels, source: str
) -> dict[str, Array]:
    """The variables of a wedge, of `_VARIABLES`."""
    wedge = wedges.wedges[name]
    geometry = wedge_geometry(wedge, wedges, f"{source}: wedges.{name}")
    count = len(wedge.planes)
    loads = wedge_loads(name, geometry, wedges, time, run=run, levels=levels, source=source)
    force = loads.force.sum(axis=1)
    sliding = slide(geometry, wedge, force)
    axes = overturning_axes(geometry, count)
    driving, resisting = overturning_moments(axes, loads, geometry.centroid)
    overturning = overturning_factor(driving, resisting).min(axis=1, initial=np.inf)
    return {
        "wedge_volume": np.array(geometry.volume),
        "wedge_centroid": geometry.centroid,
        "wedge_weight": np.array(wedge.density * geometry.volume * wedges.gravity),
        "wedge_plane": np.array(geometry.names[:count], dtype=object),
        "wedge_plane_area": geometry.areas[:count],
        "wedge_plane_water": loads.water[:, :count],
        "wedge_factor_of_safety": np.where(np.isfinite(sliding.factor), sliding.factor, np.nan),
        "wedge_driving_force": sliding.driving,
        "wedge_resisting_force": sliding.resisting,
        "wedge_displacement": permanent_displacement(sliding, geometry, wedge, force, time),
        "wedge_slip_direction": sliding.direction,
        "wedge_plane_normal_force": -sliding.normal_force,
        "wedge_plane_in_contact": sliding.contact.astype(np.int8),
        "wedge_edge": np.array([axis.name for axis in axes], dtype=object),
        "wedge_edge_driving_moment": driving,
        "wedge_edge_resisting_moment": resisting,
        "wedge_overturning_factor": np.where(np.isfinite(overturning), overturning, np.nan),
        "wedge_turning_factor": turning_factor(geometry, wedge, loads, sliding),
    }


# name -> (dimensions besides the wedge, units, what it is)
_VARIABLES: dict[str, tuple[tuple[str, ...], str, str]] = {
    "wedge_volume": ((), "m3", "volume of the wedge"),
    "wedge_centroid": (("component",), "m", "centroid of the wedge"),
    "wedge_weight": ((), "N", "weight of the wedge"),
    "wedge_plane": (("plane",), "", "name of the plane"),
    "wedge_plane_area": (("plane",), "m2", "area of the plane"),
    "wedge_plane_water": (("time", "plane"), "N", "force of the water on the plane"),
    "wedge_factor_of_safety": (
        ("time",),
        "1",
        "resisting over driving force of the wedge; NaN where its planes leave no direction free",
    ),
    "wedge_driving_force": (("time",), "N", "force along the direction of sliding"),
    "wedge_resisting_force": (("time",), "N", "friction and cohesion of the planes in contact"),
    "wedge_displacement": (
        ("time", "component"),
        "m",
        "permanent displacement while the factor is below 1, of a rigid block (Newmark)",
    ),
    "wedge_slip_direction": (
        ("time", "component"),
        "1",
        "unit vector in which the wedge would slide or lift off; 0 where no direction is free",
    ),
    "wedge_plane_normal_force": (
        ("time", "plane"),
        "N",
        "effective normal force on the plane, compression negative",
    ),
    "wedge_plane_in_contact": (
        ("time", "plane"),
        "1",
        "1 where the plane stays in contact, 0 where it opens",
    ),
    "wedge_edge": (("edge",), "", "line about which the wedge can overturn"),
    "wedge_edge_driving_moment": (("time", "edge"), "N m", "moments of the forces that overturn"),
    "wedge_edge_resisting_moment": (("time", "edge"), "N m", "moments of the forces that hold it down"),
    "wedge_overturning_factor": (
        ("time",),
        "1",
        "least of resisting over driving moment about its edges; NaN where nothing overturns",
    ),
    "wedge_turning_factor": (
        ("time",),
        "1",
        "strength over load of the wedge sliding on one plane while it turns about its normal; NaN where "
        "nothing drives, it lies on several planes or lifts off, or its force is off the plane",
    ),
}


def _padded(values: Array, width: int | None) -> Array:
    """Values with the last dimension filled up to a width: NaN, 0 or an empty text."""
    if width is None:
        return values
    fill = "" if values.dtype.kind == "O" else 0 if values.dtype.kind == "i" else np.nan
    more = np.full((*values.shape[:-1], width - values.shape[-1]), fill, dtype=values.dtype)
    joined = np.concatenate([values, more], axis=-1)
    return joined.astype(str) if values.dtype.kind == "O" else joined


def _assumed(wedges: WedgesConfig, run: xr.Dataset | None, time: Floats) -> list[str]:
    """What was taken for granted."""
    said = list[str]()
    for name, wedge in wedges.wedges.items():
        if wedge.thrust.force is not None and wedge.thrust.at is None:
            said.append(
                f"wedges.{name}.thrust.force acts in the wedge's centroid, so that it turns nothing; give "
                "`at`, a point on its line of action"
            )
        if run is not None and wedge.inertia is True and "support" in run:
            said.append(
                f"wedges.{name} is shaken by the base, but supports of the run move by themselves; give "
                "inertia: {nodes: [...]} with output nodes at the wedge's place"
            )
    if run is not None and len(time) > 1:
        between, step = float(np.diff(time).max()), float(run.attrs["record_dt"])
        if between > _SEVERAL * step:
            said.append(
                f"factors and displacements are of the written rows, every {between:g} s, and the record has "
                f"a sample every {step:g} s; run it with outputs.output_interval: {step:g} s"
            )
    return said


def wedge_rows(dataset: xr.Dataset) -> list[Row]:
    """The table under `HEAD`: a row for each wedge, at rest (the first time) and at its least factor."""
    rows = []
    time, north = dataset.time.values, dataset.attrs["north"]
    seconds = row_seconds(time) if len(time) > 1 else np.zeros(1)
    for name in map(str, dataset.wedge.values):
        wedge = dataset.sel(wedge=name)
        factor = wedge.wedge_factor_of_safety.values
        # without a free direction nothing moves, whatever the forces
        known = np.where(np.isnan(factor), np.inf, factor)
        least = int(known.argmin())
        trend, plunge = trend_and_plunge(wedge.wedge_slip_direction.values[least], north)
        moves = np.isfinite(known[least])
        vector = wedge.wedge_slip_direction.values[least]
        below = f"{seconds[known < 1.0].sum():.3g}" if len(time) > 1 else "-"
        rows.append(
            (
                name,
                f"{float(wedge.wedge_volume):.6g}",
                f"{1e-6 * float(wedge.wedge_weight):.6g}",
                _factor_text(known[0]),
                _moves_on(wedge, 0),
                _factor_text(known[least]),
                f"{time[least]:.3f}",
                _moves_on(wedge, least),
                *((f"{trend:.1f}", f"{plunge:.1f}") if moves else ("-", "-")),
                *(f"{x:.3f}" if moves else "-" for x in vector),
                below,
                f"{1e3 * np.linalg.norm(wedge.wedge_displacement[-1]):.4g}" if len(time) > 1 else "-",
            )
        )
    return rows


def rotation_rows(dataset: xr.Dataset) -> list[Row]:
    """The table under `ROTATION_HEAD`: overturning, and turning on a plane, of each wedge."""
    rows, time = list[Row](), dataset.time.values
    seconds = row_seconds(time) if len(time) > 1 else np.zeros(1)
    for name in map(str, dataset.wedge.values):
        wedge = dataset.sel(wedge=name)
        driving, resisting = wedge.wedge_edge_driving_moment.values, wedge.wedge_edge_resisting_moment.values
        of_edges = overturning_factor(driving, resisting)  # infinite of lines that other wedges have more
        rows.append((name, "overturns", *_least_of(of_edges, wedge.wedge_edge.values, time, seconds)))
        if not np.isnan(wedge.wedge_turning_factor.values).all():
            of_planes = np.where(
                (wedge.wedge_plane_in_contact.values > 0)
                & ~np.isnan(wedge.wedge_turning_factor.values[:, None]),
                wedge.wedge_turning_factor.values[:, None],
                np.inf,
            )
            rows.append(
                (name, "slides and turns", *_least_of(of_planes, wedge.wedge_plane.values, time, seconds))
            )
    return rows


def _least_of(factors: Floats, about: Array, time: Floats, seconds: Floats) -> Row:
    """Cells of a factor (nt, n) at rest and where it is least."""
    at_rest, row = int(factors[0].argmin()), int(factors.min(axis=1).argmin())
    least = int(factors[row].argmin())
    return (
        _factor_text(factors[0, at_rest]),
        str(about[at_rest]) if np.isfinite(factors[0, at_rest]) else "-",
        _factor_text(factors[row, least]),
        f"{time[row]:.3f}",
        str(about[least]) if np.isfinite(factors[row, least]) else "-",
        f"{seconds[factors.min(axis=1) < 1.0].sum():.3g}" if len(time) > 1 else "-",
    )


def _factor_text(factor: float) -> str:
    return f"{factor:.4g}" if np.isfinite(factor) else HELD


def _moves_on(wedge: xr.Dataset, row: int) -> str:
    """The planes that it slides on at a time, in words."""
    if np.isnan(float(wedge.wedge_factor_of_safety[row])):
        return HELD
    touching = wedge.wedge_plane.values[wedge.wedge_plane_in_contact.values[row] > 0]
    return ", ".join(map(str, touching)) or LIFTS
