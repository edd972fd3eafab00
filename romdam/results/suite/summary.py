"""The summary of several runs: one Dataset over records, scales and samples; and opening it with results.

A plain job of several records is a suite of one scale and one sample.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from romdam.config.load import Job
from romdam.config.sections.motions.target import NAMED
from romdam.config.sections.suite import SuiteConfig
from romdam.core.arrays import Floats
from romdam.core.errors import ResultError
from romdam.core.fingerprint import fingerprint
from romdam.core.motion import GroundMotion
from romdam.core.scene import Scene
from romdam.core.version import SOURCE
from romdam.postprocess.hazard_of_response import with_hazard_of_response
from romdam.postprocess.record_measures import MEASURES, analysed, earlier_records, measures_at_scales
from romdam.postprocess.responses import RUNS, WITHIN
from romdam.postprocess.sobol import BASE_SAMPLES, with_sobol_indices
from romdam.postprocess.stress.summary import MEASURES as STRESS
from romdam.postprocess.weights import WEIGHT, effective_number
from romdam.results.attached import attached_names
from romdam.results.checking import check_summary
from romdam.results.dataset import library_versions, open_dataset, open_netcdf, write_dataset
from romdam.results.suite.hazard_table import suite_hazard
from romdam.results.suite.record_weights import record_weights
from romdam.results.suite.rows import DONE, FAILED, ROWS, STATED, RunIndex, SuiteRow, attributes_of, dims_of
from romdam.results.variables import COORDINATES

SUMMARY, DESIGN, RUNS_FOLDER, CACHE_FOLDER = "summary.nc", "design.nc", "runs", "cache"
_RUN = ("record", "scale", "sample")
_SINGLE = ("gap_peak_opening",)  # maps, in single precision
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(\.\d+)?(e[-+]?\d+)?(?!\w)")  # but for those of names, as in J12
_FOLDER, _BESIDE = "results_folder", "."  # attribute of the summary; a plain job's results lie beside it


@dataclass(frozen=True)
class SuiteRecord:
    """A record of a suite as the summary shows it.

    Attributes
    ----------
    name : unique
    motion : as recorded and corrected, before the suite's scale; None where it cannot be used
    message : why not
    factors : (scales,) what the motion is multiplied by; NaN without a motion
    """

    name: str
    motion: GroundMotion | None
    message: str
    factors: Floats


def unscaled(name: str, motion: GroundMotion | str) -> SuiteRecord:
    """A record of a plain job: its motion as it is, or why it cannot be used."""
    if isinstance(motion, GroundMotion):
        return SuiteRecord(name, motion, "", np.ones(1))
    return SuiteRecord(name, None, motion, np.full(1, np.nan))


def suite_of(job: Job) -> SuiteConfig:
    """Variations of a suite; of a plain job, which varies nothing, only `period`, `of`, `weights` count."""
    stated = job.config.suite or SuiteConfig()
    if job.config.pipeline == "suite":
        return stated
    return SuiteConfig(period=stated.period, of=stated.of, weights=stated.weights)


def summary_dataset(
    job: Job,
    scene: Scene,
    design: xr.Dataset,
    records: Sequence[SuiteRecord],
    rows: Mapping[RunIndex, SuiteRow],
) -> xr.Dataset:
    """Put the rows of a suite, or of a plain job's records, into one Dataset.

    Parameters
    ----------
    job : the configuration
    scene : for the joints and gaps
    design : the samples
    records : all of them, in order, those that failed too
    rows : (record, scale, sample) -> row; a run without a row has not been made

    Returns
    -------
    Dataset with dims record, scale, sample, and joint, gap, node, component, stress_measure where they apply
    """
    shape = (len(records), len(_scales(job)[0]), design.sizes["sample"])
    data = _of_rows(shape, rows)
    data |= _measures(job, records)

    # what the records' own entries have done to them, besides the suite's scale
    unknown = np.full(3, np.nan)
    factors = np.array([unknown if r.motion is None else r.motion.entry_factors for r in records])
    matched = np.array([r.motion is not None and r.motion.is_matched for r in records], dtype=np.int8)
    by = "what `scale`, and a target, of the record's entry multiply it by, besides scale_factor"
    flags = {"flag_values": np.array([0, 1], dtype=np.int8), "flag_meanings": "not_matched matched"}
    data["entry_factor"] = (("record", "component"), factors, {"units": "1", "long_name": by})
    data["matched"] = (
        "record",
        matched,
        {"long_name": "whether its spectrum was matched to a target"} | flags,
    )

    within = {member: record.name for record in records for member in earlier_records(record.motion)}
    data[WITHIN] = (
        "record",
        np.array([within.get(record.name, "") for record in records], dtype=str),
        {"long_name": "the last sequence of records here that has this record in it, which runs alone too"},
    )

    data |= _outcomes(shape, records, rows)
    files = np.full(shape, "", dtype=object)
    for at, row in rows.items():
        files[at] = "" if row.kept is None else row.kept.file
    results_folder = RUNS_FOLDER if job.config.pipeline == "suite" else _BESIDE
    where = "beside this file" if results_folder == _BESIDE else f"in {results_folder}"
    data["file"] = (_RUN, files.astype(str), {"long_name": f"the run's own result {where}, if kept"})

    warnings = {r.name: list(r.motion.warnings) for r in records if r.motion and r.motion.warnings}
    attributes = {
        "title": job.config.title or job.path.stem,
        "source": SOURCE,
        "date_created": datetime.now(UTC).isoformat(timespec="seconds"),
        "configuration_file": job.path.name,
        "configuration": json.dumps(job.config.model_dump(mode="json")),
        "configuration_sha256": job.digest,
        "design": design.attrs["design"],
        "design_sha256": design.attrs["content_sha256"],
        "versions": library_versions(),
        "record_warnings": json.dumps(warnings),
        "run_warnings": json.dumps(_distinct_warnings(records, rows)),
        _FOLDER: results_folder,
        "runs_sha256": fingerprint([(run, row.key) for run, row in sorted(rows.items(), key=itemgetter(0))]),
    }
    attributes |= {name: design.attrs[name] for name in (BASE_SAMPLES,) if name in design.attrs}
    dataset = xr.Dataset(data, _coordinates(job, scene, design, records, data), attributes)
    dataset = with_sobol_indices(dataset)
    stated = suite_of(job).hazard
    if stated is None:
        return dataset
    hazard = suite_hazard(stated, job.folder, str(job.path))
    return with_hazard_of_response(dataset, hazard.curve, hazard.response, hazard.measure, hazard.levels)


def runs_dataset(
    job: Job,
    scene: Scene,
    design: xr.Dataset,
    records: Sequence[SuiteRecord],
    rows: Mapping[RunIndex, SuiteRow],
) -> xr.Dataset:
    """The runs of a summary alone, without the records' measures and what is computed of all runs.

    Parameters
    ----------
    job, scene, design, records, rows : see `summary_dataset`

    Returns
    -------
    Dataset with the dims, coordinates, responses, status and messages of `summary_dataset`
    """
    shape = (len(records), len(_scales(job)[0]), design.sizes["sample"])
    data = _of_rows(shape, rows) | _outcomes(shape, records, rows)
    attributes = {
        "title": job.config.title or job.path.stem,
        "source": SOURCE,
        "run_warnings": json.dumps(_distinct_warnings(records, rows)),
    }
    return xr.Dataset(data, _coordinates(job, scene, design, records, data), attributes)


def _of_rows(shape: tuple[int, ...], rows: Mapping[RunIndex, SuiteRow]) -> dict[str, Any]:
    """Variables of the rows' numbers, in the order of the table: that of the rows is one of chance."""
    data: dict[str, Any] = {}
    present = {name for row in rows.values() for name in row.values}
    for name in (name for name in (*ROWS, *STATED) if name in present):
        known = next(row.values[name] for row in rows.values() if name in row.values)
        whole = np.full((*shape, *known.shape), np.nan, np.float32 if name in _SINGLE else np.float64)
        for at, row in rows.items():
            if name in row.values:
                whole[at] = row.values[name]
        data[name] = ((*_RUN, *dims_of(name)), whole, attributes_of(name))
    return data


