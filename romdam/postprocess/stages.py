"""The stages of an analysis side by side: response spectrum, linear time history, nonlinear run."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator

import numpy as np
import xarray as xr

from romdam.postprocess.stress.faces import CRITERIA, HEADLINE, LIMITS, verdict
from romdam.postprocess.variant_tables import Row, VariantTable

STAGES = "stages"  # of file names
HEAD = ("quantity", "where", "unit", "response spectrum", "linear history", "nonlinear run")
_NONE = "-"
_IN_RING = "not judged: all of it is in the ring"
_ELASTIC = 1.0  # demand-capacity ratio up to which nothing cracks


def stage_table(
    record: str, spectrum: xr.Dataset, linear: xr.Dataset, nonlinear: xr.Dataset | None
) -> VariantTable:
    """Put peaks, demand and verdicts of the stages side by side.

    Parameters
    ----------
    spectrum : of `romdam.results.response_spectrum`
    linear, nonlinear : results of the record with joints tied, and as they are; None where it was not run
    """
    every = [*_displacements(spectrum, linear, nonlinear), *_stress(spectrum, linear, nonlinear)]
    every += _joints(spectrum, linear, nonlinear)
    rows: list[Row] = [tuple(map(_text, row)) for row in every]
    return VariantTable(STAGES, f"Stages of the analysis, {record}", "", HEAD, rows)


def _text(value: object) -> str:
    """A number with four digits; what is not known as a dash."""
    if isinstance(value, float):
        return _NONE if math.isnan(value) else f"{value:.4g}"
    return _NONE if value is None else str(value)


def _displacements(
    spectrum: xr.Dataset, linear: xr.Dataset, nonlinear: xr.Dataset | None
) -> Iterator[tuple[object, ...]]:
    for node in spectrum.node.values if "node" in spectrum.dims else ():
        of_node = spectrum.sel(node=node)
        rest, added = (of_node[f"{kind}_displacement"].values for kind in ("static", "peak"))
        runs = [_largest_motion(run, str(node)) for run in (linear, nonlinear)]
        for k, axis in enumerate(spectrum.component.values):
            values = (1e3 * float(abs(rest[k]) + added[k]), *(run[k] for run in runs))
            yield f"largest displacement {axis}", str(node), "mm", *values


def _largest_motion(run: xr.Dataset | None, node: str) -> list[float]:
    if run is None or "displacement" not in run:
        return [math.nan] * 3
    return [float(x) for x in 1e3 * np.abs(run.displacement.sel(node=node).values).max(axis=0)]


def _stress(
    spectrum: xr.Dataset, linear: xr.Dataset, nonlinear: xr.Dataset | None
) -> Iterator[tuple[object, ...]]:
    runs = (linear, nonlinear)
    for face in spectrum.stress_face.values if "stress_face" in spectrum.dims else ():
        of_spectrum, name = spectrum.sel(stress_face=face), str(face)
        of_runs = [None if run is None else run.sel(stress_face=face) for run in runs]
        for percent in (HEADLINE, 100.0):
            text = f"principal stress, {percent:g} % of area"
            values = [
                None if one is None else 1e-6 * float(one.face_principal_stress.sel(area_percentile=percent))
                for one in (of_spectrum, *of_runs)
            ]
            yield text, name, "MPa", *values
        if "demand_capacity_ratio" not in spectrum:
            continue
        total = [None if one is None else one.sel(stress_basis="total") for one in of_runs]
        yield (
            "demand-capacity ratio",
            name,
            "1",
            float(of_spectrum.face_demand_capacity_ratio),
            *(None if one is None else float(one.face_demand_capacity_ratio) for one in total),
        )
        yield (
            "inelastic duration above ratio 1",
            name,
            "s",
            None,
            *(None if one is None else float(one.face_inelastic_duration[0]) for one in total),
        )
        yield (
            "overstressed share",
            name,
            "%",
            float(of_spectrum.face_overstressed_share),
            *(None if one is None else float(one.face_overstressed_share[0]) for one in total),
        )
        for kind in _kinds(linear):
            met = [None if one is None else one.acceptance.sel(dam_kind=kind).values for one in total]
            judged = not math.isnan(float(of_spectrum.face_demand_capacity_ratio))
            verdicts = [
                None if one is None else verdict([int(x) for x in one]) if judged else _IN_RING for one in met
            ]
            yield f"linear criteria, {kind}", name, "", _by_spectrum(of_spectrum, kind), *verdicts


def _kinds(dataset: xr.Dataset) -> list[str]:
    """The kind of dam that a job makes of a few keys; all kinds where it does not say."""
    config = json.loads(str(dataset.attrs.get("configuration", "{}")))
    return [kind for kind in LIMITS if config.get(kind.replace(" ", "_"))] or list(LIMITS)


def _by_spectrum(face: xr.Dataset, kind: str) -> str:
    """What a response spectrum can say of a face: it knows no duration."""
    ratio, share = float(face.face_demand_capacity_ratio), float(face.face_overstressed_share)
    if math.isnan(ratio):
        return _IN_RING
    if ratio <= _ELASTIC:
        return "passes: elastic"
    limits = LIMITS[kind]
    missed = [CRITERIA[0]] if ratio > 2.0 * _ELASTIC else []
    missed += [CRITERIA[2]] if share > limits.area else []
    return f"fails: {', '.join(missed)}" if missed else "needs the duration"


def _joints(
    spectrum: xr.Dataset, linear: xr.Dataset, nonlinear: xr.Dataset | None
) -> Iterator[tuple[object, ...]]:
    for joint in spectrum.joint.values if "joint" in spectrum.dims else ():
        tied, name = spectrum.sel(joint=joint), str(joint)
        run = None if nonlinear is None or "joint" not in nonlinear else nonlinear.sel(joint=joint)
        yield (
            "largest tension across the joint",
            name,
            "MPa",
            1e-6 * float(tied.max_joint_tension),
            1e-6 * float(tied.history_max_joint_tension),
            None,
        )
        force = float(tied.static_normal_force + tied.peak_normal_force)
        history = float(tied.history_max_normal_force)
        yield "largest normal force, tension > 0", name, "MN", 1e-6 * force, 1e-6 * history, None
        shares = float(tied.joint_tension_share), float(tied.history_joint_tension_share)
        yield "share of the joint in tension", name, "%", *shares, None
        if run is not None:
            yield "largest opening", name, "mm", None, None, 1e3 * float(run.peak_opening)
        if run is not None and "peak_slip" in run:
            yield "largest slip", name, "mm", None, None, 1e3 * float(run.peak_slip)
