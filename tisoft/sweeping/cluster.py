"""Work on several processes or machines, by Dask distributed (Rocklin 2015).

Results come in any order; each tells which job it is of.  A worker that dies is replaced, and its
job computed again elsewhere.
"""

from __future__ import annotations

import logging
import multiprocessing
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from tisoft import stops
from tisoft.cores import permitted
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
    # What wakes a worker beside its row takes Python's lock from the row.
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "5s",
    "distributed.worker.memory.monitor-interval": "1s",
}


def prepare(workers: int | None) -> None:
    """Begin to import what workers need, in a process that they are then copies of, while this one
    reads the scene; only Linux copies processes safely.
    """
    if workers is None or sys.platform != "linux" or find_spec("distributed") is None:
        return
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["tisoft.sweeping.imported"])
    # This begins a process too, and lets signals in again when it does.
    import_module("multiprocessing.resource_tracker").ensure_running()
    with stops.kept_back():
        import_module("multiprocessing.forkserver").ensure_running()


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
    method = "forkserver" if sys.platform == "linux" else "spawn"
    with dask.config.set(QUIET | {"distributed.worker.multiprocessing-method": method}):
        if scheduler is not None:
            try:
                client = distributed.Client(scheduler, timeout=PATIENCE)
            except (OSError, TimeoutError, ValueError) as error:
                problem = f"--scheduler {scheduler} does not answer within {PATIENCE:g} s"
                raise SceneError(f"{problem} ({type(error).__name__}); check address") from None
            with client:
                yield client
            return
        with stops.held():
            cluster = distributed.LocalCluster(
                n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None,
                silence_logs=logging.CRITICAL,
            )  # fmt: skip
            client = distributed.Client(cluster)
        try:
            yield client
        finally:
            with stops.held():
                _end(cluster, client)


def _end(cluster: Any, client: Any) -> None:
    """End the workers at once: what they still compute is not wanted."""
    for nanny in cluster.workers.values():
        nanny.auto_restart = False
    for child in multiprocessing.active_children():
        if child.name.startswith("Dask Worker"):
            child.kill()
    client.close()
    cluster.close()


def threads_for(workers: int | None) -> int | None:
    """CPU threads of each of several workers, so that together they fill the machine."""
    return None if workers is None else max(1, permitted() // max(1, workers))
