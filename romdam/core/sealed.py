"""HDF5 and NetCDF-4 files that end in a digest of their own bytes.

HDF5 trusts what it reads: a changed byte makes it return other numbers, ask for terabytes, crash or never
come back. So a file is opened where its bytes are those that were written. The digest stands behind the end
that HDF5 itself knows, where its readers, those of NetCDF and Python's do not look, so it travels with a file
that is copied:

    romdam-seal-1 <64 hexadecimal digits> newline

the SHA-256 of the bytes before it; from 64 MB on that of the CRC-32 of every megabyte, for a basis of a
million unknowns has 6 GB. A program that changes or rewrites a file drops it. Such a file, whose length is
what its own head says, is first read by a process of its own (`romdam.core.trial`), within limits of time and
memory.
"""

from __future__ import annotations

import hashlib
import io
import json
import logging
import re
import shutil
import subprocess
import sys
import zlib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import h5py

from romdam.core.errors import ResultError
from romdam.core.files import check_file, replacing

log = logging.getLogger(__name__)

MOST = 1e13  # bytes of a file
_MAGIC = b"\x89HDF\r\n\x1a\n"
_END_AT = {0: 40, 1: 44, 2: 28, 3: 28}  # version of a superblock -> where it has the file's end
_SHORTEST = 52  # bytes that hold any of these
_BLOCKS = (0, 512, 1024, 2048)  # bytes of another program's own, such as MATLAB's, in front of HDF5's
_HEAD = b"romdam-seal-1 "
_SEAL = re.compile(_HEAD + rb"([0-9a-f]{64})\n")
_LENGTH = len(_HEAD) + 65
_LARGE, _SPAN, _BUFFER = 64 << 20, 32 << 20, 1 << 20  # bytes: a large file, a thread's part of it, a piece
_SECONDS, _PACE = 20.0, 20e6  # that a trial may take, and bytes of a file for every further one
FAILURES = (  # HDF5's own of a file that it cannot read, and ours of one that holds something else
    OSError, RuntimeError, ValueError, KeyError, TypeError, IndexError, AttributeError, MemoryError,
)  # fmt: skip


@dataclass(frozen=True)
class Opened:
    """A file's state before it is opened.

    Attributes
    ----------
    sealed : whether its bytes are those that romdam wrote
    undefined, infinite : names of its variables with NaN, and with infinite values; empty where sealed
    """

    sealed: bool
    undefined: frozenset[str] = frozenset()
    infinite: frozenset[str] = frozenset()


def examine(path: Path) -> Opened:
    """Prove that HDF5 can read a file, before it is opened.

    Raises
    ------
    ResultError
        where there is no such file, it is not HDF5, or it is damaged.
    """
    if is_sealed(path):
        return Opened(sealed=True)
    log.warning("%s: carries no digest of romdam's; a change of its numbers would not be noticed", path)
    return _tried(path)


def is_sealed(path: Path) -> bool:
    """Check the digest that a file carries; False for a whole HDF5 file that carries none.

    Raises
    ------
    ResultError
        where there is no such file, it is not HDF5, or it is damaged.
    """
    check_file(path, MOST, ResultError)
    try:
        size = path.stat().st_size
        with path.open("rb") as file:
            start = file.read(_BLOCKS[-1] + _SHORTEST)
            file.seek(max(0, size - _LENGTH))
            seal = _SEAL.fullmatch(file.read(_LENGTH))
        block = next((at for at in _BLOCKS if start[at:].startswith(_MAGIC)), 0)
        head = start[block : block + _SHORTEST]
        if len(head) < _SHORTEST or not head.startswith(_MAGIC):
            raise ResultError(f"{path}: is not a NetCDF-4 file nor another of HDF5, or its head is damaged")
        if seal:
            if _digest(path, size - _LENGTH) != seal[1].decode():
                raise ResultError(f"{path}: is damaged, its bytes are not those that were written")
            return True
    except OSError as error:
        raise ResultError(f"{path}: cannot be read ({error})") from error
    at = _END_AT.get(head[8], _SHORTEST)
    if int.from_bytes(head[at : at + 8], "little") not in (size, size - block):
        raise ResultError(f"{path}: is damaged or cut, it does not end where its head says or in its digest")
    return False


def _digest(path: Path, size: int) -> str:
    """Digest of the first bytes of a file; two threads read a large one."""
    if size < _LARGE:
        content = hashlib.sha256()
        for piece in _pieces(path, 0, size):
            content.update(piece)
        return content.hexdigest()

    def sums(first: int) -> list[bytes]:
        last = min(first + _SPAN, size)
        return [zlib.crc32(piece).to_bytes(4, "little") for piece in _pieces(path, first, last)]

    with ThreadPoolExecutor(2) as threads:
        return hashlib.sha256(b"".join(chain(*threads.map(sums, range(0, size, _SPAN))))).hexdigest()


def _pieces(path: Path, first: int, last: int) -> Iterator[memoryview]:
    """Megabytes of a file, one after another in the same buffer."""
    buffer = memoryview(bytearray(_BUFFER))
    with io.FileIO(path) as file:
        file.seek(first)
        for at in range(first, last, _BUFFER):
            piece = buffer[: min(_BUFFER, last - at)]
            if file.readinto(piece) < len(piece):
                raise OSError("it ends early")
            yield piece


