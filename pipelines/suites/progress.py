"""How far the tasks of a suite are: each notes it in a file of its own, wherever it runs, and one reads them.

Workers are processes of this machine or of a cluster; what all of them see is the output folder.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

_EVERY = 1.0  # seconds between two notes of a task, and between two looks at them
STEPS = 1000  # of a run, in what a stage is told


class Note:
    """The note of a task: how many of its runs are done, parts of runs included.

    Parameters
    ----------
    folder : of the notes; None keeps none
    key : of the task's first run, which no other task has
    runs : of the task
    """

    def __init__(self, folder: Path | None, key: str, runs: int) -> None:
        self._path = None if folder is None else folder / key
        self._runs, self._next = runs, 0.0

    def report_stage(self, first: float, last: float) -> Callable[[int, int], None]:
        """What a stage of the task, from one share of its work to another, tells how far it is."""
        return lambda done, total: self._write(first + (last - first) * done / max(total, 1))

    def _write(self, share: float) -> None:
        now = time.monotonic()
        if self._path is None or now < self._next:
            return
        self._next = now + _EVERY
        with suppress(OSError):  # a note that is lost costs nothing
            self._path.write_text(f"{self._runs * share:.6f}\n")


def of_parts(progress: Callable[[int, int], None], parts: int) -> Callable[[int, int], None]:
    """Make the progress of one stage of what its parts tell of themselves, one after another.

    What is told after the end of a part, or from less than it had done, is of the next one.
    """
    part, before = 0, 0.0

    def tell(done: int, total: int) -> None:
        nonlocal part, before
        share = done / max(total, 1)
        if before >= 1.0 or share < before:
            part += 1
        before = share
        progress(round(STEPS * min(part + share, parts)), STEPS * parts)

    return tell


@contextmanager
def watched(
    folder: Path, runs: int, progress: Callable[[int, int], None]
) -> Iterator[Callable[[int, str], None]]:
    """Tell a stage how many runs are done while the body has them made.

    Parameters
    ----------
    folder : of the notes
    runs : that are to be made
    progress : told (steps done, steps in all), `STEPS` for each run

    Yields
    ------
    to be called with the number of runs and the key of each task that has ended
    """
    finished, noted, ended, lock = [0], dict[str, float](), threading.Event(), threading.Lock()

    def tell() -> None:
        for path in folder.iterdir():
            with suppress(OSError, ValueError):  # it is being written, or has just ended
                noted[path.name] = max(noted.get(path.name, 0.0), float(path.read_text()))
        done = finished[0] + sum(noted.values())
        progress(min(round(STEPS * done), STEPS * runs), STEPS * runs)

    def watch() -> None:
        while not ended.wait(_EVERY):
            with lock:
                tell()

    def end_task(count: int, key: str) -> None:
        with lock:
            (folder / key).unlink(missing_ok=True)
            noted.pop(key, None)
            finished[0] += count
            tell()

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield end_task
    finally:
        ended.set()
        watcher.join()
