"""A scene's variants, computed one by one while the budget lasts.

First what compiles little: static answers, modes and steps, of the scene, of the rulers
(`ruling`), of all variants.  Then costs, timed where the budget reaches and predicted elsewhere;
then paths.  All answers are kept as they come, so whatever ends the survey, what is done can be
judged.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tisoft import runtime
from tisoft.changes import scene_with
from tisoft.charting.asking import Asking
from tisoft.charting.doubting import (
    BY_NUMBERS,
    CONTACT,
    ITSELF,
    PATHS_ALONE,
    by_numbers,
    may_meet,
    surfaces_touch,
)
from tisoft.charting.judged import Judged
from tisoft.charting.judging import Judging
from tisoft.charting.places import places_of
from tisoft.charting.records import Bench
from tisoft.charting.ruling import ENOUGH, QUICK, SHARES, SHARP, Ruling
from tisoft.charting.variants import CURRENT, Catalogue, Variant
from tisoft.errors import SceneError
from tisoft.scene import Scene

DEARER = 1.5
"""Times the cost of what may keep the tolerance, above which a sharper ruler is worth its time."""
LEAST_QUICK = 0.2
"""Of the budget, that quick variants are given before a dear ruler, however long the first took."""
MOST_OVER = 1.2
"""Times the budget, that the first look may take by what is known before."""
HIGHEST_ORDER = {"tet4": 2.0}
"""Power of the size of the cells that errors of an element fall with at the most; of others 3.
Elements are counted as if they filled a plane, whose thickness may be one cell on any mesh."""
SELDOM = {"tet4": 2.0}
"""Times their seconds, that elements wait which on as many nodes err by more than others."""
SOON = 1.1
"""Times its share of the budget, that an answer may end at which is soon there."""
LAST = 1.15
"""The same for advice that has nothing but paths."""
NO_TIME = "there was no time to find the equilibrium; give a larger budget"
SAME_PLACE = 1e-6
"""Share of a body's size within which a node is where a probe is."""


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
    same_probes: bool = False
    """Whether meshes without nodes where the probes are stay out."""

    def __post_init__(self) -> None:
        own = self.source if isinstance(self.source, Scene) else str(self.source)
        self.scene = scene_with(own, self.settings)
        if len(self.scene.bodies) == 0:
            self.scene.validate()
        self.catalogue = Catalogue(own, self.scene, self.settings, self.bodies)
        self.asking = Asking(
            Bench(own, places_of(self.scene), self.kept), self.budget, self.scene.duration,
            self.patient, self.tick, self.catalogue.springs and not self.catalogue.has_solid_twin,
        )  # fmt: skip
        self.asking.variants.append(self.catalogue.current)
        self.judging = Judging(self.asking, self.catalogue)
        self.ruling = Ruling(
            self.asking, self.judging, self.catalogue, self.budget, self.patient, self.warn
        )
        runtime.import_taichi()
        runtime.start("cpu")
        self.touching = may_meet(self.scene, 0.0)
        if by_numbers(self.scene):
            self.warn(BY_NUMBERS)

    def warn(self, told: str) -> None:
        """Note a warning, once."""
        if told not in self.warnings:
            self.warnings.append(told)

    def judged(self) -> list[Judged]:
        """All variants of which enough is known, the scene itself first."""
        return self.judging.judged()

    def measure(
        self, *, others: bool = True, tolerance: float = 0.0, workers: dict[str, Any] | None = None
    ) -> None:
        """Ask what the budget allows; raises SceneError for a scene that cannot be charted.

        Args:
            others: whether models, precisions and integrators vary too, costs are timed and paths
                run.
            tolerance: what is coarser than something too coarse for it is not looked at.
            workers: who answers besides.
        """
        now = self.catalogue.current
        self._first_look(now)
        candidates = [v for v in self._candidates(others=others) if self._may_be(v)]
        if workers:
            self._spread(candidates, workers)
        if not self.ruling.quantities():
            self._run_alone(candidates)
            return
        self.ruling.find(tolerance)
        if self.patient and any(self._is_long(v) for v in candidates):
            self.ruling.find_linear([
                pair for pair in self.ruling.pairs()
                if pair.told is None and self.ruling.affords_linear(pair)
            ])  # fmt: skip
        quick = max(QUICK, self.asking.spent() / self.budget + LEAST_QUICK)
        for share in (quick, self.ruling.share) if self.patient else (self.ruling.share,):
            for variant in sorted(candidates, key=self._wait):
                if tolerance and self._is_hopeless(variant, tolerance):
                    continue
                self._answers(variant, 0.9 if len(self.judged()) < 2 else share)
            self.ruling.take_known()
            if tolerance and self._is_blunt(tolerance):
                better = self.ruling.sharpen(ENOUGH * tolerance)
                if better is None or self._is_blunt(tolerance):
                    better = self.ruling.sharpen(SHARP * tolerance) or better
                if better in candidates:
                    self._answers(better, self.ruling.share)
                self.ruling.take_known()
        self.ruling.widen()
        self.asking.ask("timing", now, 0.97)
        self._time()
        if others:
            self._run()

    def ask_linear(self, name: str) -> None:
        """Look at a variant with linear elasticity in place of large strains."""
        linear = self.catalogue.as_linear(self.judging.named(name))
        if linear is not None:
            self._answers(linear)

    # -- the scene itself ----------------------------------------------------------------------

    def _first_look(self, now: Variant) -> None:
        # A net that stands for itself is judged by its paths, where there is little time for more.
        alone = self.patient and self.catalogue.is_itself
        wanted = ("step",) if alone else ("static", "modes", "step")
        missing = [w for w in wanted if not self.asking.has(w, now)]
        needs = sum(self.asking.needs(what, now) for what in missing)
        if needs > MOST_OVER * self.budget:
            raise SceneError(
                f"the scene as it is has {self.asking.bench.ask('size', now)['nodes']} nodes, "
                f"whose equilibrium and modes take about {needs:.2g} s, and there are "
                f"{self.budget:.2g} s for them; take a coarser mesh, or chart it with a larger "
                "--budget"
            )
        for what in missing:
            self.asking.ask(what, now, always=True)
        static, modes = (self.asking.known(what, now) for what in ("static", "modes"))
        self.ruling.vibrates = bool(modes and modes["frequencies"])
        self.judging.static = bool(static and static["most"] > 0.0)
        if self.catalogue.is_itself:
            self.warn(ITSELF)
        elif not self.judging.static and not self.ruling.vibrates:
            self.warn(f"{PATHS_ALONE} ({self._no_static(now)})")
        else:
            if not self.judging.static:
                self.warn(f"sag is left out: {self._no_static(now)}")
            if modes is None:
                told = self.asking.bench.ask("modes", now)["error"]
                self.warn(f"frequencies are left out: {told}")
        for told in static["warnings"] if static else []:
            self.warn(told)
        most = None if static is None else static["most"]
        self.touching = may_meet(self.scene, most)
        self.asking.touching = surfaces_touch(self.scene, most)
        if self.touching and self.ruling.quantities():
            self.warn(CONTACT)

    def _no_static(self, now: Variant) -> str:
        """Why there is no sag."""
        if self.asking.known("static", now) is not None:
            return "no load moves the scene at rest"
        told: str = self.asking.bench.record(now).get("static", {}).get("error", NO_TIME)
        return told

    # -- variants ------------------------------------------------------------------------------

    def _candidates(self, *, others: bool) -> Iterator[Variant]:
        if self.catalogue.is_itself:
            step = self.asking.known("step", self.catalogue.current)
            yield from self.catalogue.steps(step["step"]) if step else ()
            others = True
        yield from self.catalogue.meshes()
        yield from self.catalogue.others() if others else ()

    def may_turn(self) -> bool:
        """Whether bodies may turn by what no equilibrium tells of, which linear elasticity does not
        stand."""
        spins = any(np.any(np.asarray(body.spin)) for body in self.scene.bodies)
        turned = any(pin.turn is not None for body in self.scene.bodies for pin in body.pins)
        return spins or turned or not self.judging.static

    def _may_be(self, variant: Variant) -> bool:
        size = self.asking.size(variant)
        if size is None or (
            variant.kind == "model" and "linear" in size["model"].split("+") and self.may_turn()
        ):
            return False
        if not self.same_probes or variant.kind != "mesh":
            return True
        scene = self.asking.bench.scene(variant)
        gaps = [
            np.linalg.norm(scene.bodies[p.body].mesh.points - np.array(p.point), axis=1).min()
            / (np.ptp(scene.bodies[p.body].mesh.points, axis=0).max() or 1.0)
            for p in self.asking.bench.places
        ]
        return max(gaps, default=0.0) < SAME_PLACE

    def _wait(self, variant: Variant) -> float:
        """Seconds of what is not known of it, compiling left out: the soonest answers first, later
        what is seldom chosen.
        """
        shared = self.judging.shares_errors(variant)
        missing = [] if self.asking.has("modes", shared) else ["modes"]
        if not self.asking.has("static", shared) and not self.asking.has("linear static", shared):
            missing.append("linear static")
        size = self.asking.size(shared)
        share = 1.0 if size is None else SELDOM.get(size["element"], 1.0)
        return share * sum(self.asking.needs(what, shared) for what in missing)

    def _is_hopeless(self, variant: Variant, tolerance: float) -> bool:
        """Whether the same element on a finer mesh is too coarse already, or so much too coarse on
        this or a coarser one that no order of convergence makes up for it.
        """
        size = self.asking.size(variant)
        order = 3.0 if size is None else HIGHEST_ORDER.get(size["element"], 3.0)
        return size is not None and any(
            v.element == size["element"] and v.model == size["model"]
            and v.least * min(1.0, v.elements / size["elements"]) ** (order / 2.0) > tolerance
            for v in self.judged()
        )  # fmt: skip

    def _is_blunt(self, tolerance: float) -> bool:
        """Whether nothing is certain to keep the tolerance, or what may keep it costs far less."""
        judged = self.judged()
        certain = [v.cost for v in judged if v.worst.most <= tolerance]
        likely = [v.cost for v in judged if v.least <= tolerance]
        return not certain or min(certain) > DEARER * min(likely)

    def _is_long(self, variant: Variant) -> bool:
        """Whether its static answer takes longer than there is time, and a linear one does not."""
        shared = self.judging.shares_errors(variant)
        room = self.ruling.share * self.budget - self.asking.spent()
        if self.asking.has("static", shared) or self.asking.needs("static", shared) <= room:
            return False
        return self._wait(variant) <= room

    def _answers(self, variant: Variant, share: float = 1.0) -> None:
        """Static answer, modes and step of a variant, where the budget allows."""
        shared = self.judging.shares_errors(variant)
        for what in self.judging.rulers:
            found = self.asking.quantity(shared, what, share)
            if found is None and what == "sag" and self.judging.linear is not None:
                if self._is_long(variant):
                    found = self.ruling.linearly(shared)
            if found is None and what != "frequency":
                return
        found = self.asking.ask("step", variant, SOON * share)  # which makes use of the others
        known = self.judging.errors_at_rest(variant).keys() >= self.judging.rulers.keys()
        if found is not None and known and variant not in self.asking.variants:
            self.asking.variants.append(variant)

    def _time(self) -> None:
        """Time what the front is made of first."""
        limit = SHARES["timing"] * self.budget
        for _ in range(len(self.asking.variants)):
            judged = {v.name: v for v in self.judged()}
            left = [
                v for v in self.asking.variants
                if v.name in judged and not self.asking.has("timing", v)
            ]  # fmt: skip
            left.sort(key=lambda v: (not judged[v.name].pareto, judged[v.name].cost))
            room = limit - self.asking.spent()
            asked = next((v for v in left if self.asking.needs("timing", v) <= room), None)
            if asked is None:
                return
            self.asking.ask("timing", asked, SHARES["timing"])

    def _run(self) -> None:
        """Run the scene with the finest variants and the front, for their paths."""
        judged = [v for v in self.judged() if v.name != CURRENT]
        finest = [self.judging.named(v.name) for v in sorted(judged, key=lambda v: v.worst.most)]
        now = self.catalogue.current
        reference = next((v for v in finest if self._affords_run(v)), None)
        if reference is None or not self._affords_run(now):
            return
        front = [v for v in sorted(judged, key=lambda v: v.cost) if v.pareto]
        runs = [reference, now, *finest[1:2], *(self.judging.named(v.name) for v in front)]
        for variant in dict.fromkeys(runs):
            self.asking.ask("path", variant, SHARES["path"])

    def _run_alone(self, candidates: Sequence[Variant]) -> None:
        """Where nothing at rest tells of errors: the scene, its finest variants, the cheapest."""
        if self.patient and self.asking.touching:
            return  # the kernels of contact of surfaces alone compile longer than advice may take
        self.asking.patience.warm = self.patient
        now, variants = self.catalogue.current, self.asking.variants
        variants += [v for v in candidates if self.asking.ask("step", v) is not None]
        if not self.patient:
            self.asking.ask("timing", now, SHARES["timing"])
        fine = sorted(variants, key=self.judging.travel.coarseness)
        best = next((v for v in fine if v is not now and self._affords_run(v)), None)
        if best is None:
            return
        rest = sorted((v for v in variants if v not in (now, best)), key=self._dear)
        finer = [v for v in fine if v in rest][:1]
        for variant in dict.fromkeys([now, best, *finer, *rest]):
            self.asking.ask("path", variant, LAST if self.patient else SHARES["path"])
        self.asking.ask("timing", now, LAST)

    def _dear(self, variant: Variant) -> float:
        return self.asking.cost(variant)[0]

    def _affords_run(self, variant: Variant) -> bool:
        left = (LAST if self.patient else SHARES["path"]) * self.budget - self.asking.spent()
        return self.asking.needs("path", variant) <= (0.8 if self.patient else 0.5) * left

    def _spread(self, candidates: Sequence[Variant], workers: dict[str, Any]) -> None:
        """Static answers, modes and steps by workers, as many as the budget allows."""
        from tisoft.charting.spread import spread

        jobs = []
        for pair in self.ruling.pairs()[:2]:
            for variant in (pair.worse, pair.better):
                jobs += [(variant, "exact modes"), (variant, "static")]
        for variant in candidates:
            if self.judging.shares_errors(variant) is variant:
                jobs += [(variant, "static"), (variant, "modes")]
            jobs.append((variant, "step"))
        asking = self.asking
        wanted = [
            (v, what) for v, what in dict.fromkeys(jobs)
            if asking.size(v) is not None and not asking.has(what, v)
            and asking.needs(what, v) < 0.5 * self.budget
        ]  # fmt: skip
        limit = SHARES["answers"] * self.budget
        spread(asking.bench, wanted, workers, lambda: asking.spent() < limit, self.tick)
