"""The log of a run, a text file beside its results: what was asked, every stage, warnings, what came of it.

Each line is written whole as it is told, so a run that is killed leaves the log so far.
"""

from __future__ import annotations

import logging
import os
import platform
import shlex
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from romdam.core.errors import RomdamError, WriteError
from romdam.core.files import prepare_folder
from romdam.core.printable import printable
from romdam.core.threads import VARIABLES
from romdam.core.version import SOURCE

SAID = logging.getLogger("romdam.said")  # what a command has written to the terminal itself
_STAMP = "%Y-%m-%dT%H:%M:%S%z"
_LONGEST = 100  # characters of the configuration's name in that of the log
_LIBRARIES = (
    "numpy", "scipy", "numba", "h5py", "h5netcdf", "xarray", "pydantic", "obspy", "matplotlib",
    "pypardiso", "pyamg", "distributed", "pyvista",
)  # fmt: skip


class _Line(logging.Formatter):
    """The time, and the level where it is more than information."""

    def format(self, record: logging.LogRecord) -> str:
        level = f"{record.levelname}: " if record.levelno >= logging.WARNING else ""
        return printable(f"{self.formatTime(record, _STAMP)} {level}{super().format(record)}")


class _File(logging.FileHandler):
    """A file that takes no more, for a full disk, ends no run."""

    def handleError(self, record: logging.LogRecord) -> None:
        """Write nothing from here on."""
        self.setLevel(logging.CRITICAL + 1)


@contextmanager
def run_log(folder: Path, config: Path, exit_code: Callable[[BaseException], int]) -> Iterator[None]:
    """Keep the log of the body in a new file of the folder, which is made if needed.

    Parameters
    ----------
    config : the run's YAML file, whose name the log has, with the time
    exit_code : of the command where the body ends with an error

    Raises
    ------
    ResultError
        where the folder takes no file.
    """
    path = _new_file(prepare_folder(folder), config.stem[:_LONGEST])
    file, logger, root = _File(path, encoding="utf-8"), logging.getLogger("romdam"), logging.getLogger()
    file.setFormatter(_Line())
    before = logger.level, root.level
    root.addHandler(file)
    logger.setLevel(logging.DEBUG)  # its begun stages; the terminal has a filter of its own
    root.setLevel(min(root.level, logging.WARNING))
    logging.captureWarnings(True)
    begun, code = (time.perf_counter(), time.process_time()), 0
    try:
        for line in _head(config):
            SAID.debug("%s", line)
        yield
    except BaseException as error:
        code = exit_code(error)
        if not hasattr(error, "exit_code"):  # else what is wrong is said already
            expected = isinstance(error, RomdamError) or not isinstance(error, Exception)
            text = str(error) or type(error).__name__
            SAID.error(
                "%s", text if expected else traceback.format_exc().rstrip()
            )  # else the program's mistake
        raise
    finally:
        wall, cpu = time.perf_counter() - begun[0], time.process_time() - begun[1]
        SAID.debug("ended with exit code %d after %.2f s wall, %.2f s CPU", code, wall, cpu)
        logging.captureWarnings(False)
        logger.setLevel(before[0])
        root.setLevel(before[1])
        root.removeHandler(file)
        file.close()


def _new_file(folder: Path, name: str) -> Path:
    """An empty file that nobody else writes into."""
    stem = f"{name}-{time.strftime('%Y%m%dT%H%M%SZ', time.gmtime())}"
    for number in range(1, 1000):
        path = folder / (f"{stem}.log" if number == 1 else f"{stem}-{number}.log")
        try:
            path.open("x").close()
        except FileExistsError:
            continue
        except OSError as error:
            raise WriteError(f"{path}: cannot be written ({error}); free the disk") from None
        return path
    raise WriteError(f"{folder / stem}: a thousand logs have this name; wait a second")


def _head(config: Path) -> Iterator[str]:
    """Head of a log: what is run, with what, where."""
    yield f"{SOURCE}, Python {platform.python_version()}, {platform.platform()}"
    yield f"command: {shlex.join(['romdam', *sys.argv[1:]])}"
    yield f"folder: {os.getcwd()}; configuration: {config.absolute()}"
    threads = ", ".join(f"{name}={os.environ[name]}" for name in VARIABLES if name in os.environ)
    yield f"process {os.getpid()}, {os.cpu_count()} cores{'; ' if threads else ''}{threads}"
    versions = []
    for name in _LIBRARIES:
        with suppress(PackageNotFoundError):
            versions.append(f"{name} {version(name)}")
    yield f"libraries: {', '.join(versions)}"
