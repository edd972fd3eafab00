"""Stability after an earthquake and of rock wedges: `romdam stability` and `romdam wedges`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import romdam
from romdam.commands.caches import Cache, NoCache, folder_of_blocks
from romdam.commands.options import FAILED, Config, Out, Quiet, Verbose, named_folder


def stability(
    config: Config,
    results: Annotated[
        list[Path], typer.Argument(metavar="RESULT...", help="NetCDF files of runs of CONFIG.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", parser=named_folder, metavar="DIR", help="Folder for <CONFIG>-stability.csv."
        ),
    ] = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Judge the dam at rest after each RESULT, with the residual strength of `post_earthquake:`.

    The exit code is 1 where a joint has less than the required factor, or there is no equilibrium.
    """
    from romdam.pipelines.stability import assess_stability
    from romdam.terminal import complain, open_terminal
    from romdam.terminal.tables import rest_forces_table, stability_table

    stages, say = open_terminal(quiet, verbose)
    assessed = assess_stability(romdam.load_config(config), results, out, stages)
    tables = (stability_table(assessed.rows), *rest_forces_table(assessed.forces))
    say(*tables, *(f"written: {path}" for path in assessed.paths))
    complain(*(f"{record}: {message}" for record, message in assessed.failures.items()))
    if not assessed.is_stable:
        raise typer.Exit(FAILED)


def combinations(
    config: Config,
    out: Out = Path("results"),
    cache: Cache = None,
    no_cache: NoCache = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Run the load combinations of CONFIG, and state every margin in one table and on one page.

    The exit code is 1 where something that is required is not met, or there is no equilibrium.
    """
    from romdam.pipelines.combinations import assess_combinations
    from romdam.terminal import complain, open_terminal
    from romdam.terminal.tables import combinations_table

    stages, say = open_terminal(quiet, verbose)
    blocks = folder_of_blocks(cache, no_cache)
    assessed = assess_combinations(romdam.load_config(config), out, stages, blocks)
    rows = [margin.row for margin in assessed.margins]
    say(combinations_table(rows), *(f"written: {path}" for path in assessed.paths))
    complain(*(f"{of}: {message}" for of, message in assessed.failures.items()))
    if not assessed.satisfied:
        raise typer.Exit(FAILED)


def wedges(
    file: Annotated[Path, typer.Argument(help="YAML file with `wedges:`.", metavar="WEDGES")],
    result: Annotated[
        Path | None,
        typer.Argument(
            help="NetCDF file of a run, whose joints and sections press on the wedges.", metavar="[RESULT]"
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            parser=named_folder,
            metavar="DIR",
            help="Folder for <WEDGES>-wedges.nc and tables.",
        ),
    ] = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Factors of safety of rock wedges against sliding and rotation, at rest or under forces of RESULT."""
    from romdam.pipelines.wedges import assess_wedges
    from romdam.terminal import complain, open_terminal
    from romdam.terminal.tables import wedges_tables

    _, say = open_terminal(quiet, verbose)
    assessed = assess_wedges(file, result, out)
    tables = wedges_tables(assessed.rows, assessed.rotations)
    say(*tables, *(f"written: {path}" for path in assessed.paths))
    complain(*(f"{file}: {warning}" for warning in assessed.warnings))
