"""Worker processes on this machine: started once, one task each at a time, replaced when they die."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection, wait
from typing import Any

from romdam.errors import RomdamError

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
_TRIES = 3  # of a task whose worker dies
_RAISED = 1  # exit code of a Python process that an exception has ended
if sys.platform == "win32":
    _CONTEXT = multiprocessing.get_context("spawn")
else:
    _CONTEXT = multiprocessing.get_context("forkserver")

Function = Callable[[Any, Any], Any]


class WorkerDied(RuntimeError):
    """Every worker that was given a task died over it."""


class LocalPool:
    """Tasks on worker processes of this machine; the shared data travels to each worker once."""

    def __init__(self, count: int) -> None:
        self._count = count

    def map(self, function: Function, shared: object, tasks: Sequence[Any]) -> Iterator[tuple[int, Any]]:
        """Results as they come, with their tasks' numbers; a `WorkerDied` comes as a result."""
        waiting, tries = deque(range(len(tasks))), [0] * len(tasks)
        running: dict[Connection, _Worker] = {}
        try:
            while waiting or running:
                while waiting and len(running) < self._count:
                    worker = _Worker(function, shared)
                    running[worker.connection] = worker
                    worker.give(waiting.popleft(), tasks)
                for connection in wait(list(running)):
                    worker = running[connection]  # type: ignore[index]
                    number, result = worker.take()
                    if isinstance(result, WorkerDied):
                        del running[worker.connection]
                        tries[number] += 1
                        if tries[number] < _TRIES:
                            waiting.appendleft(number)
                            continue
                    elif waiting:
                        worker.give(waiting.popleft(), tasks)
                    else:
                        running.pop(worker.connection).end()
                    yield number, result
        finally:
            for worker in running.values():
                worker.end()


class _Worker:
    """One process and the task it is at."""

    def __init__(self, function: Function, shared: object) -> None:
        self.connection, theirs = _CONTEXT.Pipe()
        self._process = _CONTEXT.Process(target=_work, args=(theirs, function, shared), daemon=True)
        self._process.start()
        theirs.close()
        self._number = -1

    def give(self, number: int, tasks: Sequence[Any]) -> None:
        """Hand out a task; a worker that is dead already shows when its result is taken."""
        self._number = number
        with suppress(OSError):
            self.connection.send(tasks[number])

    def take(self) -> tuple[int, Any]:
        """The number and result of its task, or that it died.

        Raises
        ------
        RomdamError
            that the function raised.
        RuntimeError
            where it raised anything else; the worker has ended with its traceback.
        """
        try:
            raised, result = self.connection.recv()
        except (EOFError, OSError):
            self._process.join()
            self.connection.close()
            if self._process.exitcode == _RAISED:
                raise RuntimeError("a worker stopped with an error; its traceback stands above") from None
            return self._number, WorkerDied(f"exit code {self._process.exitcode}, {_TRIES} times")
        if raised:
            raise result
        return self._number, result

    def end(self) -> None:
        """Stop it, whatever it is at."""
        self._process.terminate()
        self._process.join()
        self.connection.close()


def _work(connection: Connection, function: Function, shared: object) -> None:
    """What a worker does until nobody asks any more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C: the parent ends its workers
    while True:
        try:
            task = connection.recv()
        except (EOFError, OSError):
            return
        try:
            answer = False, function(shared, task)
        except RomdamError as error:
            answer = True, error
        with suppress(OSError):  # nobody asks any more
            connection.send(answer)


def prepare(module: str) -> None:
    """Start the process that workers are forked from; it loads what they need while this one goes on."""
    if sys.platform != "win32":
        from multiprocessing import forkserver, resource_tracker

        _CONTEXT.set_forkserver_preload([module])
        resource_tracker.ensure_running()  # its own start unblocks signals, which the next lines block
        masked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # the parent hears Ctrl-C
        try:
            with _one_thread_each():
                forkserver.ensure_running()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, masked)


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Processes started in the body of a `with` statement have one thread each for BLAS and all."""
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
