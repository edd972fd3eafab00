"""The validation report of one run: its statements, approximations, benchmarks and what stands beside it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from math import nan
from pathlib import Path

from romdam.config.effects import refuse_unknown_effects
from romdam.config.load import Job
from romdam.core.benchmark_row import BenchmarkRow
from romdam.core.display_units import SI, US, DisplayUnits
from romdam.core.errors import ConfigError
from romdam.error.applicable import applies
from romdam.error.approximations import APPROXIMATIONS, Approximation
from romdam.error.statement import quantity_errors
from romdam.pipelines.error.study import refuse_study
from romdam.pipelines.report import report_command, run_subject, write_report
from romdam.pipelines.run import Clock, Stage, silent
from romdam.postprocess.record_measures import stated_warnings
from romdam.results.companions import companions_of
from romdam.timestepping.integrators.registry import integrator_class
from romdam.visual.report.document import A4, LETTER
from romdam.visual.report.one_run import RunSubject
from romdam.visual.report.validation import AppliedApproximation, How, ValidationSubject, validation_report

_PARTS = {  # statement -> what of the openings' error it states
    "discretisation": "mesh",
    "verification": "modes",
    "certificate": "modes",
    "estimate": "modes",
    "steps": "steps",
}


def validate_run(
    path: Path,
    benchmarks: Sequence[BenchmarkRow],
    system: DisplayUnits = SI,
    *,
    pdf: bool = False,
    show: Stage = silent,
) -> list[Path]:
    """Write the validation report of one run beside its result, as <result>-validation.html.

    Parameters
    ----------
    path : of the result
    benchmarks : rows of the benchmark set
    system : units of the report
    pdf : whether the same is written as <result>-validation.pdf too
    show : told of every stage

    Raises
    ------
    RomdamError
        where the file is no result, its joint laws are of a file that is gone, or the folder refuses a file.
    """
    clock = Clock(show)
    run = run_subject(path, system, report_command(path, system, "--validation", pdf=pdf), clock)
    attrs = run.dataset.attrs
    with clock.stage("report", "writing the report"):
        errors = {str(kind): of_kind for kind, of_kind in quantity_errors(attrs).items()} | mesh_parts(attrs)
        subject = ValidationSubject(
            run,
            next_commands(run, path.name),
            errors,
            *_approximations(run),
            benchmarks,
            companions_of(path, str(attrs["configuration_sha256"])),
        )
        name = path.with_name(f"{path.stem}-validation")
        return write_report(validation_report(subject), name, LETTER if system is US else A4, pdf=pdf)


def next_commands(run: RunSubject, result: str) -> dict[str, str]:
    """The commands that state what a result may lack, as far as they serve its job.

    Parameters
    ----------
    result : name of its file
    """
    config, attrs = run.config, run.dataset.attrs
    name = Path(str(attrs["configuration_file"])).name
    commands = {
        "measured": f"romdam modes {name} --measured test.csv --out DIR",
        "recorded": f"romdam compare recorded.csv {result} --out DIR",
    }
    if not config.every_joint:
        return commands
    commands["mesh"] = f"romdam verify {name} --mesh finer --out DIR"
    if config.model.order == "full":
        step = 0.5e3 * float(attrs["solver_finest_step"])
        commands["steps"] = (
            f"romdam run HALF.yaml --out DIR   # {name} with finest_step: {step:g} ms\n"
            f"romdam compare {result} DIR/{result}"
        )
        return commands
    commands |= {
        "full mesh": f"romdam verify {name} --out DIR",
        "modes": f"romdam {f'certify {result}' if _can_be_certified(run) else f'verify {name} --out DIR'}",
        "steps": f"romdam run STATED.yaml --out DIR   # {name} with transient: {{accuracy: 1 %}}",
    }
    try:
        refuse_study(Job(config, Path(name)))
    except ConfigError:
        return commands
    return commands | {"study": f"romdam study {name} --out DIR"}


def _can_be_certified(run: RunSubject) -> bool:
    """Tell whether `romdam certify` takes a run: it reads the record again, and adds jumps to the run."""
    config, integrator = run.config, run.config.transient.integrator
    try:
        refuse_unknown_effects(config, "certificate", "")
    except ConfigError:
        return False
    from_file = bool(json.loads(str(run.dataset.attrs["configuration"])).get("records"))
    at_rest = isinstance(config.loads.initial_state, str)
    return from_file and at_rest and (integrator is None or integrator_class(integrator).shifts)


def mesh_parts(attrs: Mapping[str, object]) -> dict[str, dict[str, tuple[float, float]]]:
    """What elements, contact points and each direction of the mesh leave of the openings, where stated."""
    stated = json.loads(str(attrs.get("discretisation", "{}")))
    parts = {"elements": stated.get("elements"), "contact points": stated.get("contact_points")}
    openings = {name: part.get("opening") for name, part in parts.items() if isinstance(part, dict)}
    directions = stated.get("directions")
    openings |= directions if isinstance(directions, dict) else {}
    return {
        name: {"opening": (float(error["l2"]), float(error["peak"]))}
        for name, error in openings.items()
        if isinstance(error, dict)
        and all(isinstance(error.get(norm), int | float) for norm in ("l2", "peak"))
    }


def _approximations(run: RunSubject) -> tuple[list[AppliedApproximation], int]:
    """The approximations that a run has, and the number of what is exact."""
    attrs = run.dataset.attrs
    rows = [
        row
        for row in APPROXIMATIONS
        if applies(row, run.config, str(attrs["integrator"]), set(run.statements))
    ]
    provenance = json.loads(str(attrs["record_provenance"]))
    said = [
        *stated_warnings(attrs),
        *run.statements.values(),
        *(f"{name}: {value}" for name, value in provenance.items() if isinstance(value, str)),
    ]
    applied = [one for row in rows if (one := _applied(row, run.errors, said)) is not None]
    return applied, sum(row.stated == "exact" for row in rows)


def _applied(
    row: Approximation, errors: Mapping[str, float], said: Sequence[str]
) -> AppliedApproximation | None:
    """A row as the report shows it; None for what is exact, and where the result has no word of it to say.

    Parameters
    ----------
    errors : stated of the openings
    said : all sentences of the result
    """
    how: How
    evidence, error = ", ".join(row.by), nan
    if row.stated == "exact":
        return None
    if row.stated == "varied by":
        known = [errors[part] for part in {_PARTS[statement] for statement in row.by} if part in errors]
        how, error = "stated", sum(known) if known else nan
    elif row.stated == "bounded by test":
        how = "bounded"
    elif row.stated == "not stated":
        how = "not stated"
    elif row.acts is not None:
        how, evidence = "not included", ""
    else:
        words = [text for by in row.by if (text := by.partition(": ")[2])]
        matched = next((sentence for sentence in said if any(text in sentence for text in words)), None)
        if matched is None:
            return None
        how, evidence = "said", matched
    return AppliedApproximation(row.name, row.changes.replace("`", ""), how, evidence, error)
