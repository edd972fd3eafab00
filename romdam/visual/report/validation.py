"""The validation report of one run: what its model is, how well it is solved, and what it was held against.

The headings are those of Reclamation's framework (Salamon, Hariri-Ardebili, Frontiers in Built Environment 10
(2024) 1452415): conceptual model, computational model, verification of code and solution, validation against
measurements, uncertainty. What nobody has computed yet stands there with the command that would.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np
import xarray as xr

from romdam.core.benchmark_row import WRONG, BenchmarkRow
from romdam.core.round_off import without_round_off
from romdam.postprocess.checks import MISSED, run_checks
from romdam.postprocess.record_measures import stated_warnings
from romdam.postprocess.stated_errors import PARTS, total_error, total_text
from romdam.results.companions import Companions
from romdam.visual.report.one_run import (
    RunSubject,
    dam_section,
    keys_table,
    limits_section,
    loads_section,
    motion_section,
    reproduction_section,
)
from romdam.visual.report.parts import (
    Code,
    Fact,
    PageCell,
    PageSection,
    PageTable,
    Part,
    Report,
    Text,
    Value,
    number,
)
from romdam.visual.report.statistics import responses_section
from romdam.visual.report.subject import Subject, Topic

SOURCE = "Salamon, Hariri-Ardebili, Frontiers in Built Environment 10 (2024) 1452415"
_STATEMENTS = {
    "discretisation": "mesh and contact points",
    **{
        part: f"of these, {part}" for part in ("elements", "contact points", "up", "through", "along", "rock")
    },
    "verification": "modes, against the full mesh",
    "certificate": "modes, certificate",
    "estimate": "modes, estimate",
}
_ENERGY = (  # of the end of the run: term, name
    ("input", "supplied by the ground and by forces"),
    ("kinetic", "kinetic"),
    ("strain", "strain"),
    ("joint_stored", "stored in joints"),
    ("damping", "dissipated by damping"),
    ("friction", "dissipated by friction"),
    ("contact", "lost at contact"),
    ("numerical", "taken by the integrator"),
    ("residual", "not accounted for"),
)
How = Literal["stated", "not included", "not stated", "said", "bounded"]
_LINEAR = (
    "Statements of error are of joints, and this job has none. Compare natural frequencies (romdam modes) "
    "and results (romdam compare) with those of a finer mesh, of more modes and of half the step."
)
_SIGNS = 4  # digits of a number of the benchmark set
_ROUND_OFF = 5e-6  # relative difference that is shown as none


@dataclass(frozen=True)
class AppliedApproximation:
    """An approximation that the run has.

    Attributes
    ----------
    name, changes : what differs from the exact solution, and what that changes
    how : the result accounts for it
    evidence : statements that include it, tests that bound it, or words of the result
    error : what these statements say of the openings, in L2; NaN where none does
    """

    name: str
    changes: str
    how: How
    evidence: str
    error: float = float("nan")


@dataclass(frozen=True)
class ValidationSubject:
    """A run, and what its validation report states of it.

    Attributes
    ----------
    run : the run, and how numbers are shown
    commands : "mesh", "modes", "steps", "full mesh", "study", "measured", "recorded" -> command that states
        it; what no command states for this job is left out
    errors : statement, or a part of the mesh's -> quantity -> relative error in L2 and of the peak
    approximations : that the run has
    exact : number of what approximates nothing
    benchmarks : rows that came with the package
    companions : files beside the result
    """

    run: RunSubject
    commands: Mapping[str, str]
    errors: Mapping[str, Mapping[str, tuple[float, float]]]
    approximations: Sequence[AppliedApproximation]
    exact: int
    benchmarks: Sequence[BenchmarkRow]
    companions: Companions = field(default_factory=Companions)


def validation_report(subject: ValidationSubject) -> Report:
    """The validation report of one run."""
    run, attrs = subject.run, subject.run.dataset.attrs
    created = str(attrs["date_created"]).replace("T", " ").replace("+00:00", " UTC")
    about = f"Record {attrs['record']}; run of {created}, {attrs['source']}; {run.system.name} units"
    sections = [section for make in SECTIONS if (section := make(subject)).shown]
    return Report(f"Validation: {attrs['title']}", about, _facts(subject), sections)


def _facts(subject: ValidationSubject) -> list[Fact]:
    run, attrs = subject.run, subject.run.dataset.attrs
    checks = run_checks(attrs, run.errors, run.config.transient.tolerance)
    missed = sum(check.verdict == MISSED for check in checks)
    ledger = float(str(attrs.get("solver_ledger_imbalance", "nan")))
    wrong = sum(row.verdict in WRONG for row in subject.benchmarks)
    known = sum(row.verdict == "known difference" for row in subject.benchmarks)
    measured = sum(len(modes.measured) for modes in subject.companions.modes.values())
    warnings = len(stated_warnings(attrs))
    count = len(subject.benchmarks)
    return [
        Fact("stated error of the openings, L2, at most", total_text(run.errors)),
        Fact("energy not accounted for, of the exchanged", f"{number(100.0 * ledger, 2)} %"),
        Fact("checks that are missed", f"{missed} of {len(checks)}", missed > 0),
        Fact(f"benchmarks within their bands, {known} with a known difference", f"{count - wrong} of {count}",
             wrong > 0),
        Fact("measured frequencies of this dam", str(measured)),
        Fact("warnings", str(warnings), warnings > 0),
    ]  # fmt: skip


def conceptual_section(subject: ValidationSubject) -> PageSection:
    """What is represented, with which properties, loads and motion, and what is left out."""
    run = subject.run
    parts: list[Part] = [
        Text(
            "The dam, its rock and its water as the job states them. Whether they represent the real dam is "
            "for the engineer to say: no number below tells."
        )
    ]
    for section in (dam_section(run), loads_section(run), motion_section(run)):
        parts += section.shown
    return PageSection("conceptual", "1 Conceptual model", parts)


def computational_section(subject: ValidationSubject) -> PageSection:
    """Mesh, contact points, modes and steps: what the conceptual model became."""
    run, dataset, attrs = subject.run, subject.run.dataset, subject.run.dataset.attrs
    blocks = run.config.blocks
    elements: set[str] = {block.box.element for block in blocks.values() if block.box is not None}
    elements |= {dam.element for dam in (run.config.arch_dam, run.config.gravity_dam) if dam is not None}
    if any(block.mesh is not None for block in blocks.values()):
        elements.add("those of mesh files")
    finest = 1e3 * float(attrs["solver_finest_step"])
    rows: list[list[Value]] = [
        ["mechanics", "linear elasticity of small strains and rotations; joints alone are nonlinear"],
        ["elements", ", ".join(sorted(elements)) or "matrices of other programs"],
        ["model", f"{attrs['model_order']} order, {attrs.get('unknowns', '–')} unknowns"],
        ["joints", str(dataset.sizes.get("joint", 0))],
        ["contact points", str(dataset.sizes.get("gap", 0))],
        ["integrator", f"{attrs['integrator']}, finest step {number(finest)} ms"],
        ["steps taken", number(float(str(attrs.get("solver_steps", "nan"))), 6)],
    ]
    keys = keys_table(run, "Model, time stepping and outputs", "model", "transient", "outputs")
    return PageSection("computational", "2 Computational model", [PageTable([], rows), keys])


def code_section(subject: ValidationSubject) -> PageSection:
    """Benchmarks with exact, printed and other codes' answers: does the code solve its equations?"""
    cells = list[list[Value]]()
    of_cases = {case: rows for case, rows in _cases(subject).items() if not any(r.measured for r in rows)}
    for case, rows in of_cases.items():
        worst = max(rows, key=lambda row: -1.0 if np.isnan(row.difference) else abs(row.difference))
        verdicts = dict.fromkeys(row.verdict for row in rows)
        cells.append([
            case, PageCell(rows[0].what, "text"), len(rows), _percent(worst.difference), ", ".join(verdicts),
        ])  # fmt: skip
    head = ["case", "model", "numbers", "largest difference [%]", "verdict"]
    rows = [row for rows in of_cases.values() for row in rows]
    table = PageTable(head, cells, "Cases with known answers")
    return PageSection("code", "3 Verification of the code", [table, *_notes(rows), *_benchmark_command()])


