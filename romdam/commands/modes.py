"""Natural modes: `romdam modes`."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

import romdam
from romdam.commands.options import Config, Out, Quiet, Verbose


class JointState(StrEnum):
    """State of the joints in a linear analysis."""

    TIED = "tied"
    BONDED = "bonded"
    OPEN = "open"


def modes(
    config: Config,
    out: Out = Path("."),
    joints: Annotated[
        JointState,
        typer.Option(help="Faces one (tied), held by K_n and K_s (bonded), or free of each other (open)."),
    ] = JointState.TIED,
    count: Annotated[int, typer.Option("--count", "-n", min=1, max=1000, help="Lowest modes.")] = 10,
    measured: Annotated[
        Path | None,
        typer.Option(
            help="CSV to compare with: frequency [Hz]; if wanted name, mode, damping, direction (x, y, z)."
        ),
    ] = None,
    vtu: Annotated[bool, typer.Option("--vtu", help="The shapes for ParaView too.")] = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Find the natural modes of CONFIG's mesh: frequencies, shapes, participation, water where it has some.

    They land in OUT/<config>-modes-<joints>.nc, with figures beside it.
    """
    from romdam.pipelines.modes import ModesOptions
    from romdam.pipelines.modes import modes as find_modes
    from romdam.terminal import open_terminal
    from romdam.terminal.tables import measured_table, modes_table

    stages, say = open_terminal(quiet, verbose)
    options = ModesOptions(joints.value, count, measured, vtu)
    result = find_modes(romdam.load_config(config), out, options, stages)
    say(modes_table(result.dataset))
    if measured is not None:
        say(measured_table(result.dataset))
    say(*(f"written: {path}" for path in result.paths))
