"""Arguments and options of several commands, and the exit codes of all."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

FAILED, BAD_INPUT, STOPPED = 1, 2, 130
EXIT_CODES = """
Exit codes: 0 all is well; 1 a record failed, a step did not converge, the disk is full, or workers or the
output were lost; 2 bad input (nothing was computed); 130 stopped by Ctrl-C, 143 by SIGTERM.
"""


def named_folder(text: str | Path) -> Path:
    """A folder that is named: an empty text would be the working directory. A default is a path already."""
    if not str(text).strip() or "\0" in str(text):
        raise typer.BadParameter("names no folder; write . for this one")
    return Path(text)


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
