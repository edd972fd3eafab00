"""A computed case as an xarray.Dataset, and its file."""

from __future__ import annotations

import json
import logging
import os
import platform
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from romdam.config.load import Job
from romdam.config.plausible import check_assumptions
from romdam.core.errors import ResultError
from romdam.core.final_state import FinalState
from romdam.core.fingerprint import code_digest
from romdam.core.motion import AXES, GroundMotion
from romdam.core.scene import FreeField
from romdam.core.scene_digest import scene_digest
from romdam.core.sealed import FAILURES, Opened, examine, sealing
from romdam.core.version import SOURCE
from romdam.postprocess.floor_spectra import statement as floor_statement
from romdam.postprocess.incidence import incidence_statement
from romdam.postprocess.maxima import stress_statement
from romdam.postprocess.record_measures import analysed
from romdam.results.case import damping_statement, moduli_statement, rock_blocks, upstream_of
from romdam.results.case_warnings import case_warnings
from romdam.results.checking import check_run
from romdam.results.final_state import write_final_state
from romdam.results.netcdf import netcdf_file, open_lazily, write_netcdf
from romdam.results.renamed import with_names_of_now
from romdam.results.stress.faces import of_faces, peak_shares
from romdam.results.variables import COORDINATES, VARIABLES, Case

log = logging.getLogger(__name__)

_BASES = {
    "uniform": "the ground's motion, which is that of the record",
    "free_field": "the motion of the level rock surface far from the dam, which is that of the record",
}
LIBRARIES = ("numpy", "scipy", "numba", "obspy", "xarray", "h5netcdf")
_IDENTITY = (
    "configuration_sha256",
    "record_sha256",
    "scene_sha256",
    "date_created",
    "wall_seconds_integration",
)
SINGLE = (  # histories in single precision: 6e-8 of a value is lost, less than any error that is stated
    "dissipated_energy", "mean_normal_force", "mean_shear_force", "reduced_coordinates", "shear_force",
)  # fmt: skip
COMPRESSION = {"compression": "gzip", "compression_opts": 1, "shuffle": True}
_CHUNK = 1 << 20  # bytes: HDF5 keeps as many of a variable while it reads
_CHUNKS = 8  # of a compressed variable, more where they would be larger than a piece
_PIECE = 1 << 24  # bytes of a chunk at most
CF = "CF-1.11"
SIGNS = (
    "SI units. time counts from the start of the record. Displacement, velocity and acceleration are "
    "relative to the base; opening and tension are positive, compression is negative."
)
REFERENCES = "Craig and Bampton, AIAA Journal 6 (1968) 1313; the manual's pages theory and results"


@dataclass(frozen=True)
class Timing:
    """Seconds of the stages of a run: name -> wall and CPU."""

    wall: dict[str, float]
    cpu: dict[str, float]


