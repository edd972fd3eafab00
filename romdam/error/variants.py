"""Variants of one job side by side: histories, peaks, sizes and costs, and how far each is from each."""

from __future__ import annotations

import json
from collections.abc import Mapping
from datetime import UTC, datetime

import numpy as np
import xarray as xr

from romdam.config.load import Job
from romdam.config.sections.comparison import ComparisonConfig
from romdam.core.arrays import Floats
from romdam.core.errors import ResultError
from romdam.core.version import SOURCE
from romdam.error.alignment import common_rows
from romdam.error.metrics import magnitude_error
from romdam.results.dataset import job_labels

_STRESSES = ("principal", "vertical", "arch")
_HISTORIES = {  # variable -> (its places, in words)
    "displacement": ("node", "displacement"),
    "relative_displacement": ("pair", "relative displacement"),
    "widest_opening": ("joint", "opening"),
    "acceleration": ("node", "acceleration"),
    "relative_acceleration": ("pair", "relative acceleration"),
}
_PEAKS = {  # variable -> its largest value in the compared component
    "displacement": "peak_component",
    "relative_displacement": "peak_relative_component",
    "acceleration": "peak_acceleration_component",
    "relative_acceleration": "peak_relative_acceleration_component",
}
_VARIABLES = {  # unit, meaning
    "variant": ("", "name of the variant"),
    "against": ("", "name of the variant that it is compared with"),
    "quantity": ("", "compared history and its place"),
    "pair": ("", "name of the pair of nodes"),
    "joint": ("", "name of the joint"),
    "stress": ("", "stress whose largest value is told"),
    "time": ("s", "time since the start of the record"),
    "displacement": ("m", "displacement relative to the base"),
    "relative_displacement": ("m", "displacement of the pair's second node relative to its first"),
    "widest_opening": ("m", "opening of the joint's widest gap, open positive"),
    "acceleration": ("m s-2", "acceleration relative to the base, mean since the time before"),
    "relative_acceleration": ("m s-2", "acceleration of the pair's second node relative to its first, mean"),
    "peak_displacement": ("m", "displacement when the node is farthest from where it was"),
    "peak_displacement_time": ("s", "time of that"),
    "peak_relative_displacement": ("m", "relative displacement when it is largest"),
    "peak_relative_displacement_time": ("s", "time of that"),
    "peak_component": ("m", "displacement in the compared component, largest in magnitude"),
    "peak_relative_component": ("m", "relative displacement in the compared component, largest in magnitude"),
    "peak_acceleration_component": (
        "m s-2",
        "acceleration in the compared component, largest in magnitude",
    ),
    "peak_relative_acceleration_component": (
        "m s-2",
        "relative acceleration in the compared component, largest in magnitude",
    ),
    "peak_opening": ("m", "largest opening over all gaps and steps"),
    "stress_peak": ("Pa", "largest stress of all nodes over all written times, tension positive"),
    "stress_peak_time": ("s", "time of that"),
    "gaps": ("1", "gaps of all joints"),
    "unknowns": ("1", "unknowns of the system that is integrated"),
    "model_order": ("", "model that is integrated, reduced or full"),
    "stress_peak_place": ("", "block and place of the largest stress"),
    "steps": ("1", "steps taken"),
    "finest_step": ("s", "smallest step taken"),
    "cpu_seconds_reduction": ("s", "CPU time of the reduction, or of assembling the full order"),
    "cpu_seconds_loop": ("s", "CPU time of the time loop"),
    "cpu_seconds_total": ("s", "CPU time of scene, model and integration together"),
    "l2_difference": ("1", "L2 of the difference of two variants over that of `against`"),
    "peak_difference": ("1", "difference of the two largest magnitudes over that of `against`"),
}


def comparison_dataset(runs: Mapping[str, xr.Dataset], job: Job, asked: ComparisonConfig) -> xr.Dataset:
    """Put the results of all variants into one Dataset, at the times that all of them have.

    Parameters
    ----------
    runs : variant -> its result
    job : the comparison's configuration

    Raises
    ------
    ResultError
        where two variants share fewer than two written times.
    """
    rows = common_rows(*(run.time.values for run in runs.values()))
    if len(rows[0]) < 2:
        raise ResultError(
            f"the variants {', '.join(runs)} share {len(rows[0])} written times, at least 2 are compared; "
            "set outputs.output_interval, to 0.01 s for example"
        )
    at_common_times = [
        run.isel(time=of_run).assign_coords(time=np.round(run.time.values[of_run], 7))
        for run, of_run in zip(runs.values(), rows, strict=True)
    ]
    parts = [_one(run, asked) for run in at_common_times]
    whole = xr.concat(parts, dim="variant", join="outer", data_vars="all").assign_coords(variant=list(runs))
    whole = whole.assign(_differences(whole, asked.component))
    for name, (unit, text) in _VARIABLES.items():
        if name in whole:
            whole[name].attrs = {"long_name": text} | ({"units": unit} if unit else {})
    first = next(iter(runs.values()))
    whole.attrs = job_labels(job) | {
        "source": SOURCE,
        "date_created": datetime.now(UTC).isoformat(timespec="seconds"),
        "record": str(first.attrs["record"]),
        "machine": str(first.attrs["machine"]),
        "reference": asked.against,
        "compared_component": asked.component,
        "variants": json.dumps({name: asked.variants[name] for name in runs}),
    }
    return whole


