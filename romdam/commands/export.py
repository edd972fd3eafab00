"""The model of a job for other codes: `romdam export`."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

import romdam
from romdam.commands.caches import folder_of_blocks
from romdam.commands.options import Config, Out, Quiet, Verbose


class ExportCode(StrEnum):
    """Program that a job is written for."""

    OPENSEES = "opensees"
    CALCULIX = "calculix"
    CODE_ASTER = "code_aster"
    ABAQUS = "abaqus"
    MATRICES = "matrices"


def export(
    config: Config,
    out: Out,
    to: Annotated[ExportCode, typer.Option(help="What it is written for.")],
    record: Annotated[str | None, typer.Option(help="Name of the record; else the first one.")] = None,
    dt: Annotated[
        float | None,
        typer.Option(
            min=1e-6, max=1.0, help="Step in seconds; else finest_step, or a quarter of the record's."
        ),
    ] = None,
    duration: Annotated[
        float | None, typer.Option(min=1e-3, help="Seconds of the record; as configured if not given.")
    ] = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Write CONFIG and one record as a script that runs in another code; what that cannot express is said.

    The script writes frequencies.csv and openings.csv, which `romdam compare` reads. `--to matrices`: K, M,
    C, gap operator and loads of each block and of the system, as Matrix Market and HDF5, reduced or of the
    whole mesh as `model.order` says; no record is in them.
    """
    from romdam.pipelines.export import ExportOptions, export_deck, export_matrices
    from romdam.terminal import open_terminal

    stages, say = open_terminal(quiet, verbose)
    job = romdam.load_config(config)
    if to is ExportCode.MATRICES:
        for option, value in (("--record", record), ("--dt", dt), ("--duration", duration)):
            if value is not None:
                raise typer.BadParameter("is for scripts; matrices have no record", param_hint=option)
        paths = export_matrices(job, out, stages, folder_of_blocks(None, False))
    else:
        exported = export_deck(job, out, ExportOptions(to.value, record, dt, duration), stages)
        say(exported.said, *(f"differs: {sentence}" for sentence in exported.stated))
        paths = list(exported.paths)
    say(*(f"written: {path}" for path in paths))
