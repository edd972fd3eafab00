"""Output that a person sees in a terminal: progress and log on stderr, tables on stdout."""

from __future__ import annotations

import logging
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.logging import RichHandler
from rich.progress import BarColumn, Progress, ProgressColumn, SpinnerColumn, Task, TextColumn
from rich.table import Column, Table
from rich.text import Text

from romdam.core.counted import Counted
from romdam.core.errors import ConfigError
from romdam.core.printable import printable
from romdam.terminal.run_log import SAID

Terminal = tuple["Stages", Callable[..., None]]

DELAY = 2.0  # seconds before a stage shows a bar: shorter ones would only flicker
EVERY = 30.0  # seconds between two lines about a stage where there is no terminal
STAMP = "%Y-%m-%d %H:%M:%S"
_BAR = 16  # columns, which leave room for the times in a terminal of 80
_SURE = 0.02  # of a stage, before which what is left is a guess of no use
_WIDE = 10_000  # columns: a table is as wide as its numbers, a narrow terminal must not cut them
_COMPILING = "romdam.core.kept_code"  # a first start says what it waits for
# told in messages of romdam's own
_ELSEWHERE = ("asyncio", "distributed", SAID.name)


class Stages:
    """Shows each stage with a bar, the time it has taken and what is left, once it takes longer than `DELAY`.

    Where the output is no terminal, a stage that takes longer than `EVERY` writes a line so often. Called
    with a stage's text, it is a context manager giving a callable for (steps done, steps in all).
    """

    def __init__(self, console: Console, quiet: bool) -> None:
        self._console = console
        self._quiet = quiet

    @contextmanager
    def __call__(self, text: str) -> Iterator[Callable[[int, int], None]]:
        if self._quiet:
            yield lambda done, total: None
            return
        counted = text if isinstance(text, Counted) else None
        text = printable(text)
        if not self._console.is_terminal:
            with _lines(self._console, text, counted) as progress:
                yield progress
            return
        name = TextColumn(
            "{task.description}", markup=False, table_column=Column(overflow="fold")
        )  # alone gives way
        columns = (SpinnerColumn(), name, BarColumn(_BAR), _Times())
        bar = Progress(*columns, console=self._console, transient=True)
        task = bar.add_task(text, total=None)
        timer = threading.Timer(DELAY, bar.start)
        timer.daemon = True
        timer.start()
        try:

            def update(done: int, total: int) -> None:
                name = text if counted is None else printable(counted.done(done, total))
                bar.update(task, completed=done, total=total, description=name)

            yield update
        finally:
            timer.cancel()
            timer.join()
            bar.stop()


class _Times(ProgressColumn):
    """The time that a stage has taken and, where it tells how far it is, what is left."""

    def render(self, task: Task) -> Text:
        """Write both, each with its word."""
        return Text(times(task.elapsed or 0.0, task.completed, task.total or 0.0))


@contextmanager
def _lines(console: Console, text: str, counted: Counted | None) -> Iterator[Callable[[int, int], None]]:
    """Write now and then how far a stage is, also while it tells nothing of it."""
    begun, state, ended = time.monotonic(), [0, 0], threading.Event()

    def write() -> None:
        while not ended.wait(EVERY):
            done, total = state
            share = f"{100.0 * done / total:.0f} %, " if done > 0 and total > 0 else ""
            name = text if counted is None else counted.done(done, total)
            line = f"{name}: {share}{times(time.monotonic() - begun, done, total)}"
            console.print(f"{time.strftime(STAMP)} {line}", soft_wrap=True, markup=False, highlight=False)

    def progress(done: int, total: int) -> None:
        state[:] = done, total

    writer = threading.Thread(target=write, daemon=True)
    writer.start()
    try:
        yield progress
    finally:
        ended.set()
        writer.join()


def times(seconds: float, done: float, total: float) -> str:
    """Time that a stage has taken, and what is left if it goes on so; none before anything is known of it."""
    if not total > 0.0 or done < _SURE * total:
        return f"{_clock(seconds)} elapsed"
    return f"{_clock(seconds)} elapsed, {_clock(seconds * (total - done) / done)} left"


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02}:{rest:02}"


def open_terminal(quiet: bool = False, verbose: bool = False, as_json: bool = False) -> Terminal:
    """Progress and log on stderr, and a printer that `quiet` silences.

    Parameters
    ----------
    as_json : whether stdout is for one JSON object, so that the printer writes to stderr

    Raises
    ------
    ConfigError
        where both more and less is wanted.
    """
    if quiet and verbose:
        raise ConfigError("--verbose: is the opposite of --quiet; give one of the two")
    errors = Console(stderr=True)
    output = Console(soft_wrap=True, highlight=False, emoji=False, markup=False, width=_WIDE, stderr=as_json)
    # the log goes to stderr from a level on: coloured to a terminal, else whole lines with the time
    level = logging.INFO if verbose else logging.ERROR if quiet else logging.WARNING
    handler: logging.Handler = RichHandler(console=errors, show_path=False)
    handler.setFormatter(_Plain("%(message)s"))
    if not errors.is_terminal:
        handler = logging.StreamHandler()
        handler.setFormatter(_Plain("%(asctime)s %(levelname)s %(message)s", STAMP))

    def wanted(record: logging.LogRecord) -> bool:
        least = min(level, logging.INFO) if record.name == _COMPILING and level < logging.ERROR else level
        return record.levelno >= least and not record.name.startswith(_ELSEWHERE)

    handler.addFilter(wanted)
    logging.basicConfig(level=level, handlers=[handler])
    logging.getLogger(_COMPILING).setLevel(min(level, logging.INFO))

    def say(*lines: object) -> None:
        for line in lines:
            if isinstance(line, str):
                line = printable(line)
                SAID.debug("%s", line)
            if quiet:
                continue
            if isinstance(line, Table) and not output.is_terminal:  # columns, for grep and awk
                line.box, line.pad_edge = None, False
            output.print(line, markup=False)

    return Stages(errors, quiet), say


@contextmanager
def only_errors(verbose: bool) -> Iterator[None]:
    """Leave out warnings, such as of unusual values, where models are not a user's; not if `verbose`."""
    logger = logging.getLogger("romdam")
    level = logger.level
    logger.setLevel(level if verbose else logging.ERROR)
    try:
        yield
    finally:
        logger.setLevel(level)


def complain(*lines: str) -> None:
    """Write to stderr what went wrong."""
    for line in lines:
        SAID.error("%s", line)
        print(printable(line), file=sys.stderr)


class _Plain(logging.Formatter):
    """Lines without control characters."""

    def format(self, record: logging.LogRecord) -> str:
        return printable(super().format(record))
