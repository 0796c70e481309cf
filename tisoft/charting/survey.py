"""A scene's variants, computed one by one while the budget lasts.

First what compiles little: static answers, modes and steps, of the scene, of the rulers, of all
variants.  Then costs, timed where the budget reaches and predicted elsewhere; then paths.  All
answers are kept as they come, so whatever ends the survey, what is done can be judged.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from tisoft import runtime
from tisoft.changes import scene_with
from tisoft.charting import estimate
from tisoft.charting.asking import Asking
from tisoft.charting.curves import range_of
from tisoft.charting.doubting import (
    BY_NUMBERS,
    CONTACT,
    ITSELF,
    PATHS_ALONE,
    UNSETTLED,
    by_numbers,
    may_meet,
    surfaces_touch,
)
from tisoft.charting.judged import Judged
from tisoft.charting.judging import Judging
from tisoft.charting.linearly import linear_ruler
from tisoft.charting.places import places_of
from tisoft.charting.records import Bench
from tisoft.charting.rulers import OWN_HEXES, OWN_SPRINGS, Pair, agreed, pairs_of, ruler_of
from tisoft.charting.variants import CURRENT, Catalogue, Variant
from tisoft.errors import SceneError
from tisoft.scene import Scene

LARGEST_RULER = 60_000
"""Nodes of a quadratic mesh that statics and modes are asked of."""
SHARES = {"ruler": 0.5, "answers": 0.65, "timing": 0.85, "path": 0.95}
"""Of the budget, at which each stage must be over."""
RULER_ALONE = 0.8
"""Of what is left of the budget, that the first ruler may take."""
QUICK = 0.4
"""The same for advice, and of its whole time, that what is quick takes before a dear ruler."""
ENOUGH = 0.3
"""Share of the tolerance within which the ruler's bar needs nothing better."""
DEARER = 1.5
"""Times the cost of what may keep the tolerance, above which a sharper ruler is worth its time."""
MOST_OVER = 1.2
"""Times the budget, that the first look may take by what is known before."""
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
        runtime.import_taichi()
        runtime.start("cpu")
        self.touching = may_meet(self.scene, 0.0)
        self.vibrates = False
        if by_numbers(self.scene):
            self.warn(BY_NUMBERS)

    def warn(self, told: str) -> None:
        """Note a warning, once."""
        if told not in self.warnings:
            self.warnings.append(told)

    @property
    def _share(self) -> float:
        """Of the budget, at which static answers and modes must be over."""
        return 0.95 if self.patient else SHARES["answers"]

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
        if not self._quantities():
            self._run_alone(candidates)
            return
        self._find_rulers(tolerance)
        if self.patient and any(self._is_long(v) for v in candidates):
            self._find_linear_ruler()
        for share in (QUICK, self._share) if self.patient else (self._share,):
            for variant in sorted(candidates, key=self._wait):
                if tolerance and self._is_hopeless(variant, tolerance):
                    continue
                self._answers(variant, 0.9 if len(self.judged()) < 2 else share)
            if tolerance and self._is_blunt(tolerance):
                for pair in self._pairs()[1:]:  # a sharper ruler may make one certain
                    if self._take(pair, blunt=ENOUGH * tolerance) and pair.better in candidates:
                        self._answers(pair.better, self._share)
        self._widen()
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
                f"whose equilibrium and modes take about {needs:.0f} s: too many for the time "
                "there is; take a coarser mesh, or chart it with a larger --budget"
            )
        for what in missing:
            self.asking.ask(what, now, always=True)
        static, modes = (self.asking.known(what, now) for what in ("static", "modes"))
        self.vibrates = bool(modes and modes["frequencies"])
        self.judging.static = bool(static and static["most"] > 0.0)
        if self.catalogue.is_itself:
            self.warn(ITSELF)
        elif not self.judging.static and not self.vibrates:
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
        if self.touching and self._quantities():
            self.warn(CONTACT)

    def _no_static(self, now: Variant) -> str:
        """Why there is no sag."""
        if self.asking.known("static", now) is not None:
            return "no load moves the scene at rest"
        told: str = self.asking.bench.record(now).get("static", {}).get("error", NO_TIME)
        return told

    # -- rulers --------------------------------------------------------------------------------

    def _find_rulers(self, tolerance: float) -> None:
        """The best pair of answers that its share of the budget allows, the first one always; none
        that is not known yet where the bars are well within the tolerance.
        """
        pairs = self._pairs()
        rulers = self.judging.rulers
        if not pairs or not self._take(pairs[0], always=True):
            for pair in pairs_of(self.catalogue, twin=True):
                self._take(pair, always=not rulers)
        for pair in pairs[1 : 2 if self.patient and tolerance else None] if rulers else []:
            is_new = not self.asking.has("static", pair.better)
            if not (is_new and max(r.bar for r in rulers.values()) <= ENOUGH * tolerance):
                self._take(pair)
        if not rulers:
            raise SceneError(self._no_ruler(pairs))
        for missing in set(self._quantities()) - set(rulers):
            self.warn(f"{missing} is left out: the ruler has no answer for it{self._why(missing)}")

    def _no_ruler(self, pairs: Sequence[Pair]) -> str:
        """Why nothing can be held against anything."""
        if not pairs:
            return (
                "the scene cannot be charted: none of its bodies can be varied, as those of tets, "
                "of shapes, of cages and of springs from Young's modulus can"
            )
        size = self.asking.size(pairs[0].better)
        if size is not None and size["nodes"] > LARGEST_RULER:
            return (
                f"the mesh is too large for a ruler: quadratic tets would have {size['nodes']} "
                f"nodes, more than {LARGEST_RULER}, and it has no coarser twin; take a coarser mesh"
            )
        needs = sum(self.asking.needs(what, pairs[0].better) for what in self._works())
        whole = math.ceil(1.2 * (self.asking.spent() + needs / RULER_ALONE))
        return (
            f"the budget is too small for the ruler of this scene; give {whole} s or more, or take "
            "a coarser mesh"
        )

    def _quantities(self) -> list[str]:
        """Which of sag and frequency the scene has."""
        if self.catalogue.is_itself:
            return []
        has = {"sag": self.judging.static, "frequency": self.vibrates}
        return [what for what, own in has.items() if own]

    def _works(self) -> list[str]:
        """What is asked of a ruler."""
        works = {"sag": "static", "frequency": "exact modes"}
        return [works[what] for what in self._quantities()]

    def _why(self, missing: str) -> str:
        """What quadratic tets said instead of an answer."""
        pair = next(iter(self._pairs()), None)
        if pair is None or missing != "sag":
            return ""
        told = self.asking.bench.record(pair.better).get("static", {}).get("error")
        return f" ({told})" if told else ""

    def _take(self, pair: Pair, *, always: bool = False, blunt: float | None = None) -> bool:
        """Let a pair become the ruler; returns whether it told anything.

        Args:
            pair: of variants.
            always: whatever its share of the budget.
            blunt: of the quantities whose bars are wider, the widest first, and late.
        """
        size = self.asking.size(pair.better)
        if size is None or size["nodes"] > LARGEST_RULER:
            return False
        share = SHARES["ruler"]
        quantities = self._quantities()
        if blunt is not None:
            share = self._share
            bars = {q: r.bar for q, r in self.judging.rulers.items()}
            quantities = [q for q in quantities if bars.get(q, 1.0) > blunt]
            quantities.sort(key=lambda q: -bars.get(q, 1.0))
        if always:  # within the whole budget all the same
            needs = sum(self.asking.needs(w, pair.better) for w in self._works())
            has_twin = self.catalogue.is_curved and pair.told is None
            alone = QUICK if self.patient and has_twin else RULER_ALONE
            if needs > alone * (self.budget - self.asking.spent()) and not pair.last:
                return False
            share = 100.0
        pair = self._on_curves(pair)
        found = False
        for what in quantities:
            answers = self._answers_of(pair, what, share)
            if len(answers) < 2:
                continue
            made = ruler_of(what, answers, pair)
            old = self.judging.rulers.get(what)
            best = self.judging.rulers[what] = made if old is None else agreed(old, made)
            if best is not old:
                self.judging.on_one_mesh[what] = pair.range_ == estimate.SAME_MESH
            found = True
        if found and pair.told:
            self.warn(pair.told)
        return found

    def _on_curves(self, pair: Pair) -> Pair:
        """The pair, with what is known of curved shapes."""
        if pair.range_ != estimate.TWO_MESHES or not self.catalogue.is_round:
            return pair
        coarse, fine = (self.asking.bench.scene(v) for v in (pair.worse, pair.better))
        known = range_of(coarse, fine, self.catalogue.varied)
        if known is None:
            return pair
        sizes = [self.asking.bench.ask("size", v)["elements"] for v in (pair.worse, pair.better)]
        ratio = float(sizes[1] / sizes[0]) ** (1.0 / 3.0)
        return dataclasses.replace(pair, range_=known, ratio=ratio, coarser=None)

    def _answers_of(self, pair: Pair, what: str, share: float) -> list[Any]:
        """A quantity of a pair's variants, from worse to better; empty where one lacks it."""
        variants = (pair.worse, pair.better)
        two = [self.asking.quantity(v, what, share, exact=True) for v in variants]
        if any(a is None or np.shape(a) != np.shape(two[-1]) for a in two):
            return []
        if pair.coarser is not None:
            third = self.asking.quantity(pair.coarser, what, share, exact=True)
            if third is not None and np.shape(third) == np.shape(two[0]):
                return [third, *two]
        return two

    def _widen(self) -> None:
        """A ruler of the scene's own element on a finer mesh tells no more than meshes settle."""
        if not any(pair.told in (OWN_SPRINGS, OWN_HEXES) for pair in self._pairs()):
            return
        has = self.catalogue.elements()[0]
        rows = sorted((v for v in self.judged() if v.element == has), key=lambda v: v.elements)
        for what, ruler in self.judging.rulers.items():
            errors = [v.errors[what].value for v in rows if what in v.errors]
            grows = max((fine - coarse for coarse, fine in pairwise(errors)), default=0.0)
            if grows > ruler.bar:
                self.judging.rulers[what] = dataclasses.replace(ruler, bar=grows)
                self.warn(f"{what}{UNSETTLED}")

    def _pairs(self) -> list[Pair]:
        """Those that may become the ruler."""
        return list(pairs_of(self.catalogue, twin=False))

    def may_turn(self) -> bool:
        """Whether bodies may turn by what no equilibrium tells of, which linear elasticity does not
        stand."""
        spins = any(np.any(np.asarray(body.spin)) for body in self.scene.bodies)
        turned = any(pin.turn is not None for body in self.scene.bodies for pin in body.pins)
        return spins or turned or not self.judging.static

    def _find_linear_ruler(self) -> None:
        """Linear elasticity on the meshes of the ruler, for variants whose static answer takes
        longer than there is time."""
        now = self.catalogue.current
        sag, own = self.judging.rulers.get("sag"), self.asking.quantity(now, "sag")
        linear = self._linearly(now)
        if sag is None or own is None or linear is None:
            return
        rulers = []
        for pair in self._pairs():
            if self.asking.known("static", pair.better) and pair.told is None:
                worse, better = self._linearly(pair.worse), self._linearly(pair.better)
                if worse is not None and better is not None:
                    rulers.append(ruler_of("sag", [worse, better], pair))
        if rulers:
            best = min(rulers, key=lambda ruler: ruler.bar)
            self.judging.linear = linear_ruler(best, sag.error(own), linear)

    def _linearly(self, variant: Variant) -> Any:
        """Sag as linear elasticity has it."""
        found = self.asking.ask("linear static", variant, self._share)
        return None if found is None else self.asking.sag_of(found)

    # -- variants ------------------------------------------------------------------------------

    def _candidates(self, *, others: bool) -> Iterator[Variant]:
        if self.catalogue.is_itself:
            step = self.asking.known("step", self.catalogue.current)
            yield from self.catalogue.steps(step["step"]) if step else ()
            others = True
        yield from self.catalogue.meshes()
        yield from self.catalogue.others() if others else ()

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
        """Seconds of what is not known of it, compiling left out: the soonest answers first."""
        shared = self.judging.shares_errors(variant)
        missing = [] if self.asking.has("modes", shared) else ["modes"]
        if not self.asking.has("static", shared) and not self.asking.has("linear static", shared):
            missing.append("linear static")
        return sum(self.asking.needs(what, shared) for what in missing)

    def _is_hopeless(self, variant: Variant, tolerance: float) -> bool:
        """Whether the same element on a finer mesh is too coarse already."""
        size = self.asking.size(variant)
        return size is not None and any(
            v.element == size["element"] and v.model == size["model"]
            and v.elements >= size["elements"] and v.worst.value - v.worst.bar > tolerance
            for v in self.judged()
        )  # fmt: skip

    def _is_blunt(self, tolerance: float) -> bool:
        """Whether nothing is certain to keep the tolerance, or what may keep it costs far less."""
        judged = self.judged()
        certain = [v.cost for v in judged if v.worst.most <= tolerance]
        likely = [v.cost for v in judged if v.worst.value - v.worst.bar <= tolerance]
        return not certain or min(certain) > DEARER * min(likely)

    def _is_long(self, variant: Variant) -> bool:
        """Whether its static answer takes longer than there is time, and a linear one does not."""
        shared = self.judging.shares_errors(variant)
        room = self._share * self.budget - self.asking.spent()
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
                    found = self._linearly(shared)
            if found is None:
                return
        found = self.asking.ask("step", variant, share)
        if found is not None and variant not in self.asking.variants:
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
        for pair in self._pairs()[:2]:
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
