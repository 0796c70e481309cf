"""Which core each thread of a launch runs on.

Threads of a launch meet at a barrier after each pass.  Linux may well wake two of them on one core
while another stands idle, and there each waits, some 10 ms long, until the scheduler takes the core
from the other.  So while launches take all cores, each of their threads is held to one; before a
launch of fewer threads they are let go, so that it may run where no other program does.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable

THREADS = "/proc/self/task"
TRIES = 8
"""Launches whose threads are looked for, before it is given up."""
CLEAR = 4
"""Times as long as any other that each thread of a launch must have run in its time."""


def permitted() -> int:
    """Cores that this process may run on."""
    if sys.platform != "linux":
        return os.cpu_count() or 1
    return len(os.sched_getaffinity(0))


class Cores:
    """Holds the threads of launches to cores, on Linux; elsewhere it does nothing."""

    def __init__(self) -> None:
        self._tries = TRIES if sys.platform == "linux" else 0
        self._workers: list[int] = []
        self._are_held = False

    def launch(self, threads: int, call: Callable[[], None]) -> None:
        """Call what launches so many `threads`."""
        takes_all = threads > 1 and threads == permitted()
        if takes_all and not self._workers and self._tries > 0:
            self._tries -= 1
            self._workers = _busiest(threads, call)
            return
        if takes_all != self._are_held and self._workers:
            self._hold(takes_all)
        call()

    def _hold(self, holds: bool) -> None:
        cores = sorted(os.sched_getaffinity(0))
        try:
            for worker, core in zip(self._workers, cores, strict=True):
                os.sched_setaffinity(worker, {core} if holds else cores)
        except (OSError, ValueError):  # a thread has gone, or a core been taken away
            self._workers = []
        self._are_held = holds


def _busiest(count: int, call: Callable[[], None]) -> list[int]:
    """The `count` threads, besides the caller's, that a call keeps busy; none where that is not
    clear.
    """
    before = _nanoseconds_run()
    call()
    now, caller = _nanoseconds_run(), threading.get_native_id()
    spent = {thread: now[thread] - before.get(thread, 0) for thread in now if thread != caller}
    order = sorted(spent, key=lambda thread: -spent[thread])
    least, next_one = ([spent[thread] for thread in order] + [0, 0])[count - 1 : count + 1]
    return order[:count] if least > CLEAR * next_one else []


def _nanoseconds_run() -> dict[int, int]:
    """How long each thread of the process has run."""
    run = {}
    for thread in os.listdir(THREADS):
        try:
            with open(f"{THREADS}/{thread}/schedstat") as file:
                run[int(thread)] = int(file.read().split()[0])
        except OSError:  # it has ended, or this system does not tell
            continue
    return run
