"""What is computed of one variant: static answer, modes, cost.  Everything is plain data."""

from __future__ import annotations

import hashlib
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
from tisoft.charting.variants import Variant
from tisoft.errors import Diverged, NoEquilibrium, TisoftError
from tisoft.scene import Scene
from tisoft.version import version

Floats = NDArray[np.float64]

MODES = 3
"""Elastic modes that are compared."""
TIMED = 0.3
"""Seconds of stepping that a cost is timed in."""


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
        self._mark = content + version().encode() + repr(places).encode()

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

    def ask(self, what: str, variant: Variant) -> dict[str, Any]:
        """ "size", "static", "modes", "exact modes" or "timing" of a variant, computed once.

        A failure is kept as {"error": sentence}.
        """
        record = self.record(variant)
        if what not in record:
            begun = time.perf_counter()
            compiled = runtime.compile_seconds
            try:
                work: Callable[[Scene, list[Place]], dict[str, Any]] = WORK[what]
                made = work(self.scene(variant), self.places)
            except (NoEquilibrium, Diverged, TisoftError) as error:
                made = {"error": str(error)}
            made["seconds"] = time.perf_counter() - begun
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
    }


def static_of(scene: Scene, places: list[Place]) -> dict[str, Any]:
    """Displacements at the places [m], and the work of the loads [J], at rest under them."""
    from tisoft.equilibrium.statics import equilibrium

    found = equilibrium(scene)
    ends = np.cumsum([0, *(len(body.mesh.points) for body in scene.bodies)])
    moved = []
    for place in places:
        mesh = scene.bodies[place.body].mesh
        nodes, weights = carrier(mesh, np.array(place.point))
        u = found.positions[ends[place.body] + nodes] - mesh.points[nodes]
        moved.append((weights @ u).tolist())
    work = found.energy["external_work"]
    gravity = found.energy["gravity"]
    weighed = None if work is None else float(work) - float(gravity or 0.0)
    rest = np.concatenate([body.mesh.points for body in scene.bodies])
    return {
        "places": moved,
        "work": weighed,
        "turn": _turn(scene, found.positions),
        "most": float(np.linalg.norm(found.positions - rest, axis=1).max()),
        "positions": found.positions.astype(np.float32).tolist() if len(rest) < 4000 else None,
        "warnings": found.warnings,
    }


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
    """The lowest elastic frequencies [Hz], and how many motions cost no energy."""
    from tisoft.equilibrium.modes import natural_modes

    for rigid in (0, 6 * len(scene.bodies), 6 * len(scene.bodies) + 40):
        found = natural_modes(scene, MODES + rigid, mass=mass).frequencies
        elastic = found[found > 0.0]
        if len(elastic) >= MODES:
            break
    return {"frequencies": elastic[:MODES].tolist(), "free": int((found <= 0.0).sum())}


def exact_modes_of(scene: Scene, places: list[Place]) -> dict[str, Any]:
    """The same with consistent masses, for the ruler: lumped ones turn too heavily (torsion)."""
    return modes_of(scene, places, "consistent")


def timing_of(scene: Scene, places: list[Place]) -> dict[str, Any]:
    """Step [s], stable step [s], and seconds of computing a simulated second, by a short run."""
    from tisoft.simulation import Simulation

    explicit = scene.integrator == "explicit-euler"
    sim = Simulation(scene, certify=not explicit)
    frame_time = 1.0 / scene.frame_rate
    substeps, step = sim.substeps_of(frame_time)
    limit = sim.limit.sharp()
    sim.substep(1, 0.0 if explicit else 1e-6 * step)
    speeds: list[float] = []
    begun = time.perf_counter()
    while len(speeds) < 3 or (time.perf_counter() - begun < TIMED and len(speeds) < 40):
        count = min(substeps, 512)
        start = time.perf_counter()
        sim.stepper.advance(count, step, scene.gravity)
        speeds.append((time.perf_counter() - start) / (count * step))
    overhead = _frame_overhead(sim)
    cost = float(np.median(speeds)) + overhead
    return {"step": step, "stable_step": float(limit), "cost": cost}


def _frame_overhead(sim: Any) -> float:
    """Seconds a simulated second that frames cost beyond their substeps: small scenes feel it."""
    return 60e-6 * float(sim.scene.frame_rate)


WORK: dict[str, Any] = {
    "size": size_of,
    "static": static_of,
    "modes": modes_of,
    "exact modes": exact_modes_of,
    "timing": timing_of,
}
