"""Openings and displacements over time of a result, romdam's own or another code's.

Another code's file states openings, open positive, and displacement relative to the base in metres:

- NetCDF-4 (.nc): `opening(time, gap)` with `gap_position(gap, component)`, `widest_opening(time, joint)`,
  `displacement(time, node, component)`, or some of them; `gap_joint(gap)` names the joints
- CSV (.csv): a head, then a row for each time; its columns are `time`, `opening:<number of the gap>`,
  `opening:<joint>` (of its widest gap) and `displacement:<node>:<x, y or z>`; a unit stands as in `time [ms]`
- NumPy (.npz): `time`, `gap` and `position`, as `read_reference` takes them
"""

from __future__ import annotations

import logging
import re
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from romdam.config.quantities import to_si
from romdam.core.arrays import Floats
from romdam.core.csv_table import read_table
from romdam.core.errors import ResultError
from romdam.core.files import check_file
from romdam.error.comparison import ComparedRun
from romdam.results.dataset import open_netcdf, open_run

log = logging.getLogger(__name__)

HistoryKey = tuple[str, ...]
_VARIABLES = {
    "time": (("time",), "s"),
    "opening": (("time", "gap"), "m"),
    "widest_opening": (("time", "joint"), "m"),
    "displacement": (("time", "node", "component"), "m"),
    "gap_position": (("gap", "component"), "m"),
    "gap_joint": (("gap",), ""),
}
_COLUMN = re.compile(
    r"\s*(?:(time)|opening:([^:\[]*[^:\[\s])|displacement:([^:\[]*[^:\[\s]):([xyz]))\s*(?:\[([^\]]+)\])?\s*"
)
_MOST = 4e9  # bytes of a file that is read whole
_UNREADABLE = (
    OSError, KeyError, ValueError, TypeError, IndexError, AttributeError, EOFError, MemoryError, RuntimeError,
    zipfile.BadZipFile, zlib.error,
)  # fmt: skip


@dataclass(frozen=True)
class ComparedHistories:
    """Histories of one result by place.

    Attributes
    ----------
    time : (nt,) rising [s]
    series : ("gap", number), ("joint", name) for its widest gap, or ("node", name, axis) -> (nt,) [m]
    position : ("gap", number) -> (3,) [m], where it is known
    joint : ("gap", number) -> name of its joint, where it is known
    """

    time: Floats
    series: Mapping[HistoryKey, Floats]
    position: Mapping[HistoryKey, Floats] = field(default_factory=dict)
    joint: Mapping[HistoryKey, str] = field(default_factory=dict)


def read_histories(path: Path) -> ComparedHistories:
    """Read what of a result is compared with another, see the module.

    Raises
    ------
    ResultError
        naming the file and what in it is wrong or missing.
    """
    readers = {".nc": _netcdf, ".csv": _table, ".npz": _arrays}
    if path.suffix not in readers:
        raise ResultError(
            f"{path}: {', '.join(readers)} are compared, not {path.suffix or 'what has no suffix'!r}"
        )
    histories = readers[path.suffix](path)
    time = histories.time
    if len(time) < 2 or not np.isfinite(time).all() or (np.diff(time) <= 0.0).any():
        raise ResultError(f"{path}: time must rise from row to row, over two rows at least")
    for key, values in histories.series.items():
        if not np.isfinite(values).all():
            when = time[~np.isfinite(values)][0]
            raise ResultError(f"{path}: {' '.join(key)} is no number at {when:g} s")
    if not histories.series:
        raise ResultError(f"{path}: has neither openings nor displacements; there is nothing to compare")
    return histories


def read_reference(path: Path) -> ComparedRun:
    """Openings from an .npz with `time`, `gap`, and `position` or a model.npz (points, pairs) beside it.

    Raises
    ------
    ResultError
        where it cannot be read or lacks an array.
    """
    try:
        check_file(path, _MOST, ResultError)
        with np.load(path, allow_pickle=False) as stored:
            arrays = stored["time"], stored["gap"], stored.get("position")
        if arrays[2] is None:
            with np.load(path.with_name("model.npz"), allow_pickle=False) as model:
                arrays = *arrays[:2], model["points"][model["pairs"][:, 0]]
        time, gap, position = (np.asarray(array, dtype=float) for array in arrays)
    except _UNREADABLE as error:
        raise ResultError(
            f"{path}: is no reference ({error}); it needs `time`, `gap`, and `position` or a model.npz"
        ) from error
    if time.ndim != 1 or position.shape[1:] != (3,) or gap.shape != (len(time), len(position)):
        raise ResultError(
            f"{path}: time {time.shape}, gap {gap.shape} and position {position.shape} do not fit; "
            "(nt,), (nt, gaps) and (gaps, 3) do"
        )
    for name, array in (("time", time), ("gap", gap), ("position", position)):
        if not np.isfinite(array).all():
            raise ResultError(f"{path}: {name} has values that are no numbers")
    return ComparedRun(time, gap[..., None], position, name=str(path))