def _tried(path: Path) -> Opened:
    """Have a process of its own read a file, which may die or never end over it."""
    seconds = _SECONDS + path.stat().st_size / _PACE
    command = [sys.executable, "-P", str(Path(__file__).with_name("trial.py")), str(path.absolute())]
    try:
        done = subprocess.run(command, capture_output=True, timeout=seconds, check=False)
        answer = json.loads(done.stdout)
        if "refused" in answer:
            raise ResultError(f"{path}: {answer['refused']}")
        return Opened(False, frozenset(answer["undefined"]), frozenset(answer["infinite"]))
    except subprocess.TimeoutExpired:
        raise ResultError(f"{path}: is damaged, HDF5 does not come to an end over it") from None
    except ValueError:
        raise ResultError(f"{path}: is damaged, HDF5 dies over it (exit {done.returncode})") from None


@contextmanager
def reading(path: Path, only_sealed: bool = False) -> Iterator[h5py.File]:
    """Open an HDF5 file that has been examined; what the body finds missing or other than meant is told.

    Parameters
    ----------
    only_sealed : whether a file without a digest counts as damaged

    Raises
    ------
    ResultError
        as `examine` does, and where the body meets an error of HDF5's.
    """
    if only_sealed and not is_sealed(path):
        raise ResultError(f"{path}: carries no digest of romdam's")
    if not only_sealed:
        examine(path)
    with opened(path) as file:
        yield file


@contextmanager
def opened(path: Path) -> Iterator[h5py.File]:
    """Open an HDF5 file that has been examined already; as `reading`."""
    try:
        with h5py.File(path, "r") as file:
            yield file
    except FAILURES as error:
        raise ResultError(
            f"{path}: is not what it should be ({error!r}); have romdam write it again"
        ) from error


@contextmanager
def reading_foreign(path: Path) -> Iterator[h5py.File]:
    """Open an HDF5 file of another program, once a process of its own has read all of it.

    Raises
    ------
    ResultError
        as `examine` does, and where the body meets an error of HDF5's.
    """
    if not is_sealed(path):
        _tried(path)
    try:
        with h5py.File(path, "r") as file:
            yield file
    except FAILURES as error:
        raise ResultError(f"{path}: is not what it should be ({error})") from error


def text_of(item: h5py.Group, name: str) -> str:
    """An attribute that is a text; empty where there is none, or it is something else."""
    value = item.attrs.get(name)
    return value if isinstance(value, str) else ""


@contextmanager
def creating(path: Path, size: int = 0) -> Iterator[h5py.File]:
    """Give a new HDF5 file, sealed and put in its place once the body has ended well.

    Parameters
    ----------
    size : bytes that it may take

    Raises
    ------
    WriteError
        where the disk or the folder refuses it.
    """
    with sealing(path, size) as stream, h5py.File(stream, "w") as file:
        yield file


@contextmanager
def changing(path: Path, target: Path | None = None) -> Iterator[h5py.File]:
    """Give a copy of an HDF5 file that takes its place, or that of `target`, once the body has ended well.

    Raises
    ------
    ResultError
        where the file cannot be read, or the disk or the folder refuses the copy.
    """
    examine(path)
    with replacing(target or path, path.stat().st_size) as part:
        shutil.copyfile(path, part)
        with SteadyStream(part, "r+") as stream, h5py.File(stream, "r+") as file:
            yield file
        seal(part)


@contextmanager
def sealing(path: Path, size: int = 0) -> Iterator[SteadyStream]:
    """Give a stream for a new HDF5 file, sealed and put in its place once the body has ended well.

    Raises
    ------
    WriteError
        where the disk or the folder refuses it.
    """
    with replacing(path, size) as part:
        with SteadyStream(part, "w+") as stream:
            yield stream
        seal(part)


def seal(path: Path) -> None:
    """Put the digest of a file's bytes at its end."""
    digest = _digest(path, path.stat().st_size)
    with path.open("ab") as file:
        file.write(_HEAD + digest.encode() + b"\n")


class SteadyStream(io.RawIOBase):
    """A file that HDF5 writes to and that keeps the disk's errors from it.

    HDF5 dies of a segmentation fault where a disk is full as it closes a file. Here it goes on writing to
    nowhere, and the first error is raised when the stream is closed.
    """

    def __init__(self, path: Path, mode: str) -> None:
        self._file = io.FileIO(path, mode)
        self._error: OSError | None = None

    def __exit__(self, *raised: object) -> None:
        self._file.close()
        super().__exit__(*raised)  # type: ignore[arg-type]
        if self._error is not None:
            raise self._error

    def readinto(self, buffer: Any) -> int:
        """Read, unless what was to be read may not have been written."""
        if self._error is not None:
            raise self._error
        return int(self._file.readinto(buffer) or 0)

    def write(self, data: Any) -> int:
        """Write everything, or keep the error."""
        left = memoryview(data)
        try:
            while left and self._error is None:
                left = left[self._file.write(left) :]
        except OSError as error:
            self._error = error
        return len(data)

    def truncate(self, size: int | None = None) -> int:
        """Set the file's length, or keep the error."""
        try:
            return self._file.truncate(size)
        except OSError as error:
            self._error = self._error or error
            return size or 0

    def seek(self, offset: int, whence: int = 0) -> int:
        """Go to a place."""
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        """The place."""
        return self._file.tell()

    def readable(self) -> bool:
        """HDF5 reads what it writes."""
        return True

    def writable(self) -> bool:
        """As the name says."""
        return True

    def seekable(self) -> bool:
        """As the name says."""
        return True
