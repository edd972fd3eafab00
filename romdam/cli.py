"""The `romdam` command: argument parsing only."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import romdam
from romdam.core.errors import (
    ConvergenceError,
    OutputError,
    RecordError,
    RomdamError,
    WorkerError,
    WriteError,
)
from romdam.core.files import keep_standard_files
from romdam.surroundings import Output, Signalled, check_surroundings, hear_signals

if TYPE_CHECKING:
    from romdam.config.load import Job
    from romdam.terminal import Stages

FAILED, BAD_INPUT, STOPPED = 1, 2, 130
EXIT_CODES = """
Exit codes: 0 all is well; 1 a record failed, a step did not converge, the disk is full, or workers or the
output were lost; 2 bad input (nothing was computed); 130 stopped by Ctrl-C, 143 by SIGTERM.
"""
_WIDE = 10_000  # columns: a table is as wide as its numbers, a narrow terminal must not cut them

app = typer.Typer(
    help="Reduced-order seismic analysis of concrete dams cut by contraction joints.",
    epilog=EXIT_CODES,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

Config = Annotated[Path, typer.Argument(help="YAML file of the job.", metavar="CONFIG")]
ResultFile = Annotated[Path, typer.Argument(help="NetCDF file that `romdam run` wrote.", metavar="RESULT")]


def _folder(text: str) -> Path:
    """A folder that is named: an empty text would be the working directory."""
    if not text.strip() or "\0" in text:
        raise typer.BadParameter("names no folder; write . for this one")
    return Path(text)


Out = Annotated[
    Path,
    typer.Option(
        "--out", "-o", parser=_folder, metavar="DIR", help="Folder for the results; made if needed."
    ),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Tell what is done and how long it takes.")]


def _version(asked: bool) -> None:
    if asked:
        typer.echo(f"romdam {romdam.__version__} (Python {sys.version.split()[0]})")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and stop.")
    ] = False,
) -> None:
    check_surroundings()


@app.command(epilog=EXIT_CODES)
def run(
    config: Config,
    out: Out,
    cache: Annotated[
        Path | None, typer.Option(help="Folder of reduced blocks; a suite has its own in OUT.")
    ] = None,
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

    A suite that was stopped goes on where it stopped.
    """
    job = romdam.load_config(config)
    if workers is not None and scheduler is not None:
        raise typer.BadParameter("is instead of --workers; give one of the two", param_hint="--scheduler")
    if job.config.pipeline == "suite":
        _run_suite(job, out, (workers, scheduler, cache), _terminal(quiet, verbose))
        return
    for option, given in (("--workers", workers), ("--scheduler", scheduler)):
        if given is not None:
            raise typer.BadParameter(f"is for suites; {config} has no `pipeline: suite`", param_hint=option)
    from romdam.pipelines.run import run as run_job
    from romdam.terminal import peaks_table

    stages, say = _terminal(quiet, verbose)
    outcome = run_job(job, out, stages, cache)
    say(peaks_table({path.stem: romdam.open_result(path).dataset for path in outcome.paths}))
    say(*(f"written: {path}" for path in outcome.paths))
    say(*(f"not of this run, but there from before: {path}" for path in outcome.others))
    for name, message in outcome.failures.items():
        typer.echo(f"{name}: {message}", err=True)
    if outcome.failures:
        typer.echo(
            f"{len(outcome.failures)} of {len(outcome.failures) + len(outcome.paths)} records failed",
            err=True,
        )
        raise typer.Exit(FAILED)


def _run_suite(
    job: Job,
    out: Path,
    where: tuple[int | None, str | None, Path | None],
    terminal: tuple[Stages, Callable[..., None]],
) -> None:
    from romdam.pipelines.suites.cluster import prepare_pool

    prepare_pool(
        where[0], where[1], "romdam.pipelines.suites.runs"
    )  # loads it while this process loads the rest
    from romdam.pipelines.report import report as write_report
    from romdam.pipelines.suites.run import SuiteOptions, run_suite
    from romdam.terminal import concern_lines, failure_lines, suite_table

    stages, say = terminal
    try:
        outcome = run_suite(job, out, SuiteOptions(*where), stages, say)
    except KeyboardInterrupt:
        typer.echo("romdam: stopped; what is finished is kept, and goes on when run again", err=True)
        raise typer.Exit(STOPPED) from None
    say(suite_table(outcome.summary), f"written: {outcome.path}")
    for line in (*concern_lines(outcome.summary, job.config.transient.accuracy), *failure_lines(outcome)):
        typer.echo(line, err=True)
    if job.config.outputs.plots:
        say(f"written: {write_report(out, job=job, show=stages)}")
    elif (out / "report.html").exists():
        say(f"{out / 'report.html'}: is of an earlier summary; `romdam report {out}` writes it again")
    if outcome.failures:
        raise typer.Exit(FAILED)


