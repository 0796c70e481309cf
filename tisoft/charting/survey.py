"""A scene's variants, computed one by one while the budget lasts, and judged by the ruler."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tisoft import runtime
from tisoft.changes import scene_with
from tisoft.charting import estimate
from tisoft.charting.estimate import Error, Ruler
from tisoft.charting.records import Bench, places_of
from tisoft.charting.variants import CURRENT, Catalogue, Variant
from tisoft.errors import SceneError
from tisoft.models.materials import Linear, MassSpring, MassTensor
from tisoft.scene import Scene
from tisoft.where import Nodes

COLD = {"static": 10.0, "modes": 3.0, "exact modes": 3.0, "timing": 7.0, "size": 0.1}
"""Seconds that compiling the kernels of an element takes where nothing is known of it yet."""
GROWTH = {"static": 1.4, "modes": 1.4, "exact modes": 1.4, "timing": 1.0, "size": 1.0}
"""Powers of the number of nodes that the work grows with."""
LARGEST_RULER = 60_000
"""Nodes of a quadratic mesh that statics and modes are asked of."""


@dataclass(frozen=True)
class Judged:
    """A variant with its cost and its errors."""

    name: str
    settings: tuple[str, ...]
    """Beyond those of the command line: what --set takes."""
    model: str
    element: str
    elements: int
    nodes: int
    step: float
    """[s]"""
    stable_step: float
    """[s]"""
    cost: float
    """Seconds of computing a simulated second."""
    errors: dict[str, Error]
    """By quantity: sag, frequency, path; those that the scene has."""
    current: bool = False
    pareto: bool = False

    @property
    def worst(self) -> Error:
        """The larger one of sag and frequency, by its bar's end."""
        own = [e for k, e in self.errors.items() if k != "path"]
        return max(own, key=lambda e: e.most)


