"""The `romdam` command: its options, its commands in the order of its help, and its exit codes."""

from __future__ import annotations

import atexit
import gc
import sys
from typing import Annotated

import typer

from romdam.commands.benchmarks import benchmarks
from romdam.commands.caches import cache
from romdam.commands.errors import certify, compare, study, verify
from romdam.commands.examples import init
from romdam.commands.export import export
from romdam.commands.linear import linear
from romdam.commands.modes import modes
from romdam.commands.options import EXIT_CODES, exit_code
from romdam.commands.runs import check, run
from romdam.commands.schema import schema
from romdam.commands.stability import combinations, stability, wedges
from romdam.commands.suites import clean, report
from romdam.commands.views import info, plot, records, show, view
from romdam.core.errors import RomdamError
from romdam.core.files import keep_standard_files
from romdam.core.printable import printable
from romdam.core.version import SOURCE, commit
from romdam.surroundings import Output, Signalled, check_surroundings, hear_signals, load_unsearched

app = typer.Typer(
    help="Reduced-order seismic analysis of concrete dams cut by contraction joints.",
    epilog=EXIT_CODES,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
_COMMANDS = (
    init, run, report, clean, check, modes, linear, verify, certify, study, compare, info, show, plot, view,
    records, stability, combinations, wedges, export, benchmarks, cache, schema,
)  # fmt: skip
for command in _COMMANDS:
    app.command(epilog=EXIT_CODES)(command)


def _version(asked: bool) -> None:
    if asked:
        checkout = commit()
        typer.echo(f"{SOURCE}{f', commit {checkout}' * bool(checkout)} (Python {sys.version.split()[0]})")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version",
            "-V",
            callback=_version,
            is_eager=True,
            help="Print the version, of a checkout its commit too, and stop.",
        ),
    ] = False,
) -> None:
    check_surroundings()


def main() -> None:
    """Run the command; every error of romdam's own is one message and an exit code."""
    keep_standard_files()
    sys.stdout, sys.stderr = Output.of(sys.stdout, told=True), Output.of(sys.stderr, told=False)
    hear_signals()
    load_unsearched()
    atexit.register(gc.freeze)  # what ends with the process is not searched for cycles: 0.5 s of a run
    try:
        app()
    except (Signalled, RomdamError) as error:
        typer.echo(printable(f"romdam: {error}"), err=True)
        raise SystemExit(exit_code(error)) from None