def solution_section(subject: ValidationSubject) -> PageSection:
    """How far this run is from the exact solution of its mechanics, part by part."""
    run, attrs = subject.run, subject.run.dataset.attrs
    parts: list[Part] = [_errors_table(subject)]
    lacking = [part for part in PARTS if part not in run.errors]
    if lacking:
        known = [subject.commands[part] for part in lacking if part in subject.commands]
        text = f"Not stated: the error of the {' and of the '.join(lacking)}."
        parts += (
            [Text(f"{text} To state it:"), Code("\n".join(known))] if known else [Text(f"{text} {_LINEAR}")]
        )
    parts += [Text(sentence) for sentence in run.statements.values()]
    if "verification" not in run.statements and "full mesh" in subject.commands:
        parts.append(Text("Not compared with the full mesh. The command that does:"))
        parts.append(Code(subject.commands["full mesh"]))
    if not_included := str(attrs.get("error_not_included", "")):
        parts.append(Text(not_included))
    parts += [_checks_table(subject), _ledger_table(subject), *_balance(subject), *_study(subject)]
    return PageSection("solution", "4 Verification of the solution", [*parts, *_approximations(subject)])


def _errors_table(subject: ValidationSubject) -> PageTable:
    """Every stated error, of every quantity, with the statement that it is of; openings first."""
    rows = list[list[Value]]()
    for kind, name in _STATEMENTS.items():
        for quantity, errors in sorted(
            subject.errors.get(kind, {}).items(), key=lambda one: one[0] != "opening"
        ):
            rows.append([name, quantity.replace("_", " "), *map(_percent, errors)])
    attrs, start = subject.run.dataset.attrs, "solver_estimated_time_error"
    for quantity, *ends in (
        ("opening", "", "_peaks"),
        ("slip", "_slips"),
        ("residual slip", "_residual_slips"),
    ):
        stated = [float(str(attrs.get(f"{start}{end}", "nan"))) for end in (*ends, "_none")[:2]]
        if not np.isnan(stated[0]):
            rows.append(["steps", quantity, *map(_percent, stated)])
    total, unknown = total_error(subject.run.errors)
    if rows:
        name = "all that are stated, at most" if unknown else "all, at most"
        rows.append([name, "opening", _percent(total), PageCell("–", "n")])
    head = ["error of", "quantity", "L2 [%]", "peak [%]"]
    return PageTable(head, rows, "Stated errors, relative to what moves")


