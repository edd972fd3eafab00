"""Lines on stdout."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from romdam.core.machine import shown_size
from romdam.core.printable import one_line
from romdam.postprocess.checks import MISSED, verdict
from romdam.postprocess.run_warnings import COUNTED, LEDGER_LIMIT
from romdam.postprocess.stated_errors import percent

if TYPE_CHECKING:
    import xarray as xr

    from romdam.pipelines.check import CheckedJob
    from romdam.pipelines.suites.folder import Cleaned
    from romdam.pipelines.suites.run import SuiteOutcome
    from romdam.reduction.storage.user_cache import Entry


def check_lines(check: CheckedJob) -> list[str]:
    """Frequencies and cost of a job that was checked, its warnings, and what is left to a run."""
    # three digits: a reduced model's frequencies lie above those of its mesh
    closed = ", ".join(f"{freq:.3g}" for freq in check.closed_frequencies)
    time_text = "time unknown"
    if check.costs:
        each = ", ".join(f"{name} {seconds:.2g}" for name, seconds in check.costs.items() if seconds > 0.0)
        time_text = f"about {check.seconds:.2g} s of CPU for `romdam run` ({each})"
    return [
        *(
            [f"reduced model, joints closed: {closed} Hz, undamped; `romdam modes` has the mesh's"]
            if closed
            else []
        ),
        *check.bodies,
        *check.solvers,
        *_support_lines(check),
        f"{check.unknowns} unknowns of the mesh, not reduced"
        if check.quick
        else f"{check.unknowns} unknowns; {time_text}, "
        f"{check.memory / 1e6:.0f} MB of memory, up to {check.file_size / 1e6:.0f} MB of results",
        *(f"warning: {text}" for text in check.warnings),
        *(f"not checked: {text}" for text in check.skipped),
    ]


def _support_lines(check: CheckedJob) -> list[str]:
    """Motions that supports have besides the base's: where, how late, how strong."""
    lines = []
    for name, motion in check.supports.items():
        where = "" if motion["station"] is None else f" at {motion['station']:.6g} m"
        how = f"record {motion['record']}"
        if motion["record"] is None:
            how = f"{motion['delay']:.4g} s later, factor {motion['factor']}"
        lines.append(f"{name}{where}: {how}")
    most = 12  # a wave may have 40 stations
    return lines if len(lines) <= most else [*lines[: most - 2], f"... {len(lines)} in all", lines[-1]]


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


def clean_lines(cleaned: Cleaned, removed: bool) -> list[str]:
    """List what of a suite's folder is of no run of its design."""
    does = "removed" if removed else "would be removed"
    lines = [f"{does}: {path}" for path in cleaned.files]
    lines += [f"left, romdam did not write it so: {path}" for path in cleaned.kept]
    lines.append(f"{does}: {len(cleaned.files)} files, {cleaned.size / 1e6:.1f} MB, and {cleaned.rows} rows")
    return lines if removed or not (cleaned.files or cleaned.rows) else [*lines, "--remove removes them"]


def cache_lines(kept: list[Entry], folder: Path, limit: float | None) -> list[str]:
    """List reduced blocks that are kept, up to a limit in bytes, or sum up those that were removed."""
    size = shown_size(sum(entry.size for entry in kept))
    if limit is None:
        return [f"removed: {len(kept)} reduced blocks, {size}, from {folder}"]
    lines = []
    for entry in kept:
        used = time.strftime("%Y-%m-%d %H:%M", time.localtime(entry.used))
        lines.append(f"{used}  {shown_size(entry.size):>7}  {entry.path}")
    return [*lines, f"{len(kept)} reduced blocks, {size} of at most {shown_size(limit)}, in {folder}"]


def suite_warning_lines(summary: xr.Dataset, wanted: float | None) -> list[str]:
    """Count the runs of a suite that have an open energy ledger, missed the wanted accuracy, or warn else."""
    limits = {
        "ledger_imbalance": (LEDGER_LIMIT, "do not close their energy ledger within"),
        "estimated_time_error": (wanted, "did not reach, at the finest step allowed,"),
    }
    lines = []
    for name, (limit, text) in limits.items():
        values = summary[name].values.ravel().tolist() if name in summary else []
        beyond = [verdict(value, limit) for value in values].count(MISSED)
        if beyond and limit is not None:
            worst = f"{name} says which, {percent(float(summary[name].max()))} at most"
            lines.append(f"{beyond} of {summary[name].size} runs {text} {100 * limit:g} %; {worst}")
    for warned in json.loads(str(summary.attrs.get("run_warnings", "[]"))):
        if not warned["warning"].startswith(COUNTED):  # which the lines above count
            runs = f"{warned['runs']} of {summary.status.size} runs, {warned['record']} first"
            lines.append(one_line(f"{runs}: {warned['warning']}"))
    return lines


