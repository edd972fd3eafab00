"""The linear stage: `romdam linear`."""

from __future__ import annotations

from pathlib import Path

import typer

import romdam
from romdam.commands.caches import Cache, NoCache, folder_of_blocks
from romdam.commands.options import FAILED, Config, Out, Quiet, Verbose
from romdam.surroundings import search_what_comes


def linear(
    config: Config,
    out: Out = Path("results"),
    cache: Cache = None,
    no_cache: NoCache = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Analyse CONFIG with all joints tied: response spectra and linear time histories of its records.

    They land in OUT/linear, with a table of both. `romdam run` makes them too, and the nonlinear runs beside
    them, where CONFIG has `linear_stage`.
    """
    from romdam.pipelines.linear import linear as run_linear
    from romdam.terminal import complain, open_terminal
    from romdam.terminal.tables import stress_tables, variant_table

    stages, say = open_terminal(quiet, verbose)
    search_what_comes()
    job = romdam.load_config(config)
    outcome = run_linear(job, out, stages, folder_of_blocks(cache, no_cache))
    say(*stress_tables({record: stage.history for record, stage in outcome.stages.items()}))
    say(*(variant_table(table) for table in outcome.tables))
    say(*(f"written: {path}" for path in outcome.paths))
    if outcome.failures:
        complain(*(f"{record}: {message}" for record, message in outcome.failures.items()))
        raise typer.Exit(FAILED)
