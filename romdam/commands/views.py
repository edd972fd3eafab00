"""Results, scenes and records told and drawn: `romdam info`, `show`, `plot`, `view` and `records`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import romdam
from romdam.commands.options import (
    FAILED,
    Config,
    Json,
    Out,
    Quiet,
    ResultFile,
    Verbose,
    Window,
    named_folder,
)
from romdam.core.errors import RecordError


def info(
    result: Annotated[
        Path,
        typer.Argument(
            help="NetCDF file that `romdam run` or `romdam linear` wrote, or .h5 file of reduced blocks.",
            metavar="RESULT",
        ),
    ],
    as_json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Tell what a result is, its peaks and error where measured; or what a file of reduced blocks holds."""
    from romdam.results.response_spectrum import open_spectrum
    from romdam.terminal import open_terminal
    from romdam.terminal.documents import info_document, print_document
    from romdam.terminal.lines import info_lines
    from romdam.terminal.spectrum import spectrum_document, spectrum_lines
    from romdam.terminal.tables import attached_tables, error_tables, peaks_table, sliding_tables

    _, say = open_terminal(quiet, verbose, as_json)
    if result.suffix == ".h5":
        if as_json:
            raise typer.BadParameter("is of results, not of reduced blocks", param_hint="--json")
        from romdam.results.model_info import model_lines

        say(*model_lines(result))
        return
    spectrum = open_spectrum(result)
    if spectrum is not None:
        with spectrum:
            if as_json:
                print_document("info", spectrum_document(spectrum, result))
            else:
                say(*spectrum_lines(spectrum))
        return
    with romdam.open_result(result) as opened:
        if as_json:
            print_document("info", info_document(opened.dataset, result))
            return
        say(*info_lines(opened.dataset))
        results = {str(opened.dataset.attrs["record"]): opened.dataset}
        say(peaks_table(results), *error_tables(results), *sliding_tables(results))
        say(*attached_tables(results))


def show(
    config: Config,
    out: Out = Path("."),
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Draw the scene of CONFIG: blocks, joints, water and materials, as OUT/<config>-scene.png."""
    from romdam.pipelines.views import show_scene
    from romdam.terminal import open_terminal

    stages, say = open_terminal(quiet, verbose)
    say(f"written: {show_scene(romdam.load_config(config), out, stages)}")


def plot(
    result: ResultFile,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            parser=named_folder,
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
    window: Window = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Draw the figures of a result as PNG and write its table of maxima; fields in 3-D where asked."""
    from romdam.pipelines.views import PlotOptions, plot_result
    from romdam.terminal import open_terminal
    from romdam.terminal.tables import maxima_table

    for option, value in (("--frames", frames), ("--window", window)):
        if value is not None and not (vtu or animation):
            raise typer.BadParameter("is of a series; give --vtu or --animation too", param_hint=option)
    stages, say = open_terminal(quiet, verbose)
    pictures = PlotOptions(fields, vtu, animation, frames or 40, window)
    with romdam.open_result(result) as opened:
        paths = plot_result(opened, out or result.parent, pictures, stages)
        say(maxima_table(opened.dataset), *(f"written: {path}" for path in paths))


def view(
    result: ResultFile,
    html: Annotated[
        Path | None,
        typer.Option(
            "--html",
            metavar="FILE",
            help="Write a page for the browser instead, one file that works offline.",
        ),
    ] = None,
    frames: Annotated[int, typer.Option(min=1, max=10_000, help="Frames of the motion.")] = 40,
    window: Window = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Show the motion of a result in 3-D, with displacement and stress, in a window or as a page."""
    from romdam.pipelines.views import view_result
    from romdam.results.series import Frames
    from romdam.terminal import open_terminal

    stages, say = open_terminal(quiet, verbose)
    with romdam.open_result(result) as opened:
        if page := view_result(opened, html, Frames(frames, window), stages):
            say(f"written: {page}")


def records(
    sources: Annotated[
        list[str],
        typer.Argument(
            metavar="LIST...", help="Jobs (YAML), manifests, folders, record files, or P-695 sets."
        ),
    ],
    plot: Annotated[
        Path | None,
        typer.Option(
            "--plot", parser=named_folder, metavar="DIR", help="Folder for a page of plots per record."
        ),
    ] = None,
    target: Annotated[
        Path | None,
        typer.Option(
            "--target",
            metavar="FILE",
            help="YAML with keys of an entry of `records:` (target, match, x_azimuth, unit, ...) for LIST.",
        ),
    ] = None,
    select: Annotated[
        int | None, typer.Option("--select", min=1, metavar="N", help="The N records nearest to the target.")
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """List ground motions, a row for each component; stderr says which cannot be read, and why.

    Where nothing of LIST is a source of records, that is bad input.
    """
    from romdam.core.files import prepare_folder
    from romdam.records.listing import as_document, failures, format_table, list_records, read_settings
    from romdam.terminal import complain, open_terminal
    from romdam.terminal.documents import print_document
    from romdam.visual.record_plots import write_record_plots
    from romdam.visual.target_plots import write_target_plots

    folder = prepare_folder(plot) if plot else None
    _, say = open_terminal(quiet, verbose, as_json)
    listed = list_records(sources, read_settings(target, select))
    if listed and all(record.no_source for record in listed):
        raise RecordError("\n".join(record.error for record in listed))
    if as_json:
        print_document("records", as_document(listed))
    else:
        say(format_table(listed))
    if folder:
        pairs = [(record.motion, record.recorded) for record in listed if record.motion]
        paths = write_record_plots(pairs, folder)
        for path in (*paths, *write_target_plots([motion for motion, _ in pairs], folder)):
            say(f"written: {path}")
    failed = failures(listed)
    complain(*(f"error: {text}" for text in failed.values()))
    if failed:
        raise typer.Exit(FAILED)
