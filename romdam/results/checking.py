"""Check that a file states what the result of a record must: names, dimensions, units and kinds."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from romdam.core.errors import ResultError, quote
from romdam.core.sealed import Opened
from romdam.results.sliding import UNDEFINED
from romdam.results.stress.variables import STRESS_VARIABLES
from romdam.results.suite.rows import ROWS, STATED, attributes_of, dims_of
from romdam.results.variables import COORDINATES, VARIABLES

_KNOWN = COORDINATES | VARIABLES
_TEXTS = (
    "title", "record", "configuration_file", "configuration", "configuration_sha256", "model_order",
    "integrator", "date_created",
)  # fmt: skip
_NUMBERS = ("record_dt", "record_peak_acceleration", "solver_finest_step")
_OPTIONAL_TEXTS = (
    "model_file", "stress_file", "stress_statement", "floor_spectrum_statement", "error_statement",
    "error_estimate", "error_not_included",
    "certificate_statement", "discretisation_statement", "code_sha256", "scene_sha256", "record_sha256",
)  # fmt: skip
# attributes that are numbers by the beginnings and the ends of their names
_NUMBERED = ("analysed_", "solver_", "wall_seconds_", "cpu_seconds_", "entry_factor_")
_ERRORS = ("_l2", "_peak")
# attributes that hold JSON, where they are there: lists of texts, and objects
_LISTS = ("run_warnings", "configuration_doubts", "record_warnings", "rock_blocks")
_OBJECTS = ("record_provenance", "discretisation", "verification", "certificate")
_MESH = ("mesh", "opening_error", "unknowns", "gaps", "cpu_seconds", "chosen")  # of each that was tried
_WHOLE = ("gap", "joint_state", "stress_node_number", "stress_ring", "acceptance", "status", "sample")
# what files of before lack: forces, which a certificate needs, and says so, and a mean that only tables tell
_LATER = ("normal_force", "shear_force", "mean_", "peak_mean_")
_PACKING = ("scale_factor", "add_offset", "missing_value")
_RUN = ("record", "scale", "sample")
_INDEX: dict[str, tuple[tuple[str, ...], str | None]] = {
    "record": (("record",), ""),
    "scale": (("scale",), None),
    "sample": (("sample",), None),
    "scale_factor": (("record", "scale"), None),
    "status": (_RUN, None),
    "message": (_RUN, ""),
}
_SUMMARY = _INDEX | {name: (_RUN + dims_of(name), attributes_of(name)["units"]) for name in (*ROWS, *STATED)}

_SPECTRUM_TEXTS = (
    "title", "record", "configuration_file", "configuration_sha256", "combination", "directions", "spectrum",
    "source",
)  # fmt: skip
# of a response-spectrum analysis: dimensions, units, and the variable beside which it stands, "" for all
_SPECTRUM: dict[str, tuple[tuple[str, ...], str, str]] = {
    "direction": (("direction",), "", ""),
    "frequency": (("mode",), "Hz", ""),
    "damping_ratio": (("mode",), "1", ""),
    "modal_mass_share": (("direction",), "%", ""),
    "spectral_acceleration": (("mode", "direction"), "m s-2", ""),
    "rigid_acceleration": (("direction",), "m s-2", ""),
    "node": (("node",), "", "peak_displacement"),
    "static_displacement": (("node", "component"), "m", "peak_displacement"),
    "peak_displacement": (("node", "component"), "m", "static_displacement"),
    "stress_block": (("stress_node",), "", "max_principal_stress"),
    "stress_ring": (("stress_node",), "1", "max_principal_stress"),
    "stress_position": (("stress_node", "component"), "m", "max_principal_stress"),
    "max_principal_stress": (("stress_node",), "Pa", "stress_ring"),
    "joint": (("joint",), "", "max_joint_tension"),
    "static_normal_force": (("joint",), "N", "max_joint_tension"),
    "peak_normal_force": (("joint",), "N", "max_joint_tension"),
    "max_joint_tension": (("joint",), "Pa", "joint"),
    "joint_tension_share": (("joint",), "%", "max_joint_tension"),
    "section": (("section",), "", "peak_section_force"),
    "peak_section_force": (("section", "section_axis"), "N", "section"),
    "peak_section_moment": (("section", "section_axis"), "N m", "section"),
}


def check_run(dataset: xr.Dataset, known: Opened, path: Path) -> None:
    """Refuse a file that is not the result of a record, or whose variables are not what their names say.

    A program that has rewritten it may have changed units, packed values into integers or left some out.

    Raises
    ------
    ResultError
        naming file, attribute or variable, and what is expected.
    """
    if {*_RUN} <= {*dataset.sizes}:
        raise ResultError(
            f"{path}: is the summary of several runs, not the result of a record; `romdam report "
            f'{path.parent}` makes a page of it, `romdam.open_suite("{path.parent}")` opens it'
        )
    flaw = next(_flaws(dataset, known), None)
    if flaw is not None:
        raise ResultError(
            f"{path}: is not the result of a record as romdam writes it: {flaw}; run it again, or name "
            "a file that `romdam run` wrote"
        )


def check_spectrum(dataset: xr.Dataset, known: Opened, path: Path) -> None:
    """Refuse a file that is not a response-spectrum analysis; as `check_run`.

    Raises
    ------
    ResultError
        naming file, attribute or variable, and what is expected.
    """
    flaw = next(_spectrum_flaws(dataset, known), None)
    if flaw is not None:
        raise ResultError(
            f"{path}: is not a response-spectrum analysis as romdam writes it: {flaw}; run `romdam linear` "
            "again"
        )


def _spectrum_flaws(dataset: xr.Dataset, known: Opened) -> Iterator[str]:
    """Say what is wrong with a response-spectrum analysis, of what is told of it."""
    for name in _SPECTRUM_TEXTS:
        if not isinstance(dataset.attrs.get(name), str):
            yield f"its attribute {name} must be a text, got {_got(dataset.attrs, name)}"
    if not dataset.attrs["source"].startswith("romdam"):
        yield "it has no attribute source that says so"
    value = dataset.attrs.get("cutoff_hz")
    if not isinstance(value, int | float | np.number):
        yield f"its attribute cutoff_hz must be a number, got {_got(dataset.attrs, 'cutoff_hz')}"
    for name, (dims, units, companion) in _SPECTRUM.items():
        if name in dataset.variables:
            yield from _variable_flaws(name, dims, units, dataset.variables[name])
        elif not companion or companion in dataset.variables:
            yield f"the variable {name} is missing"
    for name in sorted((known.infinite | known.undefined) & {*_SPECTRUM}):
        yield f"{name} has values that are no numbers"


def check_summary(dataset: xr.Dataset, known: Opened, path: Path) -> None:
    """Refuse a file that is not the summary of a suite; as `check_run`.

    Raises
    ------
    ResultError
        naming file, attribute or variable, and what is expected.
    """
    flaw = next(_summary_flaws(dataset, known), None)
    if flaw is not None:
        raise ResultError(
            f"{path}: is not the summary of a suite as romdam writes it: {flaw}; run the suite again"
        )


def _summary_flaws(dataset: xr.Dataset, known: Opened) -> Iterator[str]:
    """Say what is wrong with a summary, in an order in which the first flaw explains those after it."""
    for name in ("source", "configuration", "configuration_sha256"):
        if not isinstance(dataset.attrs.get(name), str):
            yield f"its attribute {name} must be a text, got {_got(dataset.attrs, name)}"
    if not dataset.attrs["source"].startswith("romdam"):
        yield "it has no attribute source that says so"
    for name, about in _SUMMARY.items():
        if name in dataset.variables:
            yield from _variable_flaws(name, *about, dataset.variables[name])
        elif name in _INDEX:
            yield f"the variable {name} is missing"
    for name in sorted(known.infinite):
        yield f"{name} has infinite values"


def _flaws(dataset: xr.Dataset, known: Opened) -> Iterator[str]:
    """Say what is wrong with a result, in an order in which the first flaw explains those after it."""
    attrs = dataset.attrs
    if not str(attrs.get("source", "")).startswith("romdam"):
        yield "it was not written by romdam, it has no attribute `source` that says so"
    for name in (*_TEXTS, *(n for n in _OPTIONAL_TEXTS if n in attrs)):
        if not isinstance(attrs.get(name), str):
            yield f"its attribute {name} must be a text, got {_got(attrs, name)}"
    for name in _NUMBERS:
        value = attrs.get(name)
        if not (isinstance(value, int | float | np.number) and math.isfinite(float(value))):
            yield f"its attribute {name} must be a number, got {_got(attrs, name)}"
    for name, value in attrs.items():
        numbered = str(name).startswith(_NUMBERED) or str(name).endswith(_ERRORS)
        if numbered and not isinstance(value, int | float | np.number):
            yield f"its attribute {name} must be a number, got {_got(attrs, name)}"
    yield from _json_flaws(attrs)
    if attrs["model_order"] not in ("reduced", "full"):
        yield f"its attribute model_order must be reduced or full, got {_got(attrs, 'model_order')}"

    for name, variable in _KNOWN.items():
        if name in dataset.variables:
            yield from _variable_flaws(name, variable.dims, variable.units, dataset.variables[name])
    # variables with the same condition are written together, so where some are there all must be
    always = VARIABLES["ground_acceleration"].when
    present = {_KNOWN[name].when: name for name in _KNOWN if name in dataset.variables}
    for name, variable in _KNOWN.items():
        companion = present.get(variable.when, "every result" if variable.when is always else "")
        if companion and name not in dataset.variables and not name.startswith(_LATER):
            yield f"the variable {name} is missing, which stands beside {companion}"

    for name in sorted(known.infinite | (known.undefined - {*STRESS_VARIABLES, *UNDEFINED})):
        if name in _KNOWN:
            yield f"{name} has values that are no numbers"
    time = dataset.time.values
    if not (len(time) and (np.diff(time) > 0.0).all()):
        yield "its times do not increase"
    if "joint" in dataset and not {*dataset.gap_joint.values.tolist()} <= {*dataset.joint.values.tolist()}:
        yield "gap_joint names a joint that is not there"
    if "gap_area" in dataset and not (dataset.gap_area.values > 0.0).all():
        yield f"gap_area must be above 0 m2, got {float(dataset.gap_area.min()):g}"
    if dataset.component.values.tolist() != ["x", "y", "z"]:
        yield "its components are not x, y, z"


def _json_flaws(attrs: Mapping[Any, object]) -> Iterator[str]:
    """Say which attributes hold no JSON of the kind that they must."""
    for name in (*_LISTS, *_OBJECTS, "configuration"):
        if name not in attrs:
            continue
        try:
            value = json.loads(str(attrs[name]))
        except (ValueError, RecursionError):
            value = None
        if name not in _LISTS and not isinstance(value, dict):
            yield f"its attribute {name} must be a JSON object, got {_got(attrs, name)}"
        if name in _LISTS and not (isinstance(value, list) and all(isinstance(text, str) for text in value)):
            yield f"its attribute {name} must be a JSON list of texts, got {_got(attrs, name)}"
        meshes = value.get("meshes", []) if isinstance(value, dict) and name == "discretisation" else []
        tried = meshes if isinstance(meshes, list) else [meshes]
        if not all(isinstance(mesh, dict) and {*_MESH} <= {*mesh} for mesh in tried):
            yield f"its attribute {name} must state {', '.join(_MESH)} of each of its `meshes`"


def _got(attrs: Mapping[Any, object], name: str) -> str:
    return quote(attrs[name]) if name in attrs else "none"


def _variable_flaws(
    name: str, dims: tuple[str, ...], units: str | None, variable_read: xr.Variable
) -> Iterator[str]:
    """`units` is "" for texts, and None for numbers that state none."""
    if variable_read.dims != dims:
        yield f"{name} must have the dimensions {dims}, got {variable_read.dims}"
    kinds = "OUST" if units == "" else "iu" if name in _WHOLE else "f"
    if variable_read.dtype.kind not in kinds:
        yield f"{name} must hold {'texts' if units == '' else 'numbers'}, got {variable_read.dtype}"
    stated = variable_read.attrs.get("units")
    if units and not (isinstance(stated, str) and stated == units):
        yield f"{name} must have the units {units!r}, got {_got(variable_read.attrs, 'units')}"
    fill = variable_read.encoding.get("_FillValue", math.nan)
    masked = units != "" and isinstance(fill, int | float | np.number) and not np.isnan(fill)
    if masked or any(key in variable_read.encoding for key in _PACKING):
        yield f"{name} is packed or masked"
