"""The runs of a summary as a table that other programs read: CSV, and a spreadsheet by the extra `xlsx`."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import xarray as xr

from romdam.core.errors import ConfigError
from romdam.core.files import replacing
from romdam.postprocess.run_columns import Column, run_columns
from romdam.results.suite.rows import FAILED
from romdam.results.table import write_csv

CSV, XLSX = "summary.csv", "summary.xlsx"
_WIDEST = 40  # letters of a spreadsheet's column


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

    with replacing(path) as unfinished:
        book = xlsxwriter.Workbook(str(unfinished), {"constant_memory": True})
        bold = book.add_format({"bold": True})
        for name, rows in (("runs", _with_head(columns, cells)), ("columns", _meanings(columns))):
            sheet = book.add_worksheet(name)
            sheet.freeze_panes(1, 1)
            for number, row in enumerate(rows):
                if number == 0:
                    for k, text in enumerate(row):
                        sheet.set_column(k, k, min(_WIDEST, len(str(text)) + 2))
                for k, cell in enumerate(row):
                    _write_cell(sheet, number, k, cell, bold if number == 0 else None)
            if name == "runs":
                sheet.autofilter(0, 0, len(cells[0]), len(columns) - 1)
        book.close()
    return path


def _write_cell(sheet: object, row: int, column: int, cell: object, look: object) -> None:
    """Write one cell: texts stay texts, whatever they begin with."""
    if isinstance(cell, int | float) and np.isfinite(cell):
        sheet.write_number(row, column, cell, look)  # type: ignore[attr-defined]
    elif cell != "":
        sheet.write_string(row, column, str(cell), look)  # type: ignore[attr-defined]


def _with_head(columns: list[Column], cells: list[list[object]]) -> Iterator[tuple[object, ...]]:
    yield tuple(column.title for column in columns)
    yield from zip(*cells, strict=True)


def _meanings(columns: list[Column]) -> Iterator[tuple[object, ...]]:
    yield ("column", "unit", "meaning")
    for column in columns:
        yield (column.title, column.units, column.long_name)
