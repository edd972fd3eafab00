"""Output that a person sees in a terminal: progress on stderr, tables on stdout."""

from __future__ import annotations

import json
import logging
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.logging import RichHandler
from rich.progress import (
    BarColumn,
    Progress,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table

from romdam.core.machine import shown_size
from romdam.postprocess.concerns import LEDGER_LIMIT

if TYPE_CHECKING:
    import xarray as xr

    from romdam.pipelines.check import Check
    from romdam.pipelines.suites.folder import Cleaned
    from romdam.pipelines.suites.run import SuiteOutcome
    from romdam.postprocess.variant_tables import Table as VariantTable
    from romdam.reduction.storage.user_cache import Entry

Terminal = tuple["Stages", Callable[..., None]]

DELAY = 2.0  # seconds before a stage shows a bar: shorter ones would only flicker
_WIDE = 10_000  # columns: a table is as wide as its numbers, a narrow terminal must not cut them


class Stages:
    """Shows each stage with a bar and the time left, once it takes longer than `DELAY`.

    Called with a stage's text, it is a context manager giving a callable for (steps done, steps in all).
    """

    def __init__(self, console: Console, quiet: bool) -> None:
        self._console = console
        self._shown = console.is_terminal and not quiet

    @contextmanager
    def __call__(self, text: str) -> Iterator[Callable[[int, int], None]]:
        if not self._shown:
            yield _ignore
            return
        columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
        bar = Progress(
            *columns, TextColumn("left"), TimeRemainingColumn(), console=self._console, transient=True
        )
        task = bar.add_task(text, total=None)
        timer = threading.Timer(DELAY, bar.start)
        timer.daemon = True
        timer.start()
        try:
            yield lambda done, total: bar.update(task, completed=done, total=total)
        finally:
            timer.cancel()
            timer.join()
            bar.stop()


def open_terminal(quiet: bool = False, verbose: bool = False) -> Terminal:
    """Progress and log on stderr, and a printer to stdout that `quiet` silences."""
    errors = Console(stderr=True)
    output = Console(soft_wrap=True, highlight=False, emoji=False, width=_WIDE)
    level = logging.INFO if verbose else logging.ERROR if quiet else logging.WARNING
    handler = RichHandler(console=errors, show_path=False)
    # what happens to its workers is in messages of romdam's own
    handler.addFilter(lambda record: not record.name.startswith(("asyncio", "distributed")))
    logging.basicConfig(level=level, format="%(message)s", handlers=[handler])

    def say(*lines: object) -> None:
        for line in lines if not quiet else ():
            output.print(line, markup=False)

    return Stages(errors, quiet), say


def _ignore(done: int, total: int) -> None:
    """Show nothing."""


def peaks_table(results: Mapping[str, xr.Dataset]) -> Table:
    """Peaks of every joint, a row for each record and joint."""
    table = Table(title="Peaks", title_justify="left")
    for name in ("record", "joint"):
        table.add_column(name, overflow="fold")
    for name in ("opening [mm]", "at [s]", "compression [MPa]", "slip [mm]"):
        table.add_column(name, justify="right")
    for record, dataset in results.items():
        for joint in dataset.joint.values if "joint" in dataset else ():
            row = dataset.sel(joint=joint)
            slip = f"{1e3 * float(row.peak_slip):.2f}" if "peak_slip" in row else "-"
            table.add_row(
                record,
                str(joint),
                f"{1e3 * float(row.peak_opening):.2f}",
                f"{float(row.peak_opening_time):.2f}",
                f"{1e-6 * float(row.peak_compressive_stress):.2f}",
                slip,
            )
    return table


def sliding_tables(results: Mapping[str, xr.Dataset]) -> list[Table]:
    """Sliding of every block on the one below it, a row for each record and joint; none without shear."""
    from romdam.postprocess.sliding import HEAD, sliding_rows

    table = _table("Sliding", ("record", *HEAD[:4]), HEAD[4:])
    for record, dataset in results.items():
        for row in sliding_rows(dataset):
            table.add_row(record, *row)
    return [table] if table.row_count else []


def maxima_table(dataset: xr.Dataset) -> Table:
    """The largest values of a result."""
    from romdam.postprocess.maxima import HEAD, maxima

    table = _table("Maxima", (HEAD[0], HEAD[3]), (HEAD[1], HEAD[2], HEAD[4]))
    for name, value, unit, where, when in maxima(dataset):
        table.add_row(name, where, f"{value:.4g}", unit, when or "-")
    return table


def stress_tables(results: Mapping[str, xr.Dataset]) -> list[Table]:
    """Stress of every named face, a table for each record that has any."""
    from romdam.postprocess.maxima import FACE_HEAD, face_rows

    made = []
    for record, dataset in results.items():
        rows = face_rows(dataset)
        table = _table(f"Major principal stress, {record}", FACE_HEAD[:1], FACE_HEAD[1:])
        for row in rows:
            table.add_row(*row)
        made += [table] if rows else []
    return made


def comparison_tables(tables: Sequence[VariantTable]) -> list[Table]:
    """The tables of a comparison that suit a terminal; its page has all."""
    from romdam.postprocess.variant_tables import shown_cell

    made = []
    for one in (table for table in tables if table.name in ("cost", "peaks", "stress", "to_reference")):
        title = f"{one.title}. {one.note}" if one.note else one.title
        table = _table(title, one.head[:1], one.head[1:])
        for row in one.rows:
            table.add_row(*map(shown_cell, row))
        made.append(table)
    return made


def modes_table(dataset: xr.Dataset) -> Table:
    """Natural modes: frequency, period, damping, participation and effective mass of each."""
    dry = "dry_frequency" in dataset
    head = ["frequency [Hz]", *(["without water [Hz]"] if dry else []), "period [s]", "damping [%]"]
    axes = dataset.direction.values.tolist()
    head += [f"participation {axis}" for axis in axes] + [f"mass {axis} [%]" for axis in axes]
    table = _table(f"Modes, joints {dataset.attrs['joints']}", ("mode",), tuple(head))
    shares = 100.0 * dataset.effective_mass / dataset.total_mass
    for mode in dataset.mode.values:
        one, share = dataset.sel(mode=mode), shares.sel(mode=mode).values
        freq, ratio = float(one.frequency), float(one.damping_ratio)
        row = [f"{freq:.4f}", *([f"{float(one.dry_frequency):.4f}"] if dry else [])]
        row += [f"{1.0 / freq:.4f}", f"{100.0 * ratio:.2f}"] if freq > 0.0 else ["rigid motion", "-"]
        row += [f"{value:.3f}" for value in one.participation_factor.values.round(3) + 0.0]  # no -0.000
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
        one = dataset.sel(measured=name)
        own = dataset.sel(mode=int(one.measured_mode))
        ratios = (float(one.measured_damping_ratio), float(own.damping_ratio))
        table.add_row(
            str(name),
            f"{float(one.measured_frequency):.4f}",
            str(int(own.mode)),
            f"{float(own.frequency):.4f}",
            f"{100.0 * float(one.frequency_difference):+.2f}",
            *(f"{100.0 * ratio:.2f}" if ratio == ratio else "-" for ratio in ratios),
        )
    return table


def check_tables(found: Check) -> list[Table]:
    """Blocks, joints and records of a job that was checked."""
    blocks = _table(
        "Blocks",
        ("block", "element"),
        ("nodes", "cells", "free DOFs", "retained", "modes", "Hz (open joints)"),
    )
    for name, block in found.blocks.items():
        lowest = block.get("frequencies_hz", [])
        shown = ", ".join(f"{f:.4g}" for f in list(lowest)[:3]) if isinstance(lowest, list) else ""
        counts = (
            block.get(key, "-")
            for key in ("nodes", "cells", "free_dofs", "retained_dofs", "fixed_interface_modes")
        )
        blocks.add_row(name, str(block["element"]), *map(str, counts), shown)
    joints = _table("Joints", ("joint", "between"), ("gaps", "area [m²]", "friction", "water [N]"))
    for name, joint in found.joints.items():
        joints.add_row(name, *(f"{v:g}" if isinstance(v, float) else str(v) for v in joint.values()))
    records = _table("Records", ("record",), ("dt [s]", "duration [s]", "peak [m/s²]", "steps"))
    for name, record in found.records.items():
        records.add_row(name, *(f"{v:.4g}" if isinstance(v, float) else str(v) for v in record.values()))
    return [blocks, joints, records]


def estimate_line(found: Check) -> str:
    """Unknowns, time, memory and disk of a job that was checked."""
    return (
        f"{found.unknowns} unknowns; about {found.seconds:.2g} s of integration, "
        f"{found.memory / 1e6:.0f} MB of memory, up to {found.file_size / 1e6:.0f} MB of results"
    )


def suite_table(summary: xr.Dataset) -> Table:
    """Peaks of a suite: a row for each joint and scale, over all records and samples."""
    table = _table(
        "Suite", ("joint", "scale"), ("runs", "median [mm]", "84 % [mm]", "largest [mm]", "failed")
    )
    failed = (summary.status > 0).sum(("record", "sample"))
    for joint in summary.joint.values if "peak_opening" in summary else ():
        for k, scale in enumerate(summary.scale.values):
            peaks = 1e3 * summary.peak_opening.sel(joint=joint).isel(scale=k)
            shares = (f"{float(peaks.quantile(share)):.2f}" for share in (0.5, 0.84, 1.0))
            bad = int(failed.isel(scale=k))
            table.add_row(str(joint), f"{scale:g}", str(peaks.size - bad), *shares, str(bad))
    return table


def failure_lines(outcome: SuiteOutcome) -> list[str]:
    """List what failed, grouped by message, and its share of the whole."""
    groups: dict[str, list[str]] = {}
    for name, message in outcome.failures.items():
        groups.setdefault(message, []).append(name)
    lines = []
    for message, names in groups.items():
        more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
        lines.append(f"{', '.join(names[:_SHOWN])}{more}: {message}")
    failed = int((outcome.summary.status > 0).sum())
    return [*lines, f"{failed} of {outcome.runs} runs failed"] if lines else []


def clean_lines(found: Cleaned, removed: bool) -> list[str]:
    """List what of a suite's folder is of no run of its design."""
    does = "removed" if removed else "would be removed"
    lines = [f"{does}: {path}" for path in found.files]
    lines += [f"left, romdam did not write it so: {path}" for path in found.kept]
    lines.append(f"{does}: {len(found.files)} files, {found.size / 1e6:.1f} MB, and {found.rows} rows")
    return lines if removed or not (found.files or found.rows) else [*lines, "--remove removes them"]


def cache_lines(found: list[Entry], folder: Path, limit: float | None) -> list[str]:
    """List reduced blocks that are kept, up to a limit in bytes, or sum up those that were removed."""
    size = shown_size(sum(entry.size for entry in found))
    if limit is None:
        return [f"removed: {len(found)} reduced blocks, {size}, from {folder}"]
    lines = [f"{_date(entry.used)}  {shown_size(entry.size):>7}  {entry.path}" for entry in found]
    return [*lines, f"{len(found)} reduced blocks, {size} of at most {shown_size(limit)}, in {folder}"]


def _date(seconds: float) -> str:
    return time.strftime("%Y-%m-%d %H:%M", time.localtime(seconds))


def concern_lines(summary: xr.Dataset, wanted: float | None) -> list[str]:
    """Count the runs of a suite that have an open energy ledger, or missed the wanted accuracy in time."""
    limits = {
        "ledger_imbalance": (LEDGER_LIMIT, "do not close their energy ledger within"),
        "estimated_time_error": (wanted, "did not reach, at the finest step allowed,"),
    }
    lines = []
    for name, (limit, text) in limits.items():
        beyond = int((summary[name] > limit).sum()) if name in summary and limit is not None else 0
        if beyond and limit is not None:
            worst = f"{name} says which, {100 * float(summary[name].max()):.2g} % at most"
            lines.append(f"{beyond} of {summary[name].size} runs {text} {100 * limit:g} %; {worst}")
    return lines


_SHOWN = 5  # names of failed runs with one message
_NOT_STATED = "not stated; `romdam verify CONFIG --out DIR` measures it"


def _time_error(attrs: Mapping[str, object]) -> str:
    """State what is known of the time-stepping error."""
    if "solver_estimated_time_error" not in attrs:
        return "error not estimated; transient.accuracy instead of dt does"
    estimate, wanted = (float(str(attrs[f"solver_{k}"])) for k in ("estimated_time_error", "accuracy"))
    verdict = "" if estimate <= wanted else ", NOT reached at the finest step allowed"
    return f"error about {100 * estimate:.2g} % (wanted {100 * wanted:g} %{verdict}), by refining the step"


def info_lines(dataset: xr.Dataset) -> list[str]:
    """Describe a result: its kind, its making, and its known error."""
    from romdam.error.statement import sentences

    attrs = dataset.attrs
    size = ", ".join(f"{n} {name}" for name, n in dataset.sizes.items())
    cpu, stated = float(attrs.get("solver_loop_cpu_seconds", float("nan"))), sentences(attrs)
    return [
        str(attrs["title"]),
        f"record         {attrs['record']}, dt {attrs['record_dt']:g} s, "
        f"peak {attrs['record_peak_acceleration']:.3g} m/s²",
        f"configuration  {attrs['configuration_file']}, SHA-256 {str(attrs['configuration_sha256'])[:12]}",
        f"model          {attrs['model_order']} order, finest step {attrs['solver_finest_step']:g} s, "
        f"basis {attrs.get('model_file', 'none')}",
        f"size           {size}",
        f"solved         {attrs.get('integrator')}: {attrs.get('solver_steps', 0):.0f} steps, "
        f"{cpu:.3g} s CPU in the time loop",
        f"time stepping  {_time_error(attrs)}",
        f"written        {attrs['date_created']} by {attrs['source']}",
        f"error          {stated.pop('verification', _NOT_STATED)}",
        *([f"stress         {attrs['stress_statement']}"] if "stress_statement" in attrs else []),
        *stated.values(),
        *_water_lines(dataset),
        *(f"warning        {text}" for text in json.loads(str(attrs.get("run_warnings", "[]")))),
    ]


def _water_lines(dataset: xr.Dataset) -> list[str]:
    """Resultants of the water in joints, and what the joints carry beside it in the first row."""
    lines = []
    for joint in dataset.joint.values if "water_force" in dataset else ():
        x, y, z = 1e-6 * dataset.water_force.sel(joint=joint).values
        carried = 1e-6 * float(dataset.normal_force[0, dataset.gap_joint.values == joint].sum())
        block = str(dataset.joint_blocks.sel(joint=joint).values[1])
        lines.append(
            f"water          {joint}: ({x:.4g}, {y:.4g}, {z:.4g}) MN on {block}; "
            f"effective normal force at the start {carried:.4g} MN"
        )
    return lines


def verification_lines(statement: Mapping[str, object]) -> list[str]:
    """The outcome of a verification."""
    numbers = {k: v for k, v in statement.items() if isinstance(v, float)}
    lines = [
        str(statement["statement"]),
        f"peak opening   reduced {1e3 * numbers['peak']:.3f} mm, "
        f"full order {1e3 * numbers['peak_reference']:.3f} mm",
        f"CPU, time loop reduced {numbers['cpu_seconds']:.3g} s, "
        f"full order {numbers['cpu_seconds_full']:.3g} s: "
        f"{numbers['cpu_ratio']:.0f} times ({numbers['cpu_ratio_per_step']:.0f} times per step)",
        f"CPU, reduction {numbers['cpu_seconds_reduction']:.3g} s, once for all records",
    ]
    joints = statement.get("joints")
    if isinstance(joints, dict) and len(joints) > 1:
        worst = max(joints, key=lambda name: float(joints[name]["peak_error"]))
        within = 100 * joints[worst]["peak_error"]
        lines.append(f"every joint    peak opening within {within:.2g} % (worst: {worst})")
    if "peak_principal_stress" in numbers:
        lines.append(
            f"peak stress    reduced {1e-6 * numbers['peak_principal_stress']:.3f} MPa, full order "
            f"{1e-6 * numbers['peak_principal_stress_full']:.3f} MPa; every node's envelope within "
            f"{100 * numbers['principal_stress_worst_node_error']:.2g} % of that"
        )
    for name in ("reduced", "full"):
        other = statement.get(f"{name}_against_reference")
        if isinstance(other, dict):
            errors = f"peak {100 * other['peak_error']:.2g} %, L2 {100 * other['l2_error']:.2g} %"
            lines.append(f"reference      {name}: {errors} over {other['seconds']:g} s")
    return lines


def certificate_table(statement: Mapping[str, Any]) -> Table:
    """Errors of a certificate: in the nonlinear run, and for the same joint forces."""
    table = _table(
        "Certificate", ("quantity",), ("error L2 [%]", "at the peak", "same forces L2 [%]", "at the peak")
    )
    same = statement["defect_for_the_same_forces"]
    for name, error in statement["error"].items():
        values = (error["l2"], error["peak"], same[name]["l2"], same[name]["peak"])
        table.add_row(name, *(f"{100 * value:.2g}" for value in values))
    return table


def _table(title: str, left: tuple[str, ...], right: tuple[str, ...]) -> Table:
    table = Table(title=title, title_justify="left")
    for name in left:
        table.add_column(name, overflow="fold")
    for name in right:
        table.add_column(name, justify="right")
    return table