@dataclass
class Survey:
    """All that is asked of a scene, within a budget [s]."""

    source: str | Path | Scene
    budget: float
    settings: Sequence[str] = ()
    kept: dict[str, dict[str, Any]] = field(default_factory=dict)
    tick: Callable[[str], Any] = lambda told: None
    warnings: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._begun = time.perf_counter()
        own = self.source if isinstance(self.source, Scene) else str(self.source)
        self.scene = scene_with(own, self.settings)
        if len(self.scene.bodies) == 0:
            self.scene.validate()
        runtime.import_taichi()
        runtime.start("cpu")
        self.catalogue = Catalogue(own, self.scene, self.settings)
        self.places = places_of(self.scene)
        self.bench = Bench(own, self.places, self.kept)
        self._seen: dict[tuple[str, ...], tuple[float, float]] = {}
        self.numbered = _by_numbers(self.scene)
        if self.numbered:
            self.warnings.append(
                "pins or loads select several nodes by number: on finer meshes they act on those "
                "nodes alone, so the errors of meshes are not to be trusted; select by box or plane"
            )
        self.springs = all(isinstance(b.model, MassSpring) for b in self.scene.bodies)

    # -- computing -----------------------------------------------------------------------------

    def left(self) -> float:
        """Seconds of the budget that are left."""
        return self.budget - (time.perf_counter() - self._begun)

    def ask(self, what: str, variant: Variant, *, always: bool = False) -> dict[str, Any] | None:
        """The answer, or None where it fails or the budget would not last."""
        record = self.bench.record(variant)
        if what not in record:
            if not always and self._needs(what, variant) > self.left():
                return None
            self.tick(variant.name)
        found = self.bench.ask(what, variant)
        if what != "size":
            kind = self._kind(what, variant)
            nodes = float(self.bench.ask("size", variant).get("nodes", 1))
            self._seen[kind] = (nodes, max(found["seconds"] - found["compiled"], 1e-3))
        return None if "error" in found else found

    def _kind(self, what: str, variant: Variant) -> tuple[str, ...]:
        size = self.bench.ask("size", variant)
        return what, str(size.get("element")), str(size.get("model"))

    def _needs(self, what: str, variant: Variant) -> float:
        """Seconds that an answer will take, from the last one of its kind."""
        size = self.bench.ask("size", variant)
        if "error" in size or what == "size":
            return 0.0
        nodes = float(size["nodes"])
        kind = self._kind(what, variant)
        if kind in self._seen:
            known, seconds = self._seen[kind]
            return seconds * max(0.3, (nodes / known) ** GROWTH[what])
        return COLD[what] + 1e-3 * nodes * (what != "timing")

    # -- the survey ----------------------------------------------------------------------------

    def measure(self, *, others: bool = True) -> list[Judged]:
        """Judge all variants that the budget allows; raises SceneError where it is too small."""
        now = self.catalogue.current
        modes = self.ask("modes", now, always=True)
        if modes is None:
            raise SceneError(
                f"the scene cannot be charted: {self.bench.ask('modes', now)['error']}"
            )
        self.free = modes["free"] > 0
        self.static = not self.free and self._has_static(now)
        self.ask("timing", now, always=True)
        self._find_rulers()
        judged = [self._judge(now)]
        candidates = [*self.catalogue.meshes(), *(self.catalogue.others() if others else ())]
        for variant in candidates:
            if "error" in self.bench.ask("size", variant):
                continue
            judged.append(self._judge(variant))
        found = [j for j in judged if j is not None]
        if len(found) < 2:
            needs = self._budget_for_two()
            raise SceneError(
                f"--budget {self.budget:g} is too small for two variants; give {needs:.0f} or more"
            )
        return with_pareto(found)

    def _budget_for_two(self) -> float:
        return 1.3 * (self.budget - self.left()) + sum(COLD.values())

    def _has_static(self, now: Variant) -> bool:
        if self.scene.obstacles:
            self.warnings.append("the static answer leaves obstacles out: contact may decide more")
        found = self.ask("static", now, always=True)
        if found is None:
            told = self.bench.ask("static", now)["error"]
            self.warnings.append(f"sag is left out: {told}")
            return False
        self.warnings += found["warnings"]
        return bool(found["most"] > 0.0)

    def quantity(self, variant: Variant, what: str, *, exact: bool = False) -> Any:
        """Sag (displacements of the places, or the loads' work), or frequencies; None without.
        Exact: as the ruler sees them.
        """
        modes = "exact modes" if exact and not self.springs else "modes"
        found = self.ask("static" if what == "sag" else modes, variant)
        if found is None:
            return None
        if what == "frequency":
            return found["frequencies"] or None
        return found["places"] if self.places else found["work"]

    def _find_rulers(self) -> None:
        """The best pair of answers that the budget's half allows."""
        self.rulers: dict[str, Ruler] = {}
        quantities = (["sag"] if self.static else []) + ["frequency"]
        pairs = list(self._pairs())
        whole, self.budget = self.budget, 0.6 * self.budget
        for worse, better, range_ in pairs:  # from cheap to dear
            if self.bench.ask("size", better).get("nodes", math.inf) > LARGEST_RULER:
                break
            answers = {
                q: (self.quantity(worse, q, exact=True), self.quantity(better, q, exact=True))
                for q in quantities
            }
            if any(a is None or b is None for a, b in answers.values()):
                continue
            for q, (a, b) in answers.items():
                made = ruler_of(a, b, q, range_)
                if q not in self.rulers or made.bar < self.rulers[q].bar:
                    self.rulers[q] = made
        self.budget = whole
        if not self.rulers:
            raise SceneError(
                "no ruler can be had: the mesh is too large for quadratic tets within the budget, "
                "or its cells cannot be refined; give a larger --budget, or a coarser mesh"
            )

    def _pairs(self) -> Any:
        make = self.catalogue.mesh
        if self.springs:
            self.warnings.append(
                "the ruler is the same springs on a finer mesh: what springs err by as a model "
                "of the material is not counted"
            )
            for factor in (1.5, 2.0):
                finer = make("spring", factor)
                if finer is not None:
                    yield self.catalogue.current, finer, estimate.OWN_MODEL
            return
        solid = self._as_solid
        linear, quadratic = make("tet4", 1.0), make("tet10", 1.0)
        current = self.catalogue.current
        has = self.catalogue.elements()[0]
        t4 = current if has == "tet4" else linear
        t10 = current if has == "tet10" else quadratic
        if t10 is None:
            return
        t10 = solid(t10)
        if t4 is not None:
            yield solid(t4), t10, estimate.SAME_MESH
        coarse, fine = make("tet10", 0.5), make("tet10", 2.0)
        if coarse is not None:
            yield solid(coarse), t10, estimate.TWO_MESHES
        if fine is not None:
            yield t10, solid(fine), estimate.TWO_MESHES

    def _as_solid(self, variant: Variant) -> Variant:
        """The variant with St. Venant-Kirchhoff bodies in place of springs and linear ones."""
        words = [
            f'body.{i}.model="viscoelastic"'
            for i, body in enumerate(self.scene.bodies)
            if isinstance(body.model, MassSpring | Linear | MassTensor)
        ]
        if not words:
            return variant
        return Variant(variant.name, (*variant.settings, *words), "model")

    def _judge(self, variant: Variant) -> Judged | None:
        size = self.bench.ask("size", variant)
        errors = {}
        shared = self.catalogue.current if variant.kind in ("precision", "integrator") else variant
        for what, truth in self.rulers.items():
            value = self.quantity(shared, what)
            if value is None or np.shape(value) != np.shape(truth.value):
                return None
            errors[what] = (
                estimate.frequency_error(value, truth) if what == "frequency" else
                truth.error(value)
            )  # fmt: skip
        timing = self.ask("timing", variant)
        if timing is None:
            return None
        first = float(self.rulers["frequency"].value[0])
        errors["path"] = estimate.path_error(
            errors.get("sag"), errors["frequency"], first, self.scene.duration
        )
        return Judged(
            variant.name, variant.settings[len(self.catalogue.given) :], size["model"],
            size["element"], size["elements"], size["nodes"], timing["step"],
            timing["stable_step"], timing["cost"], errors, variant.name == CURRENT,
        )  # fmt: skip


def _by_numbers(scene: Scene) -> bool:
    """Whether pins or loads of cells select several nodes by their numbers."""
    chosen: list[Any] = [
        where
        for body in scene.bodies
        if body.mesh.elements
        for where in ([pin.where for pin in body.pins] + [load.where for load in body.loads])
    ]
    return any(isinstance(where, Nodes) and len(where.ids) > 1 for where in chosen)


def ruler_of(worse: Any, better: Any, what: str, range_: tuple[float, float]) -> Ruler:
    """The ruler of "sag" or "frequency" from a worse and a better answer."""
    made = estimate.ruler(worse, better, range_)
    if what == "frequency":  # the bar of the root mean square of relative errors
        off = (np.asarray(better) - np.asarray(worse)) / made.value
        return Ruler(made.value, range_[1] * float(np.sqrt((off**2).mean())))
    return made


def with_pareto(judged: Sequence[Judged]) -> list[Judged]:
    """The variants, marked where none is both cheaper and better."""
    return [
        dataclasses.replace(
            one,
            pareto=not any(
                o is not one and o.cost <= one.cost and o.worst.value < one.worst.value
                for o in judged
            ),
        )
        for one in judged
    ]