def _outcomes(
    shape: tuple[int, ...], records: Sequence[SuiteRecord], rows: Mapping[RunIndex, SuiteRow]
) -> dict[str, Any]:
    """Whether each run succeeded, and why not."""
    status, message = np.full(shape, FAILED, dtype=np.int8), np.full(shape, "not run", dtype=object)
    for i, record in enumerate(records):
        if record.motion is None:
            message[i] = record.message
    for at, row in rows.items():
        status[at], message[at] = FAILED if row.message else DONE, row.message
    flags = {"flag_values": np.array([DONE, FAILED], dtype=np.int8), "flag_meanings": "done failed"}
    return {
        "status": (_RUN, status, {"long_name": "whether the run succeeded"} | flags),
        "message": (_RUN, message.astype(str), {"long_name": "why a run failed"}),
    }


def _distinct_warnings(
    records: Sequence[SuiteRecord], rows: Mapping[RunIndex, SuiteRow]
) -> list[dict[str, object]]:
    """Warnings of the runs, those that differ in numbers alone as one: text and record of the first run."""
    found: dict[str, dict[str, Any]] = {}
    for at in sorted(rows):
        for text in dict.fromkeys(rows[at].warnings):
            about = {"warning": text, "record": records[at[0]].name, "runs": 0}
            found.setdefault(_NUMBER.sub("#", text), about)["runs"] += 1
    return list(found.values())


