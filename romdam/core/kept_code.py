"""Compiled functions on disk: numba's cache, made safe for code that changes and for processes that share it.

Compiling a time loop takes a quarter of a minute, so numba keeps on disk what it has compiled and reads it
again in the next process. By itself it does so in a way that would give wrong numbers, or end a run:

- It compares the time and size of the file that holds the function. What the function calls stands in other
  files, so an updated checkout would go on with the old code. Here the key holds the digest of all that a
  module imports.
- It unpickles whatever it finds, and ends with the error of a damaged file. Here the function is compiled
  again.
- Processes that start together, as workers of a suite do, each compile the same, and of two that save at once
  the later one loses the entry of the other. Here one compiles and the others wait, and each saves alone.
- It gives up where neither the package nor the user's home takes files. Here a private temporary folder
  serves.

`keep` does this for one function. It takes parts of numba that are no public interface; where a numba has
others, nothing is kept, which costs each process the time to compile, and no number.
"""

from __future__ import annotations

import functools
import gc
import hashlib
import logging
import os
import stat
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from types import CodeType
from typing import Any

import numba

from romdam.core.files import hold, lock_folder
from romdam.core.fingerprint import code_digest, files_digest

log = logging.getLogger(__name__)

_SETTINGS: Any = numba.config
_LONG = 1.0  # seconds of compiling that are worth a line
_PATIENCE, _LOOK = 300.0, 0.05  # seconds to wait for a process that compiles the same, and between two looks
_RARELY = (50_000, 20, 20)  # objects made between two looks for garbage; looks before older ones are in them


def keep(entry: Any) -> None:
    """Keep on disk what a function is compiled to, and take it from there where it has been compiled before.

    Parameters
    ----------
    entry : what `numba.njit` returned, without its option `cache`
    """
    if not _cached_by_numba(entry):
        return
    code = entry.py_func
    try:
        index = entry._cache._cache_file
        folder = Path(code.__code__.co_filename).parent
        index._source_stamp = (index._source_stamp, _code_of(code.__module__, folder))
    except AttributeError as error:
        entry._cache = _uncached()._cache
        _say_nothing_is_kept(str(error))
        return
    compile_, shared = entry.compile, _SharedCache(entry._cache, code.__code__)

    def compile_without_collecting(signature: Any) -> Any:
        """Compile with few looks for garbage, which take an eighth of the time at numba's many objects."""
        before = gc.get_threshold()
        gc.set_threshold(*_RARELY)
        try:
            return compile_(signature)
        finally:
            gc.set_threshold(*before)
            shared.release()  # the code is kept by now, or could not be compiled

    entry._cache, entry.compile = shared, compile_without_collecting


class _SharedCache:
    """A function's cache as numba's dispatcher calls it, for processes that use it at the same time.

    From a look for what is not there until it is saved, this process holds a lock and numba compiles. Where
    that takes long, it is said while it lasts and once it is done.
    """

    def __init__(self, cache: Any, code: CodeType) -> None:
        self._numbas, self._code = cache, code
        self._asked = 0.0
        self._watch = threading.Timer(_LONG, _say_compiling)
        self._held: tuple[Path, int] | None = None

    @property
    def cache_path(self) -> str:
        """Folder of the files."""
        return str(self._numbas.cache_path)

    def flush(self) -> None:
        """Forget what is kept."""
        self._numbas.flush()

    def load_overload(self, signature: Any, context: Any) -> Any:
        """Compiled code for types of arguments, or None, whereupon numba compiles and saves it."""
        self._asked = time.perf_counter()
        kept = self._read(signature, context)
        if kept is None:
            self._watch = threading.Timer(_LONG, _say_compiling)
            self._watch.daemon = True
            self._watch.start()
            self._take(signature)
            kept = self._read(signature, context)  # another process may have compiled it meanwhile
            if kept is not None:
                self._watch.cancel()
        return kept

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Save compiled code, alone: numba reads the index, adds to it and writes it."""
        self._watch.cancel()
        seconds = time.perf_counter() - self._asked
        if seconds > _LONG:
            log.info("compiled in %.0f s", seconds)
        try:
            Path(self.cache_path).mkdir(parents=True, exist_ok=True)
            with lock_folder(Path(self.cache_path)):
                self._numbas.save_overload(signature, compiled)
        except Exception as error:  # of the disk or of pickling: what is compiled works all the same
            log.info("%s: compiled functions cannot be kept (%s)", self.cache_path, error)

    def release(self) -> None:
        """Let other processes compile, or read what was kept."""
        if self._held is not None:
            path, descriptor = self._held
            self._held = None
            os.close(descriptor)
            with suppress(OSError):
                path.unlink()

    def _read(self, signature: Any, context: Any) -> Any:
        try:
            return self._numbas.load_overload(signature, context)
        except Exception as error:  # whatever unpickling raises of a damaged file, or of another numba's
            log.info("%s: compiled functions cannot be read (%s); compiling again", self.cache_path, error)
            with suppress(OSError):
                self._numbas.flush()
            return None

    def _take(self, signature: Any) -> None:
        """Wait for another process that compiles the same, not for ever: it may be stopped."""
        about = self._code.co_filename, self._code.co_firstlineno, signature
        kind = hashlib.sha256(repr(about).encode()).hexdigest()[:16]
        path = Path(self.cache_path) / f"{self._code.co_name}.{kind}.lock"
        end = time.monotonic() + _PATIENCE
        with suppress(OSError):  # where nothing can be written, nothing is kept either
            path.parent.mkdir(parents=True, exist_ok=True)
            while (descriptor := hold(path)) is None and time.monotonic() < end:
                time.sleep(_LOOK)
            self._held = None if descriptor is None else (path, descriptor)


def _cached_by_numba(entry: Any) -> bool:
    """Let numba choose a folder for a function's code; tell whether there is one."""
    try:
        entry.enable_caching()
    except RuntimeError as error:
        if "no locator" not in str(error):
            raise
        # neither the package nor the user's home takes files
        folder = _temporary_folder()
        if folder is None:
            return False
        with _caching_in(folder):
            entry.enable_caching()
    return bool(entry._cache.cache_path)  # None while `keeping_nothing`


