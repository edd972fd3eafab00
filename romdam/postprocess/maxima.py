"""The largest values of a result, what they are, where and when: the table that a report needs."""

from __future__ import annotations

import numpy as np
import xarray as xr

Row = tuple[str, float, str, str, str]  # quantity, value, unit, where, when [s]
HEAD = ("quantity", "value", "unit", "where", "time [s]")


def maxima(dataset: xr.Dataset) -> list[Row]:
    """Rows of quantity, value, unit, where, when: motion, joints, stress, what the result has of each."""
    return [*_motion(dataset), *_joints(dataset), *_stress(dataset)]


def _motion(dataset: xr.Dataset) -> list[Row]:
    rows: list[Row] = []
    for name in ("displacement", "acceleration"):
        for axis in dataset.component.values if name in dataset else ():
            values = dataset[name].sel(component=axis)
            step, node = np.unravel_index(int(np.abs(values.values).argmax()), values.shape)
            value = float(values[step, node])
            if value != 0.0:
                unit = str(dataset[name].attrs["units"])
                where, when = str(values.node.values[node]), f"{float(values.time[step]):.3f}"
                rows.append((f"{name} {axis}", value, unit, where, when))
    return rows


def _joints(dataset: xr.Dataset) -> list[Row]:
    rows: list[Row] = []
    for joint in dataset.joint.values if "joint" in dataset else ():
        own = dataset.sel(joint=joint)
        when = f"{float(own.peak_opening_time):.3f}"
        rows.append(("joint opening", float(own.peak_opening), "m", str(joint), when))
        rows.append(("joint compression", float(own.peak_compressive_stress), "Pa", str(joint), ""))
        if "peak_slip" in own:
            rows.append(("joint slip", float(own.peak_slip), "m", str(joint), ""))
    return rows


def _stress(dataset: xr.Dataset) -> list[Row]:
    rows: list[Row] = []
    for side, find in (("max", np.nanargmax), ("min", np.nanargmin)):
        for name in ("principal", "vertical", "arch"):
            variable = f"{side}_{name}_stress"
            if variable not in dataset or not dataset[variable].notnull().any():
                continue
            k = int(find(dataset[variable].values))
            timed = f"{variable}_time"
            when = f"{float(dataset[timed][k]):.3f}" if timed in dataset else ""
            label = f"{'largest' if side == 'max' else 'smallest'} {name} stress"
            rows.append((label, float(dataset[variable][k]), "Pa", _place(dataset, k), when))
    return rows + _damage(dataset)


def _damage(dataset: xr.Dataset) -> list[Row]:
    if "demand_capacity_ratio" not in dataset:
        return []
    ratio, time = dataset.demand_capacity_ratio.values, dataset.cumulative_inelastic_duration.values[:, 0]
    k, j = int(ratio.argmax()), int(time.argmax())
    rows: list[Row] = [
        ("demand-capacity ratio", float(ratio[k]), "1", _place(dataset, k), ""),
        ("cumulative inelastic duration", float(time[j]), "s", _place(dataset, j), ""),
    ]
    for face in dataset.stress_face.values if "stress_face" in dataset else ():
        own = dataset.sel(stress_face=face)
        share = 100.0 * float(own.overstressed_area[0]) / float(own.stress_face_area)
        rows.append(("overstressed part of the face", share, "%", str(face), ""))
    return rows


def _place(dataset: xr.Dataset, k: int) -> str:
    at = ", ".join(f"{x:.4g}" for x in dataset.stress_position.values[k])
    return f"{dataset.stress_block.values[k]} ({at})"
