"""Tables as CSV: largest values and sliding of a result, and the runs of a summary.

The runs are also written as a spreadsheet, by the extra `xlsx`.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import xarray as xr

from romdam.core.errors import ConfigError
from romdam.core.files import replacing
from romdam.core.printable import plain_cell
from romdam.postprocess.maxima import HEAD, maxima
from romdam.postprocess.run_columns import Column, run_columns
from romdam.postprocess.sliding import HEAD as SLIDING_HEAD
from romdam.postprocess.sliding import sliding_rows
from romdam.results.suite.rows import FAILED

CSV, XLSX = "summary.csv", "summary.xlsx"
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


def write_tables(summary: xr.Dataset, folder: Path, xlsx: bool = False) -> list[Path]:
    """Write `summary.csv`, and `summary.xlsx` if asked for: a row for each run, SI units, every digit.

    What a run does not have is an empty cell; the stiffness of a rigid joint is `inf`.

    Raises
    ------
    ResultError
        where the folder or the disk refuses a file.
    """
    columns = run_columns(summary)
    cells = [_cells(column) for column in columns]
    paths = [write_csv([c.title for c in columns], zip(*cells, strict=True), folder / CSV)]
    return [*paths, _write_xlsx(columns, cells, folder / XLSX)] if xlsx else paths


def refuse_without_xlsx(location: Path) -> None:
    """Refuse a spreadsheet that cannot be written, before anything is run.

    Raises
    ------
    ConfigError
        where the extra is not installed.
    """
    if find_spec("xlsxwriter") is None:
        raise ConfigError(
            f"{location}: outputs.xlsx: needs the package XlsxWriter; install romdam with the extra "
            "`xlsx`, or "
            f"leave the key out: {CSV} has the same table"
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
