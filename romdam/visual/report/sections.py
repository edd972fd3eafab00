"""The report of several runs: one page made from their summary, with spectra and a picture if given."""

from __future__ import annotations

import json
from collections.abc import Callable

import matplotlib as mpl
import numpy as np

from romdam.core.display_units import unit_text
from romdam.core.version import SOURCE
from romdam.postprocess.checks import MISSED, verdict
from romdam.postprocess.responses import (
    RUNS,
    intensity_of,
    measures,
    parameters,
    repeated_text,
    response_of,
)
from romdam.postprocess.stated_errors import PARTS
from romdam.postprocess.weights import effective_number, weights_of
from romdam.visual import suite_plots as plots
from romdam.visual.report.parts import (
    Code,
    Fact,
    Folded,
    PageSection,
    PageTable,
    Part,
    Report,
    Text,
    Value,
    number,
    picture,
    side_by_side,
)
from romdam.visual.report.runs import runs_section, worst_section
from romdam.visual.report.statistics import (
    correlation_section,
    floors_section,
    fragility_section,
    hazard_section,
    responses_section,
    sensitivity_section,
    sobol_section,
)
from romdam.visual.report.subject import Subject, plain, values_of
from romdam.visual.style import STYLE

_SHOWN = 5  # names of runs that failed with one message
# variables of a summary that hold the errors of PARTS
_ERRORS = "estimated_mesh_error", "estimated_reduction_error", "estimated_time_error"


def suite_report(subject: Subject) -> Report:
    """The report of a suite, or of a plain job's records.

    Raises
    ------
    ResultError
        for a response or measure that the suite does not have.
    """
    if subject.topic.response:
        response_of(subject.summary, subject.topic.response)
    intensity_of(subject.summary, subject.topic.intensity)
    with mpl.rc_context(STYLE):
        sections = [section for make in SECTIONS if (section := make(subject)) is not None]

    summary, failed = subject.summary, int((subject.summary.status > 0).sum())
    size = " × ".join(
        f"{summary.sizes[dim]} {dim}{'s' * (summary.sizes[dim] > 1)}"
        for dim in RUNS
        if dim == "record" or summary.sizes[dim] > 1
    )
    created = str(summary.attrs.get("date_created", "")).replace("T", " ").replace("+00:00", " UTC")
    facts = [Fact("runs", f"{summary.status.size}"), Fact("of them failed", f"{failed}", failed > 0)]
    if subject.done and subject.response:
        values = response_of(summary, subject.response)
        factor, unit = plots.display_unit(values, str(values.attrs.get("units", "1")))
        largest = f"{number(factor * float(values.max()))} {unit}"
        facts.append(Fact(f"largest {plain(subject.response)}", largest))
    cpu = values_of(subject, "cpu_seconds")
    facts.append(Fact("CPU of all runs", f"{number(float(np.nansum(cpu)))} s" if cpu.size else "–"))
    title = str(summary.attrs.get("title", "Suite"))
    return Report(title, f"{size}; summary of {created}", facts, sections)


def scene_section(subject: Subject) -> PageSection | None:
    """Picture of the scene; of the gaps where there is no mesh to draw."""
    sketch = subject.picture or plots.gap_sketch(subject.summary)
    if sketch is None:
        return None
    caption = "The blocks with their joints." if subject.picture else "The gaps of the joints."
    return PageSection("scene", "Scene", [side_by_side(picture(sketch, caption))])


def _accuracies(subject: Subject) -> dict[str, float]:
    """Accuracies that a suite's configuration asks for, that of a number being of the openings."""
    asked = subject.configuration.get("transient", {}).get("accuracy") or {}
    every = asked.items() if isinstance(asked, dict) else [("openings", asked)]
    return {name: float(str(value)) for name, value in every if name != "of" and value is not None}


