"""Where tasks run: in this process, in worker processes on this machine, or on an existing dask cluster."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from romdam.errors import ConfigError

if TYPE_CHECKING:
    from distributed import Client

S = TypeVar("S", contravariant=True)
T = TypeVar("T")
R = TypeVar("R")

LOOPBACK = "127.0.0.1"
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
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

        everywhere = self._client.scatter(shared, broadcast=True, hash=False)
        waiting = iter(enumerate(tasks))
        numbers = {}
        running = as_completed(loop=self._client.loop)

        def hand_out(count: int) -> None:
            for _, (number, task) in zip(range(count), waiting, strict=False):
                future = self._client.submit(function, everywhere, task, pure=False, retries=2)
                numbers[future.key] = number
                running.add(future)

        workers = max(1, len(self._client.scheduler_info(n_workers=-1)["workers"]))
        hand_out(_AHEAD * workers + workers)
        for future in running:
            number = numbers.pop(future.key)
            try:
                yield number, future.result()
            except KilledWorker as error:
                yield number, error
            future.release()
            hand_out(1)


@contextmanager
def open_pool(workers: int | None, scheduler: str | None) -> Iterator[Pool]:
    """A pool for the body of a `with` statement.

    Parameters
    ----------
    workers : processes on this machine; as many as there are cores if not given. One runs here, without dask
    scheduler : address of an existing dask scheduler, instead

    Raises
    ------
    ConfigError
        where dask is not installed, or the scheduler does not answer.
    """
    count = workers or len(os.sched_getaffinity(0))
    if scheduler is None and count == 1:
        yield OneProcess()
        return
    try:
        import distributed
    except ImportError:
        raise ConfigError(
            "--workers, --scheduler: need dask.distributed; install romdam with the extra `cluster`, "
            "or use --workers 1"
        ) from None
    if scheduler is not None:
        try:
            client = distributed.Client(scheduler, timeout="10s", set_as_default=False)
        except (OSError, ValueError) as error:
            raise ConfigError(f"--scheduler {scheduler}: no dask scheduler answers there ({error})") from None
        with client:
            yield DaskPool(client)
        return
    with _local_cluster(count) as cluster, distributed.Client(cluster, set_as_default=False) as client:
        yield DaskPool(client)


def _local_cluster(count: int) -> Any:
    import logging

    import dask
    from distributed import LocalCluster

    settings = {
        "distributed.nanny.pre-spawn-environ": dict.fromkeys(_THREADS, "1"),
        "distributed.comm.retry.count": 2,
    }
    with dask.config.set(settings):
        return LocalCluster(
            n_workers=count,
            threads_per_worker=1,
            processes=True,
            host=LOOPBACK,
            dashboard_address=f"{LOOPBACK}:0",
            silence_logs=logging.ERROR,
        )
