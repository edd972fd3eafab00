"""The table of the largest values of a result, beside its figures."""

from __future__ import annotations

import csv
from pathlib import Path

import xarray as xr

from romdam.core.files import replacing
from romdam.postprocess.maxima import HEAD, maxima


def write_maxima(dataset: xr.Dataset, folder: Path, stem: str) -> Path:
    """Write the table as `folder`/`stem`-maxima.csv."""
    path = folder / f"{stem}-maxima.csv"
    with replacing(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(HEAD)
        writer.writerows((name, f"{value:.6g}", *rest) for name, value, *rest in maxima(dataset))
    return path
