# mypy: ignore-errors
"""Threads that walk through a launch side by side: their shares, and where they meet.

A share is first + count·t/threads: fixed ranges, so that no sum depends on who is faster.
"""

import taichi as ti

SLICE = 512
"""Iterations per thread of an outer loop: Taichi never cuts a slice of this size in two."""


@ti.func
def meet(s: ti.template(), scene, phase, threads):
    """Wait until all threads have come here for the `phase`-th time (counted from 1)."""
    if threads > 1:
        ti.atomic_add(s.state.arrived[scene], 1)
        while ti.atomic_or(s.state.arrived[scene], 0) < phase * threads:
            pass


@ti.func
def share(low, high, t, threads):
    """Where the share of thread t in low .. high begins."""
    return low + (high - low) * t // threads
