"""The error of a model or of a result: `romdam verify`, `certify`, `study` and `compare`."""

from __future__ import annotations

import math
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

import romdam
from romdam.commands.options import FAILED, Config, Json, Out, Quiet, ResultFile, Verbose, named_folder


class OtherMesh(StrEnum):
    """A mesh to compare with."""

    finer = "finer"
    coarser = "coarser"


def verify(
    config: Config,
    out: Out = Path("results"),
    duration: Annotated[
        str | None,
        typer.Option(help="Of the record from its start, with a unit; its strongest 10 s if not given."),
    ] = None,
    full: Annotated[bool, typer.Option("--full", help="Compare over the whole record.")] = False,
    reference: Annotated[
        Path | None, typer.Option(help="An .npz with `time`, `gap` and `position` to compare with as well.")
    ] = None,
    mesh: Annotated[
        OtherMesh | None,
        typer.Option(
            help="State the mesh's own error instead, from elements of half (finer) or twice (coarser) the "
            "size, over all that CONFIG runs of the record."
        ),
    ] = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Measure the error of the reduced model, or of the mesh, on the first record of CONFIG."""
    from romdam.config.quantities import to_si
    from romdam.pipelines.error.verify import verify as verify_job
    from romdam.pipelines.error.verify import verify_mesh
    from romdam.terminal import open_terminal
    from romdam.terminal.lines import mesh_lines, verification_lines

    if mesh is not None and (full or reference is not None):
        name = "--full" if full else "--reference"
        raise typer.BadParameter(
            "goes without this, which is of the reduction", param_hint=f"--mesh and {name}"
        )
    if duration is not None and full:
        raise typer.BadParameter("is the whole record; give one of the two", param_hint="--full")
    try:
        seconds = None if duration is None else to_si(duration, "s")
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="--duration") from error
    if seconds is not None and seconds <= 0.0:
        raise typer.BadParameter(f"must be longer than 0 s, got {duration}", param_hint="--duration")
    stages, say = open_terminal(quiet, verbose)
    if mesh is not None:
        job = romdam.load_config(config)
        verified_mesh = verify_mesh(job, out, seconds, finer=mesh is OtherMesh.finer, show=stages)
        say(
            *mesh_lines(verified_mesh.statement.document),
            f"written: {verified_mesh.path}",
            f"written: {verified_mesh.figure}",
        )
        return
    verified = verify_job(
        romdam.load_config(config), out, math.inf if full else seconds, reference, stages, say
    )
    say(
        *verification_lines(verified.statement.document),
        f"written: {verified.path}",
        f"written: {verified.figure}",
    )


def certify(
    result: ResultFile,
    config: Annotated[
        Path | None,
        typer.Option("--config", help="YAML file RESULT was made with; found through it if not given."),
    ] = None,
    full: Annotated[
        bool, typer.Option("--full", help="Solve the mesh over the whole record, not in windows of it.")
    ] = False,
    passes: Annotated[
        int, typer.Option(min=1, max=10, help="How often the defect is fed back; more than once is --full.")
    ] = 1,
    as_json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """State RESULT's reduction error from its joint forces and the full-order linear model.

    The mesh is solved in windows of the record, and the error stated as an interval; with --full throughout.
    """
    from romdam.pipelines.error.certify import certify as certify_result
    from romdam.terminal import open_terminal
    from romdam.terminal.documents import certificate_document, print_document
    from romdam.terminal.tables import certificate_table

    stages, say = open_terminal(quiet, verbose, as_json)
    whole = full or passes > 1
    certified = certify_result(result, config, passes if whole else None, stages, say)
    if as_json:
        print_document("certify", certificate_document(certified, result))
        return
    statement = certified.statement
    say(certificate_table(statement.document), statement.sentence, f"written: {certified.path}")


def study(
    config: Config,
    out: Out = Path("results"),
    reference: Annotated[
        Path | None, typer.Option(help="An .npz with `time`, `gap` and `position` to compare with instead.")
    ] = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Set speed against error: meshes, modes and steps of `study:`, on the first record of CONFIG."""
    from romdam.pipelines.error.study import study as study_job
    from romdam.terminal import open_terminal

    stages, say = open_terminal(quiet, verbose)
    studied = study_job(romdam.load_config(config), out, reference, stages)
    say(studied.table, *(f"written: {path}" for path in studied.paths))


def compare(
    first: Annotated[Path, typer.Argument(metavar="A", help="Result of romdam's (.nc), or another code's.")],
    second: Annotated[
        Path, typer.Argument(metavar="B", help="The better one; differences are relative to it.")
    ],
    tolerance: Annotated[
        str | None,
        typer.Option(help="Largest L2 and peak difference, such as '2 %'; beyond it the exit code is 1."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", parser=named_folder, metavar="DIR", help="Folder for compare.csv and .png."
        ),
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Compare two results on one clock: L2, peaks and phase, joint by joint.

    Another code's are NetCDF-4 (opening, gap_position, displacement), .npz (time, gap, position), or CSV
    with columns time, opening:<gap or joint>, displacement:<node>:<x, y or z>, each with a unit in brackets.
    """
    from romdam.config.quantities import to_si
    from romdam.pipelines.error.two_results import compare_results
    from romdam.terminal import complain, open_terminal
    from romdam.terminal.documents import comparison_document, print_document
    from romdam.terminal.tables import variant_table

    try:
        most = to_si(tolerance, "") if tolerance is not None else None
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="--tolerance") from error
    if most is not None and not most > 0.0:
        raise typer.BadParameter(f"must be above 0, got {tolerance}", param_hint="--tolerance")
    _, say = open_terminal(quiet, verbose, as_json)
    both = compare_results(first, second, out)
    beyond = [] if most is None else both.beyond(most)
    if as_json:
        print_document("compare", comparison_document(both, beyond))
    else:
        say(variant_table(both.table), *(f"written: {path}" for path in both.paths))
    if beyond:
        complain(f"more than {tolerance} apart: {', '.join(beyond)}")
        raise typer.Exit(FAILED)
