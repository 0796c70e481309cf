"""How many threads a launch takes, by a clock that the test writes."""

import numpy as np

import tisoft as ts
from tisoft.step.pace import LONGEST_WAIT, RENEWED, Pace, most_threads


def shares(cost, launches=2000):
    """Share of launches with several threads, where cost(threads, number) is a launch's time."""
    pace = Pace(2)
    taken = []
    for number in range(launches):
        threads = pace.threads()
        pace.took(threads, cost(threads, number))
        taken.append(threads)
    return np.array(taken)


def test_threads_are_no_more_than_there_are_nor_than_parts_and_one_for_little_work():
    assert [most_threads(10**6, parts, 8) for parts in (1, 3, 99)] == [1, 3, 8]
    assert [most_threads(work, 99, 8) for work in (0, 1)] == [1, 1]
    assert all(
        1 <= most_threads(work, 99, 8) <= most_threads(2 * work, 99, 8) <= 8
        for work in range(0, 20_000, 50)
    )


def test_idle_cores_are_used_and_alone_is_looked_at_again_now_and_then():
    taken = shares(lambda threads, _: 1.0 / threads)
    assert taken[0] == 1
    assert (taken == 1).sum() == 1 + (len(taken) - 1) // (RENEWED + 1)


def test_a_busy_core_leaves_one_thread_with_trials_ever_rarer():
    taken = shares(lambda threads, _: 30.0 if threads == 2 else 1.0)
    assert taken[200:].mean() - 1.0 < 1.5 / LONGEST_WAIT
    assert np.flatnonzero(taken == 2)[:5].tolist() == [1, 3, 8, 25, 90]


def test_a_machine_that_slows_down_as_a_whole_keeps_its_threads():
    taken = shares(lambda threads, number: (1.0 + number / 100) / threads)
    assert (taken == 2).mean() > 0.9


def test_threads_return_after_a_neighbour_has_gone():
    taken = shares(lambda threads, number: 1.0 if threads == 1 else 30.0 if number < 1000 else 0.5)
    assert (taken[1000 + LONGEST_WAIT :] == 2).mean() > 0.99


def test_a_machine_with_one_thread_never_tries():
    pace = Pace(1)
    for _ in range(10):
        assert pace.threads() == 1 and not pace.is_trial()
        pace.took(1, 1.0)


def test_paces_are_taken_where_threads_are_not_given():
    for threads in (None, 1):
        scene = ts.Scene(frame_rate=60.0)
        scene.add_body(ts.net([[0, 1, 0]], []), ts.MassSpring(stiffness=1.0, node_mass=0.1))
        sim = ts.Simulation(scene, threads=threads)
        sim.run(0.1)
        assert np.isfinite(sim.stepper.pace.alone) == (threads is None)
