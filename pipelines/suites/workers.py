"""Worker processes on this machine: forked from one that has loaded what they need, replaced when they die.

That one is a Python of its own, the nursery, and knows nothing of the caller's main module: this may be a
script without a guard, standard input or a notebook, which multiprocessing would run again in each worker.
Nothing of it lies in a temporary folder. It ends its workers and itself as soon as the caller is gone.
"""

from __future__ import annotations

import atexit
import multiprocessing
import os
import signal
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from importlib import import_module
from multiprocessing.connection import Connection, wait
from typing import Any

from romdam.core.errors import RomdamError, WorkerError
from romdam.core.threads import VARIABLES
from romdam.surroundings import load_unsearched, search_what_comes

_TRIES = 3  # of a task whose worker dies
_RAISED = 1  # exit code of a Python process that an exception has ended
_CODE = (
    "import sys; sys.path[:] = {path}; "
    "from romdam.pipelines.suites.workers import serve; serve({fd}, {module!r})"
)

Function = Callable[[Any, Any], Any]


class WorkerDied(RuntimeError):
    """Every worker that was given a task died over it."""


class LocalPool:
    """Tasks on worker processes of this machine; the shared data and the tasks travel once."""

    def __init__(self, count: int) -> None:
        self._count = count

    def map(self, function: Function, shared: object, tasks: Sequence[Any]) -> Iterator[tuple[int, Any]]:
        """Results as they come, with their tasks' numbers; a `WorkerDied` comes as a result.

        Raises
        ------
        RomdamError
            that the function raised; a WorkerError where the process died that workers are forked from.
        RuntimeError
            where it raised anything else; the worker has ended with its traceback.
        """
        if not tasks:
            return
        nursery = _ready.pop() if _ready else _Nursery(function.__module__)
        try:
            nursery.connection.send((self._count, function, shared, tasks))
            for _ in tasks:
                number, raised, result = nursery.connection.recv()
                if raised:
                    raise result
                yield number, result
        except (EOFError, OSError):
            code = nursery.end()
            raise WorkerError(
                f"the process that workers are started from ended with exit code {code}; what is finished is "
                "kept, run the same command again, with more memory or fewer --workers where it was killed"
            ) from None
        finally:
            nursery.end()


class _Nursery:
    """The process that workers are forked from; it loads a module while this one goes on."""

    def __init__(self, module: str) -> None:
        self.connection, theirs = multiprocessing.Pipe()
        # imports pass over anything else, too
        path = [folder for folder in sys.path if isinstance(folder, str)]
        code = _CODE.format(path=path, fd=theirs.fileno(), module=module)
        # it does not hear Ctrl-C: this process ends it
        masked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-c", code],
                stdin=subprocess.DEVNULL,
                pass_fds=[theirs.fileno()],
                env=os.environ | dict.fromkeys(VARIABLES, "1"),
            )
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, masked)
        theirs.close()

    def end(self) -> int:
        """Let it end its workers and itself; its exit code."""
        self.connection.close()
        return self._process.wait()

    def kill(self) -> None:
        """End it at once, before it has any workers."""
        self._process.kill()
        self.end()


_ready: list[_Nursery] = []  # started ahead


def prepare(module: str) -> None:
    """Start the process that workers are forked from; it loads what they need while this one goes on."""
    if not _ready:
        _ready.append(_Nursery(module))


@atexit.register
def _leave() -> None:
    """End what was started ahead and not needed."""
    while _ready:
        _ready.pop().kill()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_ready.clear)  # it serves the process that has started it


def serve(fd: int, module: str) -> None:
    """Serve as the nursery: load a module, fork workers, and hand on what they give."""
    caller = Connection(fd)
    load_unsearched()
    import_module(module)
    search_what_comes()  # in the workers too: their first search takes 0.2 s otherwise
    with suppress(EOFError, ConnectionError):  # the caller is gone
        count, function, shared, tasks = caller.recv()
        for answer in _answers(caller, count, function, shared, tasks):
            caller.send(answer)


def _answers(
    caller: Connection, count: int, function: Function, shared: object, tasks: Sequence[Any]
) -> Iterator[tuple[int, bool, Any]]:
    """Number of each task as it is done, whether the function raised, and its result or error."""
    waiting, tries = deque(range(len(tasks))), [0] * len(tasks)
    running: dict[Connection, _Worker] = {}
    try:
        while waiting or running:
            while waiting and len(running) < count:
                worker = _Worker([caller, *running], function, shared, tasks)
                running[worker.connection] = worker
                worker.give(waiting.popleft())
            for connection in wait([*running, caller]):
                if connection is caller:
                    return  # it has asked for all and sends nothing more: it is gone
                worker = running[connection]  # type: ignore[index]
                number, raised, result = worker.take()
                if isinstance(result, WorkerDied):
                    del running[worker.connection]
                    tries[number] += 1
                    if tries[number] < _TRIES:
                        waiting.appendleft(number)
                        continue
                elif waiting:
                    worker.give(waiting.popleft())
                else:
                    running.pop(worker.connection).end()
                yield number, raised, result
    finally:
        for worker in running.values():
            worker.end()


class _Worker:
    """One process and the task it is at."""

    def __init__(
        self, others: list[Connection], function: Function, shared: object, tasks: Sequence[Any]
    ) -> None:
        self.connection, theirs = multiprocessing.Pipe()
        process = multiprocessing.get_context("fork").Process
        args = (theirs, [self.connection, *others], function, shared, tasks)
        self._process = process(target=_work, args=args, daemon=True)
        self._process.start()
        theirs.close()
        self._number = -1

    def give(self, number: int) -> None:
        """Hand out a task; a worker that is dead already shows when its result is taken."""
        self._number = number
        with suppress(OSError):
            self.connection.send(number)

    def take(self) -> tuple[int, bool, Any]:
        """The number of its task, whether that raised, and its result or error, or that the worker died."""
        try:
            return self._number, *self.connection.recv()
        except (EOFError, OSError):
            self._process.join()
            self.connection.close()
            code = self._process.exitcode
            if code != _RAISED:
                return self._number, False, WorkerDied(f"exit code {code}, {_TRIES} times")
            error = RuntimeError("a worker stopped with an error; its traceback stands above")
            return self._number, True, error

    def end(self) -> None:
        """Stop it, whatever it is at."""
        self._process.terminate()
        self._process.join()
        self.connection.close()


def _work(
    connection: Connection,
    others: list[Connection],
    function: Function,
    shared: object,
    tasks: Sequence[Any],
) -> None:
    """Serve as a worker until nobody asks any more."""
    for inherited in others:  # or nobody would see the nursery die
        inherited.close()
    while True:
        try:
            number = connection.recv()
        except (EOFError, OSError):
            return
        try:
            answer = False, function(shared, tasks[number])
        except RomdamError as error:
            answer = True, error
        with suppress(OSError):  # nobody asks any more
            connection.send(answer)
