"""Pools that run tasks: in this process, in worker processes on this machine, on an existing dask cluster."""

from __future__ import annotations

import asyncio
import hashlib
import inspect
import itertools
import os
import pickle
import time
import uuid
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, Protocol

from romdam.core.errors import ConfigError, ResultError, WorkerError, quote
from romdam.core.threads import cores
from romdam.pipelines.suites import admission
from romdam.pipelines.suites.workers import LocalPool, prepare

if TYPE_CHECKING:
    from distributed import Client, Future

_AHEAD = 2  # tasks handed out for each worker beyond the one it is at
_ANSWER = 10.0  # seconds that a scheduler, or a worker that is asked to prove itself, has for its answer
_NO_WORKERS = 30.0  # seconds that a cluster may be without workers
_BEAT = 5.0  # seconds without a result until the cluster is asked whether it is still there
_KEPT = "what is finished is kept; see to the cluster, and run the same command again"

Shared = tuple[str, str]  # path and SHA-256 of a file with data for all tasks


class Pool(Protocol):
    """Runs a function of shared data and a task for many tasks."""

    def map(
        self, function: Callable[[Any, Any], Any], shared: object, tasks: Sequence[Any]
    ) -> Iterator[tuple[int, Any]]:
        """Results as they come, with their tasks' numbers; an exception of the function comes as a result."""
        ...


class OneProcess:
    """Tasks one after another, here."""

    def map(
        self, function: Callable[[Any, Any], Any], shared: object, tasks: Sequence[Any]
    ) -> Iterator[tuple[int, Any]]:
        """See `Pool`."""
        for number, task in enumerate(tasks):
            yield number, function(shared, task)


class DaskPool:
    """Tasks on the workers of a dask cluster, each of which proves what `admission` asks of it.

    The shared data lies in the output folder, where each worker reads it once.

    Parameters
    ----------
    client : of the cluster
    address : as the user gave it
    folder : of the results, absolute
    """

    def __init__(self, client: Client, address: str, folder: Path) -> None:
        self._client, self._place, self._folder = client, f"--scheduler {address}", folder
        self._expected = admission.installed()

    def admit(self) -> None:
        """Let every worker that is there prove itself, before anything is computed.

        Raises
        ------
        ConfigError
            where there is none, or one must not compute.
        """
        try:
            self._client.wait_for_workers(1, timeout=_NO_WORKERS)
        except (TimeoutError, OSError):
            raise ConfigError(
                f"{self._place}: has no workers, also after {_NO_WORKERS:g} s; start some for this "
                "scheduler, or use --workers"
            ) from None
        with _left_in(self._folder, b"") as (path, _):
            sent = _sent("problem(expected, path)", expected=self._expected, path=path)
            try:
                answers = self._client.run(eval, *sent, on_error="return", callback_timeout=3 * _ANSWER)
            except (TimeoutError, OSError) as error:
                raise ConfigError(
                    f"{self._place}: not every worker answers within {3 * _ANSWER:g} s ({error}); stop those "
                    "that hang"
                ) from None
        refused = [f"worker {address}: {why}" for address, why in sorted(answers.items()) if why]
        if refused:
            more = f" (and {len(refused) - 1} more workers)" if len(refused) > 1 else ""
            raise ConfigError(f"{self._place}: {refused[0]}{more}")

    def map(
        self, function: Callable[[Any, Any], Any], shared: object, tasks: Sequence[Any]
    ) -> Iterator[tuple[int, Any]]:
        """See `Pool`. Tasks are handed out as workers get free, so that their data does not pile up.

        Raises
        ------
        WorkerError
            where the cluster is lost, or a worker has come that must not compute.
        """
        if not tasks:
            return
        waiting, numbers, ready = iter(enumerate(tasks)), dict[Any, int](), SimpleQueue[Any]()
        with _left_in(self._folder, pickle.dumps(shared)) as where:

            def hand_out(count: int) -> None:
                for number, task in itertools.islice(waiting, count):
                    future = self._submit(where, pickle.dumps((function, task)))
                    numbers[future.key] = number
                    future.add_done_callback(ready.put)

            hand_out((1 + _AHEAD) * max(1, len(self._workers())))
            while numbers:
                future, result = self._next(ready)
                yield numbers.pop(future.key), result
                future.release()
                hand_out(1)

    def _submit(self, where: Shared, work: bytes) -> Future[Any]:
        sent = _sent("perform(expected, shared, work)", expected=self._expected, shared=where, work=work)
        return self._client.submit(eval, *sent, pure=False)

    def _workers(self) -> dict[str, int]:
        """Address of each worker of the cluster -> its threads."""
        try:
            return dict(self._client.nthreads(callback_timeout=_ANSWER))
        except (OSError, AttributeError) as error:  # AttributeError: the client has closed itself
            raise WorkerError(f"{self._place}: the scheduler is lost ({_cause(error)}); {_KEPT}") from None

    def _next(self, ready: SimpleQueue[Future[Any]]) -> tuple[Future[Any], Any]:
        """The next task that is done, and what came of it."""
        seen = time.monotonic()
        while True:
            try:
                future = ready.get(timeout=_BEAT)
                return future, self._result(future)
            except Empty:
                pass
            except TimeoutError:  # its worker has left with the result: another makes it again
                ready.put(future)
            if self._workers():
                seen = time.monotonic()
            elif time.monotonic() - seen > _NO_WORKERS:
                raise WorkerError(f"{self._place}: has had no workers for {_NO_WORKERS:g} s; {_KEPT}")

    def _result(self, future: Future[Any]) -> Any:
        """The result of the function; or the error that every worker died of which was at it."""
        from distributed import CancelledError
        from distributed.scheduler import KilledWorker

        try:
            refusal, result = future.result(timeout=_BEAT)
        except KilledWorker as error:
            return error
        except (CancelledError, OSError) as error:
            if future.status == "error":
                raise RuntimeError(f"a worker stopped with an error ({_cause(error)})") from error
            if isinstance(error, TimeoutError):
                raise
            raise WorkerError(f"{self._place}: the scheduler is lost ({_cause(error)}); {_KEPT}") from None
        if refusal:
            raise WorkerError(f"{self._place}: {refusal}; {_KEPT}")
        return result


