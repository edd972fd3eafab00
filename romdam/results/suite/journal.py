"""The finished rows of a suite on disk: `rows.jsonl`, a line for each, with its SHA-256 before it.

A line is appended when its run is done, and never changed; of two lines of one run the later counts. What is
damaged, or was cut by a process that was killed, does not match its SHA-256 and counts as not there.
"""

from __future__ import annotations

import hashlib
import json
import logging
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from romdam.core.errors import ResultError, WriteError
from romdam.core.files import check_file, replacing
from romdam.results.suite.rows import Kept, SuiteRow

log = logging.getLogger(__name__)

JOURNAL = "rows.jsonl"
_MOST = 50e9  # bytes
_LONGEST = 1 << 28  # bytes of a line
_DIGITS = 64
_UNSTATED = "romdam 0.1.0"  # which did not yet state itself in its rows


def append_rows(path: Path, rows: Iterable[SuiteRow]) -> None:
    """Add rows at the end of a journal.

    Raises
    ------
    WriteError
        where the folder or the disk refuses them.
    """
    # a line of its own, whatever a process that was killed has left before it
    lines = memoryview(b"".join(b"\n" + _line(row) + b"\n" for row in rows))
    try:
        with path.open("ab", buffering=0) as file:
            before = file.tell()
            try:
                while lines:
                    lines = lines[file.write(lines) :]
            except OSError:
                file.truncate(before)
                raise
    except OSError as error:
        raise WriteError(
            f"{path}: cannot be written ({error}); free the disk or choose another folder"
        ) from error


def read_rows(path: Path) -> dict[str, SuiteRow]:
    """Key -> row of every row of a journal that is whole.

    Raises
    ------
    ResultError
        where something else than a file has the journal's name, or it cannot be read.
    """
    if not path.exists():
        return {}
    check_file(path, _MOST, ResultError)
    rows, damaged = dict[str, SuiteRow](), 0
    try:
        with path.open("rb") as file:
            for line in iter(lambda: file.readline(_LONGEST), b""):
                if line.strip():
                    row = _row(line)
                    damaged += row is None
                    rows |= {} if row is None else {row.key: row}
    except OSError as error:
        raise ResultError(f"{path}: cannot be read ({error})") from error
    if damaged:
        log.warning("%s: %d lines are damaged or cut; what they held is made again", path, damaged)
    return rows


def rewrite_rows(path: Path, rows: Iterable[SuiteRow]) -> None:
    """Replace a journal by one with these rows alone, whole or not at all.

    Raises
    ------
    ResultError
        where the folder or the disk refuses it.
    """
    with replacing(path) as unfinished:
        unfinished.touch()
        append_rows(unfinished, rows)


def _line(row: SuiteRow) -> bytes:
    values = {name: np.asarray(value).tolist() for name, value in row.values.items()}
    kept = None if row.kept is None else vars(row.kept)
    about = {
        "key": row.key,
        "message": row.message,
        "values": values,
        "kept": kept,
        "source": row.source,
        "warnings": row.warnings,
    }
    text = json.dumps(about).encode()
    return hashlib.sha256(text).hexdigest().encode() + b" " + text


def _row(line: bytes) -> SuiteRow | None:
    """The row of a line; None where it is not what was written."""
    digest, text = line[:_DIGITS], line[_DIGITS + 1 :].rstrip(b"\n")
    if hashlib.sha256(text).hexdigest().encode() != digest:
        return None
    try:
        about = json.loads(text)
        values = {name: np.array(value, dtype=float) for name, value in about["values"].items()}
        kept = None if about["kept"] is None else Kept(**about["kept"])
        warnings = tuple(map(str, about.get("warnings", ())))
        source = about.get("source", _UNSTATED)
        return SuiteRow(about["key"], about["message"], values, kept, source=source, warnings=warnings)
    except (ValueError, KeyError, TypeError, AttributeError):  # whole, but not of this version
        return None