def _measures(job: Job, records: Sequence[SuiteRecord]) -> dict[str, Any]:
    """Measures of what was analysed; where `transient.duration` cuts it, those of the whole records too."""
    suite, duration = suite_of(job), job.config.transient.duration
    period, of = suite.period, suite.of
    spans = {"record": duration} if duration is None else {"record": duration, "recorded": None}
    data: dict[str, Any] = {}
    for prefix, span in spans.items():
        motions = [None if record.motion is None else analysed(record.motion, span) for record in records]
        measured = [
            measures_at_scales(m, record.factors, period, of)
            for m, record in zip(motions, records, strict=True)
        ]
        if duration is None:
            stretch = ""
        else:
            stretch = f", of the {duration:g} s analysed" if span else ", of the whole record"
        for name in (*MEASURES, "sa"):
            pseudo = ("m s-2", f"pseudo-spectral acceleration at {period:g} s, 5 % damping")
            units, long_name = pseudo if name == "sa" else MEASURES[name]
            if name not in ("duration", "dt"):  # which are of the record, not of a component
                long_name += f" of the {NAMED[of]}" + ("" if units == "s" else ", scaled")
            values = np.array([values[name] for values in measured])
            about = {"units": units, "long_name": long_name + stretch}
            data[f"{prefix}_{name}"] = (("record", "scale"), values, about)
    return data


def _scales(job: Job) -> tuple[Floats, dict[str, str]]:
    """The values of the dimension `scale`, and what they are."""
    suite = suite_of(job)
    target = suite.intensities
    if target is None:
        return np.array(suite.scales), {"units": "1", "long_name": "factor on the records"}
    period = "" if target.period is None else f" at {target.period:g} s, {100 * target.damping:g} % damping"
    return np.array(target.values), {
        "units": "m s-2",
        "long_name": f"target {target.measure}{period} of the {NAMED[target.of]}",
    }


