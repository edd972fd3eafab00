"""The largest values of a result, what they are, where and when: the table that a report needs."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from romdam.core.arrays import Floats
from romdam.core.round_off import NOTHING, ROUND_OFF
from romdam.core.scene import MOST_RING
from romdam.postprocess.joint_roles import bearing_first
from romdam.postprocess.stress.faces import HEADLINE, LIMITS, StressLimits, verdict

INSTANT = "one instant"
WRITTEN = "of the written rows"
BELOW = "below"
AS_DISPLACEMENT = "as the displacement"
IN_RING = "all of it is in the ring"
NOTES = {
    WRITTEN: "the largest of the steps between them may be larger; a finer outputs.output_interval tells",
    INSTANT: "of an impact: depends on the step; a mean over the writing interval does not",
    BELOW: f"round-off, shown as 0: less than {ROUND_OFF:.0e} of the largest value of the unit",
    AS_DISPLACEMENT: "shown as 0: the displacement along this axis is round-off",
}

_MOVES = 1e-8  # of the widest opening, below which what it varies by is round-off
_FIXED = ("joint", "stress_face", "section")  # what rows are of; other places are those of the largest


class MaximaRow(NamedTuple):
    """A largest value: `when` [s] and `where` as texts; the note is one of NOTES, IN_RING, or empty."""

    quantity: str
    value: float
    unit: str
    where: str
    when: str = ""
    note: str = ""

    @property
    def is_round_off(self) -> bool:
        """Whether its value is shown as 0."""
        return self.note == AS_DISPLACEMENT or self.note.startswith(BELOW)


HEAD = ("quantity", "value", "unit", "where", "time [s]", "note")


def maxima(dataset: xr.Dataset) -> list[MaximaRow]:
    """Motion, joints, stress, what the result has of each; round-off as 0, with a note that says what is."""
    stated = [*_motion(dataset), *_joints(dataset), *_stress(dataset), *_sections(dataset)]
    rows = []
    for row in stated:
        same_unit = [abs(r.value) for r in stated if r.unit == row.unit and r.value == r.value]
        least = max(ROUND_OFF * max(same_unit, default=0.0), NOTHING)
        if 0.0 < abs(row.value) < least:
            rows.append(row._replace(value=0.0, when="", note=f"{BELOW} {least:.1g} {row.unit}"))
        else:
            rows.append(row._replace(value=row.value + 0.0))  # no -0
    # accelerations are 0 along axes whose displacement is round-off
    still = {row.quantity.replace("displacement", "acceleration") for row in rows if row.is_round_off}
    still &= {f"acceleration {axis}" for axis in "xyz"}
    rows = [
        row._replace(value=0.0, when="", note=AS_DISPLACEMENT) if row.quantity in still else row
        for row in rows
    ]
    fixed = {str(name) for dim in _FIXED if dim in dataset for name in dataset[dim].values}
    return [row._replace(where="") if row.is_round_off and row.where not in fixed else row for row in rows]


def explained(rows: list[MaximaRow]) -> list[str]:
    """Sentences on the notes that stand in a table."""
    said = [part for row in rows for part in row.note.split(", ")]
    return [f"{note}: {words}" for note, words in NOTES.items() if any(s.startswith(note) for s in said)]


def _motion(dataset: xr.Dataset) -> list[MaximaRow]:
    """Of a dam with joints the largest accelerations are those of impacts."""
    rows, stated = [], "peak_displacement" in dataset
    written = written_note(dataset)
    if stated:
        for axis in dataset.component.values:
            peaks = dataset.peak_displacement.sel(component=axis)
            largest = int(peaks.values.argmax())
            if float(peaks[largest]) > 0.0:
                when = f"{float(dataset.peak_displacement_time.sel(component=axis)[largest]):.3f}"
                where = str(peaks.node.values[largest])
                rows.append(MaximaRow(f"displacement {axis}", float(peaks[largest]), "m", where, when))
    for name in ("acceleration",) if stated else ("displacement", "acceleration"):
        note = written
        if name == "acceleration" and "joint" in dataset:
            note = ", ".join(filter(None, (INSTANT, written)))
        for axis in dataset.component.values if name in dataset else ():
            values = dataset[name].sel(component=axis)
            step, node = np.unravel_index(int(np.abs(values.values).argmax()), values.shape)
            value = float(values[step, node])
            if value != 0.0:
                unit = str(dataset[name].attrs["units"])
                where, when = str(values.node.values[node]), f"{float(values.time[step]):.3f}"
                rows.append(MaximaRow(f"{name} {axis}", value, unit, where, when, note))
    return rows


def written_note(dataset: xr.Dataset) -> str:
    """WRITTEN where the run has steps between its written rows, else empty; of an older result empty."""
    step = float(dataset.attrs.get("solver_base_step", np.inf))
    leaves_out = (
        "time" in dataset
        and dataset.time.size > 1
        and float(dataset.time[1] - dataset.time[0]) > (1.0 + 1e-9) * step
    )
    return WRITTEN if leaves_out else ""


def water_at_rest(dataset: xr.Dataset) -> xr.DataArray | None:
    """Resultant of the water in every joint and its cracks at the start on block J, (joint, component) [N].

    Of a result of an earlier version without that in cracks; None where no joint has water.
    """
    if "joint_water_force" in dataset:
        return dataset.joint_water_force.isel(time=0)
    return dataset.get("water_force")


def peak_ground_acceleration(dataset: xr.Dataset) -> xr.DataArray:
    """Largest ground acceleration along each axis over all steps, (component,) [m/s2].

    Of a result of an earlier version over its written rows.
    """
    if "peak_ground_acceleration" in dataset:
        return dataset.peak_ground_acceleration
    return abs(dataset.ground_acceleration).max("time")


def _joints(dataset: xr.Dataset) -> list[MaximaRow]:
    rows = []
    for joint in dataset.joint.values if "joint" in dataset else ():
        of_joint, where = dataset.sel(joint=joint), str(joint)
        when = peak_opening_time(dataset, joint)
        instant = "" if when is None else f"{when:.3f}"
        rows.append(MaximaRow("joint opening", float(of_joint.peak_opening), "m", where, instant))
        stress = float(of_joint.peak_compressive_stress)
        rows.append(MaximaRow("joint compression", stress, "Pa", where, note=INSTANT))
        if "peak_mean_compressive_stress" in of_joint:
            interval = float(dataset.time[-1] - dataset.time[0]) / max(dataset.time.size - 1, 1)
            name = f"joint compression, mean of {interval:.3g} s"
            rows.append(MaximaRow(name, float(of_joint.peak_mean_compressive_stress), "Pa", where))
        if "peak_slip" in of_joint:
            rows.append(MaximaRow("joint slip", float(of_joint.peak_slip), "m", where))
    return rows


class JointPeaks(NamedTuple):
    """Peaks of a joint over all steps, as `maxima` has them; NaN where the result has none.

    Attributes
    ----------
    joint : its name
    opening : [m]
    opening_time : [s]; None where the opening does not move
    mean_compression : of one gap over a writing interval, compression negative [Pa]
    compression : of one gap at one instant, compression negative [Pa]
    slip : [m]
    """

    joint: str
    opening: float
    opening_time: float | None
    mean_compression: float
    compression: float
    slip: float


def joint_peaks(dataset: xr.Dataset) -> list[JointPeaks]:
    """Peaks of every joint, bases and lifts first."""
    dataset = bearing_first(dataset)
    value_of = dict[tuple[str, str], float]()
    for row in maxima(dataset):
        value_of[row.quantity.partition(",")[0] + ", mean" * (", mean" in row.quantity), row.where] = (
            row.value
        )
    return [
        JointPeaks(
            name,
            value_of["joint opening", name],
            peak_opening_time(dataset, name),
            value_of.get(("joint compression, mean", name), np.nan),
            value_of["joint compression", name],
            value_of.get(("joint slip", name), np.nan),
        )
        for name in (map(str, dataset.joint.values) if "joint" in dataset else ())
    ]


def peak_opening_time(dataset: xr.Dataset, joint: str) -> float | None:
    """Time of a joint's largest opening [s]; None where its widest opening does not move over the run.

    Blocks that mirror each other at a joint and shake along it keep the opening of the start: when the
    largest comes is then round-off.
    """
    of_joint = dataset.sel(joint=joint)
    peak = float(of_joint.peak_opening)
    if "opening" in dataset:
        widest = dataset.opening.values[:, dataset.gap_joint.values == joint].max(axis=1)
        if peak - widest.min() <= _MOVES * max(abs(peak), abs(float(widest.min()))):
            return None
    return float(of_joint.peak_opening_time)


def _sections(dataset: xr.Dataset) -> list[MaximaRow]:
    """Extremes over time of forces, moments and linearised stress on sections, tension positive."""
    rows, note = [], written_note(dataset)
    for name, dim in (("force", "axis"), ("moment", "axis"), ("stress", "side")):
        for section in dataset.section.values if f"section_{name}" in dataset else ():
            forces = dataset[f"section_{name}"].sel(section=section)
            for along in forces[f"section_{dim}"].values:
                values = forces.sel({f"section_{dim}": along}).values
                for side, k in (("largest", int(values.argmax())), ("smallest", int(values.argmin()))):
                    label, when = f"{side} section {name}, {along}", f"{float(forces.time[k]):.3f}"
                    row = MaximaRow(
                        label, float(values[k]), str(forces.attrs["units"]), str(section), when, note
                    )
                    rows.append(row)
    return rows


def _stress(dataset: xr.Dataset) -> list[MaximaRow]:
    """Largest and smallest stress, and of a dam with a tensile strength its demand."""
    rows, kinds = [], ("principal", "vertical", "arch")
    for name in kinds:  # stress that most of each face does not exceed: what a face is judged by
        for face in dataset.stress_face.values if f"face_{name}_stress" in dataset else ():
            value = dataset[f"face_{name}_stress"].sel(stress_face=face, area_percentile=HEADLINE)
            label = f"{name} stress, {HEADLINE:g} % of the area"
            note = written_note(dataset) if value.notnull() else IN_RING
            rows.append(MaximaRow(label, float(value), "Pa", str(face), note=note))
    for side, find in (("max", np.nanargmax), ("min", np.nanargmin)):
        for name in kinds:
            variable = f"{side}_{name}_stress"
            if variable not in dataset or not dataset[variable].notnull().any():
                continue
            label = f"{'largest' if side == 'max' else 'smallest'} {name} stress"
            worst = _at_worst(dataset, label, dataset[variable], find)
            rows += worst if side == "max" else worst[:1]
    if "demand_capacity_ratio" not in dataset:
        return rows
    rows += _at_worst(dataset, "demand-capacity ratio", dataset.demand_capacity_ratio)
    duration = dataset.cumulative_inelastic_duration[:, 0]
    rows += _at_worst(dataset, "cumulative inelastic duration", duration)
    if "change_demand_capacity_ratio" in dataset:
        ratio, duration = dataset.change_demand_capacity_ratio, dataset.change_inelastic_duration[:, 0]
        rows += _at_worst(dataset, "demand-capacity ratio of the change", ratio)
        rows += _at_worst(dataset, "inelastic duration of the change", duration)
    for face in dataset.stress_face.values if "overstressed_area" in dataset else ():
        of_face = dataset.sel(stress_face=face)
        share = 100.0 * float(of_face.overstressed_area[0]) / float(of_face.stress_face_area)
        rows.append(MaximaRow("overstressed part of the face, with the ring", share, "%", str(face)))
    return rows


def _at_worst(
    dataset: xr.Dataset, label: str, values: xr.DataArray, find: Callable[[Floats], Any] = np.nanargmax
) -> list[MaximaRow]:
    """Worst of (stress_node,) values, and the worst outside the ring where the first is in it."""
    whole, rows, note = values.values, [], written_note(dataset)
    ring = dataset.stress_ring.values > 0 if "stress_ring" in dataset else np.zeros(len(whole), dtype=bool)
    time = dataset.get(f"{values.name}_time")
    for name, value in ((label, whole), (f"{label} outside the ring", np.where(ring, np.nan, whole))):
        if np.isfinite(value).any() and (value is whole or ring[int(find(whole))]):
            k = int(find(value))
            position = ", ".join(f"{x:.4g}" for x in dataset.stress_position.values[k])
            where = f"{dataset.stress_block.values[k]} ({position})"
            when = "" if time is None else f"{float(time[k]):.3f}"
            rows.append(MaximaRow(name, float(value[k]), str(values.attrs["units"]), where, when, note))
    return rows


def face_head(dataset: xr.Dataset) -> tuple[str, ...]:
    """Head of `face_rows`."""
    return (
        "face", f"{HEADLINE:g} % of area [MPa]", "largest [MPa]", "at (x, y, z [m])", "ring [% of area]",
        "overstressed at rest [%]", "basis", *limits_of(dataset),
    )  # fmt: skip


def face_rows(dataset: xr.Dataset) -> list[tuple[str, ...]]:
    """Rows under `face_head`: headline stress, ring, and acceptance of the total and of the change."""
    rows, kinds = list[tuple[str, ...]](), list(limits_of(dataset))
    for face in dataset.stress_face.values if "face_principal_stress" in dataset else ():
        of_face = dataset.sel(stress_face=face)
        stress = 1e-6 * of_face.face_principal_stress
        at = ", ".join(f"{x:.4g}" for x in of_face.face_peak_position.values)
        numbers = (float(stress.sel(area_percentile=p)) for p in (HEADLINE, 100.0))
        start = f"{float(of_face.face_start_overstressed_share):.3g}" if "acceptance" in dataset else "-"
        about = (str(face), *(f"{x:.3g}" for x in numbers), at, f"{float(of_face.ring_share):.3g}", start)
        for basis in dataset.stress_basis.values if "acceptance" in dataset else ():
            met = of_face.acceptance.sel(stress_basis=basis)
            words = (verdict(met.sel(dam_kind=kind).values) for kind in kinds)
            rows.append((*about, str(basis), *words))
            about = ("",) * len(about)
        if "acceptance" not in dataset:
            rows.append((*about, "-", *("-" for _ in kinds)))
    return rows


def limits_of(dataset: xr.Dataset) -> dict[str, StressLimits]:
    """Limits of linear analysis of the dam at hand; of every kind where the result names none."""
    config = json.loads(str(dataset.attrs.get("configuration", "{}")))
    return {kind: LIMITS[kind] for kind in LIMITS if config.get(kind.replace(" ", "_"))} or LIMITS


def stress_statement(dataset: xr.Dataset, peak_shares: Mapping[str, float]) -> str:
    """Say what the stress on every face comes to, outside the ring; empty without faces.

    Parameters
    ----------
    peak_shares : face -> share of the node with the largest stress in the area outside the ring [%]
    """
    faces = []
    for face in dataset.stress_face.values if "face_principal_stress" in dataset else ():
        of_face = dataset.sel(stress_face=face)
        low, top = (
            1e-6 * float(of_face.face_principal_stress.sel(area_percentile=p)) for p in (HEADLINE, 100.0)
        )
        at = ", ".join(f"{x:.4g}" for x in of_face.face_peak_position.values)
        known = "face_start_overstressed_share" in of_face
        start = float(of_face.face_start_overstressed_share) if known else 0.0
        rest = f", {start:.3g} % of its area above the strength before the shaking" if start > 0.0 else ""
        is_headline = peak_shares.get(str(face), 0.0) > 100.0 - HEADLINE
        coarse = f"; one node is more than {100.0 - HEADLINE:g} % of this face" if is_headline else ""
        mostly_ring = float(of_face.ring_share) > 100.0 * MOST_RING
        judged = ", so that no acceptance is stated" if mostly_ring else ""
        faces.append(
            f"{face} {low:.3g} MPa (largest {top:.3g} MPa at ({at}){rest}{coarse}; "
            f"the ring leaves out {float(of_face.ring_share):.3g} % of its area{judged})"
        )
    named = f"major principal stress that {HEADLINE:g} % of a face's area outside the ring do not exceed: "
    return named + "; ".join(faces) if faces else ""