def _arrays(path: Path) -> ComparedHistories:
    stored = read_reference(path)
    gaps = [("gap", str(k)) for k in range(len(stored.position))]
    return ComparedHistories(
        stored.time,
        dict(zip(gaps, stored.opening.T, strict=True)),
        dict(zip(gaps, stored.position, strict=True)),
    )


def _netcdf(path: Path) -> ComparedHistories:
    dataset, _ = open_netcdf(path)
    with dataset:
        if not str(dataset.attrs.get("source", "")).startswith("romdam"):
            return _histories(_checked(dataset, path))
    with open_run(path) as result:
        return _histories(result)


def _checked(dataset: xr.Dataset, path: Path) -> xr.Dataset:
    """The variables that are read, once their dimensions, kinds and units are as they must be."""
    for name, (dims, unit) in _VARIABLES.items():
        if name not in dataset.variables:
            continue
        values = dataset[name]
        if set(values.dims) != set(dims):
            raise ResultError(
                f"{path}: {name} is over {', '.join(map(str, values.dims))}, must be over {', '.join(dims)}"
            )
        if unit and values.dtype.kind not in "fiu":
            raise ResultError(f"{path}: {name} is of {values.dtype}, must be of numbers")
        if unit and values.attrs.get("units", unit) != unit:
            raise ResultError(f"{path}: {name} is in {values.attrs['units']}, must be in {unit}")
        if "component" in dims and dataset.sizes["component"] != 3:
            raise ResultError(f"{path}: component has {dataset.sizes['component']} places, must have x, y, z")
    if "time" not in dataset.variables:
        raise ResultError(f"{path}: has no variable time")
    return dataset


def _histories(dataset: xr.Dataset) -> ComparedHistories:
    def of_places(name: str) -> list[Any]:
        """Values of each place of a variable, over time if it has one; none without the variable."""
        if name not in dataset.variables:
            return []
        places = (dim for dim in _VARIABLES[name][0] if dim != "time")
        return list(dataset[name].transpose(*places, ...).values)

    gaps: list[HistoryKey] = [("gap", str(k)) for k in range(dataset.sizes.get("gap", 0))]
    position = dict(zip(gaps, of_places("gap_position"), strict=False))
    joint = {gap: str(name) for gap, name in zip(gaps, of_places("gap_joint"), strict=False)}
    series = dict(zip(gaps, of_places("opening"), strict=False))
    for k, widest in enumerate(of_places("widest_opening")):
        series["joint", str(dataset.joint.values[k])] = widest
    for k, vectors in enumerate(of_places("displacement")):
        node = str(dataset.node.values[k])
        series |= {("node", node, axis): values for axis, values in zip("xyz", vectors, strict=True)}
    for name in dict.fromkeys(joint[gap] for gap in gaps if gap in joint and gap in series):
        widest = np.max([series[gap] for gap in gaps if joint[gap] == name], axis=0)
        series.setdefault(("joint", name), widest)
    floats = {key: np.asarray(values, dtype=float) for key, values in series.items()}
    return ComparedHistories(np.asarray(dataset.time, dtype=float), floats, position, joint)


def _table(path: Path) -> ComparedHistories:
    table = read_table(path, ResultError, most=_MOST)
    series: dict[HistoryKey, Floats] = {}
    for name in table.names:
        key, factor = _column(name, path)
        if key in series:
            raise ResultError(f"{path}: two columns are {name.strip()!r}")
        if key:
            series[key] = factor * table.numbers(name)
    if ("time",) not in series:
        raise ResultError(f"{path}: no column is named time; the first row is {', '.join(table.names)[:200]}")
    return ComparedHistories(series.pop(("time",)), series)


def _column(name: str, path: Path) -> tuple[HistoryKey, float]:
    """Key of a column, () where its name says none, and what its unit is in SI."""
    match = _COLUMN.fullmatch(name)
    if match is None:
        log.warning(
            "%s: column %r is not compared; `romdam compare --help` says how columns are named",
            path,
            name.strip(),
        )
        return (), 1.0
    time, gap, node, axis, unit = match.groups()
    try:
        factor = to_si(f"1 {unit}", "s" if time else "m") if unit else 1.0
    except ValueError as error:
        raise ResultError(f"{path}: column {name.strip()!r}: {error}") from error
    if time:
        return ("time",), factor
    return ("node", node, axis) if node else ("gap" if gap.isdecimal() else "joint", gap), factor
