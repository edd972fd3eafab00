"""`romdam run` and `romdam check`: a configuration is computed, or what that would take."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import romdam
from romdam.commands.caches import Cache, NoCache, folder_of_blocks
from romdam.commands.options import FAILED, Config, Out, Quiet, Verbose
from romdam.commands.suites import run_suite

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
    """Run every record of CONFIG; each lands as OUT/<record>.nc, those of a suite in OUT/summary.nc.

    A suite that was stopped goes on where it stopped. The variants of a comparison land in OUT/<variant>, and
    side by side in OUT/comparison.html.
    """
    from romdam.terminal import open_terminal

    job, terminal = romdam.load_config(config), open_terminal(quiet, verbose)
    if workers is not None and scheduler is not None:
        raise typer.BadParameter("is instead of --workers; give one of the two", param_hint="--scheduler")
    folder = folder_of_blocks(cache, no_cache)
    if job.config.pipeline == "suite":
        if no_cache:
            raise typer.BadParameter(
                "is for single jobs; a suite has its own in OUT", param_hint="--no-cache"
            )
        run_suite(job, out, (workers, scheduler, cache), terminal)
        return
    for option, value in (("--workers", workers), ("--scheduler", scheduler)):
        if value is not None:
            raise typer.BadParameter(f"is for suites; {config} has no `pipeline: suite`", param_hint=option)
    if job.config.pipeline == "comparison":
        _run_comparison(job, out, folder, terminal)
        return
    _run_records(job, out, folder, terminal)


def _run_comparison(job: Job, out: Path, cache: Path | None, terminal: Terminal) -> None:
    from romdam.pipelines.error.comparison import compare
    from romdam.terminal.tables import comparison_tables

    stages, say = terminal
    found = compare(job, out, stages, cache)
    say(*comparison_tables(found.tables), *(f"written: {path}" for path in found.paths))
    for name, message in found.failures.items():
        typer.echo(f"{name}: {message}", err=True)
    if found.failures:
        raise typer.Exit(FAILED)


def _run_records(job: Job, out: Path, cache: Path | None, terminal: Terminal) -> None:
    from romdam.pipelines.run import run as run_job
    from romdam.terminal.tables import peaks_table, sliding_tables, stress_tables

    stages, say = terminal
    outcome = run_job(job, out, stages, cache)
    results = {path.stem: romdam.open_result(path).dataset for path in outcome.paths}
    say(peaks_table(results), *sliding_tables(results), *stress_tables(results))
    say(*(f"written: {path}" for path in outcome.paths))
    say(*(f"not of this run, but there from before: {path}" for path in outcome.others))
    for name, message in outcome.failures.items():
        typer.echo(f"{name}: {message}", err=True)
    if outcome.failures:
        records = len(outcome.failures) + len(outcome.paths)
        typer.echo(f"{len(outcome.failures)} of {records} records failed", err=True)
        raise typer.Exit(FAILED)


def check(
    config: Config,
    cache: Cache = None,
    no_cache: NoCache = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Validate CONFIG and print sizes, frequencies, estimated time and memory, without running it.

    What it reduces is kept for `romdam run`.
    """
    from romdam.pipelines.check import check as check_job
    from romdam.terminal import open_terminal
    from romdam.terminal.lines import estimate_line
    from romdam.terminal.tables import check_tables

    stages, say = open_terminal(quiet, verbose)
    found = check_job(romdam.load_config(config), stages, folder_of_blocks(cache, no_cache))
    say(*check_tables(found), estimate_line(found), *(f"warning: {w}" for w in found.warnings))
    say(f"{config}: is valid")
