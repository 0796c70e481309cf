"""What is known of each variant, computed once: what it is, static answer, modes, step, runs.

Everything is plain data.
"""

from __future__ import annotations

import hashlib
import math
import os
import pickle
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tisoft import runtime
from tisoft.changes import MODEL_WORDS, scene_with
from tisoft.charting.carried import carried
from tisoft.charting.linearly import linear_static
from tisoft.charting.places import Place, at_places
from tisoft.charting.runs import path_of, timing_of
from tisoft.charting.variants import Variant, poisson_of
from tisoft.errors import Diverged, NoEquilibrium, OutOfTime, TisoftError
from tisoft.geometry.mesh import Mesh
from tisoft.models.materials import Linear, MassSpring, MassTensor
from tisoft.scene import Scene
from tisoft.version import version

Floats = NDArray[np.float64]

FORM = b"9"
"""Changes where records hold other things than before."""
MODES = 3
"""Elastic modes that are compared."""
DRAWN = 6000
"""Nodes up to which displacements are kept for pictures."""
ACCURACY = 1e-8
"""Forces out of balance, as a share of the load, that no error of a mesh is small enough for."""

AtRest = list[tuple[Floats, Floats]]
"""Of each body its nodes and their displacements [m], shape (nodes, 3)."""


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
        self.clock: Callable[[], float] = time.perf_counter
        """On which answers that take too long are given up."""
        self._finest: AtRest = []
        """The static answer of most nodes so far, which the next one is sought next to."""
        self._nets: dict[str, Floats] = {}
        """Positions of nets at rest under their loads [m], by key: they swing about them."""
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
                with latest(seconds, self.clock):
                    made = self._answer(what, variant)
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

    def _answer(self, what: str, variant: Variant) -> dict[str, Any]:
        scene, key = self.scene(variant), self.key(variant)
        if what == "modes" and key in self._nets:
            return modes_of(scene, self.places, positions=self._nets[key])
        if what != "static":
            work: Callable[[Scene, list[Place]], dict[str, Any]] = WORK[what]
            return work(scene, self.places)
        made, moved = static_of(scene, self.places, self._finest)
        if any(isinstance(body.model, MassSpring) for body in scene.bodies):
            self._nets[key] = np.concatenate([rest + u for rest, u in moved])
        is_linear = any(isinstance(body.model, Linear | MassTensor) for body in scene.bodies)
        if not is_linear and _nodes(moved) >= _nodes(self._finest):
            self._finest = moved
        return made


def _nodes(answer: AtRest) -> int:
    return sum(len(u) for _, u in answer)


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
        "front": sum(_front(body.mesh) for body in scene.bodies),
        "precision": scene.precision,
        "integrator": scene.integrator,
        "frame_rate": scene.frame_rate,
        "poisson": max((poisson_of(body) for body in scene.bodies), default=0.0),
        "warped": any(_is_warped(body.mesh) for body in scene.bodies),
    }


def _is_warped(mesh: Mesh) -> bool:
    """Whether it has hexahedra whose sides do not lie along the axes, which take longer."""
    from tisoft.elements import element
    from tisoft.elements.brick import Brick

    hexes = mesh.cells.get("hex8")
    return hexes is not None and element("hex8", mesh.points, hexes)[0] is not Brick


def _front(mesh: Mesh) -> float:
    """Unknowns of the widest front of a factorisation, cubed: those of a cut across the body's
    longest way, on one side of the cells that it goes through; of a long body twice as many, as
    pieces of it lie between two cuts.
    """
    extents = np.ptp(mesh.points, axis=0)
    along = mesh.points[:, extents.argmax()]
    low = along < np.median(along)
    cut = [
        cells[low[cells].any(axis=1) & ~low[cells].all(axis=1)].ravel()
        for cells in mesh.cells.values()
    ]
    nodes = np.unique(np.concatenate([np.empty(0, np.int64), *cut]))
    count = min(int(low[nodes].sum()), int((~low[nodes]).sum()))
    _, second, longest = np.sort(extents)
    return float(3 * count * min(2.0, longest / (second or longest or 1.0))) ** 3


def static_of(
    scene: Scene, places: list[Place], known: AtRest | None = None
) -> tuple[dict[str, Any], AtRest]:
    """Displacements at the places [m], and the elastic energy [J], at rest under the loads; and all
    displacements.

    Args:
        scene: that is asked about.
        places: where displacements are told.
        known: the answer of another mesh, next to which it is sought.
    """
    from tisoft.equilibrium.statics import equilibrium

    guess = [
        carried(*at_rest, body.mesh.points)
        for at_rest, body in zip(known or [], scene.bodies, strict=False)
    ]
    near = np.concatenate(guess) if guess else None
    found = equilibrium(scene, near=near, accuracy=ACCURACY)
    ends = np.cumsum([len(body.mesh.points) for body in scene.bodies])[:-1]
    of_bodies = np.split(found.positions, ends)
    moved = [x - body.mesh.points for x, body in zip(of_bodies, scene.bodies, strict=True)]
    elastic = found.energy["elastic"]
    rest = np.concatenate([body.mesh.points for body in scene.bodies])
    made = {
        "places": at_places(scene, places, moved),
        "energy": None if elastic is None else float(elastic),
        "turn": _turn(scene, found.positions),
        "most": float(np.linalg.norm(found.positions - rest, axis=1).max()),
        "shape": _rounded(found.positions - rest) if len(rest) <= DRAWN else None,
        "warnings": found.warnings,
    }
    return made, [(body.mesh.points, u) for body, u in zip(scene.bodies, moved, strict=True)]


def linear_static_of(scene: Scene, places: list[Place]) -> dict[str, Any]:
    """The same by linear elasticity, whatever the model."""
    from tisoft.equilibrium.one_thread import one_thread

    with one_thread():
        moved, energy = linear_static(scene)
    return {"places": at_places(scene, places, moved), "energy": energy}


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
    scene: Scene,
    places: list[Place],
    mass: Literal["consistent"] | None = None,
    positions: Floats | None = None,
) -> dict[str, Any]:
    """The lowest elastic frequencies [Hz], at rest; of nets that are slack there, under load.

    Args:
        scene: that is asked about.
        places: where displacements are told.
        mass: of solids; left out, each body's own kind.
        positions: under load [m], where they are known.
    """
    from tisoft.equilibrium.modes import natural_modes

    nets = any(isinstance(body.model, MassSpring) for body in scene.bodies)
    for word in ("rest", "equilibrium") if nets else ("rest",):
        about = positions if word == "equilibrium" and positions is not None else word
        for rigid in (0, 6 * len(scene.bodies), 6 * len(scene.bodies) + 40):
            found = natural_modes(scene, MODES + rigid, mass=mass, about=about).frequencies
            elastic = found[found > 0.0]
            if len(elastic) >= MODES or len(found) < MODES + rigid:
                break
        is_slack = nets and len(found) - len(elastic) > 6 * len(scene.bodies)
        if len(elastic) >= MODES and not is_slack:
            break
    return {"frequencies": elastic[:MODES].tolist(), "about": word}


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


WORK: dict[str, Any] = {
    "size": size_of,
    "linear static": linear_static_of,
    "modes": modes_of,
    "exact modes": exact_modes_of,
    "step": step_of,
    "timing": timing_of,
    "path": path_of,
}
