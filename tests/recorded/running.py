"""A recorded job: its inputs, its commands in this process, and the digest of all that they write and say."""

from __future__ import annotations

import io
import json
import os
import re
import shutil
import sys
from collections.abc import Iterator
from contextlib import ExitStack, chdir, contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any
from unittest.mock import patch

import digest
import inputs
from jobs import JOBS

from romdam import cli
from romdam.core.files import replacing

HERE = Path(__file__).parent
REFERENCES = HERE / "references"
_DOT = b"\x89PNG\r\n\x1a\n"
# what states CPU times among its numbers
TIMED = re.compile(
    r"compared\.yaml.*stdout|comparison-cost|comparison\.(?:html|md)|study (?:linear.*stdout|.*study\.png)"
    r"|study/study\.(?:md|csv)|study.*figure|study\.nc:(?:cheapest_case|on_front)"
)
_ENVIRONMENT = {"COLUMNS": "200", "MPLBACKEND": "agg", "OPENBLAS_THREAD_TIMEOUT": "18"}


def called(line: str) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of a command line."""
    out, err = io.StringIO(), io.StringIO()
    with (
        patch.object(sys, "argv", ["romdam", *line.split()]),
        patch.dict(os.environ, _ENVIRONMENT),
        redirect_stdout(out),
        redirect_stderr(err),
    ):
        try:
            cli.main()
        except SystemExit as stop:
            return int(stop.code or 0), out.getvalue(), err.getvalue()
    return 0, out.getvalue(), err.getvalue()


@contextmanager
def figures_as_numbers() -> Iterator[digest.Digest]:
    """Figures are built, and their digest is kept; pixels are not."""
    from romdam.visual import field_views, mode_views, plots, scene_view
    from romdam.visual.report.parts import PagePicture

    seen: digest.Digest = {}

    def kept(figure: Any, path: Path) -> Path:
        seen[f"figure {Path(path).name}"] = digest.of_figure(figure)
        with replacing(path) as unfinished:
            Path(unfinished).write_bytes(_DOT)
        return path

    def drawn(self: Any, kind: str, dpi: float | None = None) -> bytes:
        seen.setdefault(f"figure {len(seen)} of a page", digest.of_figure(self.drawing))
        return b"<svg/>" if kind == "svg" else _DOT

    with ExitStack() as stack:
        for module in (plots, field_views, mode_views, scene_view):
            stack.enter_context(patch.object(module, "save_figure", kept))
        stack.enter_context(patch.object(PagePicture, "_saved", drawn))
        yield seen


def recorded(name: str, folder: Path) -> digest.Digest:
    """Run a job's commands in an empty folder.

    Raises
    ------
    AssertionError
        where a command ends with another exit code than the job states.
    """
    shutil.copytree(HERE / "jobs" / name, folder, dirs_exist_ok=True)
    inputs.write(folder)
    if name == "records":
        inputs.write_formats(folder)
    if name == "meshes":
        inputs.write_meshes(folder)
    before = {path for path in folder.rglob("*") if path.is_file()}
    found: digest.Digest = {}
    with chdir(folder), figures_as_numbers() as figures:
        for number, line in enumerate(JOBS[name]):
            wanted, _, command = line.partition(" ") if line[0].isdigit() else ("0", "", line)
            code, out, err = called(command)
            assert code == int(wanted), f"romdam {command}: exit code {code}\n{err[-3000:]}"
            said = f"{number + 1} romdam {command}"
            found[f"{said}: stdout"] = (
                digest.of_leaves(json.loads(out)) if out[:1] == "{" else digest.of_text(out)
            )
            found[f"{said}: stderr"] = digest.of_text(err)
            found |= {f"{said}: {what}": entry for what, entry in figures.items()}
            figures.clear()
    for path in sorted(folder.rglob("*")):
        inside = path.relative_to(folder).as_posix()
        if path.is_file() and path not in before and "cache" not in inside and ".log" not in inside:
            inside = digest.FINGERPRINT.sub("-*", inside)
            found[f"file {inside}"] = ["there"]
            found |= dict(digest.of_file(path, inside))
    return {thing: entry for thing, entry in found.items() if not TIMED.search(thing)}
