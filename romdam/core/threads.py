"""Threads of BLAS, LAPACK and PARDISO: one, but for what is so large that further ones pay.

Reductions and runs are made of many small products, for each of which a second thread costs more than it
saves: it waits spinning. Measured on two cores, one thread against two (`tests/benchmarks/bench_threads.py`):

| | wall | CPU |
|---|---|---|
| dense eigenproblem of 200 unknowns | 4 and 8 ms | 8 and 16 ms |
| of 800 | 126 and 87 ms | 126 and 172 ms |
| of 3,000 | 4.8 and 2.7 s | 4.8 and 5.2 s |
| PARDISO of 17,496 unknowns, factors and 64 solutions | 0.30 and 0.32 s | 0.29 and 0.35 s |
| of 41,472 | 0.74 and 0.51 s | 0.72 and 1.00 s |

SuperLU has one thread, and the products within it are small. Products with a basis are made some columns or
rows at a time, a twentieth of a large reduction: they stay at one thread, so that below both sizes no bit
depends on the number of cores. Nothing of numba's is compiled to run in parallel.

A second core works on what is independent instead: on tasks that are cut alike whatever does them, their
results taken in their order (`side_by_side`), and, of large models, on the second of two (`at_once`) and on
what nobody waits for yet (`beside`).
Products, hashes and compiled functions let other Python threads go on; what they do not is what a small model
takes its time for. A job whose blocks are kept, one thread against two, medians:

| unknowns of the mesh | wall | CPU |
|---|---|---|
| 4,410, main job | 2.48 and 2.64 s | 2.45 and 2.67 s |
| 28,782, the same with half the elements | 3.6 and 3.9 s | 3.5 and 3.9 s |
| 75,798, arch dam, on a quicker machine | 14.1 and 10.8 s | 14.1 and 14.7 s |

What a user has set (OPENBLAS_NUM_THREADS, OMP_NUM_THREADS, MKL_NUM_THREADS, or threadpoolctl around a call)
is what a library says when it is first asked, and is never exceeded.
"""

from __future__ import annotations

import math
import os
import sys
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import RLock, get_ident, local
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from threadpoolctl import LibController

T = TypeVar("T")
U = TypeVar("U")

