"""Short real runs: what a simulated second costs, and where the places go."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from tisoft import runtime
from tisoft.charting.carriers import carrier
from tisoft.charting.places import Place, corners_of
from tisoft.scene import Scene
from tisoft.step.pace import Pace

TIMED, WINDOWS = 0.3, 6
"""Seconds of stepping that a cost is timed in, and parts of it, of which the fastest counts: what
other programs take comes on top."""
LAUNCH = 0.02
"""Seconds of stepping beside which calling a kernel does not count."""
LONG_FRAME, LONGEST_FRAME = 0.1, 1.0
"""Seconds of computing above which one frame is timed, and above which some of its substeps are."""
FIRST_FRAMES = 12
"""Frames made before those that are timed: a run makes its first ones one by one."""


def timing_of(scene: Scene, places: list[Place]) -> dict[str, Any]:
    """What a simulated second costs, by a short real run of the scene's duration or, where that
    takes long, of its beginning; of some substeps where single frames do.
    """
    from tisoft.simulation import Simulation

    explicit = scene.integrator == "explicit-euler"
    sim = Simulation(scene, certify=not explicit)
    substeps, step = sim.substeps_of(1.0 / scene.frame_rate)
    limit = sim.limit.sharp()
    short = 0.0 if explicit else 1e-6 * step  # bodies stay where they are
    sim.substep(1, short)  # compiles
    each = _substep(sim, short, min(substeps, 16))
    found = {"step": step, "stable_step": float(limit)}
    if each * substeps < LONGEST_FRAME and not explicit:
        return found | _by_frames(sim, each * substeps, substeps)
    counts, most = {1, sim.stepper.pace.most}, min(substeps, 10_000)
    each = min(_by_substeps(sim, count, each, most, step) for count in counts)
    cost = each * substeps * scene.frame_rate
    return found | {"cost": cost, "substep": each, "frame": None, "growth": None}


def _substep(sim: Any, step: float, count: int) -> float:
    """Seconds of a bare substep of `step` [s]; `count` of them are tried first."""
    each = np.inf
    for _ in range(4):  # the first ones tell how many make a launch not count
        begun = _stepping(sim)
        sim.stepper.advance(count, step, sim.gravity_now)
        each = min(each, max(_stepping(sim) - begun, 1e-9) / count)
        count = min(1000, max(1, int(LAUNCH / each)))
    return each


def _stepping(sim: Any = None) -> float:
    """Seconds on a clock that stands still while something is compiled; of a simulation in one
    thread those of this process, which other programs do not slow down by taking turns.
    """
    alone = sim is not None and sim.stepper.pace.most == 1
    return (time.process_time() if alone else time.perf_counter()) - runtime.compile_seconds


def _by_substeps(sim: Any, threads: int, each: float, most: int, step: float) -> float:
    """Seconds of a substep of those that take about `each`, `most` at a time at the most."""
    _take(sim, threads)
    count = max(1, min(most, int(TIMED / WINDOWS / max(each, 1e-9))))
    speeds = []
    for _ in range(WINDOWS):
        begun = _stepping(sim)
        sim.stepper.advance(count, step, sim.gravity_now)
        speeds.append((_stepping(sim) - begun) / count)
    return min(speeds)


def _by_frames(sim: Any, each: float, at_rest: int) -> dict[str, Any]:
    """The cost of runs of the scene's duration until time is up, and what it is made of (`costs`).

    Args:
        sim: of the scene, at its start.
        each: seconds that a frame takes, about.
        at_rest: substeps of a frame at rest.
    """
    from tisoft.simulation import Simulation

    scene, threads = sim.scene, sim.stepper.pace.most
    speeds: dict[int, float] = {}
    spent, growth, is_part = 0.0, 0.0, False
    for number in range(WINDOWS):
        if number > 0:
            sim = None  # its place in memory is the next one's
            sim = Simulation(scene)
        windows = _windows(sim, TIMED - spent, each, [threads, 1][number % 2 :])
        if number == 0:
            growth = sim.substeps / (sim.frame * at_rest)
            is_part = sim.frame < min(FIRST_FRAMES, _frames(scene))
        for count, seconds, substeps in windows:
            speeds[count] = min(speeds.get(count, np.inf), seconds / substeps)
            spent += seconds
        if spent > (1.0 - 1.0 / WINDOWS) * TIMED:
            break
    count, whole = min(speeds.items(), key=lambda item: item[1])
    _take(sim, count)
    bare = min(whole, _substep(sim, 0.5 * sim.steps[-1], 16))
    return {
        "cost": whole * growth * at_rest * scene.frame_rate, "substep": bare,
        "frame": (whole - bare) * growth * at_rest, "growth": None if is_part else growth,
    }  # fmt: skip


def _take(sim: Any, threads: int) -> None:
    """Let a simulation take so many threads from now on."""
    sim.stepper.pace, sim.stepper.fixed = Pace(threads), threads


def _frames(scene: Scene) -> int:
    return max(2, round(scene.duration * scene.frame_rate))


def _windows(
    sim: Any, most: float, each: float, threads: Sequence[int]
) -> list[tuple[int, float, int]]:
    """Threads, seconds and substeps of stretches of a run to the end of the scene's duration.

    Args:
        sim: at its start.
        most: seconds after which it is given up.
        each: seconds that a frame takes, about.
        threads: of stretches in turn: several wait for one another while other programs run, and
            what one takes is then all there is to go by.
    """
    last = _frames(sim.scene)
    first = min(FIRST_FRAMES if each < LONG_FRAME else 1, last // 2)
    while sim.frame < first:
        sim.step()
    windows: list[tuple[int, float, int]] = []
    spent = 0.0
    while sim.frame < last and (spent < most or len(windows) < len(threads)):
        _take(sim, threads[len(windows) % len(threads)])
        begun, before, seconds = _stepping(sim), sim.substeps, 0.0
        while sim.frame < last and seconds < TIMED / WINDOWS:
            if not sim.make_frames(last - sim.frame):
                sim.step()
            seconds = _stepping(sim) - begun
        windows.append((sim.stepper.pace.most, seconds, sim.substeps - before))
        spent += seconds
    long = [window for window in windows if window[1] > 0.5 * TIMED / WINDOWS]
    return long or windows


def path_of(scene: Scene, places: list[Place]) -> dict[str, Any]:
    """Displacements of the places, or of the corners of the bodies' boxes, frame by frame [m]."""
    from tisoft.simulation import Simulation

    sim = Simulation(scene)
    watched = [
        (place.body, *carrier(scene.bodies[place.body].mesh, np.array(place.point)))
        for place in places or corners_of(scene)
    ]
    ends = np.cumsum([0, *(len(body.mesh.points) for body in scene.bodies)])
    rest = np.concatenate([body.mesh.points for body in scene.bodies])
    rows: list[list[list[float]]] = []
    moments = []

    def look(frame: Any) -> None:
        u = frame.positions() - rest
        rows.append([(w @ u[ends[body] + nodes]).tolist() for body, nodes, w in watched])
        moments.append(_stepping())

    sim.run(observers=[look])
    first = min(FIRST_FRAMES, len(moments) // 2)
    each = (moments[-1] - moments[first]) / max(1, len(moments) - 1 - first)
    return {"path": rows, "cost": each * scene.frame_rate}
