"""What is computed of one variant: static answer, modes, cost.  Everything is plain data."""

from __future__ import annotations

import hashlib
import math
import os
import pickle
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tisoft import runtime
from tisoft.changes import MODEL_WORDS, scene_with
from tisoft.charting.carriers import carrier
from tisoft.charting.linearly import linear_static
from tisoft.charting.variants import Variant
from tisoft.errors import Diverged, NoEquilibrium, OutOfTime, TisoftError
from tisoft.models.materials import MassSpring
from tisoft.scene import Scene
from tisoft.version import version

Floats = NDArray[np.float64]

FORM = b"5"
"""Changes where records hold other things than before."""
MODES = 3
"""Elastic modes that are compared."""
TIMED, WINDOWS = 0.3, 6
"""Seconds of stepping that a cost is timed in, and parts of it, of which the fastest counts: what
other programs take comes on top."""
LONG_FRAME, LONGEST_FRAME = 0.1, 1.0
"""Seconds of computing above which one frame is timed, and above which some of its substeps are."""
FIRST_FRAMES = 12
"""Frames made before those that are timed: a run makes its first ones one by one."""
DRAWN = 6000
"""Nodes up to which displacements are kept for pictures."""


@dataclass(frozen=True)
class Place:
    """A point of a body, which probes follow: its name in the scene, rest position [m]."""

    name: str
    body: int
    point: tuple[float, float, float]


def places_of(scene: Scene) -> list[Place]:
    """Where the scene's probes are: the nodes that they follow."""
    found = []
    for probe in scene.probes:
        seen = scene.probed(probe)
        x, y, z = (float(c) for c in seen.at(seen.body.mesh.points))
        found.append(Place(probe.name, scene.bodies.index(seen.body), (x, y, z)))
    return found


class Bench:
    """Computes what is asked of variants of a scene, and keeps it.

    Args:
        source: the scene file, or a Scene.
        places: where displacements are compared.
        kept: results of an earlier call, by content.
    """

    def __init__(
        self, source: str | Scene, places: list[Place], kept: dict[str, dict[str, Any]]
    ) -> None:
        self.source = source
        self.places = places
        self.kept = kept
        if isinstance(source, Scene):
            content = pickle.dumps(source)
        else:
            content = os.path.realpath(source).encode() + Path(source).read_bytes()
        self._mark = content + FORM + version().encode() + repr(places).encode()

    def key(self, variant: Variant) -> str:
        """What a variant's results depend on."""
        told = self._mark + repr(variant.settings).encode()
        return hashlib.sha256(told).hexdigest()[:20]

    def record(self, variant: Variant) -> dict[str, Any]:
        """What is known of a variant; filled by the functions below."""
        return self.kept.setdefault(self.key(variant), {"settings": list(variant.settings)})

    def scene(self, variant: Variant) -> Scene:
        """The variant's scene; raises SceneError."""
        return scene_with(self.source, variant.settings)

    def ask(self, what: str, variant: Variant, seconds: float = math.inf) -> dict[str, Any]:
        """What one of the functions below finds, by its word in `WORK`, computed once.

        A failure is kept as {"error": sentence}; what a static answer has no time for within so
        many seconds is told and not kept.
        """
        from tisoft.equilibrium.linear_solve import latest

        record = self.record(variant)
        if what not in record:
            begun, worked = time.perf_counter(), time.process_time()
            compiled = runtime.compile_seconds
            try:
                work: Callable[[Scene, list[Place]], dict[str, Any]] = WORK[what]
                with latest(seconds):
                    made = work(self.scene(variant), self.places)
            except OutOfTime as error:
                return {"error": str(error), "seconds": seconds, "worked": seconds}
            except (NoEquilibrium, Diverged, TisoftError) as error:
                made = {"error": str(error)}
            made["seconds"] = time.perf_counter() - begun
            made["worked"] = time.process_time() - worked
            made["compiled"] = runtime.compile_seconds - compiled
            record[what] = made
        found: dict[str, Any] = record[what]
        return found


def size_of(scene: Scene, places: list[Place]) -> dict[str, Any]:
    """What the variant is: model, element, counts."""
    kinds = sorted({word for body in scene.bodies for word in body.mesh.cells})
    models = sorted({MODEL_WORDS.get(type(body.model), "own") for body in scene.bodies})
    springs = models == ["mass-spring"]
    counts = [len(b.springs()) if springs else b.mesh.elements for b in scene.bodies]
    return {
        "model": "+".join(models),
        "element": "spring" if springs else "+".join(kinds) or "spring",
        "elements": sum(counts),
        "nodes": sum(len(body.mesh.points) for body in scene.bodies),
        "front": sum(_front(body.mesh.points) for body in scene.bodies),
        "precision": scene.precision,
        "integrator": scene.integrator,
        "frame_rate": scene.frame_rate,
    }


def _front(points: Floats) -> float:
    """Unknowns of the widest front of a factorisation, cubed: those of a cut across the body's
    longest way, 3 n^⅔ V^⅓/L nodes of its box.
    """
    extents = np.ptp(points, axis=0)
    longest = float(extents.max()) or 1.0
    return 27.0 * len(points) ** 2 * float(extents.prod()) / longest**3


