"""Where tasks run: in this process, in worker processes on this machine, or on an existing dask cluster."""

from __future__ import annotations

import itertools
import os
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from romdam.errors import ConfigError
from romdam.pipelines.workers import LocalPool, prepare

if TYPE_CHECKING:
    from distributed import Client, Future

T = TypeVar("T")

_AHEAD = 2  # tasks handed out for each worker beyond the one it is at


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
    """Tasks on the workers of a dask cluster; the shared data travels to each worker once."""

    def __init__(self, client: Client) -> None:
        self._client = client

    def map(
        self, function: Callable[[Any, Any], Any], shared: object, tasks: Sequence[Any]
    ) -> Iterator[tuple[int, Any]]:
        """See `Pool`. Tasks are handed out as workers get free, so that their data does not pile up."""
        from distributed import as_completed
        from distributed.scheduler import KilledWorker

        if not tasks:
            return
        client = self._client
        everywhere = _shared(client, shared)
        waiting, numbers = iter(enumerate(tasks)), dict[Any, int]()
        running = as_completed(loop=client.loop)

        def hand_out(count: int) -> None:
            for number, task in itertools.islice(waiting, count):
                future = client.submit(function, everywhere, task, pure=False)
                numbers[future.key] = number
                running.add(future)

        hand_out((1 + _AHEAD) * max(1, len(client.nthreads())))
        for future in running:
            number = numbers.pop(future.key)
            try:
                yield number, future.result()
            except KilledWorker as error:
                yield number, error
            future.release()
            hand_out(1)


def _shared(client: Client, shared: object) -> Future:
    """The shared data as the result of a task, which the scheduler makes again should its workers die."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Sending large graph")
        return client.submit(_same, shared, pure=False)


def _same(value: T) -> T:
    return value


@contextmanager
def open_pool(workers: int | None, scheduler: str | None, module: str) -> Iterator[Pool]:
    """A pool for the body of a `with` statement.

    Parameters
    ----------
    workers : processes on this machine; as many as there are cores if not given. One runs here
    scheduler : address of an existing dask scheduler, instead
    module : what the workers will need; it is loaded for them while the body goes on

    Raises
    ------
    ConfigError
        where a scheduler is given and dask is not installed, or the scheduler does not answer.
    """
    if scheduler is not None:
        with _client(scheduler) as client:
            yield DaskPool(client)
        return
    prepare_pool(workers, scheduler, module)
    yield LocalPool(_count(workers)) if _count(workers) > 1 else OneProcess()


def prepare_pool(workers: int | None, scheduler: str | None, module: str) -> None:
    """Let own worker processes load a module ahead of `open_pool`, which has the same parameters."""
    if scheduler is None and _count(workers) > 1:
        prepare(module)


def _count(workers: int | None) -> int:
    return workers or len(os.sched_getaffinity(0))


def _client(scheduler: str) -> Client:
    """A client of dask.distributed, which tells of every worker that comes and goes unless told before."""
    try:
        import dask

        with dask.config.set({"logging": {"distributed": "error"}}):
            import distributed
    except ImportError:
        raise ConfigError(
            "--scheduler: needs dask.distributed; install romdam with the extra `cluster`, or use --workers"
        ) from None
    try:
        return distributed.Client(scheduler, timeout="10s", set_as_default=False)
    except (OSError, ValueError) as error:
        raise ConfigError(f"--scheduler {scheduler}: no dask scheduler answers there ({error})") from None
