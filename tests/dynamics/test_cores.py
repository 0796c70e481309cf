"""Which cores the threads of launches run on."""

import os
import sys

import pytest

import tisoft as ts
from tisoft.cores import Cores, permitted

on_linux = pytest.mark.skipif(sys.platform != "linux", reason="threads are held on Linux only")
CORES = os.sched_getaffinity(0) if sys.platform == "linux" else set()


def places():
    """The cores that each thread of this process may run on, by its number."""
    return {int(t): os.sched_getaffinity(int(t)) for t in os.listdir("/proc/self/task")}


@on_linux
def test_each_thread_has_a_core_while_all_are_taken_and_any_core_otherwise():
    scene = ts.Scene(frame_rate=60.0)
    scene.add_body(ts.box(size=(1, 1, 1), cells=(4, 4, 4)), ts.ViscoElastic(1e5, 0.3, 1e3))
    many, one = ts.Simulation(scene, threads=permitted()), ts.Simulation(scene, threads=1)
    many.run(0.2)
    held = [place for place in places().values() if place != CORES]
    if permitted() > 1:
        assert sorted(held, key=min) == [{core} for core in sorted(CORES)]
    assert os.sched_getaffinity(0) == CORES
    one.run(0.02)
    assert all(place == CORES for place in places().values())


@on_linux
def test_a_launch_whose_threads_are_not_clear_holds_none():
    calls = []
    cores = Cores()
    for _ in range(20):
        cores.launch(permitted(), lambda: calls.append(1))
    assert len(calls) == 20
    assert all(place == CORES for place in places().values())
