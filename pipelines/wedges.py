"""Rock wedges of a file, under the forces that a result has: one Dataset, its table and files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import xarray as xr

from romdam.config.sections.wedges import read_wedges
from romdam.core.files import prepare_folder
from romdam.postprocess.wedge_histories import HEAD, Row, wedge_dataset, wedge_rows
from romdam.results.dataset import write_dataset
from romdam.results.fields import open_result
from romdam.results.table import write_csv


@dataclass(frozen=True)
class Wedges:
    """Sliding of all wedges: the Dataset, rows of its table, and files that were written."""

    dataset: xr.Dataset
    rows: list[Row]
    paths: tuple[Path, ...]


def assess_wedges(
    file: str | Path, result: str | Path | None = None, out: str | Path | None = None
) -> Wedges:
    """Find the factors of safety of rock wedges against sliding.

    Parameters
    ----------
    file : YAML with `wedges:`
    result : a run's NetCDF file, whose joints and sections press on the wedges and whose ground shakes them;
        without one the wedges stand under constant forces
    out : folder for <file>-wedges.nc and .csv; nothing is written without one

    Raises
    ------
    ConfigError
        for wrong keys, wedges that are open, and forces that the result does not have.
    ResultError
        where the result cannot be read, or the folder refuses a file.
    """
    path = Path(file)
    wedges = read_wedges(path)
    if result is None:
        dataset = wedge_dataset(wedges, None, str(path))
    else:
        with open_result(result) as opened:
            dataset = wedge_dataset(wedges, opened.dataset, str(path))
    rows = wedge_rows(dataset)
    if out is None:
        return Wedges(dataset, rows, ())
    folder = prepare_folder(Path(out))
    written = folder / f"{path.stem}-wedges.nc"
    write_dataset(dataset, written)
    return Wedges(dataset, rows, (written, write_csv(HEAD, rows, written.with_suffix(".csv"))))