@app.command(epilog=EXIT_CODES)
def report(
    folder: Annotated[Path, typer.Argument(help="Folder that a suite was written to.", metavar="DIR")],
    config: Annotated[
        Path | None,
        typer.Option("--config", help="YAML file of the suite: spectra and the scene, where DIR lacks them."),
    ] = None,
    response: Annotated[
        str | None, typer.Option(help="Such as peak_opening (largest joint), the suite's first if not given.")
    ] = None,
    intensity: Annotated[str, typer.Option(help="Measure of the records, or scale.")] = "sa",
    threshold: Annotated[
        list[str] | None, typer.Option(help='Of a fragility, such as "20 mm"; give it again for more.')
    ] = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Write DIR/report.html, a page of a suite's summary that needs no network."""
    from romdam.pipelines.report import ReportOptions
    from romdam.pipelines.report import report as write

    stages, say = _terminal(quiet, verbose)
    job = romdam.load_config(config) if config else None
    say(f"written: {write(folder, ReportOptions(response, intensity, tuple(threshold or ())), job, stages)}")


@app.command(epilog=EXIT_CODES)
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
    from romdam.terminal import clean_lines

    stages, say = _terminal(quiet, verbose)
    say(*clean_lines(clean_folder(romdam.load_config(config), out, remove, stages), remove))


@app.command(epilog=EXIT_CODES)
def check(config: Config, quiet: Quiet = False, verbose: Verbose = False) -> None:
    """Validate CONFIG and print sizes, frequencies, estimated time and memory, without running it."""
    from romdam.pipelines.check import check as check_job
    from romdam.terminal import check_tables, estimate_line

    stages, say = _terminal(quiet, verbose)
    found = check_job(romdam.load_config(config), stages)
    say(*check_tables(found), estimate_line(found), *(f"warning: {w}" for w in found.warnings))
    say(f"{config}: is valid")


@app.command(epilog=EXIT_CODES)
def verify(
    config: Config,
    out: Out,
    duration: Annotated[str, typer.Option(help="Length of record to compare, with a unit.")] = "10 s",
    reference: Annotated[
        Path | None, typer.Option(help="An .npz with `time`, `gap` and `position` to compare with as well.")
    ] = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Measure the reduced model's error against the unreduced mesh, on the first record of CONFIG."""
    from romdam.config.quantities import to_si
    from romdam.pipelines.verify import verify as verify_job
    from romdam.terminal import verification_lines

    try:
        seconds = to_si(duration, "s")
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="--duration") from error
    if seconds <= 0.0:
        raise typer.BadParameter(f"must be longer than 0 s, got {duration}", param_hint="--duration")
    stages, say = _terminal(quiet, verbose)
    found = verify_job(romdam.load_config(config), out, seconds, reference, stages)
    say(*verification_lines(found.statement.document), f"written: {found.path}", f"written: {found.figure}")


@app.command(epilog=EXIT_CODES)
def certify(
    result: ResultFile,
    config: Annotated[
        Path | None,
        typer.Option("--config", help="YAML file RESULT was made with; found through it if not given."),
    ] = None,
    passes: Annotated[int, typer.Option(min=1, max=10, help="How often the defect is fed back.")] = 1,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """State RESULT's reduction error from its joint forces and the full-order linear model."""
    from romdam.pipelines.certify import certify as certify_result
    from romdam.terminal import certificate_table

    stages, say = _terminal(quiet, verbose)
    found = certify_result(result, config, passes, stages)
    statement = found.statement
    say(certificate_table(statement.document), statement.sentence, f"written: {found.path}")


@app.command(epilog=EXIT_CODES)
def study(
    config: Config,
    out: Out,
    reference: Annotated[
        Path | None, typer.Option(help="An .npz with `time`, `gap` and `position` to compare with instead.")
    ] = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Set speed against error: modes, integrators and steps of `study:`, on the first record of CONFIG."""
    from romdam.pipelines.study import study as study_job

    stages, say = _terminal(quiet, verbose)
    found = study_job(romdam.load_config(config), out, reference, stages)
    say(found.table, *(f"written: {path}" for path in found.paths))


@app.command(epilog=EXIT_CODES)
def info(
    result: Annotated[
        Path,
        typer.Argument(
            help="NetCDF file that `romdam run` wrote, or .h5 file of reduced blocks.", metavar="RESULT"
        ),
    ],
) -> None:
    """Tell what a result is, its peaks and error where measured; or what a file of reduced blocks holds."""
    from romdam.terminal import info_lines, peaks_table

    _, say = _terminal(quiet=False, verbose=False)
    if result.suffix == ".h5":
        from romdam.results.model_info import model_lines

        say(*model_lines(result))
        return
    with romdam.open_result(result) as opened:
        say(*info_lines(opened.dataset))
        say(peaks_table({str(opened.dataset.attrs["record"]): opened.dataset}))


@app.command(epilog=EXIT_CODES)
def show(
    config: Config,
    out: Out = Path("."),
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Draw the scene of CONFIG: blocks, joints, water and materials, as OUT/<config>-scene.png."""
    from romdam.pipelines.views import show_scene

    stages, say = _terminal(quiet, verbose)
    say(f"written: {show_scene(romdam.load_config(config), out, stages)}")


@app.command(epilog=EXIT_CODES)
def plot(
    result: ResultFile,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            parser=_folder,
            metavar="DIR",
            help="Folder for the figures; RESULT's own if not given.",
        ),
    ] = None,
    fields: Annotated[
        bool, typer.Option("--fields", help="Displacement and stress in 3-D at their worst steps (PNG).")
    ] = False,
    vtu: Annotated[bool, typer.Option("--vtu", help="A .vtu/.pvd series for ParaView.")] = False,
    animation: Annotated[bool, typer.Option("--animation", help="The motion as a GIF.")] = False,
    frames: Annotated[
        int | None,
        typer.Option(min=1, max=10_000, help="Frames of the series and of the GIF; 40 if not given."),
    ] = None,
    window: Annotated[
        tuple[float, float] | None,
        typer.Option(help="First and last second of both; 2 s around the largest displacement if not given."),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Draw the figures of a result as PNG and write its table of maxima; fields in 3-D where asked."""
    from romdam.pipelines.views import PlotOptions, plot_result
    from romdam.terminal import maxima_table

    for option, given in (("--frames", frames), ("--window", window)):
        if given is not None and not (vtu or animation):
            raise typer.BadParameter("is of a series; give --vtu or --animation too", param_hint=option)
    if window is not None and not 0.0 <= window[0] < window[1] < float("inf"):
        raise typer.BadParameter(
            f"goes from a first to a later second, got {window[0]:g} to {window[1]:g}", param_hint="--window"
        )
    stages, say = _terminal(quiet, verbose=False)
    wanted = PlotOptions(fields, vtu, animation, frames or 40, window)
    with romdam.open_result(result) as opened:
        paths = plot_result(opened, out or result.parent, wanted, stages)
        say(maxima_table(opened.dataset), *(f"written: {path}" for path in paths))


@app.command(epilog=EXIT_CODES)
def records(
    sources: Annotated[
        list[str],
        typer.Argument(
            metavar="LIST...", help="Jobs (YAML), manifests, folders, record files, or P-695 sets."
        ),
    ],
    plot: Annotated[
        Path | None,
        typer.Option("--plot", parser=_folder, metavar="DIR", help="Folder for a page of plots per record."),
    ] = None,
) -> None:
    """List ground motions with their measures; one that cannot be read is a row that says why.

    Where nothing of LIST is a source of records, that is bad input.
    """
    from romdam.core.files import prepare_folder
    from romdam.records.formats.table import format_table, list_records
    from romdam.visual.record_plots import write_record_plots

    folder = prepare_folder(plot) if plot else None
    _, say = _terminal(quiet=False, verbose=False)
    listed = list_records(sources)
    if listed and all(one.no_source for one in listed):
        raise RecordError("\n".join(one.error for one in listed))
    say(format_table(listed))
    if folder:
        pairs = [(one.motion, one.recorded) for one in listed if one.motion]
        for path in write_record_plots(pairs, folder):
            say(f"written: {path}")
    if any(one.motion is None for one in listed):
        raise typer.Exit(FAILED)


def _terminal(quiet: bool, verbose: bool) -> tuple[Stages, Callable[..., None]]:
    """Progress on stderr, and a printer to stdout that --quiet silences."""
    import logging

    from rich.console import Console
    from rich.logging import RichHandler

    from romdam.terminal import Stages

    errors = Console(stderr=True)
    output = Console(soft_wrap=True, highlight=False, emoji=False, width=_WIDE)
    level = logging.INFO if verbose else logging.ERROR if quiet else logging.WARNING
    handler = RichHandler(console=errors, show_path=False)
    handler.addFilter(
        lambda record: not record.name.startswith(("asyncio", "distributed"))
    )  # in messages here
    logging.basicConfig(level=level, format="%(message)s", handlers=[handler])

    def say(*lines: object) -> None:
        for line in lines if not quiet else ():
            output.print(line, markup=False)

    return Stages(errors, quiet), say


def main() -> None:
    """Run the command; every error of romdam's own is one message and an exit code."""
    keep_standard_files()
    sys.stdout, sys.stderr = Output.of(sys.stdout, told=True), Output.of(sys.stderr, told=False)
    hear_signals()
    try:
        app()
    except Signalled as stopped:
        _stop(stopped, 128 + stopped.number)
    except (ConvergenceError, WorkerError, OutputError, WriteError) as error:
        _stop(error, FAILED)
    except RomdamError as error:
        _stop(error, BAD_INPUT)


def _stop(error: BaseException, code: int) -> None:
    typer.echo(f"romdam: {error}", err=True)
    raise SystemExit(code)
