"""Compare two stored results: `romdam compare A B`.

Nothing is run. The histories of both files are read and brought to common times and places, and their
differences are written as a table and a figure.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import xarray as xr

from romdam.core.errors import ResultError
from romdam.core.files import prepare_folder
from romdam.error.histories import read_histories
from romdam.error.two_results import side_by_side
from romdam.postprocess.variant_tables import VariantTable, shown_cell
from romdam.results.table import write_csv


@dataclass(frozen=True)
class TwoResults:
    """Differences of two results: Dataset, table, and the files that were written."""

    dataset: xr.Dataset
    table: VariantTable
    paths: tuple[Path, ...]

    def beyond(self, tolerance: float) -> list[str]:
        """Names of the quantities whose L2 or peak differs by more than a tolerance, relative."""
        worse = (self.dataset[["l2_difference", "peak_difference"]].to_array() > tolerance).any("variable")
        return [str(name) for name in self.dataset["quantity"].values[worse.values]]


def compare_results(first: str | Path, second: str | Path, out: str | Path | None = None) -> TwoResults:
    """Compare a result with another, romdam's own or another code's.

    Parameters
    ----------
    first, second : files as `romdam.error.histories` reads them; differences are relative to the second
    out : folder for a table (CSV) and a figure (PNG); nothing is written where it is None

    Raises
    ------
    ResultError
        where one of them cannot be read, or they have nothing in common.
    """
    first, second = Path(first), Path(second)
    if first.resolve() == second.resolve():
        raise ResultError(f"{first}: is compared with itself; name two results")
    names = (str(first), str(second))
    dataset = side_by_side(read_histories(first), read_histories(second), names)
    table = _table(dataset)
    return TwoResults(dataset, table, _write(dataset, table, prepare_folder(Path(out))) if out else ())


def _table(dataset: xr.Dataset) -> VariantTable:
    first, second = dataset.variant.values
    head = ("quantity", "of", "first [mm]", "second [mm]", "L2 [%]", "peak [%]", "late [ms]")
    columns = (
        dataset["quantity"].values.tolist(),
        dataset.places.values.tolist(),
        *(1e3 * dataset.peak).T.values.tolist(),
        (100.0 * dataset.l2_difference).values.tolist(),
        (100.0 * dataset.peak_difference).values.tolist(),
        (1e3 * dataset.phase).values.tolist(),
    )
    time = f"{float(dataset.time[0]):g} to {float(dataset.time[-1]):g} s"
    return VariantTable(
        "agreement", f"{first} against {second}", time, head, list(zip(*columns, strict=True))
    )


def _write(dataset: xr.Dataset, table: VariantTable, folder: Path) -> tuple[Path, ...]:
    from romdam.visual.plots import save_figure
    from romdam.visual.variant_plots import quantity_histories

    rows = [[shown_cell(cell) for cell in row] for row in table.rows]
    return (
        write_csv(table.head, rows, folder / "compare.csv"),
        save_figure(quantity_histories(dataset), folder / "compare.png"),
    )