_SHOWN = 5  # names of failed runs with one message
_MUCH = 0.01  # of the energy put in: what time stepping took is told above it


_DONE = {"estimate": "estimated", "certificate": "certified"}


def _error_lines(attrs: Mapping[str, object]) -> list[str]:
    """State what was measured against the mesh, then what was estimated or certified."""
    from romdam.error.statement import opening_errors, sentences
    from romdam.postprocess.stated_errors import total_text

    stated = dict(sentences(attrs))
    measured, mesh = stated.pop("verification", ""), stated.pop("discretisation", "")
    if not measured and attrs["model_order"] == "full":
        measured = "none of a reduction, this is the mesh itself"
    if not measured:
        below = f", {' and '.join(_DONE[kind] for kind in stated)} below" if stated else ""
        measured = f"not measured against the mesh{below}; `romdam verify CONFIG --out DIR` measures it"
    lines = [f"error          {measured}", *(f"{kind:<15}{sentence}" for kind, sentence in stated.items())]
    if left_out := str(attrs.get("error_not_included", "")):
        lines.append(f"not included   {left_out}")
    if not mesh:
        mesh = "its error, often the largest, is not known; `romdam verify CONFIG --mesh finer` states it"
        return [*lines, f"mesh           {mesh}"]
    parts = opening_errors(attrs)  # in L2, of mesh, modes and steps, as far as they are known
    each = ", ".join(f"{name} {percent(value)}" for name, value in parts.items())
    peaks = total_text(opening_errors(attrs, "peak"))
    total = f"of the openings in L2 at most {total_text(parts)}: {each}; of their peaks at most {peaks}"
    lines += [f"mesh           {mesh}", f"total          {total}"]
    tried = [
        f"{entry['mesh']} {percent(entry['opening_error'])} ({entry['unknowns']} unknowns, "
        f"{entry['gaps']} gaps, {entry['cpu_seconds']:.2g} s of CPU){', chosen' if entry['chosen'] else ''}"
        for entry in json.loads(str(attrs.get("discretisation", "{}"))).get("meshes", [])
    ]
    return [*lines, f"meshes tried   {'; '.join(tried)}"] if tried else lines


def _time_error(attrs: Mapping[str, object]) -> str:
    """State what is known of the time-stepping error."""
    if "solver_estimated_time_error" not in attrs:
        return "error not estimated; transient.accuracy instead of transient.finest_step does"
    estimate = float(str(attrs["solver_estimated_time_error"]))
    others = "".join(_other_error(attrs, name) for name in ("peaks", "slips", "residual_slips"))
    if "solver_accuracy" not in attrs:
        return f"error about {percent(estimate)} of the openings in L2{others}, by a quarter of the step"
    wanted = float(str(attrs["solver_accuracy"]))
    missed = ", NOT reached at the finest step allowed" * (verdict(estimate, wanted) == MISSED)
    reached = f"error about {percent(estimate)} (wanted {100 * wanted:g} %{missed})"
    return f"{reached}{others}, by refining the step"


def _other_error(attrs: Mapping[str, object], name: str) -> str:
    """State what is known of the time-stepping error of peaks, slips or residual slips."""
    key, wanted = f"solver_estimated_time_error_{name}", attrs.get(f"solver_accuracy_{name}")
    if key not in attrs:
        return ""
    asked = "" if wanted is None else f" (wanted {100 * float(str(wanted)):g} %)"
    return f", {percent(float(str(attrs[key])))} of the {name.replace('_', ' ')}{asked}"


def _of_the_run(dataset: xr.Dataset) -> str:
    """State what `romdam check` leaves to the run: convergence, the ledger, what time stepping took."""
    attrs = dataset.attrs
    residual, ledger = (attrs.get(f"solver_{name}") for name in ("largest_residual", "ledger_imbalance"))
    lines = []
    if residual is not None:
        lines.append(f"every step converged, residual at most {float(str(residual)):.2g}")
    if ledger is not None:
        lines.append(f"energy ledger closed within {float(str(ledger)):.2g} of the energy")
    if "energy_contact" in dataset and "energy_input" in dataset:
        put_in, taken = (float(dataset[f"energy_{name}"][-1]) for name in ("input", "contact"))
        if "energy_numerical" in dataset:  # only their sum is never negative
            taken += float(dataset.energy_numerical[-1])
        if put_in > 0.0 and taken > _MUCH * put_in:
            lines.append(f"time stepping took {percent(taken / put_in)} of the energy put in")
    return "; ".join(lines) or "not stated by the version that wrote it"


