"""Natural modes as a dataset and as a mesh for ParaView, and measured frequencies from a CSV file."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from romdam.config.load import Job
from romdam.core.arrays import Ints
from romdam.core.csv_table import plain_number, read_table
from romdam.core.errors import ResultError
from romdam.core.scene import Scene
from romdam.core.version import SOURCE
from romdam.postprocess.measured_modes import MeasuredMode
from romdam.results.dataset import job_labels, library_versions
from romdam.results.vtu import mesh_of, write_vtu

AXES = ("x", "y", "z")
_NUMBER = {"units": "1"}
_COLUMNS = ("frequency", "name", "mode", "damping", "direction")
_MEANING: dict[str, tuple[tuple[str, ...], str, str]] = {
    "frequency": (("mode",), "Hz", "natural frequency, zero of a rigid motion"),
    "dry_frequency": (("mode",), "Hz", "natural frequency of the same number without water"),
    "damping_ratio": (("mode",), "1", "phi^T C phi / (2 omega phi^T M phi), of the solids' damping C"),
    "modal_mass": (("mode",), "kg", "phi^T M phi, with a largest displacement of 1"),
    "participation_factor": (("mode", "direction"), "1", "phi^T M r / (phi^T M phi)"),
    "effective_mass": (("mode", "direction"), "kg", "effective modal mass"),
    "motion_share": (("mode", "direction"), "1", "share of the structure's kinetic energy"),
    "total_mass": (("direction",), "kg", "mass of all blocks that are shaken, with the water's added mass"),
    "position": (("node", "direction"), "m", "position of the node"),
    "shape": (("mode", "node", "direction"), "1", "displacement of the mode, the largest of all nodes is 1"),
}


def modes_dataset(scene: Scene, values: Mapping[str, Any], job: Job, joints: str) -> xr.Dataset:
    """Gather natural modes.

    Parameters
    ----------
    values : variable -> array; `shape` as block -> (m, n, 3); None is left out
    joints : what they did, for the attributes
    """
    arrays = {name: value for name, value in values.items() if value is not None}
    arrays["shape"] = np.concatenate([arrays["shape"][name] for name in scene.blocks], axis=1)
    arrays["position"] = np.concatenate([block.points for block in scene.blocks.values()])
    variables = {
        name: xr.Variable(dims, arrays[name], {"units": unit, "long_name": text})
        for name, (dims, unit, text) in _MEANING.items()
        if name in arrays
    }
    sizes = [len(block.points) for block in scene.blocks.values()]
    coordinates = {
        name: xr.Variable(dims, values, about)
        for name, dims, values, about in (
            ("mode", "mode", np.arange(1, len(arrays["frequency"]) + 1), _NUMBER | {"long_name": "mode"}),
            ("direction", "direction", list(AXES), {"long_name": "global axis"}),
            ("block", "node", np.repeat(list(scene.blocks), sizes), {"long_name": "block of the node"}),
            (
                "node_number",
                "node",
                np.concatenate([np.arange(n) for n in sizes]),
                _NUMBER | {"long_name": "number of the node in its block"},
            ),
        )
    }
    labels = job_labels(job) | {
        "source": SOURCE,
        "date_created": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": library_versions(),
        "joints": joints,
    }
    return xr.Dataset(variables, coordinates, labels)


def write_shapes(scene: Scene, dataset: xr.Dataset, path: Path) -> Path:
    """Write the mesh with point data `mode_01` and so on as one .vtu file."""
    mesh = mesh_of([(block.points, block.element, block.cells) for block in scene.blocks.values()])
    for mode in dataset.mode.values:
        mesh.point_data[f"mode_{mode:02d}"] = dataset["shape"].sel(mode=mode).values
    return write_vtu(mesh, scene.blocks, path)


def read_measured(path: Path, modes: int) -> list[MeasuredMode]:
    """Read measured frequencies: columns frequency [Hz] and, if wanted, name, mode, damping, direction.

    Parameters
    ----------
    modes : how many are computed

    Raises
    ------
    ResultError
        where the file cannot be read, or a row is wrong.
    """
    table = read_table(path, ResultError)
    columns = table.names
    if "frequency" not in columns or not {*columns} <= {*_COLUMNS}:
        raise ResultError(
            f"{path}: the first row names columns of {', '.join(_COLUMNS)}, of which frequency [Hz] is "
            f"required, got {', '.join(columns) or 'none'}; correct it"
        )
    if not table.rows:
        raise ResultError(f"{path}: has no measured mode, at least 1 is needed; add a row for each")
    measured = [
        _measured_mode(dict(zip(columns, row, strict=True)), table.at(k)) for k, row in enumerate(table.rows)
    ]
    if len(measured) > modes:
        raise ResultError(
            f"{path}: has {len(measured)} measured modes, and {modes} are computed; ask for more with -n"
        )
    stated = [measured_mode.mode for measured_mode in measured if measured_mode.mode is not None]
    for mode in stated:
        if not 1 <= mode <= modes or stated.count(mode) > 1:
            raise ResultError(
                f"{path}: mode {mode} is {'named twice' if stated.count(mode) > 1 else 'not computed'}, "
                f"computed are 1 to {modes}, each for one row; correct it, or ask for more with -n"
            )
    return measured


def _measured_mode(texts: Mapping[str, str], location: str) -> MeasuredMode:
    frequency = _number(texts["frequency"], f"{location}: frequency [Hz]", 0.0, 1e4)
    mode, direction = texts.get("mode", ""), texts.get("direction", "").lower()
    if mode and not (mode.isascii() and mode.isdecimal()):
        raise ResultError(
            f"{location}: mode is a whole number from 1, got {mode!r}; correct it, or leave it out"
        )
    if direction and direction not in AXES:
        raise ResultError(
            f"{location}: direction is x, y or z, got {direction!r}; correct it, or leave it out"
        )
    damping = texts.get("damping", "")
    return MeasuredMode(
        name=texts.get("name", "") or f"{frequency:g} Hz",
        frequency=frequency,
        damping=_number(damping, f"{location}: damping ratio", 0.0, 1.0) if damping else float("nan"),
        mode=int(mode) if mode else None,
        direction=AXES.index(direction) if direction else None,
    )


def _number(text: str, what: str, above: float, below: float) -> float:
    value = plain_number(text)
    if value is None or not above < value < below:
        raise ResultError(f"{what} must be a number above {above:g} and below {below:g}, got {text!r}")
    return value


def add_measured(dataset: xr.Dataset, measured: list[MeasuredMode], numbers: Ints) -> xr.Dataset:
    """The dataset with the measured modes and the number of the computed one that each is compared with."""
    freq = np.array([mode.frequency for mode in measured])
    ratio = np.array([mode.damping for mode in measured])
    computed = dataset.frequency.sel(mode=numbers).values
    table = {
        "measured_frequency": (freq, "Hz", "measured natural frequency"),
        "measured_damping_ratio": (ratio, "1", "measured damping ratio"),
        "measured_mode": (numbers, "1", "number of the computed mode that it is compared with"),
        "frequency_difference": (computed / freq - 1.0, "1", "computed frequency over the measured, less 1"),
    }
    variables = {
        name: xr.Variable(("measured",), values, {"units": unit, "long_name": text})
        for name, (values, unit, text) in table.items()
    }
    names = ("measured", [mode.name for mode in measured], {"long_name": "name of the measured mode"})
    return dataset.assign(variables).assign_coords(measured=names)
