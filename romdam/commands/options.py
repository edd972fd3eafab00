"""Arguments and options of several commands, and the exit codes of all."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from romdam.core.errors import ConvergenceError, OutputError, RomdamError, WorkerError, WriteError

FAILED, BAD_INPUT, STOPPED = 1, 2, 130
EXIT_CODES = """
Exit codes: 0 all is well; 1 a record failed, a step did not converge, the disk is full, or workers or the
output were lost; 2 bad input (nothing was computed); 130 stopped by Ctrl-C, 143 by SIGTERM.
"""
_FAILURES = (ConvergenceError, WorkerError, OutputError, WriteError)


def exit_code(error: BaseException) -> int:
    """The code that an error ends the command with."""
    if isinstance(error, RomdamError):
        return FAILED if isinstance(error, _FAILURES) else BAD_INPUT
    if isinstance(error, KeyboardInterrupt):
        return STOPPED
    if (number := getattr(error, "number", None)) is not None:  # of a signal
        return 128 + int(number)
    return int(getattr(error, "exit_code", FAILED))


def named_folder(text: str | Path) -> Path:
    """A folder that is named: an empty text would be the working directory. A default is a path already."""
    if not str(text).strip() or "\0" in str(text):
        raise typer.BadParameter("names no folder; write . for this one")
    return Path(text)


def _interval(seconds: tuple[float, float] | None) -> tuple[float, float] | None:
    """Seconds that go from a first to a later one, as they are."""
    if seconds is not None and not 0.0 <= seconds[0] < seconds[1] < float("inf"):
        raise typer.BadParameter(f"goes from a first to a later second, got {seconds[0]:g} to {seconds[1]:g}")
    return seconds


Config = Annotated[Path, typer.Argument(help="YAML file of the job.", metavar="CONFIG")]
ResultFile = Annotated[Path, typer.Argument(help="NetCDF file that `romdam run` wrote.", metavar="RESULT")]
Out = Annotated[
    Path,
    typer.Option(
        "--out", "-o", parser=named_folder, metavar="DIR", help="Folder for the results; made if needed."
    ),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Tell what is done and how long it takes.")]
Json = Annotated[
    bool,
    typer.Option("--json", help="Print one JSON object on stdout, and all else on stderr."),
]
Window = Annotated[
    tuple[float, float] | None,
    typer.Option(
        callback=_interval,
        help="First and last second of the motion; 2 s around the largest displacement if not given.",
    ),
]
