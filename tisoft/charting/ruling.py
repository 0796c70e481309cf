"""What a scene's variants are held against, found while the budget lasts.

A ruler is made of the answers of a pair of variants, the better of which stands for the truth, with
a bar that tells how far it may be off (`rulers`).  The first pair is asked whatever its share;
further ones where they are worth their time.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from tisoft.charting import estimate
from tisoft.charting.asking import Asking
from tisoft.charting.curves import range_of
from tisoft.charting.doubting import UNSETTLED
from tisoft.charting.judging import Judging
from tisoft.charting.linearly import is_near, linear_ruler
from tisoft.charting.rulers import (
    OWN_HEXES,
    OWN_SPRINGS,
    Pair,
    agreed,
    pairs_of,
    ratios_of_family,
    ruler_of,
    ruler_of_family,
)
from tisoft.charting.variants import FACTORS, Catalogue, Variant
from tisoft.errors import SceneError

LARGEST_RULER = 60_000
"""Nodes of a quadratic mesh that statics and modes are asked of."""
SHARES = {"ruler": 0.5, "answers": 0.65, "timing": 0.85, "path": 0.95}
"""Of the budget, at which each stage must be over."""
RULER_ALONE = 0.8
"""Of what is left of the budget, that the first ruler may take."""
QUICK = 0.4
"""The same for advice, and of its whole time, that what is quick takes before a dear ruler."""
SHARPENING = 0.9
"""Of what is left for answers, that a sharper ruler may take: variants are asked after it."""
FAMILY = 4
"""Meshes that tell by themselves how far they can be trusted."""
LITTLE = 0.15
"""Of what is left for answers, that is tried before a dear ruler."""
CHEAP = 0.02
"""Of the whole budget, that an answer may take which makes four meshes of three."""
ENOUGH = 0.3
"""Share of the tolerance within which the ruler's bar needs nothing better."""

SHARP = 0.1
"""The same where something cheaper may keep the tolerance."""


