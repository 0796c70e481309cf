"""Short real runs: what a simulated second costs, and where the places go."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from tisoft import runtime
from tisoft.charting.carriers import carrier
from tisoft.charting.places import Place, corners_of
from tisoft.scene import Scene

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
    """Seconds of computing a simulated second, by a short real run; whole frames where they are
    short, else substeps.
    """
    from tisoft.simulation import Simulation

    explicit = scene.integrator == "explicit-euler"
    sim = Simulation(scene, certify=not explicit)
    frame_time = 1.0 / scene.frame_rate
    substeps, step = sim.substeps_of(frame_time)
    limit = sim.limit.sharp()
    sim.substep(1, 0.0 if explicit else 1e-6 * step)  # compiles
    count, each = min(substeps, 16), np.inf
    for _ in range(4):  # the first ones tell how many make a launch not count
        begun = _stepping(sim)
        sim.stepper.advance(count, step, sim.gravity_now)
        each = min(each, max(_stepping(sim) - begun, 1e-9) / count)
        count = min(1000, max(1, int(LAUNCH / each)))
    if each * substeps < LONGEST_FRAME and not explicit:
        cost = _by_frames(sim, each * substeps)
    else:
        cost = _by_substeps(sim, each, min(substeps, 10_000), step)
    return {"step": step, "stable_step": float(limit), "cost": cost}


def _stepping(sim: Any = None) -> float:
    """Seconds on a clock that stands still while something is compiled; of a simulation in one
    thread those of this process, which other programs do not slow down by taking turns.
    """
    alone = sim is not None and sim.stepper.pace.most == 1
    return (time.process_time() if alone else time.perf_counter()) - runtime.compile_seconds


def _by_substeps(sim: Any, each: float, most: int, step: float) -> float:
    """Of substeps that take about `each` seconds, `most` of them at a time at the most."""
    count = max(1, min(most, int(TIMED / WINDOWS / max(each, 1e-9))))
    speeds = []
    for _ in range(WINDOWS):
        begun = _stepping(sim)
        sim.stepper.advance(count, step, sim.gravity_now)
        speeds.append((_stepping(sim) - begun) / (count * step))
    return min(speeds)


def _by_frames(sim: Any, each: float) -> float:
    """Of frames that take about `each` seconds, some at a time as a run makes them."""
    rate = float(sim.scene.frame_rate)
    is_long = each > LONG_FRAME
    sim.run((1 if is_long else FIRST_FRAMES) / rate)
    frames = min(max(1, int(TIMED / WINDOWS / max(each, 1e-9))), 600)
    speeds = []
    for _ in range(2 if is_long else WINDOWS):
        begun = _stepping(sim)
        made = sim.frame
        while sim.frame < made + frames:
            if not sim.make_frames(made + frames - sim.frame):
                sim.step()
        speeds.append((_stepping(sim) - begun) * rate / frames)
    return min(speeds)


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
