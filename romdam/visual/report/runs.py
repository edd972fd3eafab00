"""The runs of a summary as tables: all of them, which a reader sorts and filters, and the worst."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from romdam.core.display_units import unit_text
from romdam.core.round_off import without_round_off
from romdam.postprocess.extremes import worst_runs
from romdam.postprocess.fragility import none_exceeds
from romdam.postprocess.responses import RUNS, intensity_of, parameters, response_of, responses
from romdam.results.suite.rows import RunIndex
from romdam.visual import suite_plots as plots
from romdam.visual.report.parts import (
    PageCell,
    PageSection,
    PageTable,
    Text,
    Value,
    cell_of,
    number,
    picture,
    side_by_side,
)
from romdam.visual.report.subject import Subject, plain

MOST_ROWS = 5_000  # of a table: more make a page slow, and nobody reads them
_WORST = 10
_FEWEST_BARS = 4  # runs, below which bars say no more than the table under them
_MOST_PARAMETERS = 4  # of a table of runs; the values of more stand in a table of the samples
_ANSWERS = {  # response -> its head in a table
    "peak_opening": "peak opening",
    "peak_slip": "peak slip",
    "residual_opening": "residual opening",
    "residual_slip": "residual slip",
    "peak_mean_compressive_stress": "mean compr.",
    "peak_compressive_stress": "instant compr.",
    "peak_displacement": "largest displ.",
    "peak_stress": "peak stress",
    "face_stress": "face stress",
}
_HEADS = (
    "Compression is the largest mean of a writing interval, and the largest at one instant. Residual opening "
    "and slip are those of a gap."
)


@dataclass(frozen=True)
class _Column:
    """A column of a table of runs: its head, the cell of the run at a place, the response that it shows."""

    head: str
    cell: Callable[[RunIndex], Value]
    name: str = ""


def runs_section(subject: Subject) -> PageSection:
    """Every run in one table, the largest response first."""
    summary, notes = subject.summary, []
    places = _by_response(subject)
    columns = _columns(subject)
    if len(places) > MOST_ROWS:
        notes.append(
            Text(
                f"The {MOST_ROWS} runs of the largest {plain(subject.response)}, of {len(places)}; all are "
                "in summary.csv.",
                soft=True,
            )
        )
    head, rows = _table(columns, places[:MOST_ROWS])
    if "recorded_duration" in summary:
        notes.append(
            Text("Measures are those of what was analysed, beside the time that was recorded.", True)
        )
    notes.append(Text(_HEADS, soft=True))
    ordered = next((k for k, column in enumerate(columns) if column.name == subject.response), None)
    table = PageTable(head, rows, label="All runs", sortable=True, descending=ordered)
    return PageSection("runs", "All runs", [*notes, table, _samples_table(summary)])


def _samples_table(summary: xr.Dataset) -> PageTable:
    """Parameters of every sample; empty where they stand in the tables of the runs."""
    of_parameters = [_numbers(name, values) for name, values in parameters(summary).items()]
    if len(of_parameters) <= _MOST_PARAMETERS:
        return PageTable([], [])
    columns = [_Column("sample", lambda at: str(at[2])), *of_parameters]
    places = [(0, 0, k) for k in range(min(summary.sizes["sample"], MOST_ROWS))]
    head, rows = _table(columns, places)
    return PageTable(head, rows, label="Samples", sortable=True)


def worst_section(subject: Subject) -> PageSection | None:
    """The runs of the largest response as bars, and the same rows as in the table of all."""
    if not subject.done or not subject.response:
        return None
    worst = worst_runs(subject.summary, subject.response, _WORST)
    places = _by_response(subject)[: worst.sizes["run"]]
    caption = f"The {len(places)} largest of {subject.done} runs."
    bars = None
    if len(places) >= _FEWEST_BARS and float(worst.response.max()) > 0.0:
        bars = picture(plots.worst_figure(worst, [label(subject.summary, at) for at in places]), caption)
    head, rows = _table(_columns(subject), places)
    table = PageTable(head, rows, label="Worst runs")
    # what the largest response says of records that were not run
    factor, unit = plots.display_unit(worst.response, worst.attrs["response_units"])
    largest, count = number(factor * float(worst.response.max())), int(worst.attrs["records"])
    beyond = (
        f"None of {count} records exceeds {largest} {unit}; of others like them at most "
        f"1 - 0.05^(1/{count}) = {number(100 * none_exceeds(count))} % would, with 95 % confidence."
    )
    notes = [Text(_HEADS, soft=True), Text(beyond)]
    return PageSection("worst", "Worst runs", [side_by_side(bars), table, *notes])


def label(summary: xr.Dataset, at: RunIndex) -> str:
    """A run in words: its record, and of scale and parameters what varies, with its value."""
    words = [str(summary.record.values[at[0]])]
    if summary.sizes["scale"] > 1:
        unit = unit_text(str(summary.scale.attrs.get("units", "1")))
        scale = float(summary.scale[at[1]])
        words.append(f"{number(scale)} {unit}" if unit else f"× {number(scale)}")
    for name, values in parameters(summary).items():
        factor, unit = plots.display_unit(values, str(values.attrs.get("units", "1")))
        words.append(f"{name} {number(factor * float(values[at[2]]))} {unit}".rstrip())
    return words[0] + ("\n" + ", ".join(words[1:]) if words[1:] else "")


def _by_response(subject: Subject) -> list[RunIndex]:
    """Places of all runs: the largest response first, those that failed last."""
    summary = subject.summary
    shape = tuple(summary.sizes[dim] for dim in RUNS)
    values = np.full(shape, np.nan)
    if subject.response:
        values = response_of(summary, subject.response).transpose(*RUNS).values
    order = np.argsort(-values.ravel(), kind="stable")  # NaN stands last
    i, k, s = np.unravel_index(order, shape)
    return list(zip(i.tolist(), k.tolist(), s.tolist(), strict=True))


def _table(columns: Sequence[_Column], places: Sequence[RunIndex]) -> tuple[list[str], list[list[Value]]]:
    return [column.head for column in columns], [[column.cell(at) for column in columns] for at in places]


def _columns(subject: Subject) -> list[_Column]:
    """Columns of a run's row: where it stands, what it answered, of what motion, and its files."""
    summary = subject.summary
    columns = [_Column("record", lambda at: str(summary.record.values[at[0]]))]
    if summary.sizes["scale"] > 1 or summary.scale.values[0] != 1.0:
        columns.append(_numbers("scale", summary.scale))
    of_parameters = [_numbers(name, values) for name, values in parameters(summary).items()]
    if len(of_parameters) > _MOST_PARAMETERS:
        of_parameters = [_Column("sample", lambda at: str(at[2]))]
    columns += of_parameters
    there = responses(summary)
    chosen = dict.fromkeys([subject.response, *(name for name in _ANSWERS if name in there)])
    columns += [
        _numbers(_ANSWERS.get(name, plain(name)), response_of(summary, name), name) for name in chosen if name
    ]
    measured = dict.fromkeys([subject.topic.intensity, "sa", "pga"])
    for name in measured:
        if name == "scale" or f"record_{name}" in summary:
            columns.append(_numbers(plots.short(name), intensity_of(summary, name)))
    for name, text in (("record_duration", "analysed"), ("recorded_duration", "recorded")):
        if name in summary and float(summary[name].max() - summary[name].min()) > 0.0:  # else in Records
            columns.append(_numbers(text, summary[name]))
    if (summary.status > 0).any():
        status, message = summary.status.transpose(*RUNS).values, summary.message.transpose(*RUNS).values
        columns.append(_Column("outcome", lambda at: f"failed: {message[at]}" if status[at] else "done"))
    if subject.files:
        links = subject.files
        columns.append(_Column("files", lambda at: PageCell("–", "files", links=tuple(links.get(at, ())))))
    return columns


def _numbers(title: str, values: xr.DataArray, name: str = "") -> _Column:
    """A column of a variable, in a unit that suits its numbers."""
    factor, unit = plots.display_unit(values, str(values.attrs.get("units", "1")))
    dims = [k for k, dim in enumerate(RUNS) if dim in values.dims]
    numbers = factor * without_round_off(values.transpose(*(RUNS[k] for k in dims)))

    def cell(at: RunIndex) -> PageCell:
        return cell_of(float(numbers[tuple(at[k] for k in dims)]))

    return _Column(f"{title} [{unit}]" if unit else title, cell, name)