def info_lines(dataset: xr.Dataset) -> list[str]:
    """Describe a result: its kind, its making, and its known error."""
    from romdam.postprocess.record_measures import peak_text, sequence_of, stated_warnings

    attrs, sequence = dataset.attrs, sequence_of(dataset.attrs)
    size = ", ".join(f"{n} {name}" for name, n in dataset.sizes.items())
    cpu = float(attrs.get("solver_loop_cpu_seconds", float("nan")))
    lines = [
        str(attrs["title"]),
        f"record         {attrs['record']}, dt {attrs['record_dt']:g} s, peak {peak_text(attrs)}",
        *([f"sequence       {sequence}"] if sequence else []),
        f"configuration  {attrs['configuration_file']}, SHA-256 {str(attrs['configuration_sha256'])[:12]}",
        f"model          {attrs['model_order']} order, finest step {attrs['solver_finest_step']:g} s, "
        f"basis {attrs.get('model_file', 'none')}",
        f"size           {size}",
        f"solved         {attrs.get('integrator')}: {attrs.get('solver_steps', 0):.0f} steps, "
        f"{cpu:.3g} s CPU in the time loop",
        f"time stepping  {_time_error(attrs)}",
        f"not in `check` {_of_the_run(dataset)}",
        f"written        {attrs['date_created']} by {attrs['source']}",
        *_error_lines(attrs),
        *([f"stress         {attrs['stress_statement']}"] if "stress_statement" in attrs else []),
        *_water_lines(dataset),
        *(f"warning        {text}" for text in stated_warnings(attrs)),
    ]
    return [one_line(line) for line in lines]  # a text of the file makes no line of its own


def _water_lines(dataset: xr.Dataset) -> list[str]:
    """Resultants of the water in joints, and what the joints carry beside it in the first row."""
    from romdam.core.round_off import without_round_off
    from romdam.postprocess.maxima import water_at_rest

    lines, resultants = list[str](), water_at_rest(dataset)
    if resultants is None:
        return []
    for joint in dataset.joint.values:
        carried = float(dataset.normal_force[0, dataset.gap_joint.values == joint].sum())
        water = resultants.sel(joint=joint).values
        x, y, z, carried = 1e-6 * without_round_off([*water, carried])
        block = str(dataset.joint_blocks.sel(joint=joint).values[1])
        crack = ""
        if "crack_at_rest" in dataset:
            of_joint = dataset.crack_at_rest.values[dataset.gap_joint.values == joint]
            crack = (
                ""
                if math.isnan(of_joint[0])
                else f"; crack at rest up to {of_joint.max():.4g} m from the heel"
            )
        lines.append(
            f"water          {joint}: ({x:.4g}, {y:.4g}, {z:.4g}) MN on {block}; "
            f"effective normal force at the start {carried:.4g} MN{crack}"
        )
    return lines


def mesh_lines(statement: Mapping[str, object]) -> list[str]:
    """The error of the mesh, quantity by quantity."""
    lines, errors, lost = [str(statement["statement"])], statement["error"], statement["not_resolved"]
    assert isinstance(errors, dict) and isinstance(lost, list)
    faces = statement.get("faces", {})
    assert isinstance(faces, dict)
    lines.append(f"{'':<19}{'L2':>9}{'peak':>9}   worst joint or face")
    for name, error in errors.items():
        of_faces = {face: quantities[name] for face, quantities in faces.items() if name in quantities}
        places = error.get("joints", {}) or of_faces
        worst = max(places, key=lambda place: float(places[place]["l2"])) if len(places) > 1 else ""
        remark = f"   {worst}, {percent(places[worst]['l2'])}" if worst else ""
        numbers = "".join(f"{percent(error[measure]):>9}" for measure in ("l2", "peak"))
        remark = "   not resolved by either mesh" if name in lost else remark
        lines.append(f"{name.replace('_', ' '):<19}{numbers}{remark}")
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
            f"{percent(numbers['principal_stress_worst_node_error'])} of that"
        )
    for name in ("reduced", "full"):
        other = statement.get(f"{name}_against_reference")
        if isinstance(other, dict):
            errors = f"peak {percent(other['peak_error'])}, L2 {percent(other['l2_error'])}"
            lines.append(f"reference      {name}: {errors} over {other['seconds']:g} s")
    return lines
