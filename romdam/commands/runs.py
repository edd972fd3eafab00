"""`romdam run` and `romdam check`: a configuration is computed, or what that would take."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import romdam
from romdam.commands.caches import Cache, NoCache, folder_of_blocks
from romdam.commands.options import FAILED, Config, Json, Out, Quiet, Verbose, exit_code
from romdam.commands.suites import run_suite, write_page
from romdam.surroundings import search_what_comes

if TYPE_CHECKING:
    from romdam.config.load import Job
    from romdam.terminal import Terminal


def run(
    config: Config,
    out: Out = Path("results"),
    cache: Cache = None,
    no_cache: NoCache = False,
    workers: Annotated[
        int | None,
        typer.Option(min=1, max=1000, help="Processes of a suite; one for each core if not given."),
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a dask scheduler for a suite, instead of own processes.")
    ] = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Run every record of CONFIG; each lands as OUT/<record>.nc, several in OUT/report.html too.

    A suite that was stopped goes on where it stopped. The variants of a comparison land in OUT/<variant>, and
    side by side in OUT/comparison.html. OUT/<config>-<time>.log tells every stage and warning.
    """
    from romdam.terminal import complain, open_terminal
    from romdam.terminal.run_log import run_log
    from romdam.terminal.written import seen, written_lines

    terminal = open_terminal(quiet, verbose)
    job = romdam.load_config(config)
    if workers is not None and scheduler is not None:
        raise typer.BadParameter("is instead of --workers; give one of the two", param_hint="--scheduler")
    folder, is_suite = folder_of_blocks(cache, no_cache), job.config.pipeline == "suite"
    if is_suite and no_cache:
        raise typer.BadParameter("is for single jobs; a suite has its own in OUT", param_hint="--no-cache")
    for option, value in (("--workers", workers), ("--scheduler", scheduler)):
        if value is not None and not is_suite:
            raise typer.BadParameter(f"is for suites; {config} has no `pipeline: suite`", param_hint=option)
    before = seen(out)
    with run_log(out, config, exit_code):
        if is_suite:
            failed = run_suite(job, out, workers, scheduler, cache, terminal)
        elif job.config.pipeline == "comparison":
            failed = _run_comparison(job, out, folder, terminal)
        else:
            failed = _run_records(job, out, folder, terminal)
        terminal[1](*written_lines(out, before))
        if failed:
            complain(*failed)
            raise typer.Exit(FAILED)


def _run_comparison(job: Job, out: Path, cache: Path | None, terminal: Terminal) -> list[str]:
    """Run the variants; a line for each that failed."""
    from romdam.pipelines.error.comparison import compare
    from romdam.terminal.tables import comparison_tables

    search_what_comes()
    stages, say = terminal
    compared = compare(job, out, stages, cache)
    say(*comparison_tables(compared.tables))
    return [f"{name}: {message}" for name, message in compared.failures.items()]


def _run_records(job: Job, out: Path, cache: Path | None, terminal: Terminal) -> list[str]:
    """Run the records; a line for each that failed."""
    from romdam.pipelines.run import run as run_job
    from romdam.terminal.tables import (
        attached_tables,
        error_tables,
        peaks_table,
        sliding_tables,
        stress_tables,
        variant_table,
    )

    search_what_comes()
    stages, say = terminal
    outcome = run_job(job, out, stages, cache)
    if outcome.lone is None:
        results = {path.stem: romdam.open_result(path).dataset for path in outcome.paths}
    else:  # opening it takes 0.1 s
        results = {outcome.paths[0].stem: outcome.lone}
    say(peaks_table(results), *error_tables(results))
    say(*sliding_tables(results), *attached_tables(results), *stress_tables(results))
    say(*map(variant_table, outcome.stages))
    if outcome.summary:
        say(*write_page(job, out, stages))
    say(*(f"not of this run, but there from before: {path}" for path in outcome.others))
    records = len(outcome.failures) + len(outcome.paths)
    count = [f"{len(outcome.failures)} of {records} records failed"] if outcome.failures else []
    return [f"{name}: {message}" for name, message in outcome.failures.items()] + count


def check(
    config: Config,
    cache: Cache = None,
    no_cache: NoCache = False,
    quick: Annotated[
        bool, typer.Option("--quick", help="Reduce nothing: keys, records, meshes, joints and loads alone.")
    ] = False,
    as_json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Validate CONFIG and print sizes, frequencies, estimated time and memory, without running it.

    What it reduces is kept for `romdam run`.
    """
    from romdam.pipelines.check import check as check_job
    from romdam.terminal import open_terminal
    from romdam.terminal.documents import check_document, print_document
    from romdam.terminal.lines import check_lines
    from romdam.terminal.tables import check_tables

    stages, say = open_terminal(quiet, verbose, as_json)
    checked = check_job(romdam.load_config(config), stages, folder_of_blocks(cache, no_cache), quick=quick)
    if as_json:
        print_document("check", check_document(checked, config))
        return
    say(*check_tables(checked), *check_lines(checked))
    say(f"{config}: is valid")
