"""What stands beside a result and is of the same job: a study, measured modes, a summary of several runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import xarray as xr

from romdam.core.errors import ResultError
from romdam.results.dataset import open_dataset
from romdam.results.suite.summary import RUNS_FOLDER, SUMMARY, open_summary

STUDY, MODES = "study.nc", "*-modes-*.nc"
_OF_STUDY = ("setting", "l2_error", "peak_error", "total_cpu_seconds", "of_job")
_OF_MODES = ("measured", "measured_frequency", "measured_mode", "frequency", "frequency_difference")


@dataclass(frozen=True)
class Companions:
    """Files of the same configuration, loaded.

    Attributes
    ----------
    study : of `romdam study`; None where there is none
    modes : file name -> natural modes with measured frequencies
    summary : of several runs, without what is of every gap; None where there is none
    passed_over : file and why it is not used, a sentence each
    """

    study: xr.Dataset | None = None
    modes: dict[str, xr.Dataset] = field(default_factory=dict)
    summary: xr.Dataset | None = None
    passed_over: list[str] = field(default_factory=list)


def companions_of(path: Path, digest: str) -> Companions:
    """Read what stands beside a result, or beside the folder of a suite's runs.

    Files of another configuration, and files that are damaged, are named in `passed_over`.

    Parameters
    ----------
    digest : SHA-256 of the result's configuration
    """
    folders = [path.parent, *([path.parent.parent] if path.parent.name == RUNS_FOLDER else [])]
    passed_over, modes = list[str](), dict[str, xr.Dataset]()
    study = summary = None
    for folder in folders:
        if study is None and (folder / STUDY).is_file():
            study = _read(folder / STUDY, _OF_STUDY, digest, passed_over)
        for file in sorted(folder.glob(MODES)):
            dataset = _read(file, (), digest, passed_over)
            if dataset is None or "measured" not in dataset.dims:
                continue  # natural modes that were compared with nothing
            if lacking := [name for name in _OF_MODES if name not in dataset.variables]:
                passed_over.append(
                    f"{file.name}: lacks {', '.join(lacking)}; `romdam modes` writes it again."
                )
            else:
                modes[file.name] = dataset
        if summary is None and (folder / SUMMARY).is_file():
            summary = _read_summary(folder, digest, passed_over)
    return Companions(study, modes, summary, passed_over)


def _read(path: Path, names: Sequence[str], digest: str, passed_over: list[str]) -> xr.Dataset | None:
    """A file's dataset; None where it is not of this configuration, is damaged or lacks a variable."""
    try:
        with open_dataset(path) as dataset:
            if not _same(dataset, path, digest, passed_over):
                return None
            if lacking := [name for name in names if name not in dataset.variables]:
                passed_over.append(f"{path.name}: lacks {', '.join(lacking)}.")
                return None
            return dataset.load()
    except ResultError as error:
        passed_over.append(f"{path.name}: cannot be read: {error}.")
        return None


def _read_summary(folder: Path, digest: str, passed_over: list[str]) -> xr.Dataset | None:
    try:
        with open_summary(folder) as summary:
            if not _same(summary, folder / SUMMARY, digest, passed_over):
                return None
            return summary.drop_dims("gap", errors="ignore").load()
    except ResultError as error:
        passed_over.append(f"{SUMMARY}: cannot be read: {error}.")
        return None


def _same(dataset: xr.Dataset, path: Path, digest: str, passed_over: list[str]) -> bool:
    """Tell whether a file is of a configuration, and name it where it is of another."""
    if str(dataset.attrs.get("configuration_sha256", "")) == digest:
        return True
    passed_over.append(f"{path.name}: is of another configuration, so it is left out.")
    return False