@dataclass
class Ruling:
    """Finds the rulers of a survey, and gives them to its `judging`."""

    asking: Asking
    judging: Judging
    catalogue: Catalogue
    budget: float
    """[s]"""
    patient: bool
    """Whether it is for advice (see `Survey`)."""
    warn: Callable[[str], None]
    vibrates: bool = False
    """Whether the scene has frequencies."""

    @property
    def share(self) -> float:
        """Of the budget, at which static answers and modes must be over."""
        return 0.95 if self.patient else SHARES["answers"]

    def find(self, tolerance: float) -> None:
        """The best pair of answers that its share of the budget allows, the first one always; none
        that is not known yet where the bars are well within the tolerance.
        """
        pairs = self.pairs()
        rulers = self.judging.rulers
        if not pairs or not self.take(pairs[0], always=True):
            for pair in pairs_of(self.catalogue, twin=True):
                self.take(pair, always=not rulers)
        for pair in pairs[1 : 2 if self.patient and tolerance else None] if rulers else []:
            is_new = not self.asking.has("static", pair.better)
            room = QUICK * (self.budget - self.asking.spent()) if self.patient else math.inf
            is_dear = self._misses(pair, self.quantities()) > room  # `sharpen` may come to it
            is_sharp = is_new and max(r.bar for r in rulers.values()) <= ENOUGH * tolerance
            if not (is_sharp or is_dear):
                self.take(pair)
        if not rulers:
            raise SceneError(self._no_ruler(pairs))
        for missing in set(self.quantities()) - set(rulers):
            self.warn(f"{missing} is left out: the ruler has no answer for it{self._why(missing)}")

    def _no_ruler(self, pairs: Sequence[Pair]) -> str:
        """Why nothing can be held against anything."""
        if not pairs:
            return (
                "the scene cannot be charted: none of its bodies can be varied, as those of tets, "
                "of shapes, of cages and of springs from Young's modulus can"
            )
        size = self.asking.size(pairs[0].better)
        if size is None:
            why = self.asking.bench.ask("size", pairs[0].better)["error"]
            return f"the scene cannot be charted: quadratic tets are to judge it, but {why}"
        if size["nodes"] > LARGEST_RULER:
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

    def quantities(self) -> list[str]:
        """Which of sag and frequency the scene has."""
        if self.catalogue.is_itself:
            return []
        has = {"sag": self.judging.static, "frequency": self.vibrates}
        return [what for what, own in has.items() if own]

    @property
    def works(self) -> dict[str, str]:
        """What is asked for a quantity."""
        return {"sag": "static", "frequency": "modes" if self.asking.springs else "exact modes"}

    def _works(self) -> list[str]:
        """What is asked of a ruler."""
        return [self.works[what] for what in self.quantities()]

    def _why(self, missing: str) -> str:
        """What quadratic tets said instead of an answer."""
        pair = next(iter(self.pairs()), None)
        if pair is None or missing != "sag":
            return ""
        told = self.asking.bench.record(pair.better).get("static", {}).get("error")
        return f" ({told})" if told else ""

    def take(self, pair: Pair, *, always: bool = False) -> bool:
        """Let a pair become the ruler; returns whether it told anything.

        Args:
            pair: of variants.
            always: whatever its share of the budget.
        """
        if not self._has_size(pair):
            return False
        share = SHARES["ruler"]
        if always:  # within the whole budget all the same
            needs = sum(self.asking.needs(w, pair.better) for w in self._works())
            has_twin = self.catalogue.is_curved and pair.told is None
            alone = QUICK if self.patient and has_twin else RULER_ALONE
            if needs > alone * (self.budget - self.asking.spent()) and not pair.last:
                return False
            share = 100.0
        return self._rule(pair, self.quantities(), share)

    def sharpen(self, blunt: float) -> Variant | None:
        """A sharper ruler of the quantities whose bars are wider than that, on the finest mesh that
        there is time for; returns its better variant, or None where there is no time for any.
        """
        self._climb(blunt)
        wanted = self._blunt(blunt)
        some: tuple[Pair, list[str]] | None = None
        for pair in reversed(self.pairs()[1:]):
            room = SHARPENING * (self.share * self.budget - self.asking.spent())
            if not self._has_size(pair):
                continue
            if self._misses(pair, wanted) <= room:
                if self._rule(pair, wanted, self.share):
                    return pair.better
                continue  # it took longer than was foretold
            is_soon = "sag" in wanted and self._misses(pair, wanted, linearly=True) <= room
            if is_soon and self._own_linear() is not None:
                self._rule(pair, [what for what in wanted if what != "sag"], self.share)
                self.find_linear([*self.pairs()[:2], pair])
                return pair.better
            cheap = [what for what in wanted if self._misses(pair, [what]) <= room]
            some = some or ((pair, cheap[:1]) if cheap else None)
        if some is not None and self._rule(*some, self.share):
            return some[0].better
        return None

    def _blunt(self, blunt: float) -> list[str]:
        """Quantities of which the ruler's bar is wider than that, the widest first."""
        bars = {what: ruler.bar for what, ruler in self.judging.rulers.items()}
        wanted = [what for what in self.quantities() if bars.get(what, 1.0) > blunt]
        return sorted(wanted, key=lambda what: -bars.get(what, 1.0))

    def _climb(self, blunt: float) -> None:
        """Take what costs little of the time that is left, of which a dear ruler may have no
        need."""
        for pair in self.pairs()[1:]:
            room = LITTLE * (self.share * self.budget - self.asking.spent())
            for what in self._blunt(blunt) if self._has_size(pair) else []:
                if 0.0 < self._misses(pair, [what]) <= room:
                    self._rule(pair, [what], self.share)
                    self._take_family()

    def take_known(self) -> None:
        """Let pairs of which all is known by now, as their variants were asked, become rulers."""
        for pair in self.pairs():
            known = [what for what in self.quantities() if not self._misses(pair, [what])]
            if known and pair.told is None:
                self._rule(pair, known, 0.0)
        self._take_family()
        if self.judging.linear is not None:
            pairs = [p for p in self.pairs() if not self._misses(p, ["sag"], linearly=True)]
            self.find_linear(pairs)

    def _has_size(self, pair: Pair) -> bool:
        """Whether a pair is known, and not too large."""
        size = self.asking.size(pair.better)
        return size is not None and size["nodes"] <= LARGEST_RULER

    def _misses(self, pair: Pair, quantities: Sequence[str], *, linearly: bool = False) -> float:
        """Seconds of what is not known yet of a pair's quantities; linearly: of sag as linear
        elasticity has it."""
        variants = [v for v in (pair.worse, pair.better, pair.coarser) if v is not None]
        works = [self.works[what] for what in quantities]
        if linearly:
            works = ["linear static" if work == "static" else work for work in works]
        return sum(
            self.asking.needs(work, v) for v in variants for work in works
            if not self.asking.has(work, v)
        )  # fmt: skip

    def _rule(self, pair: Pair, quantities: Sequence[str], share: float) -> bool:
        """Let a pair become the ruler of quantities; returns whether it told anything."""
        pair = self._on_curves(pair)
        found = False
        for what in quantities:
            answers = self._answers_of(pair, what, share)
            if len(answers) < 2:
                continue
            made = ruler_of(what, answers, pair)
            self._agree(what, made, on_one_mesh=pair.range_ in estimate.SAME_MESH)
            found = True
        if found and pair.told:
            self.warn(pair.told)
        return found

    def _agree(self, what: str, made: estimate.Ruler, *, on_one_mesh: bool) -> None:
        """Let a ruler of a quantity count beside the one that is known."""
        old = self.judging.rulers.get(what)
        best = self.judging.rulers[what] = made if old is None else agreed(old, made)
        if best is not old:
            self.judging.on_one_mesh[what] = on_one_mesh

    def _take_family(self) -> None:
        """Let four meshes of quadratic tets or more become the ruler, where they converge."""
        tets = {f: found[1] for f in (1.0, *FACTORS) if (found := self.catalogue.tets(f))}
        for what in self.quantities():
            known = [f for f, v in tets.items() if self.asking.known(self.works[what], v)]
            if not known or self.catalogue.is_curved:
                continue
            coarser = [f for f in tets if f <= max(known) and self._is_cheap(what, tets[f])]
            family = ratios_of_family(self.catalogue, coarser)
            answers = [self.asking.quantity(tets[f], what, 1.0, exact=True) for f in family]
            if len(family) >= FAMILY and len({np.shape(a) for a in answers}) == 1:
                made = ruler_of_family(what, answers, list(family.values()))
                if made is not None:
                    self._agree(what, made, on_one_mesh=False)

    def _is_cheap(self, what: str, variant: Variant) -> bool:
        """Whether a quantity of a variant is known or soon is."""
        work = self.works[what]
        if self.asking.has(work, variant):
            return self.asking.known(work, variant) is not None
        return self.asking.needs(work, variant) <= CHEAP * self.budget

    def _on_curves(self, pair: Pair) -> Pair:
        """The pair, with what is known of curved shapes."""
        if pair.range_ not in estimate.TWO_MESHES or not self.catalogue.is_round:
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

    def widen(self) -> None:
        """A ruler of the scene's own element on a finer mesh tells no more than meshes settle."""
        if not any(pair.told in (OWN_SPRINGS, OWN_HEXES) for pair in self.pairs()):
            return
        has = self.catalogue.elements()[0]
        rows = sorted(
            (v for v in self.judging.judged() if v.element == has), key=lambda v: v.elements
        )
        for what, ruler in self.judging.rulers.items():
            errors = [v.errors[what].value for v in rows if what in v.errors]
            grows = max((fine - coarse for coarse, fine in pairwise(errors)), default=0.0)
            if grows > ruler.bar:
                self.judging.rulers[what] = dataclasses.replace(ruler, bar=grows)
                self.warn(f"{what}{UNSETTLED}")

    def pairs(self) -> list[Pair]:
        """Those that may become the ruler."""
        return list(pairs_of(self.catalogue, twin=False))

    def affords_linear(self, pair: Pair) -> bool:
        """Whether linear elasticity tells of a pair soon."""
        room = QUICK * (self.share * self.budget - self.asking.spent())
        return self._misses(pair, ["sag"], linearly=True) <= QUICK * room

    def find_linear(self, pairs: Sequence[Pair]) -> None:
        """Linear elasticity on the meshes of pairs, for variants whose static answer takes longer
        than there is time."""
        sag, linear = self.judging.rulers.get("sag"), self._own_linear()
        own = self.asking.quantity(self.catalogue.current, "sag")
        if sag is None or linear is None:
            return
        best: estimate.Ruler | None = None
        for pair in map(self._on_curves, pairs):
            variants = [v for v in (pair.coarser, pair.worse, pair.better) if v is not None]
            answers = [found for v in variants if (found := self.linearly(v)) is not None]
            if len(answers) == len(variants):
                made = ruler_of("sag", answers, pair)
                best = made if best is None else agreed(best, made)
        if best is not None:
            self.judging.linear = linear_ruler(best, sag.error(own), linear)

    def _own_linear(self) -> Any:
        """The scene's own sag as linear elasticity has it; None where that is far from it."""
        now = self.catalogue.current
        own = self.asking.quantity(now, "sag")
        linear = None if own is None else self.linearly(now)
        return linear if linear is not None and is_near(linear, own) else None

    def linearly(self, variant: Variant) -> Any:
        """Sag as linear elasticity has it."""
        found = self.asking.ask("linear static", variant, self.share)
        return None if found is None else self.asking.sag_of(found)
