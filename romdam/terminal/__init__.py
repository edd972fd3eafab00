"""Output that a person sees in a terminal: progress on stderr, tables on stdout."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.logging import RichHandler
from rich.progress import (
    BarColumn,
    Progress,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table

Terminal = tuple["Stages", Callable[..., None]]

DELAY = 2.0  # seconds before a stage shows a bar: shorter ones would only flicker
EVERY = 30.0  # seconds between two lines about a stage where there is no terminal
_WIDE = 10_000  # columns: a table is as wide as its numbers, a narrow terminal must not cut them


class Stages:
    """Shows each stage with a bar and the time left, once it takes longer than `DELAY`.

    Where the output is no terminal, a stage that takes longer than `EVERY` writes a line so often. Called
    with a stage's text, it is a context manager giving a callable for (steps done, steps in all).
    """

    def __init__(self, console: Console, quiet: bool) -> None:
        self._console = console
        self._quiet = quiet

    @contextmanager
    def __call__(self, text: str) -> Iterator[Callable[[int, int], None]]:
        if self._quiet:
            yield _ignore
            return
        if not self._console.is_terminal:
            with _lines(self._console, text) as progress:
                yield progress
            return
        columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
        bar = Progress(
            *columns, TextColumn("left"), TimeRemainingColumn(), console=self._console, transient=True
        )
        task = bar.add_task(text, total=None)
        timer = threading.Timer(DELAY, bar.start)
        timer.daemon = True
        timer.start()
        try:
            yield lambda done, total: bar.update(task, completed=done, total=total)
        finally:
            timer.cancel()
            timer.join()
            bar.stop()


@contextmanager
def _lines(console: Console, text: str) -> Iterator[Callable[[int, int], None]]:
    """Write now and then how far a stage is, also while it tells nothing of it."""
    begun, state, ended = time.monotonic(), [0, 0], threading.Event()

    def write() -> None:
        while not ended.wait(EVERY):
            console.print(_line(text, time.monotonic() - begun, *state), soft_wrap=True, markup=False)

    def progress(done: int, total: int) -> None:
        state[:] = done, total

    writer = threading.Thread(target=write, daemon=True)
    writer.start()
    try:
        yield progress
    finally:
        ended.set()
        writer.join()


def _line(text: str, seconds: float, done: int, total: int) -> str:
    """Time that a stage has taken, and what is left if it goes on so."""
    if done <= 0 or total <= 0:
        return f"{text}: {seconds:.0f} s"
    left = seconds * (total - done) / done
    return f"{text}: {100.0 * done / total:.0f} % in {seconds:.0f} s, about {left:.0f} s left"


def open_terminal(quiet: bool = False, verbose: bool = False) -> Terminal:
    """Progress and log on stderr, and a printer to stdout that `quiet` silences."""
    errors = Console(stderr=True)
    output = Console(soft_wrap=True, highlight=False, emoji=False, width=_WIDE)
    level = logging.INFO if verbose else logging.ERROR if quiet else logging.WARNING
    handler = RichHandler(console=errors, show_path=False)
    # what happens to its workers is in messages of romdam's own
    handler.addFilter(lambda record: not record.name.startswith(("asyncio", "distributed")))
    logging.basicConfig(level=level, format="%(message)s", handlers=[handler])
    # a first start says what it waits for
    logging.getLogger("romdam.core.jit").setLevel(logging.ERROR if quiet else logging.INFO)

    def say(*lines: object) -> None:
        for line in lines if not quiet else ():
            if isinstance(line, Table) and not output.is_terminal:  # columns, for grep and awk
                line.box, line.pad_edge = None, False
            output.print(line, markup=False)

    return Stages(errors, quiet), say


def _ignore(done: int, total: int) -> None:
    """Show nothing."""