def build_dataset(case: Case, job: Job, timing: Timing, model_file: str | None) -> xr.Dataset:
    """Put one case into a Dataset with units, names and provenance.

    Parameters
    ----------
    case : scene, ground motion and history
    job : the configuration that asked for it
    timing : seconds spent
    model_file : name of the basis file beside the result; None at full order
    """
    scene, motion, history = case.scene, case.motion, case.history
    attributes = job_labels(job) | record_labels(motion)
    upstream = upstream_of(job.config, scene)
    if upstream is not None:
        attributes["upstream"] = upstream
    if moduli := moduli_statement(scene):
        attributes["moduli"] = moduli
    if damping := damping_statement(scene):
        attributes["material_damping"] = damping
    base = _BASES[job.config.ground.input]
    field = scene.find(FreeField)
    if field is not None and field.inclined:
        base += f" at {field.origin} m"
        attributes["incidence"] = incidence_statement(field)
    attributes |= {
        "rock_blocks": json.dumps(rock_blocks(scene)),
        "source": SOURCE,
        "code_sha256": code_digest(),
        "date_created": datetime.now(UTC).isoformat(timespec="seconds"),
        "record_dt": motion.dt,
        "record_peak_acceleration": motion.peak,
        "analysed_peak_acceleration": analysed(motion, job.config.transient.duration).peak,
        "scene_sha256": scene_digest(scene),
        "run_warnings": json.dumps(case_warnings(case, job)),
        "model_order": job.config.model.order,
        "base": base,
        "integrator": history.integrator,
        "versions": library_versions(),
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
    }
    attributes |= {f"wall_seconds_{stage}": seconds for stage, seconds in timing.wall.items()}
    attributes |= {f"cpu_seconds_{stage}": seconds for stage, seconds in timing.cpu.items()}
    attributes |= {f"solver_{name}": value for name, value in history.stats.items()}
    data, coordinates = (
        {name: xr.Variable(v.dims, v.get(case), v.about) for name, v in table.items() if v.when(case)}
        for table in (VARIABLES, COORDINATES)
    )
    dataset = xr.Dataset(data, coordinates, attributes)
    if model_file is not None:
        dataset.attrs["model_file"] = model_file
    if case.floors is not None:
        dataset.attrs["floor_spectrum_statement"] = floor_statement(case.floors)
    if statement := stress_statement(dataset, peak_shares(case) if of_faces(case) else {}):
        dataset.attrs["stress_statement"] = statement
    return dataset


def run_identity(attrs: Mapping[Any, Any]) -> str:
    """Attributes of a result that tell its run from any other; a statement of its error leaves them be."""
    return ", ".join(f"{attrs.get(name)}" for name in _IDENTITY)


def library_versions() -> str:
    """Versions of Python and of the libraries that a result depends on, as JSON."""
    return json.dumps({name: version(name) for name in LIBRARIES} | {"python": platform.python_version()})


def job_labels(job: Job) -> dict[str, object]:
    """Attributes that name the configuration that a result belongs to."""
    return {
        "title": job.config.title or job.path.stem,
        "configuration_file": job.path.name,
        "configuration": json.dumps(job.config.model_dump(mode="json")),
        "configuration_sha256": job.digest,
        "configuration_doubts": json.dumps([*check_assumptions(job.config), *job.scene_warnings]),
    }


def record_labels(motion: GroundMotion) -> dict[str, object]:
    """Attributes that name the source of a result's ground motion."""
    return {
        "record": motion.name,
        "record_sha256": motion.digest,
        "record_provenance": json.dumps(motion.provenance, default=str),
        "record_warnings": json.dumps(list(motion.warnings)),
        **{f"entry_factor_{axis}": float(f) for axis, f in zip(AXES, motion.entry_factors, strict=True)},
        "record_matched": int(motion.is_matched),
    }


def single_precision(dataset: xr.Dataset) -> xr.Dataset:
    """The same dataset with its variables over time in single precision; time itself stays double."""
    kept = {
        name: v.astype(np.float32)
        for name, v in dataset.data_vars.items()
        if "time" in v.dims and v.dtype == np.float64
    }
    return dataset.assign(kept)