def what_was_run_section(subject: Subject) -> PageSection:
    """Size of the suite, what it varies, and with what model."""
    summary, config = subject.summary, subject.configuration
    model, transient = config.get("model", {}), config.get("transient", {})
    scale = ", ".join(f"{value:g}" for value in summary.scale.values)
    unit = unit_text(str(summary.scale.attrs.get("units", "1")))
    accuracies = ", ".join(f"{100 * value:g} % of {name}" for name, value in _accuracies(subject).items())
    step = f"accuracy {accuracies}" if accuracies else f"step {transient.get('finest_step')} s"
    modes = f"{model['modes']} a block" if model.get("modes") else f"up to {model.get('cutoff')} Hz"
    rows: list[list[Value]] = [
        ["records", str(summary.sizes["record"])],
        [str(summary.scale.attrs.get("long_name", "scale")), f"{scale} {unit}".strip()],
        ["samples", f"{summary.sizes['sample']} ({summary.attrs.get('design', '')})"],
        ["modes", modes],
        ["time stepping", step],
    ]
    if scale == "1" and summary.sizes["sample"] == 1:  # as the records are, of one dam
        del rows[1:3]
    weights = weights_of(summary)
    if weights is not None:
        each = zip(map(str, summary.record.values), weights, strict=True)
        text = ", ".join(f"{name} {number(100.0 * weight)} %" for name, weight in each)
        rows.append(["weights of the records", f"{text}; they count as {number(effective_number(weights))}"])
    varied: list[list[Value]] = []
    for name, values in parameters(summary).items():
        factor, name_of_unit = plots.display_unit(values, str(values.attrs.get("units", "1")))
        numbers = (factor * float(np.quantile(values, q, method="nearest")) for q in (0.0, 0.5, 1.0))
        varied.append([name, name_of_unit, *numbers, str(values.attrs.get("long_name", ""))])
    joints: list[list[Value]] = []
    for name in summary.joint.values if "joint" in summary.coords else ():
        chosen = summary.gap_joint.values == name
        area = float(summary.gap_area.values[chosen].sum())
        joints.append([str(name), int(chosen.sum()), area])
    return PageSection(
        "what",
        "What was run",
        [
            PageTable([], rows),
            PageTable(["parameter", "unit", "lowest", "median", "highest", "stands for"], varied, "Samples"),
            PageTable(["joint", "gaps", "area [m²]"], joints, "Joints"),
        ],
    )


def records_section(subject: Subject) -> PageSection:
    """Spectra and measures of the records; where they are cut, what was analysed beside what was recorded."""
    summary, parts = subject.population, list[Part]()
    if left_out := repeated_text(subject.summary):
        parts.append(Text(f"Statistics over records are {left_out}."))
    if subject.spectra is not None:
        caption = "Pseudo-acceleration of every record, the largest of x, y, z."
        parts.append(side_by_side(picture(plots.spectra_figure(subject.spectra), caption)))
    else:
        parts.append(
            Text("The spectra of the records are drawn where the report is given CONFIG.", soft=True)
        )
    rows: list[list[Value]] = []
    cut = "recorded_duration" in summary
    for name in measures(summary):
        values = intensity_of(summary, name)
        finite = values.values[np.isfinite(values.values)]
        if finite.size:
            about = values.attrs
            unit = unit_text(str(about.get("units", "1")))
            numbers = [float(np.quantile(finite, q)) for q in (0.0, 0.5, 1.0)]
            whole = [float(summary[f"recorded_{name}"].median())] if cut else []
            meaning = str(about.get("long_name", name)).partition(", of the ")[0]
            rows.append([name, unit, *numbers, *whole, int(finite.size), meaning])
    whole_record = ["median of the whole"] if cut else []
    head = ["measure", "unit", "lowest", "median", "highest", *whole_record, "n", "meaning"]
    if cut:
        low, high = (float(q) for q in (summary.recorded_duration.min(), summary.recorded_duration.max()))
        recorded = (
            f"{number(high)} s" if number(low) == number(high) else f"{number(low)} to {number(high)} s"
        )
        text = f"Analysed: {number(float(summary.record_duration.max()))} s of records of {recorded}"
        share = 100.0 * summary.record_arias.values / summary.recorded_arias.values
        share = share[np.isfinite(share)]
        if share.size:
            text += (
                f", with {number(float(np.median(share)))} % of their Arias intensity in the median and "
                f"{number(float(share.min()))} % at least"
            )
        parts.append(Text(f"{text}."))
    return PageSection(
        "records", "Records", [*parts, PageTable(head, rows, "Measures of the scaled records")]
    )


