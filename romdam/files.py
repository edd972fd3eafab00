"""Files written whole or not at all, and read only where they are files of a size that can be meant."""

from __future__ import annotations

import os
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from romdam.errors import ResultError, RomdamError, shown

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


def keep_standard_files() -> None:
    """Open what is closed of standard input, output and error on the null device.

    Else the next file that is opened gets its number, and what a library writes there lands in a result.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free


def check_file(path: Path, most: float, error: type[RomdamError]) -> None:
    """Refuse what is not an ordinary file, or larger than anything of its kind, before it is opened.

    A device or a pipe would be read without end, or waited for without end.

    Parameters
    ----------
    most : bytes
    error : what is raised; one of `romdam.errors`

    Raises
    ------
    RomdamError
        of the class `error`, where the path names no file, no ordinary file, or too large a one.
    """
    try:
        about = path.stat()
    except FileNotFoundError:
        raise error(f"{path}: no such file") from None
    except (OSError, ValueError) as problem:  # ValueError: a NUL in the name
        raise error(f"{shown(str(path))}: cannot be read ({problem})") from None
    if not stat.S_ISREG(about.st_mode):
        kind = "a folder" if stat.S_ISDIR(about.st_mode) else "a device, pipe or socket"
        raise error(f"{path}: is {kind}; give a file")
    if about.st_size > most:
        raise error(
            f"{path}: has {about.st_size / 1e6:.0f} MB, at most {most / 1e6:.0f} MB are read; "
            "is this the file that was meant?"
        )