def _one(run: xr.Dataset, asked: ComparisonConfig) -> xr.Dataset:
    """Histories of one result that are compared, with their largest values.

    Accelerations are means since the time before, and the value at the first time. They follow from the
    velocities and keep the impulse of an impact, whose acceleration at the written times is chance.
    """
    attrs = run.attrs
    cpu = {key: float(attrs.get(f"cpu_seconds_{key}", 0.0)) for key in ("scene", "model", "integration")}
    variables: dict[str, object] = {
        "model_order": str(attrs["model_order"]),
        "unknowns": int(attrs["unknowns"]),
        "gaps": run.sizes.get("gap", 0),
        "steps": int(attrs["solver_steps"]),
        "finest_step": float(attrs["solver_finest_step"]),
        "cpu_seconds_reduction": cpu["model"],
        "cpu_seconds_loop": float(attrs["solver_loop_cpu_seconds"]),
        "cpu_seconds_total": sum(cpu.values()),
    }
    motions = {}
    if "displacement" in run:
        mean, intervals = run.acceleration.copy(), np.diff(run.time.values)[:, None, None]
        velocity = run.velocity.transpose("time", "node", "component").values
        mean[1:] = np.diff(velocity, axis=0) / intervals
        for name, motion in {"displacement": run.displacement, "acceleration": mean}.items():
            motions[name] = motion
            if asked.relative:
                pairs = [
                    motion.sel(node=b, drop=True) - motion.sel(node=a, drop=True)
                    for a, b in asked.relative.values()
                ]
                relative = xr.concat(pairs, dim="pair").assign_coords(pair=list(asked.relative))
                motions[f"relative_{name}"] = relative.transpose("time", ...)
    for name, motion in motions.items():
        values = motion.drop_vars([c for c in motion.coords if c not in motion.dims])
        component = values.sel(component=asked.component, drop=True)
        variables[name] = values
        variables[_PEAKS[name]] = component.isel(time=abs(component).argmax("time")).drop_vars("time")
        if name.endswith("displacement"):  # and when the node is farthest
            square: xr.DataArray = (values**2).sum("component")
            variables[f"peak_{name}"] = values.isel(time=square.argmax("time")).drop_vars("time")
            variables[f"peak_{name}_time"] = square.idxmax("time")
    if "opening" in run:
        names = run.joint.values
        widest = [run.opening.values[:, run.gap_joint.values == name].max(axis=1) for name in names]
        coords = {"time": run.time, "joint": names}
        variables["widest_opening"] = xr.DataArray(np.array(widest).T, coords, ("time", "joint"))
        variables["peak_opening"] = run.peak_opening.drop_vars("joint_blocks", errors="ignore")
    histories = xr.Dataset(variables).drop_vars(("node_block", "node_position"), errors="ignore")
    return histories.assign(_stress(run))


def _stress(run: xr.Dataset) -> dict[str, xr.DataArray]:
    """Largest stresses with place and time, where they are asked for."""
    peaks = {name: run.get(f"max_{name}_stress") for name in _STRESSES}
    at = {
        name: int(np.nanargmax(v.values)) for name, v in peaks.items() if v is not None and v.notnull().any()
    }

    def column(values: list[object]) -> xr.DataArray:
        return xr.DataArray(values, {"stress": list(at)}, ("stress",))

    if not at:
        return {}
    places = [[f"{x:.4g}" for x in run.stress_position.values[k]] for k in at.values()]
    blocks = [str(run.stress_block.values[k]) for k in at.values()]
    return {
        "stress_peak": column([float(run[f"max_{name}_stress"][k]) for name, k in at.items()]),
        "stress_peak_time": column([float(run[f"max_{name}_stress_time"][k]) for name, k in at.items()]),
        "stress_peak_place": column([f"{b} ({', '.join(x)})" for b, x in zip(blocks, places, strict=True)]),
    }


def _differences(whole: xr.Dataset, component: str) -> dict[str, xr.DataArray]:
    """Every variant against every other, quantity by quantity; NaN where one of the two lacks it."""
    histories = _histories(whole, component)
    count = whole.sizes["variant"]
    l2, peak = np.full((2, count, count, len(histories)), np.nan)
    for q, rows in enumerate(histories.values()):
        for i, j in np.ndindex(count, count):
            if np.isfinite(rows[[i, j]]).all():
                error = magnitude_error(rows[i], rows[j])
                l2[i, j, q], peak[i, j, q] = error.l2, error.peak
    names = whole.variant.values
    coords = {"variant": names, "against": names, "quantity": list(histories)}
    return {
        name: xr.DataArray(values, coords, ("variant", "against", "quantity"))
        for name, values in (("l2_difference", l2), ("peak_difference", peak))
    }


def _histories(whole: xr.Dataset, component: str) -> dict[str, Floats]:
    """Quantity in words -> (variants, times) [m]."""
    histories = {}
    for name, (dim, words) in _HISTORIES.items():
        for point in whole[dim].values if name in whole else ():
            rows = whole[name].sel({dim: point})
            rows_of = rows.sel(component=component) if "component" in rows.dims else rows
            histories[f"{words} {point}"] = rows_of.transpose("variant", "time").values
    return histories
