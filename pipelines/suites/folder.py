"""The folder of a suite: one suite at a time works in it, and what earlier designs have left can be removed.

The lock is that of the operating system on `.romdam-lock`: it goes with the process that holds it, however
that ends. Windows has no flock; there nothing keeps two suites out of one folder.
"""

from __future__ import annotations

import logging
import os
import re
import socket
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from romdam.config.load import Job, naming_lines
from romdam.core.errors import ConfigError, ResultError
from romdam.core.fingerprint import file_digest
from romdam.core.threads import one_thread
from romdam.pipelines.run import Clock, Stage, silent
from romdam.pipelines.suites.kept import KEY_LETTERS, RUN_KEY, file_name
from romdam.pipelines.suites.plan import Plan, make_plan
from romdam.results.suite.journal import JOURNAL, read_rows, rewrite_rows
from romdam.results.suite.report_data import DATA
from romdam.results.suite.rows import SuiteRow
from romdam.results.suite.summary import DESIGN, RUNS_FOLDER, SUMMARY

try:
    import fcntl
except ImportError:  # Windows: nothing keeps a second suite from the folder
    fcntl = None  # type: ignore[assignment]

log = logging.getLogger(__name__)

LOCK = ".romdam-lock"
_HELD = 512  # bytes of what the holder says of itself
_SHOWN = 5  # names in a message
_KEPT = re.compile(rf".+__\d+__\d+-([0-9a-f]{{{KEY_LETTERS}}})\.nc")
_KEPT_BEFORE = re.compile(r".+__\d+__\d+\.nc")  # by romdam 0.1
_ROWS_BEFORE = re.compile(r"[0-9a-f]{16}\.nc")  # by romdam 0.1, in `rows`
_SHARED = re.compile(r"(model|stress)-[0-9a-f]{12,64}\.h5")
_HDF5 = b"\x89HDF\r\n\x1a\n"


@contextmanager
def suite_lock(folder: Path) -> Iterator[None]:
    """Keep every other suite out of a folder until the body, or this process, has ended.

    Raises
    ------
    ResultError
        where another process is at work there.
    """
    try:
        file = (folder / LOCK).open("a+b", buffering=0)
    except OSError as error:
        raise ResultError(f"{folder / LOCK}: cannot be written ({error}); choose another folder") from error
    with file:
        if fcntl is not None:
            try:
                fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                holder = os.pread(file.fileno(), _HELD, 0).decode(errors="replace")
                raise ResultError(
                    f"{folder}: another suite is at work there, {holder or 'a process that just began'}; "
                    "wait for its end, stop it, or choose another folder"
                ) from None
            except OSError as error:  # a disk of a network that knows no locks
                log.warning("%s: cannot be locked (%s); start no second suite there", folder, error)
        when = datetime.now().astimezone().isoformat(sep=" ", timespec="seconds")
        with suppress(OSError):  # a full disk: nobody can read who holds the lock, but it is held
            file.truncate(0)
            file.write(f"process {os.getpid()} on {socket.gethostname()} since {when}".encode())
        yield


@dataclass(frozen=True)
class Cleaned:
    """Contents of a suite's folder that are of no run of its design.

    Attributes
    ----------
    files : that romdam wrote; gone if they were to be removed
    rows : of other runs in the journal; gone too
    size : of the files [bytes]
    kept : files that lie there as well, that romdam did not write, or not so
    """

    files: tuple[Path, ...]
    rows: int
    size: int
    kept: tuple[Path, ...]