def speed_section(subject: Subject) -> PageSection:
    """Time that a run takes, and its estimated errors."""
    asked = _accuracies(subject).get("openings")
    rows: list[list[Value]] = []
    for name, text, factor, unit in (
        ("wall_seconds", "wall time of a run", 1.0, "s"),
        ("cpu_seconds", "CPU time of a run", 1.0, "s"),
        ("steps", "accepted steps", 1.0, ""),
        ("finest_step", "finest step", 1e3, "ms"),
        ("estimated_time_error", "estimated error of the time stepping", 100.0, "%"),
        ("estimated_reduction_error", "estimated error of leaving out modes, openings in L2", 100.0, "%"),
        ("estimated_mesh_error", "estimated error of the mesh, openings in L2", 100.0, "%"),
    ):
        values = factor * values_of(subject, name)
        if values.size:
            total = float(values.sum()) if unit == "s" else float("nan")
            rows.append([text, unit, float(np.median(values)), float(values.max()), total, int(values.size)])
    errors = {
        part: values_of(subject, name, keep=True)
        for part, name in zip(PARTS, _ERRORS, strict=True)
        if np.isfinite(values_of(subject, name, keep=True)).any()
    }
    if errors:
        together = 100.0 * np.sum(list(errors.values()), axis=0)
        together = together[np.isfinite(together)]
        unknown = [part for part in PARTS if part not in errors]
        text = "stated error of the openings, L2, at most" + (
            f", {' and '.join(unknown)} unknown" if unknown else ""
        )
        if together.size:
            rows.append(
                [text, "%", float(np.median(together)), float(together.max()), float("nan"), together.size]
            )
    both = [values_of(subject, name, keep=True) for name in ("energy_residual", "energy_input")]
    if all(runs.size for runs in both):
        share = 100.0 * np.abs(both[0]) / np.where(both[1] == 0.0, np.nan, np.abs(both[1]))
        share = share[np.isfinite(share)]
        if share.size:
            text = "imbalance of the energy over the input"
            rows.append(
                [text, "%", float(np.median(share)), float(share.max()), float("nan"), int(share.size)]
            )
    notes = []
    if not values_of(subject, "estimated_reduction_error").size:
        notes.append(
            "The error of leaving out modes is unknown, not estimated; `romdam verify CONFIG` measures it."
        )
    if asked:
        error = values_of(subject, "estimated_time_error")
        over = [verdict(value, asked) for value in error.tolist()].count(MISSED)
        notes.append(
            f"The time-stepping error asked for was {100 * asked:g} %; "
            f"{over} of {error.size} runs estimate more."
        )
    head = ["quantity", "unit", "median", "largest", "all runs", "n"]
    return PageSection("speed", "Speed and error", [PageTable(head, rows), *map(Text, notes)])


def failures_section(subject: Subject) -> PageSection:
    """Runs that failed, by their message."""
    summary = subject.summary
    failed = summary.status.transpose(*RUNS).values > 0
    if not failed.any():
        return PageSection("failures", "Failures", [Text(f"None of {failed.size} runs failed.")])
    messages = summary.message.transpose(*RUNS).values
    groups: dict[str, list[str]] = {}
    for at in np.argwhere(failed):
        groups.setdefault(str(messages[tuple(at)]), []).append(str(summary.record.values[at[0]]))
    rows: list[list[Value]] = []
    for message, names in sorted(groups.items(), key=lambda group: -len(group[1])):
        records = list(dict.fromkeys(names))
        more = f" and {len(records) - _SHOWN} more" if len(records) > _SHOWN else ""
        rows.append([", ".join(records[:_SHOWN]) + more, len(names), message])
    said = f"{int(failed.sum())} of {failed.size} runs failed; they are left out of every statistic."
    return PageSection("failures", "Failures", [Text(said), PageTable(["records", "runs", "message"], rows)])


def warnings_section(subject: Subject) -> PageSection | None:
    """Warnings of the runs and of the records, a row for each text."""
    parts = list[Part]()
    of_runs = json.loads(str(subject.summary.attrs.get("run_warnings", "[]")))
    if of_runs:
        warned: list[list[Value]] = [[one["runs"], one["record"], one["warning"]] for one in of_runs]
        parts.append(PageTable(["runs", "the first", "warning"], warned, "Of runs, numbers of the first"))
    said = json.loads(str(subject.summary.attrs.get("record_warnings", "{}")))
    groups: dict[str, list[str]] = {}
    for name, texts in said.items():
        for text in texts:
            groups.setdefault(str(text), []).append(str(name))
    rows: list[list[Value]] = [[", ".join(names), text] for text, names in groups.items()]
    if rows:
        parts.append(PageTable(["records", "warning"], rows, "Of records"))
    return PageSection("warnings", "Warnings", parts) if parts else None


def reproduction_section(subject: Subject) -> PageSection:
    """What makes the same runs again: digests, versions, commands and the configuration."""
    attrs = subject.summary.attrs
    versions = json.loads(str(attrs.get("versions", "{}")))
    rows: list[list[Value]] = [
        ["configuration", str(attrs.get("configuration_file", "–"))],
        ["its SHA-256", str(attrs.get("configuration_sha256", "–"))],
        ["SHA-256 of the samples", str(attrs.get("design_sha256", "–"))],
        ["summary made with", ", ".join(f"{name} {version}" for name, version in versions.items())],
        ["page made with", SOURCE],
    ]
    commands = f"romdam run {attrs.get('configuration_file', 'CONFIG')} --out DIR"
    if subject.topic.command:
        commands += f"\n{subject.topic.command}"
    whole = json.dumps(subject.configuration, indent=1, ensure_ascii=False)
    parts: list[Part] = [PageTable([], rows), Code(commands), Folded("The configuration, in SI units", whole)]
    return PageSection("reproduce", "How to reproduce", parts)


SECTIONS: tuple[Callable[[Subject], PageSection | None], ...] = (
    scene_section,
    what_was_run_section,
    worst_section,
    runs_section,
    records_section,
    responses_section,
    floors_section,
    fragility_section,
    hazard_section,
    correlation_section,
    sobol_section,
    sensitivity_section,
    speed_section,
    warnings_section,
    failures_section,
    reproduction_section,
)
