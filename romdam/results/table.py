"""Tables as CSV: those of the largest values and of the sliding of a result, beside its figures."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path

import xarray as xr

from romdam.core.files import replacing
from romdam.core.printable import plain_cell
from romdam.postprocess.maxima import HEAD, maxima
from romdam.postprocess.sliding import HEAD as SLIDING_HEAD
from romdam.postprocess.sliding import sliding_rows


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
