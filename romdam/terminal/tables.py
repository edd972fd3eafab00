"""Tables on stdout."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import TYPE_CHECKING, Any

from rich.console import RenderableType
from rich.table import Table

from romdam.config.quantities import to_si
from romdam.core.printable import one_line

if TYPE_CHECKING:
    import xarray as xr

    from romdam.benchmarks.case import BenchmarkCase
    from romdam.core.benchmark_row import BenchmarkRow
    from romdam.pipelines.check import CheckedJob
    from romdam.postprocess.variant_tables import VariantTable

_ROUND_OFF = 5e-6  # relative difference that a table of benchmarks shows as none


def peaks_table(results: Mapping[str, xr.Dataset]) -> Table:
    """Peaks of every joint, a row for each record and joint."""
    from romdam.postprocess.maxima import joint_peaks

    mean, instant = "compression, mean of a writing interval [MPa]", "at one instant [MPa]"
    table = _table("Peaks", ("record", "joint"), ("opening [mm]", "at [s]", mean, instant, "slip [mm]"))
    for record, dataset in results.items():
        for peaks in joint_peaks(dataset):
            when = peaks.opening_time
            values = (1e-6 * peaks.mean_compression, 1e-6 * peaks.compression, 1e3 * peaks.slip)
            table.add_row(
                record,
                peaks.joint,
                f"{1e3 * peaks.opening:.2f}",
                "-" if when is None else f"{when:.2f}",
                *(f"{value:.2f}" if value == value else "-" for value in values),
            )
    return table


def error_tables(results: Mapping[str, xr.Dataset]) -> list[Table]:
    """Estimated errors of the openings, a row for each record and joint; none where nothing is estimated."""
    from romdam.error.statement import opening_errors
    from romdam.postprocess.stated_errors import total_text

    parts = "steps", "mesh"
    head = ("modes, L2 [%]", "modes, peak [%]", *(f"{part}, all joints, L2 [%]" for part in parts))
    head = (*head, "total, all joints, at most, L2")
    table = _table("Estimated error of the openings", ("record", "joint"), head)
    for record, dataset in results.items():
        stated = opening_errors(dataset.attrs)
        of_all = [f"{100 * stated[part]:.2g}" if part in stated else "unknown" for part in parts]
        of_all.append(total_text(stated))
        for joint in dataset.joint.values if stated and "joint" in dataset else ():
            names, row = ("estimated_error_l2", "estimated_error_peak"), dataset.sel(joint=joint)
            of_modes = [f"{100 * float(row[name]):.2g}" if name in row else "unknown" for name in names]
            table.add_row(record, str(joint), *of_modes, *of_all)
    return [table] if table.row_count else []


def sliding_tables(results: Mapping[str, xr.Dataset]) -> list[Table]:
    """Sliding of every block on the one below it, a row for each record and joint; none without shear."""
    from romdam.postprocess.sliding import HEAD, sliding_rows

    table = _table("Sliding", ("record", *HEAD[:4]), HEAD[4:])
    for record, dataset in results.items():
        for row in sliding_rows(dataset):
            table.add_row(record, *row)
    return [table] if table.row_count else []


def attached_tables(results: Mapping[str, xr.Dataset]) -> list[Table]:
    """Forces of anchors and what else is attached, a row for each record and one; none without any."""
    from romdam.postprocess.attached import attached_forces

    table = _table("Attached", ("record", "of", "name"), ("at rest [kN]", "least [kN]", "largest [kN]"))
    for record, dataset in results.items():
        for of, name, *forces in attached_forces(dataset):
            table.add_row(record, of, name, *(f"{1e-3 * force:.1f}" for force in forces))
    return [table] if table.row_count else []


def wedges_tables(rows: Sequence[Sequence[str]], rotations: Sequence[Sequence[str]]) -> tuple[Table, Table]:
    """Sliding of rock wedges, a row for each, and their rotation."""
    from romdam.postprocess.wedge_histories import HEAD, ROTATION_HEAD

    sliding = _table("Rock wedges", HEAD[:1], HEAD[1:])
    for row in rows:
        sliding.add_row(*row)
    turning = _table("Rotation of rock wedges", ROTATION_HEAD[:2], ROTATION_HEAD[2:])
    for row in rotations:
        turning.add_row(*row)
    return sliding, turning


def stability_table(rows: Sequence[Sequence[str]]) -> Table:
    """Static stability after earthquakes, a row for each record and joint."""
    from romdam.postprocess.stability import HEAD

    table = _table("Stability after the earthquake", HEAD[:3], HEAD[3:])
    for row in rows:
        table.add_row(*row)
    return table


def combinations_table(rows: Sequence[Sequence[str]]) -> Table:
    """Every margin of load combinations."""
    from romdam.postprocess.combinations import HEAD

    table = _table("Load combinations", HEAD[:5], HEAD[5:])
    for row in rows:
        table.add_row(*row)
    return table


def rest_forces_table(rows: Sequence[Sequence[str]]) -> list[Table]:
    """Forces and moments on the dam and its bodies at rest; none where no rows are."""
    from romdam.postprocess.stability import FORCES_HEAD

    table = _table("Forces at rest", FORCES_HEAD[:3], FORCES_HEAD[3:])
    for row in rows:
        table.add_row(*row)
    return [table] if table.row_count else []


def maxima_table(dataset: xr.Dataset) -> Table:
    """The largest values of a result."""
    from romdam.postprocess.maxima import HEAD, explained, maxima

    table, rows = _table("Maxima", (HEAD[0], HEAD[3]), (HEAD[1], HEAD[2], HEAD[4], HEAD[5])), maxima(dataset)
    for row in rows:
        value = f"{row.value:.4g}" if row.value == row.value else "-"
        table.add_row(row.quantity, row.where or "-", value, row.unit, row.when or "-", row.note)
    table.caption = "\n".join(explained(rows))
    table.caption_justify = "left"
    return table


def stress_tables(results: Mapping[str, xr.Dataset]) -> list[Table]:
    """Stress of every named face, a table for each record that has any."""
    from romdam.postprocess.maxima import face_head, face_rows

    tables = []
    for record, dataset in results.items():
        rows, head = face_rows(dataset), face_head(dataset)
        table = _table(f"Major principal stress, {record}", head[:1], head[1:])
        for row in rows:
            table.add_row(*row)
        tables += [table] if rows else []
    return tables


def comparison_tables(tables: Sequence[VariantTable]) -> list[Table]:
    """The tables of a comparison that suit a terminal; its page has all."""
    names = ("cost", "peaks", "stress", "to_reference")
    return [variant_table(table) for table in tables if table.name in names]


def variant_table(table_data: VariantTable) -> Table:
    """A table of a comparison."""
    from romdam.postprocess.variant_tables import shown_cell

    table = _table(
        f"{table_data.title}. {table_data.note}" if table_data.note else table_data.title,
        table_data.head[:1],
        table_data.head[1:],
    )
    for row in table_data.rows:
        table.add_row(*map(shown_cell, row))
    return table


def modes_table(dataset: xr.Dataset) -> Table:
    """Natural modes: frequency, period, damping, participation and effective mass of each."""
    dry = "dry_frequency" in dataset
    head = ["frequency [Hz]", *(["without water [Hz]"] if dry else []), "period [s]", "damping [%]"]
    axes = dataset.direction.values.tolist()
    head += [f"participation {axis}" for axis in axes] + [f"mass {axis} [%]" for axis in axes]
    table = _table(f"Modes, joints {dataset.attrs['joints']}", ("mode",), tuple(head))
    shares = 100.0 * dataset.effective_mass / dataset.total_mass
    for mode in dataset.mode.values:
        shape, share = dataset.sel(mode=mode), shares.sel(mode=mode).values
        freq, ratio = float(shape.frequency), float(shape.damping_ratio)
        row = [f"{freq:.4f}", *([f"{float(shape.dry_frequency):.4f}"] if dry else [])]
        row.append(f"{1.0 / freq:.4f}" if freq > 0.0 else "rigid motion")
        row.append(f"{100.0 * ratio:.2f}" if isfinite(ratio) else "-")
        row += [f"{value:.3f}" for value in shape.participation_factor.values.round(3) + 0.0]  # no -0.000
        table.add_row(str(mode), *row, *(f"{value:.2f}" for value in share))
    sums = (f"{value:.2f}" for value in shares.sum("mode").values)
    table.add_row("sum", *[""] * (len(head) - len(axes)), *sums)
    totals = (f"{float(value):.4g}" for value in dataset.total_mass.values)
    table.caption = f"total mass along {', '.join(axes)}: {', '.join(totals)} kg"
    return table


def measured_table(dataset: xr.Dataset) -> Table:
    """Measured modes beside the computed ones."""
    table = _table(
        "Measured",
        ("name",),
        ("measured [Hz]", "mode", "computed [Hz]", "difference [%]", "damping measured [%]", "computed [%]"),
    )
    for name in dataset.measured.values:
        mode = dataset.sel(measured=name)
        matched = dataset.sel(mode=int(mode.measured_mode))
        ratios = (float(mode.measured_damping_ratio), float(matched.damping_ratio))
        table.add_row(
            str(name),
            f"{float(mode.measured_frequency):.4f}",
            str(int(matched.mode)),
            f"{float(matched.frequency):.4f}",
            f"{100.0 * float(mode.frequency_difference):+.2f}",
            *(f"{100.0 * ratio:.2f}" if ratio == ratio else "-" for ratio in ratios),
        )
    return table


def check_tables(check: CheckedJob) -> list[Table]:
    """Blocks, joints, ties and records of a job that was checked."""
    blocks = _table(
        "Blocks",
        ("block", "element"),
        ("nodes", "cells", "free DOFs", "retained DOFs", "modes", "reduced, open [Hz]"),
    )
    for name, block in check.blocks.items():
        lowest = block.get("frequencies_hz", [])
        frequencies = ", ".join(f"{f:.3g}" for f in list(lowest)[:3]) if isinstance(lowest, list) else ""
        counts = (
            block.get(key, "-")
            for key in ("nodes", "cells", "free_dofs", "retained_dofs", "fixed_interface_modes")
        )
        blocks.add_row(name, str(block["element"]), *map(str, counts), frequencies)
    joints = _table("Joints", ("joint", "between"), ("gaps", "area [m²]", "friction [-]", "water [N]"))
    for name, joint in check.joints.items():
        joints.add_row(name, *(f"{v:g}" if isinstance(v, float) else str(v) for v in joint.values()))
    loads = _table("Loads at rest", ("load",), ("x [MN]", "y [MN]", "z [MN]"))
    for name, force in check.loads.items():
        loads.add_row(name, *(f"{1e-6 * value:.4g}" for value in force.values()))
    ties = _table("Ties", ("tie", "between"), ("nodes", "discretization", "faces apart [m]"))
    for name, tie in check.ties.items():
        ties.add_row(name, *(f"{v:.2g}" if isinstance(v, float) else str(v) for v in tie.values()))
    sequences = any(record["sequence"] != "-" for record in check.records.values())
    head = ("dt [s]", "duration [s]", "peak [m/s²]", "steps", *(["sequence"] if sequences else []))
    records = _table("Records", ("record",), head)
    for name, record in check.records.items():
        cells = [
            "-" if v is None else f"{v:.4g}" if isinstance(v, float) else str(v) for v in record.values()
        ]
        records.add_row(name, *cells[: len(head)])
    return [blocks, joints, *([loads] if check.loads else []), *([ties] if check.ties else []), records]


def suite_table(summary: xr.Dataset) -> Table:
    """Peaks of a suite: a row for each joint and scale, over all records and samples."""
    import numpy as np

    from romdam.postprocess.responses import each_once, repeated_text
    from romdam.postprocess.weights import effective_number, weighted_quantiles, weights_of

    what, unit = _scale_head(summary)
    table = _table("Suite", ("joint", what), ("runs", "median [mm]", "84 % [mm]", "largest [mm]", "failed"))
    weights = weights_of(summary)
    by_weights = (
        "" if weights is None else f"by weights of records, which count as {effective_number(weights):.3g}"
    )
    if caption := "; ".join(filter(None, (repeated_text(summary), by_weights))):
        table.caption = caption
        table.caption_justify = "left"
    summary = each_once(summary)
    weights = weights_of(summary)
    failed = (summary.status > 0).sum(("record", "sample"))
    for joint in summary.joint.values if "peak_opening" in summary else ():
        for k, scale in enumerate(summary.scale.values):
            peaks = 1e3 * summary.peak_opening.sel(joint=joint).isel(scale=k)
            values = peaks.transpose("record", "sample").values
            each = (
                None
                if weights is None
                else np.broadcast_to(weights[:, None], values.shape)[~np.isnan(values)]
            )
            values = values[~np.isnan(values)]
            numbers = (
                weighted_quantiles(values, (0.5, 0.84, 1.0), each) if values.size else np.full(3, np.nan)
            )
            shares = (f"{value:.2f}" for value in numbers)
            bad = int(failed.isel(scale=k))
            table.add_row(str(joint), f"{float(scale) / unit:.4g}", str(peaks.size - bad), *shares, str(bad))
    return table


def _scale_head(summary: xr.Dataset) -> tuple[str, float]:
    """Head of a column of scales, and the unit that they are shown in [SI]."""
    units = str(summary.scale.attrs.get("units", "1"))
    if units == "1":
        return "scale factor", 1.0
    return ("scaled to [g]", to_si("1 g", "m/s^2")) if units == "m s-2" else (f"scaled to [{units}]", 1.0)


def sobol_tables(summary: xr.Dataset) -> list[Table]:
    """Sobol' indices of the suite's first response; none where its samples are not made for them."""
    from romdam.postprocess.responses import responses
    from romdam.postprocess.sobol import BASE_SAMPLES, sobol_indices, sobol_rows

    names = responses(summary) if BASE_SAMPLES in summary.attrs else []
    if not names:
        return []
    indices = sobol_indices(summary, names[0])
    title = f"Shares of the variance of {names[0].replace('_', ' ')} (Sobol' indices), 95 % bounds"
    what, unit = _scale_head(summary)
    table = _table(title, (what, "parameter"), ("first order", "total", "base samples"))
    for row in sobol_rows(indices.assign_coords(scale=indices.scale / unit)):
        table.add_row(*row)
    if indices.attrs["statement"]:
        table.caption = str(indices.attrs["statement"])
        table.caption_justify = "left"
    return [table]


def hazard_tables(summary: xr.Dataset) -> list[Table]:
    """Annual frequencies of the levels of a suite's response; none where no hazard is named."""
    from romdam.postprocess.hazard_of_response import CONFIDENCE, LEVEL, STATEMENT, WARNING, hazard_rows

    if LEVEL not in summary.coords and STATEMENT not in summary.attrs:
        return []
    table = _table("Hazard of the response", (), ())
    if LEVEL in summary.coords:
        about = summary[LEVEL].attrs
        factor, unit = (1e3, "mm") if about["units"] == "m" else (1.0, str(about["units"]))
        name = str(about["response"]).replace("_", " ")
        bounds = f"{100 * CONFIDENCE:g} % bounds, records"
        head = ("per year", bounds, "return period [years]", "outside the table [%]")
        table = _table(f"Hazard of {name}, by {about['measure']}", (f"level [{unit}]",), head)
        table.add_column("")
        for row in hazard_rows(summary, factor):
            table.add_row(*row)
        if WARNING in summary.attrs:
            table.caption = f"warning: {summary.attrs[WARNING]}"
    else:
        table.caption = str(summary.attrs[STATEMENT])
    return [table]