def _checks_table(subject: ValidationSubject) -> PageTable:
    run, rows = subject.run, list[list[Value]]()
    for check in run_checks(run.dataset.attrs, run.errors, run.config.transient.tolerance):
        value, limit = (
            "–" if x is None else f"{number(100 * x, 2)} %" if check.is_share else f"{x:.2g}"
            for x in (check.value, check.limit)
        )
        rows.append([check.text, "unknown" if check.value is None else value, limit, check.verdict])
    return PageTable(["check", "value", "limit", "verdict"], rows, "Checks of the run")


def _ledger_table(subject: ValidationSubject) -> PageTable:
    """Where the energy is at the end, and how much the ledger lacks."""
    run, rows = subject.run, list[list[Value]]()
    known = [(term, name) for term, name in _ENERGY if f"energy_{term}" in run.dataset]
    last = [float(run.dataset[f"energy_{term}"][-1]) for term, _ in known]
    largest = max((abs(value) for value in last), default=0.0)
    for (_, name), value in zip(known, last, strict=True):
        share = value / largest if largest else float("nan")
        rows.append([name, PageCell(run.text("J", value), "n"), _percent(share)])
    return PageTable(["energy", "at the end", "of the largest [%]"], rows, "Energy ledger")


def _balance(subject: ValidationSubject) -> Iterator[Part]:
    dataset = subject.run.dataset
    if "imbalance_at_rest" not in dataset:
        return
    worst = float(np.nanmax(without_round_off(dataset.imbalance_at_rest.values)))
    yield Text(
        f"Forces at rest are in balance to {number(worst, 2)} of what acts, for each of "
        f"{dataset.sizes['body']} bodies (table under loads)."
    )


