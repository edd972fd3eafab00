"""Tables as CSV: largest values and sliding of a result, and the runs of a summary.

The runs are also written as a spreadsheet, by the extra `xlsx`, and as Parquet and Zarr, by `arrays`.
"""

from __future__ import annotations

import csv
import os
import warnings
from collections.abc import Iterable, Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import xarray as xr

from romdam.core.errors import ConfigError, WriteError
from romdam.core.files import private_folder, replacing
from romdam.core.printable import plain_cell
from romdam.postprocess.maxima import HEAD, maxima
from romdam.postprocess.run_columns import Column, run_columns
from romdam.postprocess.sliding import HEAD as SLIDING_HEAD
from romdam.postprocess.sliding import sliding_rows
from romdam.results.suite.rows import FAILED
from romdam.results.suite.summary import open_summary

CSV, XLSX, PARQUET, ZARR = "summary.csv", "summary.xlsx", "summary.parquet", "summary.zarr"
_MODULES = {  # key of `outputs` -> module, package and extra that it needs, and what has the same without
    "xlsx": ("xlsxwriter", "XlsxWriter", "xlsx", f"{CSV} has the same table"),
    "parquet": ("pyarrow", "pyarrow", "arrays", f"{CSV} has the same table"),
    "zarr": ("zarr", "zarr", "arrays", "summary.nc has the same Dataset"),
}
_WIDEST = 40  # letters of a spreadsheet's column


def write_maxima(dataset: xr.Dataset, folder: Path, stem: str) -> Path:
    """Write the table as `folder`/`stem`-maxima.csv."""
    rows = [(name, f"{value:.6g}", *rest) for name, value, *rest in maxima(dataset)]
    return write_csv(HEAD, rows, folder / f"{stem}-maxima.csv")


def write_sliding(dataset: xr.Dataset, folder: Path, stem: str) -> list[Path]:
    """Write the table as `folder`/`stem`-sliding.csv where a joint carries shear."""
    rows = sliding_rows(dataset)
    return [write_csv(SLIDING_HEAD, rows, folder / f"{stem}-sliding.csv")] if rows else []


def write_csv(head: Sequence[str], rows: Iterable[Sequence[object]], path: Path) -> Path:
    """Write a table whole or not at all; no text of it is a formula to a spreadsheet."""
    with replacing(path) as unfinished, unfinished.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(map(plain_cell, head))
        writer.writerows(map(plain_cell, row) for row in rows)
    return path


def write_tables(
    summary: xr.Dataset, folder: Path, xlsx: bool = False, parquet: bool = False, zarr: bool = False
) -> list[Path]:
    """Write `summary.csv`, and what is asked for of `summary.xlsx`, `summary.parquet` and `summary.zarr`.

    Tables have a row for each run, in SI units with every digit. What a run does not have is an empty cell,
    NaN in Parquet; the stiffness of a rigid joint is `inf`.

    Raises
    ------
    ResultError
        where the folder or the disk refuses a file.
    """
    columns = run_columns(summary)
    cells = [_cells(column) for column in columns]
    paths = [write_csv([c.title for c in columns], zip(*cells, strict=True), folder / CSV)]
    if xlsx:
        paths.append(_write_xlsx(columns, cells, folder / XLSX))
    if parquet:
        paths.append(_write_parquet(columns, cells, folder / PARQUET))
    if zarr:
        paths.append(_write_zarr(folder / ZARR))
    return paths


def refuse_without(keys: Iterable[str], location: Path) -> None:
    """Refuse files that cannot be written, before anything is run.

    Parameters
    ----------
    keys : of `outputs`: xlsx, parquet, zarr

    Raises
    ------
    ConfigError
        where the extra is not installed.
    """
    for key in keys:
        module, package, extra, same = _MODULES[key]
        if find_spec(module) is None:
            raise ConfigError(
                f"{location}: outputs.{key}: needs the package {package}; install romdam with the extra "
                f"`{extra}`, or leave the key out: {same}"
            )


def _cells(column: Column) -> list[object]:
    if column.name == "status":
        return ["failed" if status == FAILED else "done" for status in column.values.tolist()]
    if column.values.dtype.kind != "f":
        return list(column.values.tolist())
    values = column.values.astype(object)
    values[np.isnan(column.values)] = ""
    return list(values)


def _write_xlsx(columns: list[Column], cells: list[list[object]], path: Path) -> Path:
    """Write a sheet of the runs, and one that says what the columns are."""
    import xlsxwriter

    runs = [tuple(column.title for column in columns), *zip(*cells, strict=True)]
    meanings = [("column", "unit", "meaning"), *((c.title, c.units, c.long_name) for c in columns)]
    with replacing(path) as unfinished:
        book = xlsxwriter.Workbook(str(unfinished), {"constant_memory": True})
        bold = book.add_format({"bold": True})
        for name, rows in (("runs", runs), ("columns", meanings)):
            sheet = book.add_worksheet(name)
            sheet.freeze_panes(1, 1)
            for k, text in enumerate(rows[0]):
                sheet.set_column(k, k, min(_WIDEST, len(str(text)) + 2))
            for number, row in enumerate(rows):
                look = bold if number == 0 else None
                for k, cell in enumerate(row):
                    if isinstance(cell, int | float) and np.isfinite(cell):
                        sheet.write_number(number, k, cell, look)
                    elif cell != "":  # texts stay texts, whatever they begin with
                        sheet.write_string(number, k, str(cell), look)
            if name == "runs":
                sheet.autofilter(0, 0, len(cells[0]), len(columns) - 1)
        book.close()
    return path


def _write_parquet(columns: list[Column], cells: list[list[object]], path: Path) -> Path:
    """Write a table whose columns have their units and meanings as metadata."""
    import pyarrow
    from pyarrow import parquet

    fields, arrays = [], []
    for column, texts in zip(columns, cells, strict=True):
        numbers = column.values.dtype.kind == "f"
        arrays.append(pyarrow.array(column.values if numbers else texts))
        about = {"units": column.units, "long_name": column.long_name}
        fields.append(pyarrow.field(column.title, arrays[-1].type, metadata=about))
    with replacing(path) as unfinished:
        parquet.write_table(pyarrow.table(arrays, schema=pyarrow.schema(fields)), unfinished)
    return path


def _write_zarr(path: Path) -> Path:
    """Write the summary.nc beside it as a store, which takes the place of an earlier one.

    Raises
    ------
    WriteError
        where the disk refuses it, and where something else stands there.
    """
    if path.exists() and not (path / "zarr.json").is_file():
        raise WriteError(f"{path}: is there and no Zarr store of version 3; move it away")
    try:
        with (
            private_folder(path.parent) as folder,
            open_summary(path.parent) as summary,
            warnings.catch_warnings(),
        ):
            warnings.simplefilter("ignore")  # texts have no place in the format's specification yet
            summary.drop_encoding().to_zarr(folder / ZARR, mode="w", zarr_format=3, consolidated=True)
            if path.exists():
                os.replace(path, folder / "before")
            os.replace(folder / ZARR, path)
    except OSError as error:
        raise WriteError(
            f"{path}: cannot be written ({error}); free the disk or choose another folder"
        ) from error
    return path