def certificate_table(statement: Mapping[str, Any]) -> Table:
    """Errors of a certificate in the run, and for the same joint forces; of a sample their intervals."""
    if "within" in statement:
        table = _table("Certificate, from a sample", ("quantity",), ("error L2 [%]", "at the peak [%]"))
        for name, error in statement["within"].items():
            intervals = (" to ".join(f"{100 * v:.2g}" for v in error[norm]) for norm in ("l2", "peak"))
            table.add_row(name, *intervals)
        return table
    table = _table(
        "Certificate", ("quantity",), ("error L2 [%]", "at the peak", "same forces L2 [%]", "at the peak")
    )
    same = statement["defect_for_the_same_forces"]
    for name, error in statement["error"].items():
        values = (error["l2"], error["peak"], same[name]["l2"], same[name]["peak"])
        table.add_row(name, *(f"{100 * value:.2g}" for value in values))
    return table


def cases_table(cases: Sequence[BenchmarkCase]) -> Table:
    """Cases of the benchmark set, what they are, and the sources of their numbers."""
    table = _table("Benchmarks", ("case", "model", "numbers", "sources"), ())
    for case in cases:
        sources = dict.fromkeys(f"{quantity.source} ({quantity.kind})" for quantity in case.quantities)
        table.add_row(case.name, case.what, str(len(case.quantities)), "; ".join(sources))
    return table


