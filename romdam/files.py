"""Files written whole or not at all."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from romdam.errors import ResultError

_SPARE = 1 << 20  # bytes of a file beside its arrays


@contextmanager
def replacing(path: Path, size: int = 0) -> Iterator[Path]:
    """Give a temporary name in the same folder, renamed to `path` once the body has ended well.

    Parameters
    ----------
    size : bytes that the file may take. HDF5 does not survive a disk that fills while it writes, so that
        room is asked for beforehand

    Raises
    ------
    ResultError
        where the operating system refuses the file, or has no room for it.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    if size:
        _refuse_full_disk(path, size + _SPARE)
    try:
        yield part
        os.replace(part, path)
    except OSError as error:
        raise ResultError(
            f"{path}: cannot be written ({error}); free the disk or choose another folder"
        ) from error
    finally:
        part.unlink(missing_ok=True)


def _refuse_full_disk(path: Path, size: int) -> None:
    try:
        free = shutil.disk_usage(path.parent).free
    except OSError:
        return  # the writing itself says what is wrong
    if free < size:
        raise ResultError(
            f"{path}: cannot be written, it may take {size / 1e6:.1f} MB and {free / 1e6:.1f} MB are free; "
            "free the disk or choose another folder"
        )


def sweep_parts(folder: Path) -> None:
    """Remove what writers that were killed have left in a folder; only where nobody else is writing."""
    for part in folder.glob(".*.part"):
        part.unlink(missing_ok=True)


def prepare_folder(folder: Path) -> Path:
    """Make an output folder and prove that it takes files, before anything is computed.

    Raises
    ------
    ResultError
        where it cannot be made or written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ResultError(f"{folder}: the output folder cannot be made ({error}); choose another") from error
    with replacing(folder / ".writable") as part:
        part.touch()
    (folder / ".writable").unlink()
    return folder
