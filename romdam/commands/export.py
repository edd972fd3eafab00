"""A job for other codes: `romdam export`."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

import romdam
from romdam.commands.options import Config, Out, Quiet, Verbose


class Code(StrEnum):
    """What a job is written for."""

    OPENSEES = "opensees"
    CALCULIX = "calculix"
    ABAQUS = "abaqus"


def export(
    config: Config,
    out: Out,
    to: Annotated[Code, typer.Option(help="What it is written for.")],
    record: Annotated[str | None, typer.Option(help="Name of the record; else the first one.")] = None,
    dt: Annotated[
        float | None,
        typer.Option(min=1e-6, max=1.0, help="Step [s]; else finest_step, or a quarter of the record's."),
    ] = None,
    duration: Annotated[
        float | None, typer.Option(min=1e-3, help="Seconds of the record; as configured if not given.")
    ] = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Write CONFIG and one record as a script that runs in another code; what that cannot express is said.

    The script writes frequencies.csv and openings.csv, which `romdam compare` reads.
    """
    from romdam.pipelines.export import ExportOptions
    from romdam.pipelines.export import export as export_job
    from romdam.terminal import open_terminal

    stages, say = open_terminal(quiet, verbose)
    made = export_job(romdam.load_config(config), out, ExportOptions(to.value, record, dt, duration), stages)
    say(made.said, *(f"differs: {sentence}" for sentence in made.stated))
    say(*(f"written: {path}" for path in made.paths))
