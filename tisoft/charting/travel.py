"""What paths err by: run, or foretold from those that were run, or from sag and frequency.

Paths lie apart in proportion to what their variants are coarse by, c: with d = e − e_ref of a run
against the best one,

    e_ref ≈ d c_ref/(c − c_ref),        e ≈ c median(e/c) of the others

c is the error of sag or frequency where there is one; of nets that stand for themselves what the
step errs by; else the size of the cells.
"""

from __future__ import annotations

from statistics import median
from typing import TYPE_CHECKING

import numpy as np

from tisoft.charting import estimate
from tisoft.charting.estimate import Error
from tisoft.charting.steps import step_error
from tisoft.charting.variants import Variant

if TYPE_CHECKING:
    from tisoft.charting.judging import Judging

APART = 1.2
"""Times coarser than the reference, that a run must be to tell of what the reference errs by."""
FORETOLD = 0.5
"""Bar of a path that was not run, as a share of its error."""


class Travel:
    """Errors of paths.

    Args:
        judging: what else is known of the variants.
    """

    def __init__(self, judging: Judging) -> None:
        self._judging = judging

    @property
    def reference(self) -> Variant | None:
        """The best variant that was run, where another one was."""
        ran = self._ran()
        return min(ran, key=self.coarseness) if len(ran) > 1 else None

    def error(self, variant: Variant, at_rest: dict[str, Error]) -> Error | None:
        """What the variant's path errs by; None where nothing tells it.

        Args:
            variant: of the scene.
            at_rest: its errors of sag and frequency.
        """
        judging, best = self._judging, self.reference
        if best is not None and (left := self._left(best)) is not None:
            own, share = self.coarseness(variant), left / self.coarseness(best)
            if variant == best:
                return Error(left, left)
            if judging.paths.has(variant):
                apart = judging.paths.error(variant, best)
                return None if apart is None else Error(apart, left)
            if judging.by_path:
                return Error(own * share, FORETOLD * own * share)
        elif judging.catalogue.is_itself:
            return self._by_theory(variant)
        if not judging.by_path and "frequency" in at_rest:
            first = float(judging.rulers["frequency"].value[0])
            duration = judging.asking.duration
            return estimate.path_error(at_rest.get("sag"), at_rest["frequency"], first, duration)
        return None

    def coarseness(self, variant: Variant) -> float:
        """c"""
        judging = self._judging
        if judging.catalogue.is_itself:
            return self._of_step(variant)
        at_rest = judging.errors_at_rest(variant)
        if at_rest:
            return max(max(e.value, e.bar) for e in at_rest.values())
        size = judging.asking.size(variant)
        across = 1.0 / judging.dimension
        return 1.0 if size is None else float(max(1, size["elements"])) ** -across

    def _of_step(self, variant: Variant) -> float:
        """What the step errs by, in proportion."""
        step = self._judging.asking.known("step", variant)
        size = self._judging.asking.size(variant)
        if step is None or size is None:
            return 1.0
        share = step["step"] / step["stable_step"]
        fine = 1.0 if size["precision"] == "f32" else 0.99  # the better of two alike
        return fine * (share**2 if size["integrator"] == "velocity-verlet" else share)

    def _by_theory(self, variant: Variant) -> Error | None:
        """What the step alone errs by along the first modes."""
        modes = self._judging.asking.known("modes", self._judging.catalogue.current)
        step = self._judging.asking.known("step", variant)
        size = self._judging.asking.size(variant)
        if modes is None or step is None or size is None or not modes["frequencies"]:
            return None
        omega = 2.0 * np.pi * np.array(modes["frequencies"])
        duration = self._judging.asking.duration
        found = step_error(size["integrator"], omega, step["step"], duration)
        found = max(found, estimate.ROUNDING[size["precision"]])
        return Error(found, found)

    def _left(self, best: Variant) -> float | None:
        """What the best path errs by itself; None where no other tells."""
        least = self.coarseness(best)
        found = []
        for variant in self._ran():
            apart = self._judging.paths.error(variant, best)
            coarse = self.coarseness(variant)
            if apart is not None and variant != best and coarse > APART * least:
                found.append(apart * least / (coarse - least))
        return median(found) if found else None

    def _ran(self) -> list[Variant]:
        return [v for v in self._judging.asking.variants if self._judging.paths.has(v)]