@one_thread()
@naming_lines
def clean(job: Job, out: str | Path, remove: bool = False, show: Stage = silent) -> Cleaned:
    """Find, and remove if asked to, what earlier designs of a suite have left in its folder.

    Parameters
    ----------
    job : the suite as it is now
    remove : else nothing is changed

    Raises
    ------
    RomdamError
        for bad input, where there is no such folder or another suite works in it, and where a file cannot be
        removed.
    """
    folder = Path(out)
    if job.config.pipeline != "suite":
        raise ConfigError(
            f"{job.path}: is no suite (pipeline: {job.config.pipeline}), only suites are cleaned"
        )
    if not (folder / JOURNAL).exists() and not (folder / SUMMARY).exists():
        raise ResultError(f"{folder}: holds no {JOURNAL} or {SUMMARY}, so it is not the folder of a suite")
    with suite_lock(folder):
        plan = make_plan(job, Clock(show))
        rows = read_rows(folder / JOURNAL)
        present = {key: rows[key] for key in plan.first if key in rows}
        others = [path for path in leftovers(folder, plan, present) if path.parent != folder]
        ours = tuple(path for path in others if _is_ours(path, rows))
        left = {path.name: path for path in others if path not in ours}
        # the row of a result that was altered stays: it is what tells that the file is not as romdam wrote it
        staying = present | {key: row for key, row in rows.items() if row.kept and row.kept.file in left}
        size = sum(path.stat().st_size for path in ours)
        if remove and rows and not present:
            raise ResultError(
                f"{folder}: none of the {len(plan.runs)} runs of {job.path} is there, all would go; "
                "is it the suite's configuration? if so, run it first"
            )
        if remove:
            for path in ours:
                try:
                    path.unlink()
                except OSError as error:
                    raise ResultError(f"{path}: cannot be removed ({error})") from error
            rewrite_rows(folder / JOURNAL, staying.values())
    return Cleaned(ours, len(rows) - len(staying), size, tuple(left.values()))


def leftovers(folder: Path, plan: Plan, rows: Mapping[str, SuiteRow]) -> tuple[Path, ...]:
    """Files of results in a suite's folder that are of no run of the design, or of no suite.

    Parameters
    ----------
    rows : key -> row of the design's runs that are done
    """
    kept = {key: row.kept for key, row in rows.items() if row.kept is not None}
    # a run that has moved in the design has its file under the name of before until the suite is run again
    known = {kept[key].file if key in kept else file_name(run) for key, run in plan.first.items()}
    known |= {name for result in kept.values() for name in result.shared.values()}
    runs = [
        path
        for pattern in ("*.nc", "*.h5")
        for path in sorted((folder / RUNS_FOLDER).glob(pattern))
        if path.name not in known
    ]
    summary_files = {SUMMARY, DESIGN, DATA}
    others = [path for path in sorted(folder.glob("*.nc")) if path.name not in summary_files]
    return (*others, *sorted((folder / "rows").glob("*.nc")), *runs)


def of_no_run(paths: Sequence[Path], config: Path, folder: Path) -> str:
    """Tell of files that are of no run."""
    names = ", ".join(str(path.relative_to(folder)) for path in paths[:_SHOWN])
    more = f" and {len(paths) - _SHOWN} more" if len(paths) > _SHOWN else ""
    return (
        f"of no run of this design: {names}{more} in {folder}; `romdam clean {config} --out {folder}` lists "
        "them and removes those of earlier designs"
    )


def _is_ours(path: Path, rows: dict[str, SuiteRow]) -> bool:
    """True where romdam wrote a file, as it is: by its name and by its bytes; HDF5 is not asked."""
    if not path.is_file() or path.is_symlink():
        return False
    with path.open("rb") as file:
        if file.read(len(_HDF5)) != _HDF5:
            return False
    if path.parent.name != RUNS_FOLDER:
        return _ROWS_BEFORE.fullmatch(path.name) is not None
    if _SHARED.fullmatch(path.name):
        return True
    if name := _KEPT.fullmatch(path.name):
        written = {row.kept.sha256 for row in rows.values() if row.kept and row.kept.file == path.name}
        return file_digest(path) in written if written else _names_key(path, name[1])
    return _KEPT_BEFORE.fullmatch(path.name) is not None and _names_key(path, "")


def _names_key(path: Path, key: str) -> bool:
    """True where a file says that it is of a run of a suite, whose key begins so."""
    content, whole = path.read_bytes(), rf"{key}[0-9a-f]{{{64 - len(key)}}}"
    return RUN_KEY.encode() in content and re.search(whole.encode(), content) is not None
