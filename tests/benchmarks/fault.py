"""A planted fault: one text of a file in place of another."""

from __future__ import annotations

from dataclasses import dataclass

COMPILED = ("contact", "records", "timestepping")  # rooms whose compiled functions follow from their files


@dataclass(frozen=True)
class Fault:
    """One text of a file in place of another.

    Attributes
    ----------
    room : of the file, which is `file` from the room on
    file : path from the root of the tree
    old : text that stands there exactly once
    new : what is put in its place
    tests : what is run, as pytest takes it: narrow, some seconds
    """

    room: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]


def faults_in(file: str, tests: tuple[str, ...], *pairs: tuple[str, str]) -> list[Fault]:
    """Faults of one file of the package, or of `pipelines/`."""
    room = file.partition("/")[0]
    path = file if room == "pipelines" else f"romdam/{file}"
    return [Fault(room, path, old, new, tests) for old, new in pairs]
