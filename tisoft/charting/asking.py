"""Asking within a budget: what is known of variants, and what there is time to find out."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from tisoft import runtime
from tisoft.charting.costs import Kind, Timing, growth_of, predicted
from tisoft.charting.patience import Patience
from tisoft.charting.records import Bench
from tisoft.charting.variants import Variant
from tisoft.model.layout import LANES, parts_in
from tisoft.step.pace import most_threads, work_of

TIMED_OF = ("cost", "substep", "frame", "growth")
"""What a record tells of a timing."""
LATE = 2.0
"""Times what did not suffice for an answer, that it is supposed to need."""
OVERRUN = 1.3
"""Times what is left of the budget of advice, after which an answer is given up."""
LONGEST = 3.0
"""Times the budget of advice, after which nothing tells what it is asked."""


@dataclass
class Asking:
    """Questions about variants, and their answers."""

    bench: Bench
    budget: float
    """[s]"""
    duration: float
    """Of the scene [s]."""
    patient: bool = False
    """Whether only the time counts that this process computes, not what others take."""
    tick: Callable[[str], Any] = lambda told: None
    springs: bool = False
    """Whether springs are judged by themselves, which have no exact modes."""
    touching: bool = False
    """Whether surfaces may touch when it runs."""
    patience: Patience = field(default_factory=Patience)
    variants: list[Variant] = field(default_factory=list)
    """Those of which enough is known to be judged, in the order in which it came."""
    _late: dict[tuple[str, tuple[str, ...]], float] = field(default_factory=dict)
    """Seconds that did not suffice for an answer."""

    def __post_init__(self) -> None:
        self._clock = time.process_time if self.patient else time.perf_counter
        self._begun = self._clock()
        self.bench.clock = self._clock

    def spent(self) -> float:
        """Seconds of the budget that are gone."""
        return self._clock() - self._begun

    def ask(
        self, what: str, variant: Variant, share: float = 1.0, *, always: bool = False
    ) -> dict[str, Any] | None:
        """The answer, or None where it fails, or would end after a share of the budget."""
        if what not in self.bench.record(variant):
            needs = self.needs(what, variant)
            if not always and self.spent() + needs > share * self.budget:
                return None
            if self._hangs_on_static(what, variant):
                self.ask("static", variant, share, always=always)
                if not self.has("static", variant):
                    return None
            self.tick(variant.name)
            until = min(share, 0.5) if always else share
            left = max(1.0, until * self.budget - self.spent())
            if self.patient:  # what others take does not count; what leads nowhere shall not last
                left = LONGEST * self.budget if always else min(OVERRUN * left, 1.0 + 3.0 * needs)
            found = self.bench.ask(what, variant, left)
            if what not in self.bench.record(variant):
                self._late[what, variant.settings] = left
            seconds = found["worked" if self.patient else "seconds"]
            kind, size = self._kind(what, variant)
            self.patience.took(what, kind, size, seconds)
        return self.known(what, variant)

    def known(self, what: str, variant: Variant) -> dict[str, Any] | None:
        """The answer, where there is one already."""
        found = self.bench.record(variant).get(what)
        return None if found is None or "error" in found else found

    def has(self, what: str, variant: Variant) -> bool:
        """Whether it was asked, with whatever outcome."""
        return what in self.bench.record(variant)

    def size(self, variant: Variant) -> dict[str, Any] | None:
        """What the variant is, or None where it cannot be had."""
        found = self.bench.ask("size", variant)
        return None if "error" in found else found

    def quantity(
        self, variant: Variant, what: str, share: float = 0.0, *, exact: bool = False
    ) -> Any:
        """Sag (displacements of the places, or the elastic energy), or frequencies; None without.

        Exact: as the ruler sees them.  A share of 0 asks nothing that is not known.
        """
        modes = "exact modes" if exact and not self.springs else "modes"
        asked = "static" if what == "sag" else modes
        found = self.ask(asked, variant, share) if share else self.known(asked, variant)
        if found is None:
            return None
        if what == "frequency":
            return found["frequencies"] or None
        return self.sag_of(found)

    def sag_of(self, static: dict[str, Any]) -> Any:
        """What sag is compared by: displacements of the places, or the elastic energy."""
        return static["places"] if self.bench.places else static["energy"]

    def needs(self, what: str, variant: Variant) -> float:
        """Seconds that an answer will take."""
        kind, size = self._kind(what, variant)
        if what == "timing":
            return self.patience.timing(kind)
        if what == "path":
            # Its kernels are those of a timing, compiled first where none was of their kind.
            return self.patience.timing(kind) + 1.2 * self.cost(variant)[0] * self.duration
        late = self._late.get((what, variant.settings), 0.0)
        first = self.needs("static", variant) if self._hangs_on_static(what, variant) else 0.0
        return first + max(self.patience.needs(what, kind, size), LATE * late)

    def _hangs_on_static(self, what: str, variant: Variant) -> bool:
        """Whether these are modes of a net, which swings about its equilibrium, and that is not
        known yet."""
        return self.springs and what == "modes" and not self.has("static", variant)

    def _kind(self, what: str, variant: Variant) -> tuple[tuple[str, ...], dict[str, Any]]:
        """What decides which kernels an answer needs, and the variant's size."""
        size = self.size(variant)
        if size is None:
            return ("", "", "", "", ""), {}
        from tisoft.model.lent import SMALL  # needs Taichi, which whoever only asks may lack

        words = [size[k] for k in ("element", "model", "precision", "integrator")]
        alone = _threads(size) == 1 if what == "timing" else size["elements"] < SMALL
        words.append("alone" if alone else "shared")  # loops are kernels of their own
        if self.touching and what in ("timing", "path"):
            words.append(f"touching, {int(size['elements']).bit_length()} digits")
        return tuple(words), size

    def cost(self, variant: Variant) -> tuple[float, bool]:
        """Seconds of computing a simulated second, and whether they were timed."""
        own, timing = self.kind_of(variant), self.timed(variant)
        if timing is not None and (timing.growth is not None or timing.substep is None):
            return timing.cost, True
        timed = [
            (kind, found)
            for other in self.variants
            if (found := self.timed(other)) is not None and (kind := self.kind_of(other))
        ]
        if own is None:
            return float("inf"), False
        if timing is None or timing.substep is None:
            return predicted(own, timed), False
        # Too long to run far: how much it stiffens is what others tell.
        return own.cost(timing.substep, timing.frame or 0.0, growth_of(own, timed)), True

    def timed(self, variant: Variant) -> Timing | None:
        """What was timed in a run of the variant; of the scene itself else over its path, frame by
        frame.  None where it was not run.
        """
        found = self.known("timing", variant)
        if found is None and variant == self.variants[0]:
            found = self.known("path", variant)
        return None if found is None else Timing(**{k: found[k] for k in TIMED_OF if k in found})

    def kind_of(self, variant: Variant) -> Kind | None:
        """What decides its cost."""
        size, step = self.size(variant), self.known("step", variant)
        if size is None or step is None:
            return None
        return Kind(
            size["element"], size["model"], size["precision"], size["integrator"],
            size["elements"], step["substeps"] * size["frame_rate"], size["frame_rate"],
            _threads(size), size["poisson"], size.get("warped", False),
        )  # fmt: skip


def _threads(size: dict[str, Any]) -> int:
    """CPU threads that a scene of one body of so many elements takes by itself."""
    count = size["elements"]
    is_net = size["element"] == "spring"
    work = work_of(0, count) if is_net else work_of(count, 0)
    return most_threads(work, parts_in(-(-count // LANES), LANES), runtime.threads())