VARIABLES = tuple(f"{name}_NUM_THREADS" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA", "NUMEXPR"))

# unknowns for each thread, measured on two cores: a second one takes a fourth to two fifths off the wall
DENSE_EIGENPROBLEM = 2_000
PARDISO = 30_000  # unknowns of a matrix for each thread of PARDISO
BESIDE = 40_000  # unknowns of a mesh from which a second thread works beside what is not cut into tasks

_MOST = 2  # Python threads of a job: they take turns at the interpreter, and each has memory of its own

_lock = RLock()
_jobs: list[int] = []  # a Python thread for each `one_thread` that it is in
_ceilings: dict[str, int] = {}  # library -> its threads before the first of them
_held: list[int] = []  # the threads that libraries were set to last, and how many modules were loaded then
_libraries: dict[int, list[LibController]] = {}  # modules that were loaded -> libraries that came with them
_of_thread = local()  # `helped`: CPU seconds that other threads have spent for this one


@contextmanager
def one_thread() -> Iterator[None]:
    """Hold the libraries of this process to one thread in the body, but for `threads_for`."""
    with _lock:
        _jobs.append(get_ident())
        _set_threads(1)
    try:
        yield
    finally:
        with _lock:
            _jobs.remove(get_ident())
            if not _jobs:
                _set_threads(max(_ceilings.values(), default=1))
                _ceilings.clear()
                _held.clear()


@contextmanager
def threads_for(unknowns: int, each: int) -> Iterator[None]:
    """Let the body have a thread for so many unknowns, up to the cores and to what the user allows.

    Outside `one_thread` nothing is changed, and where several jobs share the process they stay at one.

    Parameters
    ----------
    each : DENSE_EIGENPROBLEM or PARDISO
    """
    count = min(unknowns // each + 1, cores()) if set(_jobs) == {get_ident()} else 1
    with _lock:
        if _jobs:
            _set_threads(count)
    others = time.process_time() - time.thread_time()
    try:
        yield
    finally:
        if count > 1:
            spent = time.process_time() - time.thread_time() - others
            _of_thread.helped = getattr(_of_thread, "helped", 0.0) + spent
            with _lock:
                _set_threads(1)


def helpers() -> int:
    """Python threads that may work for this one; one where jobs share the process or the user allows one."""
    alone = set(_jobs) == {get_ident()}
    return min(_MOST, cores(), max(_ceilings.values(), default=1)) if alone else 1


def side_by_side(tasks: Iterable[Callable[[], T]]) -> Iterator[T]:
    """Results of tasks in their order; `helpers` threads work on them, a few ahead of what is asked for."""
    count, due = helpers(), deque[Future[tuple[T, float]]]()
    if count == 1:
        yield from (task() for task in tasks)
        return
    with ThreadPoolExecutor(count) as threads:
        for task in tasks:
            due.append(threads.submit(_timed, task))
            if len(due) > count:
                yield _taken(due.popleft())
        while due:
            yield _taken(due.popleft())


@contextmanager
def in_background(task: Callable[[], T], unknowns: int) -> Iterator[Callable[[], T]]:
    """Give the body what waits for a task's result, or raises its error; another thread works on it.

    The task has ended when the body has. Without a second thread it is done first.

    Parameters
    ----------
    unknowns : of the mesh; a small one's tasks are done first, too
    """
    if unknowns < BESIDE or helpers() == 1:
        result = task()
        yield lambda: result
        return
    with ThreadPoolExecutor(1) as thread:
        yield thread.submit(task).result


def at_once(first: Callable[[], T], second: Callable[[], U], unknowns: int) -> tuple[T, U]:
    """Results of two tasks that a run waits for; another thread works on the second.

    Without one, the second follows the first.

    Parameters
    ----------
    unknowns : of the mesh; the tasks of a small one follow each other, too
    """
    if unknowns < BESIDE or helpers() == 1:
        return first(), second()
    with ThreadPoolExecutor(1) as thread:
        due = thread.submit(_timed, second)
        return first(), _taken(due)


def cpu_time() -> float:
    """CPU seconds of this thread and of what has worked for it: `side_by_side`, `at_once`, libraries."""
    return time.thread_time() + float(getattr(_of_thread, "helped", 0.0))


def _timed(task: Callable[[], T]) -> tuple[T, float]:
    start = cpu_time()
    return task(), cpu_time() - start


def _taken(done: Future[tuple[T, float]]) -> T:
    result, seconds = done.result()
    _of_thread.helped = getattr(_of_thread, "helped", 0.0) + seconds
    return result


def _set_threads(count: int) -> None:
    """Set what every library loaded by now may start, at most what it had at first.

    A library comes with a module: without a new one it is as it was set, and the libraries are those listed
    before. To list them takes 2 ms.
    """
    from threadpoolctl import ThreadpoolController  # here: `import romdam` stays without it

    if _held == [count, len(sys.modules)]:
        return
    _held[:] = count, len(sys.modules)
    if len(sys.modules) not in _libraries:
        _libraries.clear()
        _libraries[len(sys.modules)] = ThreadpoolController().lib_controllers
    for library in _libraries[len(sys.modules)]:
        # from threadpoolctl 3.8 on the first Python thread that sets a library shuts the others out
        release = getattr(library, "clear_controlling_thread", lambda force: None)
        most = _ceilings.setdefault(library.filepath, library.get_num_threads())
        release(force=True)
        library.set_num_threads(min(count, most))
        release(force=True)


def cores() -> int:
    """Cores that this process may use: its affinity, and the limit of its container."""
    try:
        count = len(os.sched_getaffinity(0))
    except AttributeError:  # not on macOS
        count = os.cpu_count() or 1
    return min(count, limit_of_container(Path("/sys/fs/cgroup"), count))


def limit_of_container(groups: Path, most: int) -> int:
    """Cores whose time a container is given, in version 2 of control groups or in version 1; or `most`."""
    for names in (("cpu.max",), ("cpu/cpu.cfs_quota_us", "cpu/cpu.cfs_period_us")):
        with suppress(OSError, ValueError):  # not there, or "max"
            quota, period = map(int, " ".join((groups / name).read_text() for name in names).split())
            if quota > 0 and period > 0:
                return math.ceil(quota / period)
    return most