def _uncached() -> Any:
    """A function that numba compiles and does not keep, for the types of its parts."""
    return numba.njit(lambda: None)


@functools.cache
def _say_nothing_is_kept(reason: str) -> None:
    """Say once that this numba's cache is another than the one known here."""
    log.warning(
        "numba %s keeps compiled functions in another way (%s): every process compiles, which takes a "
        "minute; install an earlier numba", numba.__version__, reason,
    )  # fmt: skip


@contextmanager
def _caching_in(folder: Path) -> Iterator[None]:
    """Let numba cache what is declared meanwhile in this folder."""
    before = _SETTINGS.CACHE_DIR
    _SETTINGS.CACHE_DIR = str(folder)
    try:
        yield
    finally:
        _SETTINGS.CACHE_DIR = before


@contextmanager
def caching_by_content(sha256: str) -> Iterator[None]:
    """Keep functions of a file that is not romdam's, declared meanwhile, by the SHA-256 of its bytes.

    Numba by itself asks for the file's time and size, which two contents may share, and keeps what it
    compiles in the user's folder of that file.
    """
    base = Path(_SETTINGS.CACHE_DIR or _users_folder())
    with _caching_in(base / f"law-{sha256[:32]}") if sha256 else nullcontext():
        yield


def _users_folder() -> Path:
    """The user's folder for compiled code that is kept apart from its source."""
    if os.name == "nt":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local") / "numba"
    caches = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(caches) if os.path.isabs(caches) else Path(os.path.expanduser("~")) / ".cache") / "numba"


@contextmanager
def keeping_nothing() -> Iterator[None]:
    """Let functions that are declared meanwhile be compiled anew in every process, whatever they ask for.

    Numba keeps them by the time and size of their file, with the values that they have taken from elsewhere.
    """
    dispatchers: Any = type(_uncached())
    enable = dispatchers.enable_caching
    dispatchers.enable_caching = lambda self: None
    try:
        yield
    finally:
        dispatchers.enable_caching = enable


@functools.cache
def _temporary_folder() -> Path | None:
    """This user's own folder for compiled functions among the temporary ones; None where it cannot be had.

    What is cached is unpickled: a folder that another user has made, or may write into, is not used.
    """
    try:
        folder = Path(tempfile.gettempdir()) / f"romdam-numba-{os.getuid()}"
        folder.mkdir(mode=0o700, exist_ok=True)
        about = folder.lstat()
        private = about.st_uid == os.geteuid() and stat.S_IMODE(about.st_mode) & 0o077 == 0
        if not (private and stat.S_ISDIR(about.st_mode)):
            raise OSError(f"{folder} is not this user's alone")
        tempfile.TemporaryFile(dir=folder).close()
    except (OSError, AttributeError) as error:  # AttributeError: Windows has no getuid
        log.warning(
            "no folder takes compiled functions (%s): compiling takes a minute; set NUMBA_CACHE_DIR", error
        )
        return None
    log.warning("compiled functions are kept in %s; set NUMBA_CACHE_DIR to another folder", folder)
    return folder


@functools.cache
def _code_of(module: str, folder: Path) -> str:
    """SHA-256 of what compiled functions of a module may call and take: of what it imports, in the end.

    A module that is not romdam's may call all of romdam, and what stands in the folder of its file.
    """
    if module.startswith("romdam."):
        return code_digest(module, "romdam.core.jit")
    return files_digest(sorted(folder.glob("*.py"))) + code_digest()


def _say_compiling() -> None:
    log.info("compiling, once for this version: it takes up to a minute ...")
