"""Answers of commands as one JSON object: keys that stay, units in their names, null for no number."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from romdam.core.printable import printable
from romdam.core.version import VERSION
from romdam.error.statement import sentences

if TYPE_CHECKING:
    import xarray as xr

    from romdam.pipelines.check import CheckedJob
    from romdam.pipelines.error.certify import Certified
    from romdam.pipelines.error.two_results import TwoResults
    from romdam.postprocess.maxima import JointPeaks
    from romdam.reduction.storage.user_cache import Entry

Document = dict[str, Any]

_OF_A_BLOCK = {  # attribute of a check -> key
    "element": "element",
    "nodes": "nodes",
    "cells": "cells",
    "free_dofs": "free_dofs",
    "part": "part",
    "method": "reduction_method",
    "retained_dofs": "retained_dofs",
    "fixed_interface_modes": "fixed_interface_modes",
    "frequencies_hz": "frequencies_open_Hz",
}
_IN_SI = {  # of a certificate -> key
    "peak_opening": "peak_opening_m",
    "peak_opening_corrected": "peak_opening_corrected_m",
    "windows": "windows_s",
}
_PEAKS = {  # of a joint -> key
    "opening": "peak_opening_m",
    "opening_time": "peak_opening_time_s",
    "mean_compression": "peak_mean_compressive_stress_Pa",
    "compression": "peak_compressive_stress_Pa",
    "slip": "peak_slip_m",
}
_ERRORS = "estimated_error_l2", "estimated_error_peak"  # of a joint, variables and keys


def print_document(command: str, document: Document) -> None:
    """Print an object with the version and the command in front.

    Parameters
    ----------
    document : of plain values, numbers of NumPy and paths; what is not finite becomes null
    """
    whole = {"romdam": VERSION, "command": command, **document}
    text = json.dumps(_plain(whole), indent=1, ensure_ascii=False, allow_nan=False)
    print("".join(c if c == "\n" or printable(c) == c else json.dumps(c)[1:-1] for c in text))


def _plain(value: Any) -> Any:
    """The value as JSON has it."""
    if isinstance(value, Mapping):
        return {str(key): _plain(member) for key, member in value.items()}
    if isinstance(value, str | bool | int | None):
        return value
    if hasattr(value, "tolist"):  # of NumPy
        return _plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Sequence):
        return [_plain(member) for member in value]
    return str(value)


def check_document(check: CheckedJob, config: Path) -> Document:
    """A job that was checked."""
    return {
        "configuration": config,
        "valid": True,
        "unknowns": check.unknowns,
        "integration_s": check.costs.get("integration"),
        "whole_run_s": check.seconds,
        "costs_s": check.costs,
        "memory_bytes": check.memory,
        "results_bytes": check.file_size,
        "frequencies_closed_Hz": check.closed_frequencies,
        "blocks": {
            name: {key: block.get(attribute) for attribute, key in _OF_A_BLOCK.items()}
            for name, block in check.blocks.items()
        },
        "joints": {
            name: {
                "between": str(joint["between"]).split(" - "),
                "gaps": joint["gaps"],
                "area_m2": joint["area"],
                "friction": joint["friction"],
                "water_N": joint["water"],
            }
            for name, joint in check.joints.items()
        },
        "bodies": check.bodies,
        "ties": {
            name: {
                "between": str(tie["between"]).split(" - "),
                "nodes": tie["nodes"],
                "discretization": tie["discretization"],
                "apart_m": tie["apart"],
            }
            for name, tie in check.ties.items()
        },
        "records": {
            name: {
                "dt_s": record["dt"],
                "duration_s": record["duration"],
                "peak_acceleration_m_s2": record["peak_acceleration"],
                "steps": record["steps"],
                "sequence": None if record["sequence"] == "-" else record["sequence"],
            }
            for name, record in check.records.items()
        },
        "supports": {
            name: {
                "station_m": motion["station"],
                "delay_s": motion["delay"],
                "factor": motion["factor"],
                "record": motion["record"],
            }
            for name, motion in check.supports.items()
        },
        "loads_N": check.loads,
        "quick": check.quick,
        "without_factors": check.solvers,
        "warnings": check.warnings,
        "not_checked": check.skipped,
    }


def info_document(dataset: xr.Dataset, path: Path) -> Document:
    """A result."""
    from romdam.postprocess.maxima import joint_peaks
    from romdam.postprocess.record_measures import sequence_of, stated_warnings

    attrs = dataset.attrs
    prefix = "error_estimate_"
    estimate = {
        name.removeprefix(prefix): value
        for name, value in attrs.items()
        if name.startswith(prefix) and not isinstance(value, str)
    }
    return {
        "result": path,
        "title": attrs["title"],
        "record": attrs["record"],
        "sequence": sequence_of(attrs) or None,
        "record_dt_s": attrs["record_dt"],
        "record_peak_acceleration_m_s2": attrs["record_peak_acceleration"],
        "analysed_peak_acceleration_m_s2": attrs.get("analysed_peak_acceleration"),
        "configuration_file": attrs["configuration_file"],
        "configuration_sha256": attrs["configuration_sha256"],
        "order": attrs["model_order"],
        "unknowns": attrs.get("unknowns"),
        "basis_file": attrs.get("model_file"),
        "sizes": dict(dataset.sizes),
        "integrator": attrs.get("integrator"),
        "steps": attrs.get("solver_steps"),
        "finest_step_s": attrs["solver_finest_step"],
        "time_loop_cpu_s": attrs.get("solver_loop_cpu_seconds"),
        "largest_residual": attrs.get("solver_largest_residual"),
        "ledger_imbalance": attrs.get("solver_ledger_imbalance"),
        "estimated_time_error": attrs.get("solver_estimated_time_error"),
        "accuracy": attrs.get("solver_accuracy"),
        "joints": {peaks.joint: _of_joint(dataset, peaks) for peaks in joint_peaks(dataset)},
        "error": sentences(attrs),
        "error_not_included": attrs.get("error_not_included"),
        "error_estimate": estimate,
        "certificate": _json(attrs, "certificate"),
        "verification": _json(attrs, "verification"),
        "warnings": stated_warnings(attrs),
        "written": attrs["date_created"],
        "by": attrs["source"],
    }


def _of_joint(dataset: xr.Dataset, peaks: JointPeaks) -> Document:
    """Peaks and errors of a joint; those that the result does not have are left out."""
    of_joint = dataset.sel(joint=peaks.joint)
    values = {key: getattr(peaks, name) for name, key in _PEAKS.items()}
    document = {key: value for key, value in values.items() if value is None or value == value}
    return document | {name: of_joint[name].item() for name in _ERRORS if name in of_joint}


def _json(attrs: Mapping[str, Any], name: str) -> Any:
    """Value of an attribute that is JSON; null where the result has none."""
    return json.loads(str(attrs[name])) if str(attrs.get(name, "")).startswith("{") else None


def certificate_document(certified: Certified, result: Path) -> Document:
    """An error that was certified; keys without a unit are those of the file that is written."""
    stated = {_IN_SI.get(name, name): value for name, value in certified.statement.document.items()}
    return {**stated, "result": result, "written": [certified.path]}


def comparison_document(compared: TwoResults, beyond: Sequence[str]) -> Document:
    """Two results compared."""
    dataset = compared.dataset
    first, second = dataset.variant.values.tolist()
    return {
        "first": first,
        "second": second,
        "from_s": dataset.time[0].item(),
        "to_s": dataset.time[-1].item(),
        "quantities": {
            str(name): {
                "places": difference.places.item(),
                "first_peak_m": difference.peak.sel(variant=first).item(),
                "second_peak_m": difference.peak.sel(variant=second).item(),
                "l2_difference": difference.l2_difference.item(),
                "peak_difference": difference.peak_difference.item(),
                "late_s": difference.phase.item(),
            }
            for name in dataset["quantity"].values
            for difference in [dataset.sel(quantity=name)]
        },
        "beyond_tolerance": beyond,
        "written": compared.paths,
    }


def cache_document(kept: Sequence[Entry], folder: Path, limit: float | None) -> Document:
    """Reduced blocks that are kept; those that were removed where there is no limit."""
    stamp = "%Y-%m-%dT%H:%M:%SZ"
    blocks = [
        {"path": entry.path, "bytes": entry.size, "used": time.strftime(stamp, time.gmtime(entry.used))}
        for entry in kept
    ]
    return {
        "folder": folder,
        "removed": limit is None,
        "bytes": sum(entry.size for entry in kept),
        "limit_bytes": limit,
        "blocks": blocks,
    }
