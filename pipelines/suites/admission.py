"""Proof that a dask worker gives before it computes: the same code and versions as here, and the same folder.

The text of this module is sent, and run by the worker: it may have another Python, another romdam or none.
So this needs the standard library alone (and psutil, which comes with dask), and what computes is imported
once all is proved.
"""

from __future__ import annotations

import hashlib
import platform
from importlib import import_module
from pathlib import Path
from typing import Any

_NUMERICAL = ("numpy", "scipy", "numba")
_CHANGED = "changed on disk since the process started"
_SLACK = 1.0  # seconds that the start of a process is known to


def installed() -> dict[str, str]:
    """Versions of what makes the numbers in this process, and the SHA-256 of romdam's sources."""
    versions = {"Python": platform.python_version().rpartition(".")[0]}
    for name in ("romdam", *_NUMERICAL):
        try:
            versions[name] = str(import_module(name).__version__)
        except Exception as error:  # whatever an import may raise
            versions[name] = f"not there ({error})"
    try:
        versions["the code of romdam"] = _code()
    except (ImportError, OSError) as error:
        versions["the code of romdam"] = f"not there ({error})"
    return versions


def _code() -> str:
    """SHA-256 of romdam's Python files; or that this process may have loaded others than are there now."""
    started = import_module("psutil").Process().create_time()
    files: dict[str, Path] = {}
    for name in ("romdam", "romdam.pipelines"):  # two folders in a checkout, one in the other elsewhere
        for folder in map(Path, import_module(name).__path__):
            files |= {
                f"{name.replace('.', '/')}/{path.relative_to(folder).as_posix()}": path
                for path in folder.rglob("*.py")
            }
    if max(path.stat().st_ctime for path in files.values()) > started + _SLACK:
        return _CHANGED
    whole = hashlib.sha256()
    for name, path in sorted(files.items()):
        whole.update(f"{name}\n".encode() + path.read_bytes())
    return whole.hexdigest()[:16]


def problem(expected: dict[str, str], path: str) -> str:
    """Say why this process may not compute; empty where it may.

    Parameters
    ----------
    expected : what `installed` gives where the results are wanted
    path : of a file that was left in the folder of the results
    """
    versions = installed()
    wrong = [
        f"{name} is {versions[name]}, here {value}"
        for name, value in expected.items()
        if versions[name] != value or value == _CHANGED
    ]
    if wrong:
        return f"{'; '.join(wrong)}; install the same there as here and start both again"
    try:
        open(path, "rb").close()
    except OSError as error:
        return (
            f"does not see the output folder ({error}); give --out a folder that every worker reaches under "
            "the same path"
        )
    return ""


def perform(expected: dict[str, str], shared: tuple[str, str], work: bytes) -> tuple[str, Any]:
    """Do a task: why this worker may not, or the result.

    Parameters
    ----------
    expected : see `problem`
    shared : path and SHA-256 of the file with the data of all tasks
    work : the function and its task, pickled
    """
    refusal = problem(expected, shared[0])
    if refusal:
        return f"worker {import_module('distributed').get_worker().address}: {refusal}", None
    return "", import_module("romdam.pipelines.suites.cluster").compute(shared, work)
