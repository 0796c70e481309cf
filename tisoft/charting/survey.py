"""A scene's variants, computed one by one while the budget lasts, and judged by the ruler.

First what compiles little: static answers, modes and steps, of the scene, of the rulers, of all
variants.  Then costs, timed where the budget reaches and predicted elsewhere; then paths.  All
answers are kept as they come, so whatever ends the survey, what is done can be judged.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tisoft import runtime
from tisoft.changes import scene_with
from tisoft.charting import estimate
from tisoft.charting.costs import Kind, predicted
from tisoft.charting.estimate import Error, Ruler
from tisoft.charting.judged import Judged, with_pareto
from tisoft.charting.paths import Paths
from tisoft.charting.patience import Patience
from tisoft.charting.records import Bench, places_of
from tisoft.charting.rulers import OWN_SPRINGS, TWIN, pairs_of, ruler_of
from tisoft.charting.variants import CURRENT, Catalogue, Variant
from tisoft.errors import SceneError
from tisoft.gravity import strongest
from tisoft.scene import Scene
from tisoft.where import Nodes

LARGEST_RULER = 60_000
"""Nodes of a quadratic mesh that statics and modes are asked of."""
SHARES = {"ruler": 0.5, "answers": 0.65, "timing": 0.85, "path": 0.95}
"""Of the budget, at which each stage must be over."""
SMALL = 2000
"""Elements up to which kernels run on one thread (`model.system`)."""
NO_TIME = "there was no time to find the equilibrium; give a larger budget"
SAME_PLACE = 1e-6
"""Share of a body's size within which a node is where a probe is."""
RANGE = 0.6
"""The largest error of linear tets that the ruler was tried on."""
CONTACT = (
    "obstacles or other bodies may be met: sag and frequencies are those of bodies that meet "
    "nothing, and contact may decide more"
)