def _study(subject: ValidationSubject) -> Iterator[Part]:
    """Cost and error of other meshes, modes and steps, where a study stands beside the result."""
    study = subject.companions.study
    if study is None:
        if "study" in subject.commands:
            yield Text("No study of meshes, modes and steps stands beside the result. The command for one:")
            yield Code(subject.commands["study"])
        return
    rows = list[list[Value]]()
    for k in range(study.sizes["case"]):
        case = study.isel(case=k)
        failed = str(case.failure.values) if "failure" in study else ""
        setting = str(case.setting.values) + (" (the job's own)" if int(case.of_job) else "")
        if failed:
            rows.append([setting, *[PageCell("–", "n")] * 3])
        else:
            errors = float(case.l2_error), float(case.peak_error)
            rows.append([setting, *map(_percent, errors), float(case.total_cpu_seconds)])
    head = ["setting", "openings, L2 [%]", "peak [%]", "CPU [s]"]
    yield PageTable(head, rows, f"Study: {study.attrs.get('compared', 'of this job')}", digits=2)


def _approximations(subject: ValidationSubject) -> Iterator[Part]:
    """What differs from the exact solution, by how the result accounts for it."""
    of_kind = {how: [row for row in subject.approximations if row.how == how] for how in get_args(How)}
    yield PageTable(
        ["approximation", "changes", "in the statement of", "openings, L2 [%]"],
        [
            [row.name, PageCell(row.changes, "text"), row.evidence,
             _percent(row.error)]
            for row in of_kind["stated"]
        ],
        "Approximations that stated errors include",
    )  # fmt: skip
    titles = {
        "not included": "Approximations that no statement includes",
        "not stated": "Approximations that nothing states",
        "said": "Approximations that this result tells of in words",
        "bounded": "Approximations that a test holds below a bound",
    }
    heads = {"bounded": "test", "said": "the result says", "not stated": "what is known"}
    for how, title in titles.items():
        rows: list[list[Value]] = [
            [row.name, PageCell(row.changes, "text"), row.evidence] for row in of_kind[how]
        ]
        if how == "not included":
            yield PageTable(["approximation", "changes"], [row[:2] for row in rows], title)
        else:
            yield PageTable(["approximation", "changes", heads[how]], rows, title)
    yield Text(
        f"{subject.exact} further parts of the method approximate nothing, which tests show. What the table "
        "lists is found by what the job has; the manual's page on errors lists all of it.",
        soft=True,
    )


def measurements_section(subject: ValidationSubject) -> PageSection:
    """Measured dams of the benchmark set, and measured frequencies of this one."""
    parts: list[Part] = [
        Text("Do models like this one answer as dams do? Measured dams, modelled in romdam:"),
        *_measured_dams(subject),
    ]
    if not subject.companions.modes:
        parts.append(Text("No measured frequencies of this dam stand beside the result. To compare them:"))
        parts.append(Code(subject.commands["measured"]))
    for name, modes in subject.companions.modes.items():
        parts.append(_measured_table(name, modes))
    parts.append(
        Text(
            "A recorded earthquake is a stronger test: run the record of the dam's foot, and set the "
            "computed histories beside the recorded ones by:"
        )
    )
    parts.append(Code(subject.commands["recorded"]))
    return PageSection("measurements", "5 Validation against measurements", parts)


def _measured_table(file: str, modes: xr.Dataset) -> PageTable:
    rows = list[list[Value]]()
    frequency = {
        int(mode): float(f) for mode, f in zip(modes.mode.values, modes.frequency.values, strict=True)
    }
    for k, name in enumerate(modes.measured.values):
        mode = int(modes.measured_mode[k])
        rows.append([
            str(name), float(modes.measured_frequency[k]), mode, frequency.get(mode, float("nan")),
            _percent(float(modes.frequency_difference[k])),
        ])  # fmt: skip
    head = ["measured", "frequency [Hz]", "mode", "computed [Hz]", "difference [%]"]
    joints = str(modes.attrs.get("joints", "–"))
    return PageTable(head, rows, f"This dam, joints {joints}: {file}", digits=4)


