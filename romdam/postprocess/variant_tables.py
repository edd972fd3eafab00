"""The tables of a comparison of variants, from its Dataset: cost, peaks, worst steps, stress, differences."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

Row = tuple[str | int | float, ...]


@dataclass(frozen=True)
class VariantTable:
    """A table with a name for its file, a title, what its cells are, a head and rows."""

    name: str
    title: str
    note: str
    head: tuple[str, ...]
    rows: Sequence[Row]


def variant_tables(comparison: xr.Dataset) -> list[VariantTable]:
    """Every table that the comparison has numbers for."""
    tables = [make(comparison) for make in (_cost, _peaks, _worst_steps, _stress)]

    # every quantity of every variant against the reference
    reference, differences = comparison.attrs["reference"], comparison[["l2_difference", "peak_difference"]]
    both = differences.sel(against=reference)
    head = ("variant", *map(str, both["quantity"].values))
    rows: list[Row] = [(name, *_pairs(variant)) for name, variant in _each(both) if name != reference]
    note = f"Over “{reference}”: L2 / peak [%]"
    tables.append(VariantTable("to_reference", "Difference to the reference", note, head, rows))

    # all against all in one quantity: the first pair's, else the first there is
    quantities = [str(name) for name in comparison["quantity"].values]
    chosen = next((name for name in quantities if name.startswith("relative")), quantities[0])
    of_chosen = differences.sel(quantity=chosen)
    rows = [(name, *_pairs(pair)) for name, pair in _each(of_chosen)]
    note = f"{chosen[0].upper()}{chosen[1:]}, the row over the column: L2 / peak [%]"
    head = ("variant", *map(str, of_chosen.against.values))
    tables.append(VariantTable("to_each_other", "Each against each", note, head, rows))
    return [table for table in tables if table.rows]


def _cost(comparison: xr.Dataset) -> VariantTable:
    reference = float(comparison.cpu_seconds_loop.sel(variant=comparison.attrs["reference"]))
    about = ("variant", "order", "unknowns", "gaps", "step [ms]", "steps")
    head = (*about, "reduction [s]", "loop [s]", "in all [s]", "ratio")
    rows: list[Row] = []
    for name, variant in _each(comparison):
        cpu = [float(variant[f"cpu_seconds_{key}"]) for key in ("reduction", "loop", "total")]
        sizes = [int(variant[key]) for key in ("unknowns", "gaps")]
        step = 1e3 * float(variant.finest_step)
        rows.append(
            (
                name,
                str(variant.model_order.values),
                *sizes,
                step,
                int(variant.steps),
                *cpu,
                reference / max(cpu[1], 1e-9),
            )
        )
    note = "CPU time; the ratio is that of the reference's time loop to this one"
    return VariantTable("cost", "Size and cost", note, head, rows)


def _peaks(comparison: xr.Dataset) -> VariantTable:
    """Largest values in the compared component, as the source paper's table 2."""
    axis, columns = comparison.attrs["compared_component"], []
    for variable, dim, words, factor in (
        ("peak_component", "node", f"{axis} of {{}} [mm]", 1e3),
        ("peak_relative_component", "pair", f"{axis} across {{}} [mm]", 1e3),
        ("peak_opening", "joint", "opening of {} [mm]", 1e3),
        ("peak_acceleration_component", "node", f"{axis} of {{}} [m/s²]", 1.0),
        ("peak_relative_acceleration_component", "pair", f"{axis} across {{}} [m/s²]", 1.0),
    ):
        for point in comparison[dim].values if variable in comparison else ():
            columns.append((words.format(point), factor * comparison[variable].sel({dim: point})))
    rows: list[Row] = [
        (name, *(float(c.sel(variant=name)) for _, c in columns)) for name, _ in _each(comparison)
    ]
    note = "The value whose magnitude is largest, with its sign"
    return VariantTable(
        "peaks", "Peaks", note, ("variant", *(head for head, _ in columns)), rows if columns else []
    )


def _worst_steps(comparison: xr.Dataset) -> VariantTable:
    """Components when a node, or a pair, is farthest from where it was."""
    rows: list[Row] = []
    for variable, dim in (("peak_displacement", "node"), ("peak_relative_displacement", "pair")):
        for point in comparison[dim].values if variable in comparison else ():
            for name, variant in _each(comparison.sel({dim: point})):
                vector = 1e3 * variant[variable].values
                time = float(variant[f"{variable}_time"])
                rows.append((str(point), name, *map(float, vector), float(np.linalg.norm(vector)), time))
    head = ("where", "variant", "x [mm]", "y [mm]", "z [mm]", "magnitude [mm]", "at [s]")
    return VariantTable(
        "worst_steps", "Worst steps", "When the node, or the pair, is displaced most", head, rows
    )


def _stress(comparison: xr.Dataset) -> VariantTable:
    rows: list[Row] = []
    for stress in comparison.stress.values if "stress_peak" in comparison else ():
        for name, variant in _each(comparison.sel(stress=stress)):
            value, time = 1e-6 * float(variant.stress_peak), float(variant.stress_peak_time)
            rows.append((f"{stress} stress", name, value, str(variant.stress_peak_place.values), time))
    head = ("stress", "variant", "[MPa]", "where (x, y, z [m])", "at [s]")
    return VariantTable("stress", "Largest stresses", "Of all nodes and written times", head, rows)


def _pairs(dataset: xr.Dataset) -> list[str]:
    """L2 and peak in percent, as text; a dash where nothing differs or nothing is known."""
    cells = zip(100.0 * dataset.l2_difference.values, 100.0 * dataset.peak_difference.values, strict=True)
    return [f"{l2:.2g} / {peak:.2g}" if l2 > 0.0 else "–" for l2, peak in cells]


def changes_of(comparison: xr.Dataset) -> list[tuple[str, str]]:
    """Variant -> what it changes, in words."""
    stated = json.loads(str(comparison.attrs["variants"]))
    words = []
    for name, changes in stated.items():
        texts = (f"{path}: {json.dumps(value)}" for path, value in changes.items())
        words.append((name, "; ".join(texts).replace('"', "") or "as it stands"))
    return words


def _each(comparison: xr.Dataset) -> Iterator[tuple[str, xr.Dataset]]:
    for name in comparison.variant.values:
        yield str(name), comparison.sel(variant=name)


def markdown(tables: list[VariantTable]) -> str:
    """Tables as Markdown, numbers with four digits."""
    texts = []
    for table in tables:
        note = f"{table.note}\n\n" if table.note else ""
        rows = [[shown_cell(cell) for cell in row] for row in table.rows]
        texts.append(f"## {table.title}\n\n{note}{markdown_table(table.head, rows)}")
    return "\n".join(texts)


def markdown_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table of Markdown, whose cells may hold any text."""
    lines = [head, ("---",) * len(head), *rows]
    cells = ((cell.replace("|", "\\|").replace("\n", " ") for cell in line) for line in lines)
    return "".join("| " + " | ".join(line) + " |\n" for line in cells)


def shown_cell(cell: str | int | float) -> str:
    """A cell as text, numbers with four digits."""
    if isinstance(cell, float):
        return "–" if np.isnan(cell) else f"{cell:.4g}"
    return str(cell)