def _encoding(name: str, variable: xr.Variable, is_coordinate: bool) -> dict[str, Any]:
    """Encoding of a variable in its file.

    Coordinates have no fill value. The names along a dimension are characters: CF's coordinate variables are
    numbers, and its checker dies of strings. Whole numbers and what is mostly zero, as forces of open gaps
    are, are compressed in chunks of whole rows. Other histories would lose a seventh of their size for 0.015
    CPU-s a megabyte, and lie in one piece, in several where they are large.
    """
    single = name in SINGLE and "time" in variable.dims
    if single:
        variable = variable.astype(np.float32)
    kind, values = variable.dtype.kind, variable.values
    if kind in "OU":
        return {"dtype": "S1"} if variable.dims == (name,) else {}
    encoding: dict[str, Any] = {"_FillValue": None} if is_coordinate else {}
    encoding |= {"dtype": values.dtype} if single else {}
    worth = kind in "iu" or (kind == "f" and 2 * np.count_nonzero(values) < values.size)
    large = values.nbytes > _PIECE
    if not (worth or large) or variable.ndim == 0 or values.size == 0:
        return encoding
    most = min(max(_CHUNK, values.nbytes // _CHUNKS), _PIECE) if worth else _PIECE
    rows = max(1, most * len(values) // values.nbytes)
    chunks = {"chunksizes": (min(rows, len(values)), *values.shape[1:])}
    return encoding | chunks | (COMPRESSION if worth else {})


def write_dataset(dataset: xr.Dataset, path: Path, final: FinalState | None = None) -> None:
    """Write a NetCDF-4 file whole or not at all.

    Parameters
    ----------
    final : state in which the run ended, from which another can begin

    Raises
    ------
    ResultError
        where the folder or the disk refuses it.
    """
    encoding = {
        name: _encoding(str(name), variable, name in dataset.coords)
        for name, variable in dataset.variables.items()
    }
    # the attributes of the dataset, and what CF wants besides
    attrs = dataset.attrs
    source = attrs.get("source", SOURCE)
    created = attrs.get("date_created", datetime.now(UTC).isoformat(timespec="seconds"))
    of = f" from {attrs['configuration_file']}" if "configuration_file" in attrs else ""
    labels = {"source": source, "references": REFERENCES, "comment": SIGNS} | attrs
    labels |= {"Conventions": CF, "history": f"{created}: written by {source}{of}"}
    with sealing(path, dataset.nbytes) as stream, netcdf_file(stream, "w") as file:
        write_netcdf(dataset.drop_encoding().assign_attrs(labels), file, encoding)
        if final is not None:
            write_final_state(file, final, dataset)


def open_dataset(path: Path, warn: bool = True) -> xr.Dataset:
    """Open a file of romdam's lazily, once it is known to be whole; see `open_netcdf`.

    Raises
    ------
    ResultError
        where there is no such file, it is damaged, or romdam has not written it.
    """
    dataset, _ = open_netcdf(path, warn)
    if not str(dataset.attrs.get("source", "")).startswith("romdam"):
        dataset.close()
        raise ResultError(f"{path}: was not written by romdam; it has no `source` attribute that says so")
    return dataset


def open_run(path: Path) -> xr.Dataset:
    """Open the result of a record lazily, once it is known to be one.

    Raises
    ------
    ResultError
        where there is no such file, it is damaged, or it is not the result of a record.
    """
    dataset, known = open_netcdf(path)
    try:
        check_run(dataset, known, path)
    except ResultError:
        dataset.close()
        raise
    return dataset


def open_netcdf(path: Path, warn: bool = True) -> tuple[xr.Dataset, Opened]:
    """Open a NetCDF file lazily, once it is known to be whole, and what is known of it.

    Where it has gaps, `.sel(gap_joint="J3")` takes those of a joint.

    Parameters
    ----------
    path : the file
    warn : of names that were those of an earlier version; its variables and attributes have those of this one

    Raises
    ------
    ResultError
        where there is no such file, or it is damaged.
    """
    if not path.exists():
        raise ResultError(
            f"{path}: no such result file; `romdam run CONFIG --out DIR` writes DIR/<record>.nc"
        )
    known = examine(path)
    try:
        dataset = open_lazily(path)
    except FAILURES as error:
        raise ResultError(f"{path}: is not a NetCDF-4 file ({error})") from error
    dataset, former = with_names_of_now(dataset)
    if "gap_joint" in dataset.coords and dataset.gap_joint.ndim == 1:
        close = dataset.close
        dataset = dataset.set_xindex("gap_joint")
        dataset.set_close(close)
    undefined, infinite = (
        frozenset(former.get(name, name) for name in names) for names in (known.undefined, known.infinite)
    )
    if former and warn:
        names = ", ".join(f"{old} as {new}" for old, new in former.items())
        log.warning("%s: was written by %s; read %s", path, dataset.attrs.get("source", "romdam"), names)
    return dataset, replace(known, undefined=undefined, infinite=infinite)
