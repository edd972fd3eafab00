"""`romdam cache`: reduced blocks that single jobs have kept; and the options of commands that use them."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

import romdam
from romdam.commands.options import Json, Quiet, Verbose

Cache = Annotated[
    Path | None,
    typer.Option(
        help="Folder of reduced blocks; `romdam cache` names that of single jobs, a suite's is in OUT."
    ),
]
NoCache = Annotated[bool, typer.Option("--no-cache", help="Reduce anew, and keep no reduced blocks.")]


class Action(StrEnum):
    """Action on the cache."""

    LIST = "list"
    CLEAR = "clear"


def folder_of_blocks(cache: Path | None, no_cache: bool) -> Path | None:
    """Folder that the options name; None where nothing is to be kept."""
    if cache is not None and no_cache:
        raise typer.BadParameter("is the opposite of --cache; give one of the two", param_hint="--no-cache")
    return None if no_cache else cache or romdam.cache_folder()


def cache(
    action: Annotated[Action, typer.Argument(help="list or clear.")] = Action.LIST,
    as_json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """List, or clear, the reduced blocks that `romdam run` and `romdam check` have kept for the next start.

    What was used longest ago goes by itself at 10 GB.
    """
    from romdam.reduction.storage.user_cache import LIMIT, entries, remove
    from romdam.terminal import open_terminal
    from romdam.terminal.documents import cache_document, print_document
    from romdam.terminal.lines import cache_lines

    _, say = open_terminal(quiet, verbose, as_json)
    folder = romdam.cache_folder()
    kept, limit = entries(folder), LIMIT if action is Action.LIST else None
    if action is Action.CLEAR:
        kept = [entry for entry in kept if remove(entry)]
    if as_json:
        print_document("cache", cache_document(kept, folder, limit))
        return
    say(*cache_lines(kept, folder, limit))
