"""Jobs to begin with: `romdam init`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from romdam.commands.options import Quiet, Verbose, named_folder


def init(
    example: Annotated[str | None, typer.Argument(help="Which; without it they are listed.")] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", parser=named_folder, metavar="DIR", help="Folder, made if needed; or this one."
        ),
    ] = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Write a commented job to begin with: its configuration, and beside it what that names.

    The schema for editors is written too; the configuration's first line names it.
    """
    from romdam.examples import EXAMPLES, write
    from romdam.terminal import open_terminal

    _, say = open_terminal(quiet, verbose)
    if example is None:
        for name, (_, what) in EXAMPLES.items():
            say(f"{name:16} {what}")
        return
    if example not in EXAMPLES:
        raise typer.BadParameter(f"{example!r} is none of {', '.join(EXAMPLES)}", param_hint="EXAMPLE")
    written = write(example, out or Path())
    say(*(f"written: {path}" for path in written))
    say(f"run it: romdam run {written[0]} --out {(out or Path()) / 'results'}")
