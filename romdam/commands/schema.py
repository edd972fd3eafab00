"""The configuration's keys for editors: `romdam schema`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from romdam.commands.options import Quiet, Verbose


def schema(
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="FILE", help="Write it there instead of to stdout.")
    ] = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Print a JSON schema of configurations, by which editors complete, explain and check YAML.

    An editor finds it by a line in the YAML: # yaml-language-server: $schema=FILE
    """
    from romdam.config.schema import schema_text
    from romdam.core.files import prepare_folder, replacing
    from romdam.terminal import open_terminal

    _, say = open_terminal(quiet, verbose)
    text = schema_text()
    if out is None:
        typer.echo(text, nl=False)
        return
    prepare_folder(out.parent)
    with replacing(out) as unfinished:
        unfinished.write_text(text, encoding="utf-8")
    say(f"written: {out}")
