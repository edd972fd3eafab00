"""A suite: `romdam run` of one, `romdam report` and `romdam clean`."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import romdam
from romdam.commands.options import STOPPED, Config, Quiet, Verbose
from romdam.surroundings import search_what_comes

if TYPE_CHECKING:
    from romdam.config.load import Job
    from romdam.terminal import Stages, Terminal


class Units(StrEnum):
    """Units of the report of one run."""

    si = "si"
    us = "us"


def run_suite(
    job: Job, out: Path, workers: int | None, scheduler: str | None, cache: Path | None, terminal: Terminal
) -> list[str]:
    """Run a suite, tell what came of it and write its report; a line for each kind of failure.

    Parameters
    ----------
    workers : processes; as many as there are cores if not given
    scheduler : address of a Dask cluster that runs the suite instead
    cache : folder of reduced blocks
    """
    from romdam.pipelines.suites.cluster import prepare_pool

    # loads the module while this process loads the rest
    prepare_pool(workers, scheduler, "romdam.pipelines.suites.runs")
    import romdam.pipelines.report  # it is wanted at the end
    from romdam.pipelines.suites.run import SuiteOptions
    from romdam.terminal import complain
    from romdam.terminal.lines import failure_lines, suite_warning_lines
    from romdam.terminal.tables import hazard_tables, sobol_tables, suite_table

    search_what_comes()
    stages, say = terminal
    try:
        outcome = romdam.run_suite(job, out, SuiteOptions(workers, scheduler, cache), stages, say)
    except KeyboardInterrupt:
        complain("romdam: stopped; what is finished is kept, and goes on when run again")
        raise typer.Exit(STOPPED) from None
    of_samples = (*sobol_tables(outcome.summary), *hazard_tables(outcome.summary))
    say(suite_table(outcome.summary), *of_samples)
    complain(*suite_warning_lines(outcome.summary, job.config.transient.step_accuracy))
    say(*write_page(job, out, stages))
    return failure_lines(outcome)


def write_page(job: Job, out: Path, stages: Stages) -> list[str]:
    """Write the page of several runs where figures are asked for; else say which page is an earlier one's."""
    page = out / "report.html"
    if job.config.outputs.plots:
        from romdam.pipelines.report import report as write_report

        write_report(out, job=job, show=stages)
    elif page.exists():
        return [f"{page}: is of an earlier summary; `romdam report {out}` writes it again"]
    return []


def report(
    source: Annotated[
        Path,
        typer.Argument(help="Result of one run, or folder of several runs or a suite.", metavar="RESULT|DIR"),
    ],
    pdf: Annotated[bool, typer.Option("--pdf", help="The same as a PDF too.")] = False,
    validation: Annotated[
        bool,
        typer.Option(
            "--validation",
            help="The validation report of one run: model, errors, benchmarks, measurements, uncertainty.",
        ),
    ] = False,
    units: Annotated[
        Units | None, typer.Option(help="Of the report of one run: si, or us for US customary units.")
    ] = None,
    config: Annotated[
        Path | None,
        typer.Option(
            "--config", help="YAML file of several runs: spectra and the scene, where DIR lacks them."
        ),
    ] = None,
    response: Annotated[
        str | None, typer.Option(help="Such as peak_opening (largest joint), the suite's first if not given.")
    ] = None,
    intensity: Annotated[
        str | None, typer.Option(help="Measure of the records, or scale; sa if not given.")
    ] = None,
    threshold: Annotated[
        list[str] | None, typer.Option(help='Of a fragility, such as "20 mm"; give it again for more.')
    ] = None,
    hazard: Annotated[
        Path | None,
        typer.Option(help="CSV file of the intensity's hazard: adds annual frequencies to fragilities."),
    ] = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Write the report of one run beside it, or DIR/report.html of several; pages need no network.

    That of one run has assumptions, loads, checks, tables, acceptance and limits; --validation writes what
    speaks for and against the numbers instead.
    """
    from romdam.core.display_units import SI, US
    from romdam.pipelines.report import ReportOptions, report_run
    from romdam.pipelines.report import report as report_runs
    from romdam.terminal import open_terminal

    of_runs = {"--config": config, "--response": response, "--intensity": intensity, "--threshold": threshold}
    of_runs["--hazard"] = hazard
    one_run = not source.is_dir()
    of_one = {"--units": units, "--validation": validation or None}
    for option, value in (of_runs if one_run else of_one).items():
        if value is not None:
            raise typer.BadParameter(
                f"is for {'folders of several runs' if one_run else 'the result of one run'}, {source} is "
                f"{'a file' if one_run else 'a folder'}",
                param_hint=option,
            )
    stages, say = open_terminal(quiet, verbose)
    system = US if units is Units.us else SI
    if validation:
        from romdam.benchmarks.table import shipped_rows
        from romdam.pipelines.validation import validate_run

        written = validate_run(source, shipped_rows(), system, pdf=pdf, show=stages)
    elif one_run:
        written = report_run(source, system, pdf=pdf, show=stages)
    else:
        job = romdam.load_config(config) if config else None
        options = ReportOptions(response, intensity or "sa", tuple(threshold or ()), hazard)
        written = report_runs(source, options, job, stages, pdf=pdf)
    say(*(f"written: {path}" for path in written))


def clean(
    config: Config,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder that the suite was written to.")],
    remove: Annotated[
        bool, typer.Option("--remove", help="Remove what is listed; without it nothing is changed.")
    ] = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """List, and with --remove remove, what earlier designs of the suite CONFIG have left in OUT.

    Rows and results of runs that CONFIG no longer asks for go; files that romdam did not write stay.
    """
    from romdam.pipelines.suites.folder import clean as clean_folder
    from romdam.terminal import open_terminal
    from romdam.terminal.lines import clean_lines

    stages, say = open_terminal(quiet, verbose)
    say(*clean_lines(clean_folder(romdam.load_config(config), out, remove, stages), remove))