def benchmarks_table(rows: Sequence[BenchmarkRow]) -> Table:
    """A row for each number of the benchmark set: romdam's, that of others, and its source."""
    table = _table("Benchmarks", ("case", "quantity"), ("romdam", "published", "difference [%]"))
    table.add_column("")
    table.add_column("source", overflow="fold")
    for row in rows:
        unit = f" [{row.unit}]" if row.unit else ""
        table.add_row(
            row.case,
            f"{row.quantity}{unit}",
            f"{row.ours:.5g}",
            f"{row.published:.5g}",
            "0" if abs(row.difference) < _ROUND_OFF else f"{100.0 * row.difference:+.2g}",
            "" if row.verdict == "within" else row.verdict,
            f"{row.source} ({row.kind})",
        )
    return table


def _table(title: str, left: tuple[str, ...], right: tuple[str, ...]) -> Table:
    table = _Plain(title=one_line(title), title_justify="left")
    for name in left:
        table.add_column(one_line(name), overflow="fold")
    for name in right:
        table.add_column(one_line(name), justify="right")
    return table


class _Plain(Table):
    """A table whose cells are plain text, whatever names and files hold."""

    def add_row(self, *cells: RenderableType | None, **options: Any) -> None:
        """Add a row."""
        super().add_row(*(one_line(cell) if isinstance(cell, str) else cell for cell in cells), **options)