def _sent(expression: str, **names: object) -> tuple[str, dict[str, object]]:
    """Arguments of `eval` that work on any worker: an expression with the names of `admission`, and these."""
    return f"exec(text, globals()) or {expression}", {"text": inspect.getsource(admission), **names}


@contextmanager
def _left_in(folder: Path, content: bytes) -> Iterator[Shared]:
    """Leave a file in a folder while the body of a `with` statement goes on."""
    path = folder / f".{uuid.uuid4().hex}.part"
    try:
        try:
            path.write_bytes(content)
        except OSError as error:
            raise ResultError(
                f"{path}: cannot be written ({error}); free the disk or choose another folder"
            ) from None
        yield str(path), hashlib.sha256(content).hexdigest()
    finally:
        path.unlink(missing_ok=True)


def compute(shared: Shared, work: bytes) -> Any:
    """Do a task on a worker that has proved itself.

    Parameters
    ----------
    shared : path and SHA-256 of the file with the data of all tasks
    work : the function and its task, pickled
    """
    function, task = pickle.loads(work)
    return function(_read(*shared), task)


@lru_cache(maxsize=1)
def _read(path: str, digest: str) -> object:
    """The shared data, where it is what was written."""
    content = Path(path).read_bytes()
    if hashlib.sha256(content).hexdigest() != digest:
        raise ResultError(f"{path}: is not what was written there; is this the same folder?")
    return pickle.loads(content)


@contextmanager
def open_pool(workers: int | None, scheduler: str | None, module: str, folder: Path) -> Iterator[Pool]:
    """A pool for the body of a `with` statement.

    Parameters
    ----------
    workers : processes on this machine; as many as there are cores if not given. One runs here,
        and stands for all where processes cannot be forked
    scheduler : address of an existing dask scheduler, instead
    module : what the workers will need; it is loaded for them while the body goes on
    folder : of the results, absolute; the workers of a cluster must see it

    Raises
    ------
    ConfigError
        where a scheduler is given and dask is not installed, the scheduler does not answer, or its workers
        are none, or not fit to compute.
    """
    if scheduler is not None:
        with _client(scheduler) as client:
            pool = DaskPool(client, scheduler, folder)
            pool.admit()
            yield pool
        return
    prepare_pool(workers, scheduler, module)
    yield LocalPool(_count(workers)) if _count(workers) > 1 else OneProcess()


def prepare_pool(workers: int | None, scheduler: str | None, module: str) -> None:
    """Let own worker processes load a module ahead of `open_pool`, which has the same parameters."""
    if scheduler is None and _count(workers) > 1:
        prepare(module)


def _count(workers: int | None) -> int:
    return (workers or cores()) if hasattr(os, "fork") else 1


def _client(scheduler: str) -> Client:
    """A client of dask.distributed, which logs every worker that comes and goes unless told before."""
    try:
        import dask

        with dask.config.set({"logging": {"distributed": "critical", "distributed.client": "critical"}}):
            import distributed
    except ImportError:
        raise ConfigError(
            "--scheduler: needs dask.distributed; install romdam with the extra `cluster`, or use --workers"
        ) from None
    location = f"--scheduler {quote(scheduler)}"
    try:
        kind = _asked(scheduler)
        if kind == "Scheduler":
            return distributed.Client(scheduler, timeout=_ANSWER, set_as_default=False)
    except Exception as error:  # whatever answers there: what it sends may fail in any way
        raise ConfigError(
            f"{location}: no dask scheduler answers there ({_cause(error)}); give the address that it tells "
            "when it starts, such as tcp://192.168.0.1:8786"
        ) from None
    raise ConfigError(f"{location}: is the address of a dask {kind}, give that of the scheduler")


def _asked(address: str) -> str:
    """Ask what answers at an address; a `Client` that finds no scheduler would leave its threads behind.

    Asked in a thread, as this one may be in the event loop of a notebook.
    """
    from distributed import Security
    from distributed.core import rpc

    async def identity() -> dict[str, Any]:
        arguments = Security().get_connection_args("client")
        async with rpc(address, timeout=_ANSWER, connection_args=arguments) as connection:
            return dict(await connection.identity())

    def ask() -> dict[str, Any]:
        return asyncio.run(asyncio.wait_for(identity(), _ANSWER + 1.0))

    with ThreadPoolExecutor(1) as thread:
        return str(thread.submit(ask).result()["type"])


def _cause(error: BaseException) -> str:
    """The first of the errors that one stands for."""
    while error.__cause__ is not None:
        error = error.__cause__
    return " ".join(str(error).split()) or f"nothing within {_ANSWER:g} s"
