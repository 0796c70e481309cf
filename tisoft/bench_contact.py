"""What contact costs: stacks of five soft blocks beside each other, 15,000 tets on a plane, and
twenty cubes poured into a bowl.

Blocks of 3³ cells of 0.02 m, 135 tets each, stand on a plane and on each other, a little more than
their thickness apart.  Beside them the same scene with `contact = false`, so that nothing but the
tets and the nodes is left; both in one thread, by the processor's time:

    cost of a contact = (substep with − substep without)/(rows of a substep)

The bowl is timed by the clock on the wall, with as many threads as there are.
"""

from __future__ import annotations

import statistics
import time
from dataclasses import replace
from typing import Any

import numpy as np

from tisoft import runtime
from tisoft.geometry.shapes import box
from tisoft.models.materials import NeoHookean, ViscoElastic
from tisoft.obstacles import Plane, Shell
from tisoft.scene import Scene

BODIES = (5, 10, 20, 40, 80)
HIGH = 5
"""Blocks of a stack."""
ON_PLANE = (14, 14, 15)
"""Cells of the block on a plane: 14,700 tets."""
SUBSTEPS = 50
"""Substeps between two looks at the clock."""
LEAST_TURNS = 9
"""Of a scene with and one without a plane."""
SETTLING = 0.2
"""Simulated seconds that blocks get to come to rest."""
POURED, POURING = 20, 2.0
"""Cubes, and simulated seconds until most of them lie still."""
CUBE, WIDER = 0.14, 1.4
"""Their size [m], and the bowl's over that of the demo, so that they find room."""
GUMMY = NeoHookean(1e5, 0.3, 1000.0, phi=10.0, eta=10.0)
SOFT = ViscoElastic(1e5, 0.3, 1000.0, phi=120.0, eta=80.0)


def stacks(count: int, *, contact: bool = True) -> Scene:
    """So many blocks in stacks."""
    scene = Scene(frame_rate=60.0)
    size, gap = 0.06, 0.0015
    mesh = box((size, size, size), (3, 3, 3))
    for k in range(count):
        column, row = divmod(k, HIGH)
        place = (size + gap) * column, (size + gap) * row + 1e-4, 0.0
        body = scene.add_body(mesh.transformed(translate=place), SOFT, f"block{k}")
        body.contact = contact
    scene.add_obstacle(Plane())
    return scene


def block(*, plane: bool) -> Scene:
    """One block, on a plane or without it."""
    scene = Scene(frame_rate=60.0)
    scene.add_body(box((0.4, 0.4, 0.4), ON_PLANE), SOFT)
    if plane:
        scene.add_obstacle(Plane())
    return scene


def measure(count: int, *, seconds: float = 1.0) -> dict[str, Any]:
    """Cost of contact of so many blocks."""
    sim, with_it = _timed(stacks(count), seconds)
    before = sim.touching.counts()
    _stepped(sim)
    after = sim.touching.counts()
    free, without = _timed(stacks(count, contact=False), seconds)
    per = {name: (after[name] - before[name]) / SUBSTEPS for name in ("rows", "sweeps", "searches")}
    return {
        "bodies": count,
        "elements": free.system.elements,
        "contacts": per["rows"],
        "sweeps": per["sweeps"],
        "searches": per["searches"],
        "microseconds_per_substep": 1e6 * with_it,
        "without": 1e6 * without,
        "microseconds_per_contact": 1e6 * (with_it - without) / max(per["rows"], 1.0),
    }


def measure_plane(*, seconds: float = 1.0) -> dict[str, Any]:
    """Cost of contact of one block on a plane, as a share of stepping; in turns with the block
    alone, since machines change their pace.
    """
    sim, free = _begun(block(plane=True)), _begun(block(plane=False), settled=False)
    ratios: list[float] = []
    spent = 0.0
    while len(ratios) < LEAST_TURNS or spent < 2.0 * seconds:
        with_it, without = _stepped(sim), _stepped(free)
        ratios.append(without / with_it)
        spent += with_it + without
    return {"elements": sim.system.elements, "share": 1.0 - statistics.median(ratios)}


def pour(bowl: Shell) -> Scene:
    """Soft cubes over a bowl, three beside each other."""
    scene = Scene(frame_rate=60.0)
    scene.add_obstacle(replace(bowl, points=WIDER * bowl.points))
    size, cells = (CUBE, CUBE, CUBE), (6, 6, 6)
    mesh = box(size, cells).transformed(translate=(-0.5 * CUBE, -0.5 * CUBE, -0.5 * CUBE))
    for k in range(POURED):
        layer, place = divmod(k, 3)
        angle = 2.0 * np.pi / 3.0 * place + 0.6 * layer
        at = (0.145 * np.cos(angle), 0.33 + 0.25 * layer, 0.145 * np.sin(angle))
        turned = mesh.transformed(rotate=(31 * k, 17 * k, 45 * k), translate=at)
        scene.add_body(turned, GUMMY).velocity = (0.0, -0.5, 0.0)
    return scene


def measure_pour(bowl: Shell) -> dict[str, Any]:
    """How fast cubes are poured into a bowl, until they lie there."""
    runtime.import_taichi()
    from tisoft.simulation import Simulation

    sim = Simulation(pour(bowl))
    sim.run(POURING)
    return {
        "poured": POURED,
        "elements": sim.system.elements,
        "seconds": sim.time,
        "real_time_factor": sim.time / sim.wall_seconds,
    }


def _begun(scene: Scene, *, settled: bool = True) -> Any:
    """The simulation, at rest or at its start, compiled."""
    runtime.import_taichi()
    from tisoft.simulation import Simulation

    sim = Simulation(scene, threads=1)
    sim.run(SETTLING if settled else 1.0 / scene.frame_rate)
    return sim


def _timed(scene: Scene, seconds: float) -> tuple[Any, float]:
    """The simulation, and the processor's time of a substep [s]: the median of some."""
    sim = _begun(scene)
    times: list[float] = []
    while len(times) < 3 or sum(times) < seconds:
        times.append(_stepped(sim))
    return sim, statistics.median(times) / SUBSTEPS


def _stepped(sim: Any) -> float:
    """Seconds of the processor that some substeps take."""
    begun = time.thread_time()
    sim.stepper.advance(SUBSTEPS, sim.steps[-1], sim.gravity_now)
    return time.thread_time() - begun


def as_text(rows: list[dict[str, Any]]) -> str:
    """A table of the rows."""
    lines = [
        f"{'bodies':>7}{'elements':>10}{'contacts':>10}{'sweeps':>8}{'searches':>10}"
        f"{'µs/substep':>12}{'without':>9}{'µs/contact':>12}"
    ]
    for row in rows:
        if "poured" in row:
            lines.append(
                f"{row['poured']} cubes of {row['elements']} tets poured into a bowl: "
                f"{row['seconds']:.0f} s at {row['real_time_factor']:.2f} x real time"
            )
            continue
        if "share" in row:
            told = f"{100 * row['share']:.1f} % of stepping"
            lines.append(f"a plane under {row['elements']} tets: {told}")
            continue
        lines.append(
            f"{row['bodies']:>7}{row['elements']:>10}{row['contacts']:>10.0f}{row['sweeps']:>8.1f}"
            f"{row['searches']:>10.3f}{row['microseconds_per_substep']:>12.0f}"
            f"{row['without']:>9.0f}{row['microseconds_per_contact']:>12.3f}"
        )
    return "\n".join(lines)
