"""The summary of several runs beside their results: `summary.nc`, and the same as tables."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import xarray as xr

from romdam.config.load import Job
from romdam.core.errors import RecordError, ResultError
from romdam.core.fingerprint import fingerprint
from romdam.core.motion import GroundMotion
from romdam.core.scene import Scene
from romdam.error.statement import row_errors
from romdam.pipelines.input_motions import Read
from romdam.records.components import check_components
from romdam.results.dataset import run_identity
from romdam.results.suite.design import design_dataset
from romdam.results.suite.record_weights import record_weights
from romdam.results.suite.rows import Kept, SuiteRow, row_values
from romdam.results.suite.summary import SUMMARY, suite_of, summary_dataset, unscaled, write_summary
from romdam.results.table import refuse_without, write_tables
from romdam.results.variables import Case


@dataclass(frozen=True)
class FinishedRun:
    """A run that is done: its file and what stands in it, of what, its wall and CPU time but for figures."""

    path: Path
    dataset: xr.Dataset
    case: Case
    seconds: tuple[float, float]

    @property
    def kept(self) -> Kept:
        """Its file, and what tells it from that of another run."""
        return Kept(self.path.name, "", run_identity(self.dataset.attrs), {})

    def row(self, job: Job) -> SuiteRow:
        """The run as a row of a summary."""
        motion = self.case.motion
        key = fingerprint((job.digest, motion.acc, motion.dt))
        stated = dict(zip(("wall_seconds", "cpu_seconds"), self.seconds, strict=True))
        stated |= row_errors(self.dataset.attrs)
        warnings = tuple(json.loads(self.dataset.attrs["run_warnings"]))
        return SuiteRow(key, "", row_values(self.case, stated), self.kept, warnings=warnings)


def refuse_summary(job: Job, folder: Path | None, *files: str) -> None:
    """Refuse what would be found when the summary is written, after all runs.

    Parameters
    ----------
    folder : of the results; None before there is one

    Raises
    ------
    ResultError
        where a folder has the name of one of its files.
    ConfigError
        where a file is asked for whose package is not installed.
    """
    for name in (SUMMARY, *files):
        if folder is not None and (folder / name).is_dir():
            raise ResultError(f"{folder / name}: is a folder, a file is written there; choose another --out")
    outputs = job.config.outputs
    asked = {"xlsx": outputs.xlsx, "parquet": outputs.parquet, "zarr": outputs.zarr}
    refuse_without((key for key, wanted in asked.items() if wanted), job.path)


def refuse_unmeasured(job: Job, read: Read) -> None:
    """Refuse records that do not have the components which `suite.of` measures, and weights of other records.

    Raises
    ------
    RecordError, ConfigError
        naming the record.
    """
    of, weights = suite_of(job).of, suite_of(job).weights
    if weights is not None:
        record_weights(weights, list(read), str(job.path))
    for name, motion in read.items():
        if isinstance(motion, GroundMotion):
            try:
                check_components(motion.acc, of)
            except RecordError as error:
                raise RecordError(f"{name}: suite.{error}") from None


def write_summary_files(summary: xr.Dataset, job: Job, folder: Path) -> tuple[Path, ...]:
    """Write a summary, and the tables of it that a configuration asks for.

    Raises
    ------
    ResultError
        where the folder or the disk refuses a file.
    """
    outputs, path = job.config.outputs, write_summary(summary, folder)
    return (path, *write_tables(summary, folder, outputs.xlsx, outputs.parquet, outputs.zarr))


def records_summary(job: Job, scene: Scene, read: Read, rows: Mapping[str, SuiteRow]) -> xr.Dataset:
    """The summary of a plain job's records, those that failed too.

    Parameters
    ----------
    rows : record -> row of every one that was run
    """
    records = [unscaled(name, motion) for name, motion in read.items()]
    design = design_dataset(job, suite_of(job), {})
    placed = {(i, 0, 0): rows[record.name] for i, record in enumerate(records) if record.name in rows}
    return summary_dataset(job, scene, design, records, placed)