@dataclass
class Survey:
    """All that is asked of a scene, within a budget [s]."""

    source: str | Path | Scene
    budget: float
    settings: Sequence[str] = ()
    kept: dict[str, dict[str, Any]] = field(default_factory=dict)
    tick: Callable[[str], Any] = lambda told: None
    warnings: list[str] = field(default_factory=list)
    bodies: Sequence[int] | None = None
    """Numbers of those that vary; left out, all."""
    patient: bool = False
    """Whether only the time counts that this process computes, not what others take."""

    def __post_init__(self) -> None:
        self._clock = time.process_time if self.patient else time.perf_counter
        self._begun = self._clock()
        own = self.source if isinstance(self.source, Scene) else str(self.source)
        self.scene = scene_with(own, self.settings)
        if len(self.scene.bodies) == 0:
            self.scene.validate()
        runtime.import_taichi()
        runtime.start("cpu")
        self.catalogue = Catalogue(own, self.scene, self.settings, self.bodies)
        self.places = places_of(self.scene)
        self.bench = Bench(own, self.places, self.kept)
        self.patience = Patience()
        self._known: list[Variant] = [self.catalogue.current]
        self.rulers: dict[str, Ruler] = {}
        self.numbered = _by_numbers(self.scene)
        if self.numbered:
            self.warn(
                "pins or loads select several nodes by number: on finer meshes they act on those "
                "nodes alone, so the errors of meshes are not to be trusted; select by box or plane"
            )
        self.touching = bool(self.scene.obstacles)
        self.same_probes = False
        """Whether meshes without nodes where the probes are stay out."""
        self.paths = Paths(self.bench, self.catalogue.current)

    def warn(self, told: str) -> None:
        """Note a warning, once."""
        if told not in self.warnings:
            self.warnings.append(told)

    # -- asking --------------------------------------------------------------------------------

    def spent(self) -> float:
        """Seconds of the budget that are gone."""
        return self._clock() - self._begun

    def ask(
        self, what: str, variant: Variant, share: float = 1.0, *, always: bool = False
    ) -> dict[str, Any] | None:
        """The answer, or None where it fails, or would end after a share of the budget."""
        if what not in self.bench.record(variant):
            needs = self._needs(what, variant)
            if not always and self.spent() + needs > share * self.budget:
                return None
            self.tick(variant.name)
            until = min(share, 0.5) if always else share
            left = 3600.0 if self.patient else max(1.0, until * self.budget - self.spent())
            found = self.bench.ask(what, variant, left)
            seconds = found["worked" if self.patient else "seconds"]
            kind, size = self._kind(variant)
            self.patience.took(what, kind, size, seconds)
        return self.known(what, variant)

    def known(self, what: str, variant: Variant) -> dict[str, Any] | None:
        """The answer, where there is one already."""
        found = self.bench.record(variant).get(what)
        return None if found is None or "error" in found else found

    def size(self, variant: Variant) -> dict[str, Any] | None:
        """What the variant is, or None where it cannot be had."""
        found = self.bench.ask("size", variant)
        return None if "error" in found else found

    def _kind(self, variant: Variant) -> tuple[tuple[str, ...], dict[str, Any]]:
        size = self.size(variant)
        if size is None:
            return ("", "", "", "", ""), {}
        words = [size[k] for k in ("element", "model", "precision", "integrator")]
        loops = "alone" if size["elements"] <= SMALL else "shared"  # kernels of their own
        return (*words, loops), size

    def _needs(self, what: str, variant: Variant) -> float:
        kind, size = self._kind(variant)
        if what == "timing":
            return self.patience.timing(kind)
        if what == "path":
            if "timing" not in self.bench.record(variant):
                return float("inf")  # its kernels would be compiled first
            return 0.5 + 1.2 * self.cost(variant)[0] * self.scene.duration
        return self.patience.needs(what, kind, size)

    # -- the survey ----------------------------------------------------------------------------

    def measure(self, *, others: bool = True, workers: dict[str, Any] | None = None) -> None:
        """Ask what the budget allows; raises SceneError for a scene that cannot be charted."""
        now = self.catalogue.current
        self._first_look(now)
        candidates = [v for v in self._candidates(others=others) if self._may_be(v)]
        if workers:
            self._spread(candidates, workers)
        self.find_rulers()
        for variant in candidates:
            self._answers(variant, 0.9 if len(self.judged()) < 2 else SHARES["answers"])
        self.ask("timing", now, 0.97)
        self._time()
        if others:
            self._run()

    def _candidates(self, *, others: bool) -> Iterator[Variant]:
        yield from self.catalogue.meshes()
        yield from self.catalogue.others() if others else ()

    def _may_be(self, variant: Variant) -> bool:
        if self.size(variant) is None:
            return False
        if not self.same_probes or variant.kind != "mesh":
            return True
        scene = self.bench.scene(variant)
        gaps = [
            np.linalg.norm(scene.bodies[p.body].mesh.points - np.array(p.point), axis=1).min()
            / (np.ptp(scene.bodies[p.body].mesh.points, axis=0).max() or 1.0)
            for p in self.places
        ]
        return max(gaps, default=0.0) < SAME_PLACE

    def _first_look(self, now: Variant) -> None:
        for what in ("static", "modes", "step"):
            self.ask(what, now, always=True)
        self.static = self._has_static(now)
        modes = self.known("modes", now)
        self.vibrates = bool(modes and modes["frequencies"])
        if modes is None:
            self.warn(f"frequencies are left out: {self.bench.ask('modes', now)['error']}")
        if not self.static and not self.vibrates:
            raise SceneError(
                "the scene cannot be charted: it has neither a static answer under its loads nor "
                "elastic modes to compare"
            )
        self.touching = self.touching or self._may_meet(now)
        if self.touching:
            self.warn(CONTACT)

    def _may_meet(self, now: Variant) -> bool:
        """Whether two bodies that touch each other come near, swinging about their equilibrium."""
        static = self.known("static", now)
        room = 2.0 * static["most"] if static is not None else np.inf
        boxes = [
            (b.mesh.points.min(axis=0) - room, b.mesh.points.max(axis=0) + room)
            for b in self.scene.bodies if b.contact
        ]  # fmt: skip
        return any(
            bool((low <= other_high).all() and (other_low <= high).all())
            for k, (low, high) in enumerate(boxes) for other_low, other_high in boxes[k + 1 :]
        )  # fmt: skip

    def _has_static(self, now: Variant) -> bool:
        found = self.known("static", now)
        if found is None:
            told = self.bench.record(now).get("static", {}).get("error", NO_TIME)
            self.warn(f"sag is left out: {told}")
            return False
        for told in found["warnings"]:
            self.warn(told)
        if not found["most"] > 0.0:
            self.warn("sag is left out: no load moves the scene at rest")
        return bool(found["most"] > 0.0)

    def quantities(self) -> list[str]:
        """Which of sag and frequency the scene has."""
        return [q for q, has in (("sag", self.static), ("frequency", self.vibrates)) if has]

    def quantity(
        self, variant: Variant, what: str, share: float = 0.0, *, exact: bool = False
    ) -> Any:
        """Sag (displacements of the places, or the elastic energy), or frequencies; None without.

        Exact: as the ruler sees them.  A share of 0 asks nothing that is not known.
        """
        springs = self.catalogue.springs and not self.catalogue.has_solid_twin
        modes = "exact modes" if exact and not springs else "modes"
        asked = "static" if what == "sag" else modes
        found = self.ask(asked, variant, share) if share else self.known(asked, variant)
        if found is None:
            return None
        if what == "frequency":
            return found["frequencies"] or None
        return found["places"] if self.places else found["energy"]

    def find_rulers(self) -> None:
        """The best pair of answers that its share of the budget allows; the first one always."""
        pairs = list(pairs_of(self.catalogue, twin=False))
        if not pairs or not self._take(pairs[0], always=True):
            twins = list(pairs_of(self.catalogue, twin=True))
            for pair in twins:
                self._take(pair, always=not self.rulers)
        for pair in pairs[1:] if self.rulers else []:
            self._take(pair)
        if not self.rulers:
            raise SceneError(
                "no ruler can be had: the mesh is too large for quadratic tets, or its cells "
                "cannot be refined; take a coarser mesh, or tets"
            )
        for missing in set(self.quantities()) - set(self.rulers):
            self.warn(f"{missing} is left out: the ruler has no answer for it{self._why(missing)}")

    def _why(self, missing: str) -> str:
        """What quadratic tets said instead of an answer."""
        pair = next(iter(pairs_of(self.catalogue, twin=False)), None)
        if pair is None or missing != "sag":
            return ""
        told = self.bench.record(pair.better).get("static", {}).get("error")
        return f" ({told})" if told else ""

    def _take(self, pair: Any, *, always: bool = False) -> bool:
        size = self.size(pair.better)
        if size is None or size["nodes"] > LARGEST_RULER:
            return False
        share = SHARES["ruler"]
        if always:  # within the whole budget all the same
            needs = sum(self._needs(w, pair.better) for w in ("static", "exact modes"))
            if needs > 0.5 * (self.budget - self.spent()) and TWIN != pair.told:
                return False
            share = 100.0
        found = False
        for what in self.quantities():
            a, b = (self.quantity(v, what, share, exact=True) for v in (pair.worse, pair.better))
            if a is None or b is None or np.shape(a) != np.shape(b):
                continue
            made = ruler_of(a, b, what, pair.range_)
            if what not in self.rulers or made.bar < self.rulers[what].bar:
                self.rulers[what] = made
            found = True
        if found and pair.told:
            self.warn(pair.told)
        return found

    def ask_linear(self, name: str) -> None:
        """Look at a variant with linear elasticity in place of large strains."""
        by_name = {v.name: v for v in self._known}
        linear = self.catalogue.as_linear(by_name[name])
        if linear is not None:
            self._answers(linear)

    def _answers(self, variant: Variant, share: float = SHARES["answers"]) -> None:
        """Static answer, modes and step of a variant, where the budget allows."""
        shared = self._shares_errors(variant)
        for what in self.rulers:
            if self.quantity(shared, what, share) is None:
                return
        if self.ask("step", variant, share) is not None:
            self._known.append(variant)

    def _shares_errors(self, variant: Variant) -> Variant:
        """The variant whose static answer and modes are this one's too."""
        alike = variant.kind in ("precision", "integrator", "step")
        return self.catalogue.current if alike else variant

    def _time(self) -> None:
        """Time what the front is made of first."""
        for _ in range(len(self._known)):
            judged = {v.name: v for v in self.judged()}
            left = [
                v for v in self._known
                if v.name in judged and "timing" not in self.bench.record(v)
            ]  # fmt: skip
            left.sort(key=lambda v: (not judged[v.name].pareto, judged[v.name].cost))
            asked = next((v for v in left if self._affords(v)), None)
            if asked is None:
                return
            self.ask("timing", asked, SHARES["timing"])

    def _affords(self, variant: Variant) -> bool:
        return self.spent() + self._needs("timing", variant) <= SHARES["timing"] * self.budget

    def _run(self) -> None:
        """Run the scene with the finest variants and the front, for their paths."""
        judged = [v for v in self.judged() if v.name != CURRENT]
        by_name = {v.name: v for v in self._known}
        finest = sorted(judged, key=lambda v: v.worst.most)
        runs = [self.catalogue.current]
        reference = next((v for v in finest if self._affords_run(by_name[v.name], 0.5)), None)
        if reference is None or not self._affords_run(runs[0], 0.5):
            return
        runs.insert(0, by_name[reference.name])
        front = [v for v in sorted(judged, key=lambda v: v.cost) if v.pareto]
        runs += [by_name[v.name] for v in (*finest[1:2], *front)]
        for variant in dict.fromkeys(runs):
            self.ask("path", variant, SHARES["path"])

    def _affords_run(self, variant: Variant, share: float) -> bool:
        left = SHARES["path"] * self.budget - self.spent()
        return self._needs("path", variant) <= share * left

    def _spread(self, candidates: Sequence[Variant], workers: dict[str, Any]) -> None:
        """Static answers, modes and steps by workers, as many as the budget allows."""
        from tisoft.charting.spread import spread

        jobs = []
        for pair in list(pairs_of(self.catalogue, twin=False))[:2]:
            for variant in (pair.worse, pair.better):
                jobs += [(variant, "exact modes"), (variant, "static")]
        for variant in candidates:
            if self._shares_errors(variant) is variant:
                jobs += [(variant, "static"), (variant, "modes")]
            jobs.append((variant, "step"))
        wanted = [
            (v, what) for v, what in dict.fromkeys(jobs)
            if self.size(v) is not None and what not in self.bench.record(v)
            and self._needs(what, v) < 0.5 * self.budget
        ]  # fmt: skip
        limit = SHARES["answers"] * self.budget
        spread(self.bench, wanted, workers, lambda: self.spent() < limit, self.tick)

    def doubts(self) -> list[str]:
        """Why the errors may not be what decides, a sentence each."""
        found = []
        if self.touching:
            found.append(CONTACT)
        if self.numbered:
            found.append("pins or loads select nodes by number, which finer meshes do not follow")
        if self.catalogue.springs and not self.catalogue.has_solid_twin:
            found.append(OWN_SPRINGS)
        for told in self.warnings:
            if told.startswith(("sag is left out", "frequency is left out")) and self.pushed():
                found.append(told)
        large = self._first_error()
        if large is not None and large > RANGE:
            found.append(
                f"the scene as it is errs by {100 * large:.0f} %, and the estimate was measured "
                f"up to {100 * RANGE:.0f} %; ask again with a finer mesh"
            )
        parted = self.parted()
        if parted is not None:
            found.append(
                f"the two finest paths part after {parted:.3g} s: what comes later is chance, and "
                "no mesh errs by less"
            )
        return found

    def pushed(self) -> bool:
        """Whether there is any load: a body that nothing pushes has no sag to miss."""
        loads = any(body.loads for body in self.scene.bodies)
        return loads or strongest(self.scene.gravity) > 0.0

    def _first_error(self) -> float | None:
        now = self._judge(self.catalogue.current)
        return None if now is None else now.worst.value

    def parted(self) -> float | None:
        """Time [s] at which the two finest paths part, or None."""
        judged = [v for v in self.judged() if v.ran]
        if len(judged) < 2:
            return None
        by_name = {v.name: v for v in self._known}
        a, b = (by_name[v.name] for v in sorted(judged, key=lambda v: v.worst.most)[:2])
        expected = sorted(v.worst.most for v in judged)[1]
        if expected > 0.1:
            return None
        return self.paths.parting(b, a, self.scene.frame_rate)

    # -- judging -------------------------------------------------------------------------------

    def judged(self) -> list[Judged]:
        """All variants of which enough is known, the scene itself first."""
        found = [self._judge(variant) for variant in dict.fromkeys(self._known)]
        return with_pareto([one for one in found if one is not None])

    def cost(self, variant: Variant) -> tuple[float, bool]:
        """Seconds of computing a simulated second, and whether they were timed."""
        timing = self.known("timing", variant)
        if timing is not None:
            return float(timing["cost"]), True
        timed = [
            (kind, float(found["cost"]))
            for other in self._known
            if (found := self.known("timing", other)) and (kind := self.kind_of(other))
        ]
        own = self.kind_of(variant)
        return (predicted(own, timed), False) if own else (float("inf"), False)

    def kind_of(self, variant: Variant) -> Kind | None:
        """What decides its cost."""
        size, step = self.size(variant), self.known("step", variant)
        if size is None or step is None:
            return None
        return Kind(
            size["element"], size["model"], size["precision"], size["integrator"],
            size["elements"], step["substeps"] * size["frame_rate"], size["frame_rate"],
        )  # fmt: skip

    def _judge(self, variant: Variant) -> Judged | None:
        size, step = self.size(variant), self.known("step", variant)
        if size is None or step is None:
            return None
        errors: dict[str, Error] = {}
        shared = self._shares_errors(variant)
        for what, truth in self.rulers.items():
            value = self.quantity(shared, what)
            if value is None or np.shape(value) != np.shape(truth.value):
                return None
            errors[what] = (
                estimate.frequency_error(value, truth) if what == "frequency" else
                truth.error(value)
            )  # fmt: skip
        if not errors:
            return None
        self._add_path(variant, errors)
        cost, timed = self.cost(variant)
        decides = [q for q in errors if q != "path"]
        if "path" in errors and self.paths.has(variant) and not self.static:
            decides.append("path")
        return Judged(
            name=variant.name, settings=variant.settings[len(self.catalogue.given) :],
            model=size["model"], element=size["element"], elements=size["elements"],
            nodes=size["nodes"], step=step["step"], stable_step=step["stable_step"], cost=cost,
            errors=errors, timed=timed, ran=self.paths.has(variant), decides=tuple(decides),
            current=variant.name == CURRENT,
        )  # fmt: skip

    def _add_path(self, variant: Variant, errors: dict[str, Error]) -> None:
        if "frequency" in errors:
            first = float(self.rulers["frequency"].value[0])
            errors["path"] = estimate.path_error(
                errors.get("sag"), errors["frequency"], first, self.scene.duration
            )
        reference = self._reference()
        if reference is not None and self.paths.has(variant):
            its, worst = reference
            own = self.paths.error(variant, its)
            if own is not None and variant != its:
                errors["path"] = Error(own, worst)

    def _reference(self) -> tuple[Variant, float] | None:
        """The finest variant that was run, and what it may err by itself."""
        found: list[tuple[float, Variant]] = []
        for variant in self._known:
            if not self.paths.has(variant):
                continue
            own = [
                estimate.frequency_error(value, truth).most
                if what == "frequency" else truth.error(value).most
                for what, truth in self.rulers.items()
                if (value := self.quantity(self._shares_errors(variant), what)) is not None
            ]  # fmt: skip
            found.append((max(own, default=np.inf), variant))
        if len(found) < 2:
            return None
        most, best = min(found, key=lambda pair: pair[0])
        first = self.rulers.get("frequency")
        if first is None:
            return best, most
        bound = estimate.path_error(
            Error(most, 0.0), Error(most, 0.0), float(first.value[0]), self.scene.duration
        )
        return best, min(1.0, bound.value)

    def pictures(self, seconds: float) -> dict[str, str]:
        """Pictures of the judged variants as data addresses, the front first, for some
        seconds; the first one always."""
        from tisoft.charting.thumbnails import picture

        begun = time.perf_counter()
        made: dict[str, str] = {}
        by_name = {v.name: v for v in self._known}
        for one in sorted(self.judged(), key=lambda v: (not v.current, not v.pareto, v.cost)):
            if made and time.perf_counter() - begun > seconds:
                break
            variant = by_name[one.name]
            static = self.known("static", self._shares_errors(variant))
            drawn = picture(self.bench.scene(variant), static and static.get("shape"))
            if drawn is not None:
                made[one.name] = drawn
        return made


def _by_numbers(scene: Scene) -> bool:
    """Whether pins or loads of cells select several nodes by their numbers."""
    chosen: list[Any] = [
        where
        for body in scene.bodies
        if body.mesh.elements
        for where in ([pin.where for pin in body.pins] + [load.where for load in body.loads])
    ]
    return any(isinstance(where, Nodes) and len(where.ids) > 1 for where in chosen)
