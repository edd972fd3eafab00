"""Companion files of results, `<kind>-<first 12 of its content's SHA-256>.h5`.

Each is written once and verified by its SHA-256 when it is read.
A result names the file, and the name says what must stand in it. So a file of another model under the right
name is refused, and so is one without a digest of its bytes whose content is another.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import h5py

from romdam.core.errors import ResultError, WriteError, quote
from romdam.core.files import private_folder
from romdam.core.sealed import FAILURES, creating, examine, reading, text_of
from romdam.core.version import SOURCE

_DIGITS = 12
_LOOKED_INTO = 2  # of the files of a kind, the newest: each is read whole, the arch dam's in 0.4 s of CPU


def write_companion_file(
    folder: Path,
    about: tuple[str, str],
    fill: Callable[[h5py.File], str],
    size: int,
    made_of: str | None = None,
) -> str:
    """Write a companion file unless it is there and whole; return its name.

    Parameters
    ----------
    about : kind, the name's first part, and the format that the file's attributes say
    fill : puts the content into the open file, and gives its SHA-256
    size : bytes that it takes
    made_of : digest that differs where contents do, cheap to make: a whole file of it, one of the newest
        there, is taken as it is

    Raises
    ------
    WriteError
        where the folder or the disk refuses it.
    """
    kind, layout = about
    if made_of is not None and (there := find_companion_file(folder, about, made_of)) is not None:
        return there.name
    try:
        with private_folder(folder) as private:
            unnamed = private / f"{kind}.h5"
            with creating(unnamed, size) as file:
                digest = fill(file)
                file.attrs.update(format=layout, content_sha256=digest, source=SOURCE)
                if made_of is not None:
                    file.attrs["made_of"] = made_of
            path = folder / f"{kind}-{digest[:_DIGITS]}.h5"
            if not _is_written(path, digest):
                os.replace(unnamed, path)
    except OSError as error:
        raise WriteError(f"{folder}: cannot be written ({error}); choose another folder") from error
    return path.name


def find_companion_file(folder: Path, about: tuple[str, str], made_of: str) -> Path | None:
    """Find a whole file of the same content among the newest of its kind; None where there is none.

    Parameters
    ----------
    about, made_of : see `write_companion_file`
    """
    kind, layout = about
    written = {}
    for path in folder.glob(f"{kind}-{'?' * _DIGITS}.h5"):
        with suppress(FileNotFoundError):  # another job may have taken it away
            written[path] = path.stat().st_mtime_ns
    for path in sorted(written, key=lambda path: (written[path], path), reverse=True)[:_LOOKED_INTO]:
        try:
            with reading(path, only_sealed=True) as file:
                named = text_of(file, "content_sha256")[:_DIGITS] == path.stem.rpartition("-")[2]
                alike = text_of(file, "format") == layout and text_of(file, "made_of") == made_of
                if named and alike:
                    return path
        except ResultError:
            continue
    return None


def _is_written(path: Path, digest: str) -> bool:
    """Tell whether the file is there and whole: a foreign or broken one is written again."""
    if not path.is_file():
        return False
    try:
        with reading(path, only_sealed=True) as file:
            return text_of(file, "content_sha256") == digest
    except ResultError:
        return False


def open_companion_file(
    result: Path, name: str, about: tuple[str, ...], content: Callable[[h5py.File], str]
) -> h5py.File:
    """Open the companion file of a name in the folder of a result.

    Parameters
    ----------
    about : kind, format, and those of versions before that can be read
    content : the SHA-256 of what stands in an open file, asked for where its bytes carry no digest

    Raises
    ------
    ResultError
        where it is not there, damaged, or of another model, version or kind.
    """
    kind, *layouts = about
    name = Path(name).name  # a result never points outside its own folder
    if not re.fullmatch(rf"{kind}-[0-9a-f]{{{_DIGITS}}}\.h5", name):
        raise ResultError(f"{result}: its attribute {kind}_file names no such file: {quote(name)}")
    path = result.with_name(name)
    try:
        sealed = examine(path).sealed
    except ResultError as error:
        raise ResultError(
            f"{error}; it stands beside {result.name}, which cannot be read without; run it again"
        ) from error
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        raise ResultError(f"{path}: cannot be opened ({error})") from error
    try:
        if text_of(file, "format") not in layouts:
            raise ResultError(
                f"{path}: is of format {quote(text_of(file, 'format'))}, this version reads {layouts[0]!r}; "
                "run it again"
            )
        try:
            digest = text_of(file, "content_sha256") if sealed else content(file)
        except FAILURES as error:
            raise ResultError(f"{path}: is not what romdam writes ({error!r}); run it again") from error
        if path.stem.rpartition("-")[2] != digest[:_DIGITS]:
            raise ResultError(
                f"{path}: holds another model than its name says (SHA-256 {quote(digest[:_DIGITS])}); "
                "run it again"
            )
    except BaseException:
        file.close()
        raise
    return file


def in_order(file: h5py.File) -> list[tuple[str, h5py.Group]]:
    """The blocks of a file as they were written, one after another."""
    return sorted(file["blocks"].items(), key=lambda item: h5py.h5o.get_info(item[1].id).addr)
