"""Work on several processes or machines, by Dask distributed (Rocklin 2015).

Results come in any order; each tells which job it is of.  A worker that dies is replaced, and its
job computed again elsewhere.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from tisoft.errors import SceneError

PATIENCE = 10.0
"""Seconds that a scheduler has to answer."""
RETRIES = 3
"""How often a job may lose its worker."""
QUIET = {
    "distributed.admin.tick.limit": "1h",
    "distributed.worker.profile.enabled": False,
    "distributed.scheduler.allowed-failures": RETRIES,
    "distributed.comm.timeouts.connect": f"{PATIENCE}s",
    "distributed.comm.retry.count": 0,
}


def each(
    work: Callable[[Any], Any],
    jobs: Sequence[Any],
    *,
    workers: int | None = None,
    scheduler: str | None = None,
) -> Iterator[tuple[int, Any]]:
    """(number of the job, result) of every job, as they are done.

    Args:
        work: a function of a module, so that other processes find it.
        jobs: its arguments.
        workers: processes of this machine; left out, this process.
        scheduler: the address of a Dask scheduler instead.

    Raises:
        SceneError: Dask is missing, or the scheduler does not answer.
    """
    if workers is None and scheduler is None:
        yield from ((number, work(job)) for number, job in enumerate(jobs))
        return
    with client_of(workers, scheduler) as client:
        yield from _on_client(client, work, jobs)


def _on_client(
    client: Any, work: Callable[[Any], Any], jobs: Sequence[Any]
) -> Iterator[tuple[int, Any]]:
    distributed: Any = import_module("distributed")
    futures = [client.submit(work, job, pure=False, retries=0) for job in jobs]
    numbers = {future.key: number for number, future in enumerate(futures)}
    for future in distributed.as_completed(futures):
        number = numbers[future.key]
        try:
            yield number, future.result()
        except distributed.KilledWorker:
            told = f"its worker died {RETRIES + 1} times: the memory may not suffice"
            yield number, {"status": "failed", "error": told}
        future.release()


@contextmanager
def client_of(workers: int | None, scheduler: str | None) -> Iterator[Any]:
    """A Dask client: of a cluster of processes of this machine, or of a scheduler elsewhere."""
    if workers is not None and scheduler is not None:
        raise SceneError("--workers and --scheduler exclude each other; give one of them")
    if workers is not None and workers < 1:
        raise SceneError(f"--workers is {workers}; give a number of processes, as 2")
    try:
        dask: Any = import_module("dask")
        distributed: Any = import_module("distributed")
    except ImportError:
        problem = "several workers need Dask, which is not installed"
        raise SceneError(f'{problem}; install it with: pip install "tisoft[cluster]"') from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    with dask.config.set(QUIET):
        if scheduler is not None:
            try:
                client = distributed.Client(scheduler, timeout=PATIENCE)
            except (OSError, TimeoutError, ValueError) as error:
                problem = f"--scheduler {scheduler} does not answer within {PATIENCE:g} s"
                raise SceneError(f"{problem} ({type(error).__name__}); check address") from None
            with client:
                yield client
            return
        with (
            distributed.LocalCluster(
                n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None,
                silence_logs=logging.CRITICAL,
            ) as cluster,
            distributed.Client(cluster) as client,
        ):  # fmt: skip
            yield client


def threads_for(workers: int | None) -> int | None:
    """CPU threads of each of several workers, so that together they fill the machine."""
    return None if workers is None else max(1, (os.cpu_count() or 1) // max(1, workers))
