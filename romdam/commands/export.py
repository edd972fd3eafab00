"""`romdam export`: the model of a job for other programs."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

import romdam
from romdam.commands.caches import Cache, NoCache, folder_of_blocks
from romdam.commands.options import Config, Out, Quiet, Verbose


class Target(StrEnum):
    """What a job can be written for."""

    matrices = "matrices"


def export(
    config: Config,
    to: Annotated[Target, typer.Option("--to", help="What the files are for.")],
    out: Out,
    cache: Cache = None,
    no_cache: NoCache = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Write the model of CONFIG for other programs.

    `matrices`: K, M, C, gap operator and loads of each block and of the system, as Matrix Market and HDF5;
    reduced or of the whole mesh, as `model.order` says.
    """
    from romdam.pipelines.export import export_matrices
    from romdam.terminal import open_terminal

    stages, say = open_terminal(quiet, verbose)
    paths = export_matrices(romdam.load_config(config), out, stages, folder_of_blocks(cache, no_cache))
    say(*(f"written: {path}" for path in paths))