def _coordinates(
    job: Job, scene: Scene, design: xr.Dataset, records: Sequence[SuiteRecord], data: Mapping[str, Any]
) -> dict[str, Any]:
    values, about = _scales(job)
    coords: dict[str, Any] = {
        "record": (
            "record",
            np.array([suite_record.name for suite_record in records], dtype=str),
            {"long_name": "name of the record"},
        ),
        "scale": ("scale", values, about),
        "sample": ("sample", design.sample.values, design.sample.attrs),
        "scale_factor": (
            ("record", "scale"),
            np.array([record.factors for record in records]),
            {"units": "1", "long_name": "what the record is multiplied by"},
        ),
    }
    stated = suite_of(job).weights
    if stated is not None:
        weights = record_weights(stated, [record.name for record in records], str(job.path))
        about_weights = {"units": "1", "long_name": "weight of the record in statistics, of the sum 1",
                         "effective_records": effective_number(weights)}  # fmt: skip
        coords[WEIGHT] = ("record", weights, about_weights)
    coords |= {str(name): ("sample", v.values, v.attrs) for name, v in design.data_vars.items()}
    joints = list(scene.joints.values())
    coordinates: dict[str, Any] = {"component": np.array(["x", "y", "z"])}
    if joints:
        coordinates["joint"] = np.array([joint.name for joint in joints], dtype=str)
        coordinates["gap_joint"] = np.concatenate([np.full(len(j.area), j.name) for j in joints])
        coordinates["gap_position"] = np.concatenate([j.position for j in joints])
        coordinates["gap_area"] = np.concatenate([j.whole_area for j in joints])
    if scene.probes:
        coordinates["node"] = np.array([probe.name for probe in scene.probes], dtype=str)
    coordinates |= {dim: np.array(names, dtype=str) for dim, names in attached_names(scene).items()}
    floors = job.config.outputs.floor_spectra
    if floors is not None:
        places = floors.places or job.config.outputs.nodes
        coordinates["floor_place"] = np.array(list(places), dtype=str)
        coordinates["floor_damping"] = np.array(floors.dampings)
        coordinates["floor_frequency"] = np.array(floors.frequencies)
    coords |= {n: (COORDINATES[n].dims, values, COORDINATES[n].about) for n, values in coordinates.items()}
    if "peak_stress" in data:
        about = {"long_name": "stress whose largest value is told"}
        coords["stress_measure"] = ("stress_measure", np.array(STRESS, dtype=str), about)
    return coords


def write_summary(dataset: xr.Dataset, folder: Path) -> Path:
    """Write `summary.nc`, whole or not at all.

    Raises
    ------
    ResultError
        where the folder or the disk refuses it.
    """
    write_dataset(dataset, folder / SUMMARY)
    return folder / SUMMARY


def open_summary(folder: Path) -> xr.Dataset:
    """Open a summary lazily, once it is known to be one.

    Raises
    ------
    ResultError
        where it is damaged, or no summary.
    """
    dataset, known = open_netcdf(folder / SUMMARY)
    try:
        check_summary(dataset, known, folder / SUMMARY)
    except ResultError:
        dataset.close()
        raise
    return dataset


def open_suite(folder: str | Path) -> xr.DataTree:
    """Open a suite, or a plain job's records, lazily: the summary at the root, `design`, every kept result.

    The result of a record at the first scale with the second sample is `runs/<record>__0__1`; that of a plain
    job's record is `runs/<record>__0__0`.

    Raises
    ------
    ResultError
        where the folder holds no summary, or not the kept results that the summary names.
    """
    folder = Path(folder)
    if not (folder / SUMMARY).is_file():
        raise ResultError(
            f"{folder}: holds no {SUMMARY}; `romdam run CONFIG --out DIR` of several records makes it"
        )
    summary = open_summary(folder)
    parts = {"/": summary}
    if (folder / DESIGN).is_file():
        design = open_netcdf(folder / DESIGN)[0]
        if design.attrs.get("content_sha256") == summary.attrs.get("design_sha256"):
            parts["/design"] = design
    for (i, k, s), path in kept_results(summary, folder).items():
        parts[f"/runs/{summary.record.values[i]}__{k}__{s}"] = open_dataset(path, warn=False)
    return xr.DataTree.from_dict(parts)


def kept_results(summary: xr.Dataset, folder: Path) -> dict[RunIndex, Path]:
    """Index of a run -> file of its own result, of every run that has one."""
    if "file" not in summary:  # romdam 0.1 named them so
        numbers = {str(name): i for i, name in enumerate(summary.record.values)}
        kept = {}
        for path in sorted((folder / RUNS_FOLDER).glob("*.nc")):
            words = path.stem.rsplit("__", 2)
            if len(words) == 3 and words[0] in numbers and words[1].isdigit() and words[2].isdigit():
                kept[numbers[words[0]], int(words[1]), int(words[2])] = path
        return kept
    inside = folder if summary.attrs.get(_FOLDER) == _BESIDE else folder / RUNS_FOLDER
    cells = np.ndenumerate(summary.file.transpose(*RUNS).values)
    return {(at[0], at[1], at[2]): inside / Path(str(file)).name for at, file in cells if file}
