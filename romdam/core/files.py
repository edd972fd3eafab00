"""Files written whole or not at all, and read only where they are files of a size that can be meant."""

from __future__ import annotations

import errno
import os
import re
import shutil
import stat
import tempfile
import weakref
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from romdam.core.errors import ResultError, RomdamError, WriteError, quote

try:
    import fcntl
except ImportError:  # Windows: folders of writers are then neither locked nor swept
    fcntl = None  # type: ignore[assignment]

_SPARE = 1 << 20  # bytes of a file beside its arrays
_PREFIX, _SUFFIX = ".romdam-", ".part"
_EARLIER = re.compile(r"\..+\.\d+\.part")  # what romdam 0.1 left: one file, named by its process
_TRIES = 8


@contextmanager
def replacing(path: Path, size: int = 0) -> Iterator[Path]:
    """Give a temporary name on the same disk, moved to `path` once the body has ended well.

    It stands in a folder of its own, which nobody else can name beforehand or write into. What has been moved
    is on the disk: a power failure leaves the whole file, or what was there before.

    Parameters
    ----------
    size : bytes that the file may take, asked for before anything is written

    Raises
    ------
    WriteError
        where the operating system refuses the file, or has no room for it, and for a device, which a file
        would replace.
    """
    if path.is_char_device() or path.is_block_device():
        raise WriteError(f"{path}: cannot be written, it is a device; give the path of a file")
    free = float("inf")
    if size:
        with suppress(OSError):  # the writing itself says what is wrong
            free = shutil.disk_usage(path.parent).free
    if free < size + _SPARE:
        raise WriteError(
            f"{path}: cannot be written, it may take {(size + _SPARE) / 1e6:.1f} MB and {free / 1e6:.1f} MB "
            "are free; free the disk or choose another folder"
        )
    try:
        with private_folder(path.parent) as folder:
            unfinished = folder / path.name
            yield unfinished
            with unfinished.open("rb+") as file:
                os.fsync(file.fileno())
            os.replace(unfinished, path)
    except OSError as error:
        raise WriteError(
            f"{path}: cannot be written ({error}); free the disk or choose another folder"
        ) from error


class Unkept:
    """A folder among the temporary files that is removed when nothing refers to this any more.

    Attributes
    ----------
    path : of the folder
    """

    def __init__(self) -> None:
        self.path = Path(tempfile.mkdtemp(prefix="romdam-"))
        weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)


@contextmanager
def private_folder(parent: Path) -> Iterator[Path]:
    """A folder that only this writer knows, locked while it lives; removed at the end."""
    folder, lock = locked_folder(parent)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        os.close(lock)


def locked_folder(parent: Path) -> tuple[Path, int]:
    """A new folder in another one, and the descriptor that keeps `sweep_parts` from it until it is closed."""
    for _ in range(_TRIES):
        folder = Path(tempfile.mkdtemp(prefix=_PREFIX, suffix=_SUFFIX, dir=parent))
        with suppress(FileNotFoundError):  # another job has swept it before it was opened
            lock = os.open(folder if fcntl else os.devnull, os.O_RDONLY)  # Windows opens no folders
            _lock(lock, waiting=True)
            if folder.exists():  # else it was swept before it was locked
                return folder, lock
            os.close(lock)
    raise OSError(f"{parent}: folders that are made here vanish")


def hold(path: Path) -> int | None:
    """Lock a file, made if it is not there, until the descriptor is closed; None where another holds it."""
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o666)
    if _lock(descriptor) is False:
        os.close(descriptor)
        return None
    return descriptor


@contextmanager
def lock_folder(folder: Path) -> Iterator[None]:
    """Keep others that ask for this folder waiting meanwhile, where the system has such locks."""
    descriptor = os.open(folder if fcntl else os.devnull, os.O_RDONLY)
    try:
        _lock(descriptor, waiting=True)
        yield
    finally:
        os.close(descriptor)


def _lock(descriptor: int, waiting: bool = False) -> bool | None:
    """Take a lock that ends with its process; whether it could be had, None where there are no locks."""
    if fcntl is None:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if waiting else fcntl.LOCK_NB))
    except BlockingIOError:
        return False
    except OSError:  # a disk that has none
        return None
    return True


def sweep_parts(folder: Path) -> None:
    """Remove what writers that were killed have left in a folder; what living ones write stays."""
    for part in folder.glob(".*.part"):
        if part.is_file() and _EARLIER.fullmatch(part.name):
            part.unlink(missing_ok=True)
        elif part.name.startswith(_PREFIX) and part.is_dir() and not part.is_symlink():
            with suppress(OSError):  # another process has swept it
                lock = os.open(part, os.O_RDONLY)
                try:
                    if _lock(lock):
                        shutil.rmtree(part, ignore_errors=True)
                finally:
                    os.close(lock)


def prepare_folder(folder: Path) -> Path:
    """Make an output folder and prove that it takes files, before anything is computed.

    Raises
    ------
    ResultError
        where it cannot be made or written; a WriteError where that is for want of room.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        sweep_parts(folder)
        with private_folder(folder):
            pass
    except OSError as error:
        kind = WriteError if error.errno in (errno.ENOSPC, errno.EDQUOT) else ResultError
        raise kind(
            f"{folder}: the output folder cannot be made or written ({error}); choose another"
        ) from error
    return folder


def file_text(path: Path) -> str:
    """Text of a file in UTF-8, of one that is not in Latin-1, whatever the locale; line ends are plain."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        return path.read_text(encoding="latin-1")


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
    error : what is raised; one of `romdam.core.errors`

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
        raise error(f"{quote(str(path))}: cannot be read ({problem})") from None
    if not stat.S_ISREG(about.st_mode):
        kind = "a folder" if stat.S_ISDIR(about.st_mode) else "a device, pipe or socket"
        raise error(f"{path}: is {kind}; give a file")
    if about.st_size > most:
        raise error(
            f"{path}: has {about.st_size / 1e6:.0f} MB, at most {most / 1e6:.0f} MB are read; "
            "is this the file that was meant?"
        )
