"""Check that a file states what the result of a record must: names, dimensions, units and kinds."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from romdam.core.errors import ResultError, quote
from romdam.core.sealed import Opened
from romdam.postprocess.record_measures import MEASURES
from romdam.postprocess.responses import PARAMETER, WITHIN
from romdam.postprocess.stress.faces import BASES, CRITERIA, LIMITS
from romdam.postprocess.stress.sections import AXES, SIDES
from romdam.postprocess.stress.summary import COMPONENTS
from romdam.postprocess.stress.summary import MEASURES as STRESS_MEASURES
from romdam.results.sliding import UNDEFINED
from romdam.results.stress.variables import STRESS_VARIABLES
from romdam.results.suite.rows import DONE, FAILED, ROWS, STATED, attributes_of, dims_of
from romdam.results.variables import COORDINATES, UNDEFINED_MODES, VARIABLES

_KNOWN = COORDINATES | VARIABLES
_TEXTS = (
    "title", "record", "record_provenance", "configuration_file", "configuration", "configuration_sha256",
    "model_order", "integrator", "date_created",
)  # fmt: skip
_NUMBERS = ("record_dt", "record_peak_acceleration", "solver_finest_step")
_OPTIONAL_TEXTS = (
    "model_file", "stress_file", "stress_statement", "floor_spectrum_statement", "error_statement",
    "error_estimate", "error_not_included", "certificate_statement", "discretisation_statement",
    "code_sha256", "scene_sha256", "record_sha256", "base", "machine", "configuration_folder",
    "references", "comment", "Conventions", "history",
)  # fmt: skip
# attributes that are numbers, by their beginnings and their ends
_NUMBERED = (
    "analysed_", "solver_", "wall_seconds_", "cpu_seconds_", "entry_factor_", "unknowns", "record_matched"
)  # fmt: skip
_MEASURED = ("_l2", "_peak", "_cpu_seconds")
# attributes that hold JSON, where they are there: what they must be, and what that is of
_TEXT_LIST: tuple[type, type] = (list, str)
_MEMBERS: dict[type, str] = {str: " of texts", dict: " of objects", list: " of lists"}
_JSON: dict[str, tuple[type, type]] = {
    "run_warnings": _TEXT_LIST, "configuration_doubts": _TEXT_LIST, "record_warnings": _TEXT_LIST,
    "rock_blocks": _TEXT_LIST, "versions": (dict, str), "record_provenance": (dict, object),
    "discretisation": (dict, object), "verification": (dict, object), "certificate": (dict, object),
    "configuration": (dict, object),
}  # fmt: skip
_MESH = ("mesh", "opening_error", "unknowns", "gaps", "cpu_seconds", "chosen")  # of each that was tried
_WHOLE = (
    "gap",
    "joint_state",
    "stress_node_number",
    "stress_ring",
    "acceptance",
    "status",
    "sample",
    "matched",
)
# variables that have no number somewhere: a face without nodes, a joint without uplift, a block not poured
_MAY_LACK = {
    *STRESS_VARIABLES, *UNDEFINED, "stress_arch", "crack_at_rest", "construction_opening",
    "station_coordinate", "support_delay", *UNDEFINED_MODES,
}  # fmt: skip
_POSITIVE = (
    "gap_area", "section_area", "stress_face_area", "tensile_strength", "floor_frequency", "record_dt",
    "solver_finest_step", "solver_base_step",
)  # fmt: skip
_BESIDE = {"floor_spectrum": "floor_spectrum_statement"}  # variables, and what states how good they are
_COMPONENTS = ("x", "y", "z")
_WORDS: dict[str, tuple[str, ...]] = {  # all names along a dimension
    "component": _COMPONENTS,
    "tangent": ("j", "k"),
    "stress_component": (*COMPONENTS,),
    "section_axis": (*AXES,),
    "section_side": (*SIDES,),
    "stress_basis": (*BASES,),
    "dam_kind": (*LIMITS,),
    "criterion": (*CRITERIA,),
    "stress_measure": (*STRESS_MEASURES,),
}
_OF_A_JOINT = ("estimated_error_l2", "estimated_error_peak")  # beside _KNOWN, of files whose error is stated
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
_MEASURED_RECORDS = {
    f"{span}_{name}": (("record", "scale"), units)
    for span in ("record", "recorded")
    for name, units in {"sa": "m s-2", **{name: units for name, (units, _) in MEASURES.items()}}.items()
}
_SUMMARY: dict[str, tuple[tuple[str, ...], str | None]] = {
    **_INDEX,
    **_MEASURED_RECORDS,
    **{name: (_RUN + dims_of(name), attributes_of(name)["units"]) for name in (*ROWS, *STATED)},
    WITHIN: (("record",), ""),
    "file": (_RUN, ""),
    "entry_factor": (("record", "component"), "1"),
    "matched": (("record",), None),
    "stress_measure": (("stress_measure",), ""),
}

_SUMMARY_TEXTS = ("source", "title", "configuration", "configuration_sha256", "date_created")
# attributes of a summary with JSON: what they must be, and what that is of
_SUMMARY_JSON: dict[str, tuple[type, type]] = {
    "run_warnings": (list, dict), "record_warnings": (dict, list), "versions": (dict, str),
    "configuration": (dict, object),
}  # fmt: skip
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
    yield from _text_flaws(dataset.attrs, _SPECTRUM_TEXTS)
    if not dataset.attrs["source"].startswith("romdam"):
        yield "it has no attribute source that says so"
    if not _is_number(dataset.attrs.get("cutoff_hz")):
        yield f"its attribute cutoff_hz must be a number, got {_got(dataset.attrs, 'cutoff_hz')}"
    yield from _json_flaws(dataset.attrs)
    for name, (dims, units, companion) in _SPECTRUM.items():
        if name in dataset.variables:
            yield from _variable_flaws(name, dims, units, dataset.variables[name])
        elif not companion or companion in dataset.variables:
            yield f"the variable {name} is missing"
    for name in sorted((known.infinite | known.undefined) & {*_SPECTRUM}):
        yield f"{name} has values that are no numbers"
    yield from _value_flaws(dataset, [name for name in _SPECTRUM if name in dataset.variables])


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
    yield from _text_flaws(dataset.attrs, _SUMMARY_TEXTS)
    yield from _number_flaws(dataset.attrs)
    if not dataset.attrs["source"].startswith("romdam"):
        yield "it has no attribute source that says so"
    for name, about in _SUMMARY.items():
        if name in dataset.variables:
            yield from _variable_flaws(name, *about, dataset.variables[name])
        elif name in _INDEX:
            yield f"the variable {name} is missing"
    for name, variable in COORDINATES.items():
        if name in dataset.variables:
            yield from _variable_flaws(name, variable.dims, variable.units, dataset.variables[name])
    for name in (str(dim) for dim in dataset.dims):
        if name in COORDINATES and name != "gap" and name not in dataset.variables:
            yield f"the variable {name} is missing, which names what stands along a dimension"
    for name in (str(each) for each in dataset.variables):
        if name.startswith(PARAMETER):
            yield from _variable_flaws(name, ("sample",), None, dataset.variables[name])
    for name in sorted(known.infinite):
        if not name.startswith(PARAMETER):  # a rigid stiffness
            yield f"{name} has infinite values"
    yield from _json_flaws(dataset.attrs, _SUMMARY_JSON)
    yield from _value_flaws(dataset, [*_SUMMARY, *COORDINATES])
    if not np.isin(dataset.status.values, (DONE, FAILED)).all():
        yield f"status must have the values {DONE} and {FAILED} alone"


def _flaws(dataset: xr.Dataset, known: Opened) -> Iterator[str]:
    """Say what is wrong with a result, in an order in which the first flaw explains those after it."""
    attrs = dataset.attrs
    if not str(attrs.get("source", "")).startswith("romdam"):
        yield "it was not written by romdam, it has no attribute `source` that says so"
    yield from _attribute_flaws(attrs)
    yield from _json_flaws(attrs)

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

    for name in _OF_A_JOINT:
        if name in dataset.variables:
            yield from _variable_flaws(name, ("joint",), "1", dataset.variables[name])
    for name in sorted(known.infinite | (known.undefined - _MAY_LACK)):
        if name in _KNOWN or name in _OF_A_JOINT:
            yield f"{name} has values that are no numbers"
    yield from _value_flaws(dataset, _KNOWN)
    time = dataset.time.values
    if not (len(time) and (np.diff(time) > 0.0).all()):
        yield "its time does not increase"
    if "gap" in dataset.variables and dataset.gap.values.tolist() != [*range(dataset.sizes["gap"])]:
        yield "gap must count the gaps from 0"
    for name, attribute in _BESIDE.items():
        if name in dataset.variables and attribute not in attrs:
            yield f"its attribute {attribute} is missing, which stands beside {name}"


def _value_flaws(dataset: xr.Dataset, names: Iterable[str]) -> Iterator[str]:
    """Say which variables have the right form, and values that cannot be."""
    for name in names:
        if name not in dataset.variables:
            continue
        read = dataset.variables[name]
        values = read.values
        if read.dims == (name,) and len({*values.tolist()}) < len(values):
            yield f"{name} has a value twice"
        if read.dims == (name,) and values.dtype.kind in "OUST" and "" in values.tolist():
            yield f"{name} has a name without letters"
        if name in _WORDS and sorted(values.tolist()) != sorted(_WORDS[name]):
            yield f"{name} must have the values {', '.join(_WORDS[name])}, got {quote(values.tolist())}"
        about = _KNOWN[name].attributes if name in _KNOWN else {}
        flags: list[int] = np.ravel(np.asarray(about.get("flag_values", ()))).tolist()
        if flags and not np.isin(values, flags).all():
            yield f"{name} must have the values {', '.join(map(str, flags))} alone"
        if name in _POSITIVE and (values <= 0.0).any():  # records that could not be read have none
            yield f"{name} must be above 0 {read.attrs.get('units', '')}, got {float(np.nanmin(values)):g}"
    if "component" in dataset.variables and dataset.component.values.tolist() != [*_COMPONENTS]:
        yield "its component must be x, y and z"
    if "gap_joint" in dataset.variables:
        joints = dataset.joint.values.tolist() if "joint" in dataset.variables else []
        if not {*dataset.gap_joint.values.tolist()} <= {*joints}:
            yield "gap_joint names a joint that is not there"


def _attribute_flaws(attrs: Mapping[Any, object]) -> Iterator[str]:
    """Say which attributes are no texts or numbers, as they must be."""
    yield from _text_flaws(attrs, (*_TEXTS, *(name for name in _OPTIONAL_TEXTS if name in attrs)))
    for name in _NUMBERS:
        if not _is_number(attrs.get(name)):
            yield f"its attribute {name} must be a number, got {_got(attrs, name)}"
    yield from _number_flaws(attrs)
    if attrs["model_order"] not in ("reduced", "full"):
        yield f"its attribute model_order must be reduced or full, got {_got(attrs, 'model_order')}"


def _number_flaws(attrs: Mapping[Any, object]) -> Iterator[str]:
    """Say which attributes are no numbers, of those that are numbers where they are there."""
    for name, value in attrs.items():
        is_number = isinstance(value, int | float | np.number)
        if (str(name).startswith(_NUMBERED) or str(name).endswith(_MEASURED)) and not is_number:
            yield f"its attribute {name} must be a number, got {_got(attrs, name)}"
        if name in _POSITIVE and not (is_number and float(str(value)) > 0.0):
            yield f"its attribute {name} must be above 0, got {_got(attrs, name)}"


def _text_flaws(attrs: Mapping[Any, object], names: Sequence[str]) -> Iterator[str]:
    for name in names:
        if not isinstance(attrs.get(name), str):
            yield f"its attribute {name} must be a text, got {_got(attrs, name)}"


def _is_number(value: object) -> bool:
    return isinstance(value, int | float | np.number) and math.isfinite(float(value))


def _json_flaws(attrs: Mapping[Any, object], kinds: Mapping[str, tuple[type, type]] = _JSON) -> Iterator[str]:
    """Say which attributes hold no JSON of the kind that they must."""
    for name, (kind, member) in kinds.items():
        if name not in attrs:
            continue
        try:
            value: Any = json.loads(str(attrs[name]))
        except (ValueError, RecursionError):
            value = None
        members = list(value.values()) if isinstance(value, dict) else value
        if not (isinstance(value, kind) and all(isinstance(each, member) for each in members)):
            what = f"{'list' if kind is list else 'object'}{_MEMBERS.get(member, '')}"
            yield f"its attribute {name} must be a JSON {what}, got {_got(attrs, name)}"
        elif name == "discretisation" and isinstance(value, dict):
            meshes = value.get("meshes", [])
            tried = meshes if isinstance(meshes, list) else [meshes]
            if not all(isinstance(mesh, dict) and {*_MESH} <= {*mesh} for mesh in tried):
                yield f"its attribute {name} must state {', '.join(_MESH)} of each of its `meshes`"


def _got(attrs: Mapping[Any, object], name: str) -> str:
    value = attrs.get(name)
    return quote(value.item() if isinstance(value, np.generic) else value) if name in attrs else "none"


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
