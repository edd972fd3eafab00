"""Rock wedges of a file, under the forces that a result has: one Dataset, its table and files."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import xarray as xr

from romdam.config.sections.wedges import read_levels, read_wedges
from romdam.core.files import prepare_folder
from romdam.postprocess.wedge_histories import (
    HEAD,
    ROTATION_HEAD,
    Row,
    rotation_rows,
    wedge_dataset,
    wedge_rows,
)
from romdam.results.dataset import write_dataset
from romdam.results.fields import open_result
from romdam.results.table import write_csv


@dataclass(frozen=True)
class Wedges:
    """Sliding and rotation of all wedges.

    Attributes
    ----------
    rows, rotations : of the tables under `HEAD` and `ROTATION_HEAD`
    warnings : what was taken for granted
    paths : files that were written
    """

    dataset: xr.Dataset
    rows: list[Row]
    rotations: list[Row]
    warnings: list[str]
    paths: tuple[Path, ...]


def assess_wedges(
    file: str | Path, result: str | Path | None = None, out: str | Path | None = None
) -> Wedges:
    """Find the factors of safety of rock wedges against sliding and rotation.

    Parameters
    ----------
    file : YAML with `wedges:`
    result : a run's NetCDF file, whose joints and sections press on the wedges and whose ground shakes them;
        without one the wedges stand under constant forces
    out : folder for <file>-wedges.nc, -wedges.csv and -wedge-rotations.csv; nothing is written without one

    Raises
    ------
    ConfigError
        for wrong keys and tables, wedges that are open, and forces that the result does not have.
    ResultError
        where the result cannot be read, or the folder refuses a file.
    """
    path = Path(file)
    wedges = read_wedges(path)
    levels = read_levels(wedges, path.parent, str(path))
    if result is None:
        dataset = wedge_dataset(wedges, None, str(path), levels)
    else:
        with open_result(result) as opened:
            dataset = wedge_dataset(wedges, opened.dataset, str(path), levels)
    rows, rotations = wedge_rows(dataset), rotation_rows(dataset)
    warnings = json.loads(dataset.attrs["wedge_warnings"])
    if out is None:
        return Wedges(dataset, rows, rotations, warnings, ())
    folder = prepare_folder(Path(out))
    written = folder / f"{path.stem}-wedges.nc"
    write_dataset(dataset, written)
    tables = (
        write_csv(HEAD, rows, written.with_suffix(".csv")),
        write_csv(ROTATION_HEAD, rotations, folder / f"{path.stem}-wedge-rotations.csv"),
    )
    return Wedges(dataset, rows, rotations, warnings, (written, *tables))