def static_of(scene: Scene, places: list[Place]) -> dict[str, Any]:
    """Displacements at the places [m], and the elastic energy [J], at rest under the loads."""
    from tisoft.equilibrium.statics import equilibrium

    found = equilibrium(scene)
    ends = np.cumsum([len(body.mesh.points) for body in scene.bodies])[:-1]
    of_bodies = np.split(found.positions, ends)
    moved = [x - body.mesh.points for x, body in zip(of_bodies, scene.bodies, strict=True)]
    elastic = found.energy["elastic"]
    rest = np.concatenate([body.mesh.points for body in scene.bodies])
    return {
        "places": _at_places(scene, places, moved),
        "energy": None if elastic is None else float(elastic),
        "turn": _turn(scene, found.positions),
        "most": float(np.linalg.norm(found.positions - rest, axis=1).max()),
        "shape": _rounded(found.positions - rest) if len(rest) <= DRAWN else None,
        "warnings": found.warnings,
    }


def linear_static_of(scene: Scene, places: list[Place]) -> dict[str, Any]:
    """The same by linear elasticity, whatever the model."""
    moved, energy = linear_static(scene)
    return {"places": _at_places(scene, places, moved), "energy": energy}


def _at_places(scene: Scene, places: list[Place], moved: list[Floats]) -> list[list[float]]:
    """Displacements [m] at the places from those of the nodes of each body."""
    found = []
    for place in places:
        mesh, u = scene.bodies[place.body].mesh, moved[place.body]
        nodes, weights = carrier(mesh, np.array(place.point))
        found.append((weights @ u[nodes]).tolist())
    return found


def _rounded(u: Floats) -> list[list[float]]:
    """Displacements [m] to four digits of the largest: enough for a picture."""
    unit = 1e-4 * (float(np.abs(u).max(initial=0.0)) or 1.0)
    return [[float(f"{x:.6g}") for x in row] for row in np.round(u / unit) * unit]


def _turn(scene: Scene, positions: Floats) -> float | None:
    """Largest rotation of any cell [rad]; None where there are springs alone."""
    from tisoft.model.part import parts_of
    from tisoft.study.own import extremes

    largest, begun = None, 0
    for part in parts_of(scene.bodies):
        count = len(part.order)
        u = positions[begun : begun + count] - part.body.mesh.points
        for cells in part.solids:
            F = cells.deformation(u[part.order])
            largest = max(largest or 0.0, extremes(F.reshape(-1, 3, 3))[1])
        begun += count
    return largest


def modes_of(
    scene: Scene, places: list[Place], mass: Literal["consistent"] | None = None
) -> dict[str, Any]:
    """The lowest elastic frequencies [Hz], at rest; of nets that are slack there, under load."""
    from tisoft.equilibrium.modes import natural_modes

    nets = any(isinstance(body.model, MassSpring) for body in scene.bodies)
    for about in ("rest", "equilibrium") if nets else ("rest",):
        for rigid in (0, 6 * len(scene.bodies), 6 * len(scene.bodies) + 40):
            found = natural_modes(scene, MODES + rigid, mass=mass, about=about).frequencies
            elastic = found[found > 0.0]
            if len(elastic) >= MODES or len(found) < MODES + rigid:
                break
        if len(elastic) >= MODES:
            break
    return {"frequencies": elastic[:MODES].tolist(), "about": about}


def exact_modes_of(scene: Scene, places: list[Place]) -> dict[str, Any]:
    """The same with consistent masses, for the ruler: lumped ones turn too heavily (torsion)."""
    return modes_of(scene, places, "consistent")


def step_of(scene: Scene, places: list[Place]) -> dict[str, Any]:
    """The step that "auto" takes at rest, the given one, and the limit [s]; kernels for nets only,
    whose own bound is the limit that they keep.
    """
    from tisoft.equilibrium.damping import damped_body
    from tisoft.equilibrium.operators import operators_at_rest
    from tisoft.model.part import parts_of
    from tisoft.stable.bound import limits_at_rest
    from tisoft.stable.limit import SHARE
    from tisoft.stable.sharp import sharp_limit
    from tisoft.step.stepper import INTEGRATORS

    limits, allowed = [], []
    factor = INTEGRATORS[scene.integrator].damping_factor
    for part in parts_of([damped_body(body) for body in scene.bodies]):
        if part.is_springs:
            bound = float(limits_at_rest(part, factor).min(initial=np.inf))
            limits.append(bound)
            allowed.append(bound)
        else:
            rest: Any = operators_at_rest(part)
            limits.append(sharp_limit(part, integrator=scene.integrator, elastic=rest).step)
            allowed.append(SHARE * limits[-1])
    limit = float(min(limits, default=np.inf))
    wanted = min(allowed, default=np.inf) if scene.step == "auto" else float(scene.step)
    frame = 1.0 / scene.frame_rate
    count = max(1, math.ceil(frame / wanted - 1e-9)) if math.isfinite(wanted) else 1
    return {"step": frame / count, "stable_step": limit, "substeps": count}


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
    count, tried = min(substeps, 64), []
    for _ in range(3):
        begun = _stepping(sim)
        sim.stepper.advance(count, step, sim.gravity_now)
        tried.append((_stepping(sim) - begun) / count)
    each = min(tried)
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


def corners_of(scene: Scene) -> list[Place]:
    """Where bodies are watched that no probe follows: the nodes nearest to their boxes' corners."""
    found = []
    for k, body in enumerate(scene.bodies):
        points = body.mesh.points
        low, high = points.min(axis=0), points.max(axis=0)
        for pick in np.ndindex(2, 2, 2):
            corner = np.where(pick, high, low)
            x, y, z = points[np.linalg.norm(points - corner, axis=1).argmin()].tolist()
            found.append(Place("", k, (x, y, z)))
    return found


WORK: dict[str, Any] = {
    "size": size_of,
    "static": static_of,
    "linear static": linear_static_of,
    "modes": modes_of,
    "exact modes": exact_modes_of,
    "step": step_of,
    "timing": timing_of,
    "path": path_of,
}