def _cases(subject: ValidationSubject) -> dict[str, list[BenchmarkRow]]:
    """Rows of the benchmark set by their case."""
    names = dict.fromkeys(row.case for row in subject.benchmarks)
    return {name: [row for row in subject.benchmarks if row.case == name] for name in names}


def _percent(difference: float) -> PageCell:
    """A relative difference in per cent, round-off as 0."""
    value = 0.0 if abs(difference) < _ROUND_OFF else 100.0 * difference
    return PageCell(number(value, 2), "n")


def _notes(rows: Sequence[BenchmarkRow]) -> list[Part]:
    """The reasons of known differences."""
    return [Text(note) for note in dict.fromkeys(f"{row.case}: {row.note}." for row in rows if row.note)]


def _benchmark_command(*cases: str) -> list[Part]:
    options = "".join(f" --only {case}" for case in cases)
    return [
        Text("These figures came with this version of romdam. To compute them on this machine:", soft=True),
        Code(f"romdam benchmarks{options}"),
    ]


def _measured_dams(subject: ValidationSubject) -> list[Part]:
    """Every number of the cases that were measured, their models, sources and known differences."""
    of_cases = {case: rows for case, rows in _cases(subject).items() if any(row.measured for row in rows)}
    cells, parts = list[list[Value]](), list[Part]()
    for case, rows in of_cases.items():
        for row in rows:
            unit = f" [{row.unit}]" if row.unit else ""
            band = PageCell(f"±{number(100.0 * row.tolerance, 2)}", "n")
            shown = [_number(row.ours), _number(row.published), _percent(row.difference), band]
            cells.append([case, f"{row.quantity}{unit}", *shown])
        sources = dict.fromkeys(f"{row.source} ({row.kind})" for row in rows)
        parts += [Text(f"{case}: {rows[0].what}. Sources: {'; '.join(sources)}.", soft=True), *_notes(rows)]
    head = ["case", "quantity", "romdam", "others", "difference [%]", "band [%]"]
    return [PageTable(head, cells, "Measured dams"), *parts, *_benchmark_command(*of_cases)]


def _number(value: float) -> PageCell:
    return PageCell(number(value, _SIGNS), "n")


def uncertainty_section(subject: ValidationSubject) -> PageSection:
    """What scatters: materials, records and parameters; from several runs where there are any."""
    parts: list[Part] = [
        Text(
            "No statement of error above includes the uncertainty of moduli, strengths, loads or the record. "
            "Only runs with other values tell what these change."
        )
    ]
    summary = subject.companions.summary
    if summary is None:
        parts.append(
            Text(
                "No runs with other values stand beside the result. A job with the section suite makes "
                "them, of parameters such as materials.concrete.E or joints.base.friction and of records:"
            )
        )
        parts.append(Code("romdam run SUITE.yaml --out DIR"))
    else:
        runs = Subject(summary, Topic())
        parts.append(Text(f"Statistics of {runs.done} runs of the same job."))
        section = responses_section(runs)
        parts += section.shown if section else []
    return PageSection("uncertainty", "6 Uncertainty", parts)


def remarks_section(subject: ValidationSubject) -> PageSection:
    """Warnings, limits of the model, and files that were passed over."""
    section = limits_section(subject.run)
    left_out = [[text] for text in subject.companions.passed_over]
    return PageSection(
        "limits", "7 Warnings and limits", [*section.shown, PageTable(["file"], left_out, "Files left out")]
    )


def again_section(subject: ValidationSubject) -> PageSection:
    """What makes the run and this report again."""
    section = reproduction_section(subject.run)
    basis = Text(f"Headings after {SOURCE}.", soft=True)
    return PageSection("reproduce", "8 How to reproduce", [*section.shown, basis])


SECTIONS: tuple[Callable[[ValidationSubject], PageSection], ...] = (
    conceptual_section,
    computational_section,
    code_section,
    solution_section,
    measurements_section,
    uncertainty_section,
    remarks_section,
    again_section,
)
"""The headings, in their order."""
