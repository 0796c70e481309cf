"""How long an answer will take, so that a budget is kept: a table, and how slow this machine is.

Nothing is known for certain before it was done; what takes longer than its share of the budget by
this table is not begun.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from statistics import median
from typing import Any

COMPILED: dict[tuple[str, ...], dict[str, float]] = {
    ("hex8", "neo-hookean"): {"static": 12.0},
    ("spring", "mass-spring"): {"static": 1.5},
}
"""Seconds of compiling the first answer where the kernels of whole elements are needed."""
TIMING = {"tet4": 7.0, "tet10": 16.0, "hex8": 12.0, "spring": 4.0}
"""The same for a running scene."""
TOUCHING = 16.0
"""Seconds more where surfaces touch, for each size of the fields."""
LARGE = 0.75
"""The least slowness that answers of a second or more are foretold with."""
WARM = 0.2
"""What is left of them where kernels are in the disk cache."""
NODE = {
    "static": 1.8e-4, "linear static": 6e-5, "modes": 2e-4, "exact modes": 2.2e-4, "step": 2e-5,
}  # fmt: skip
"""Seconds a node."""
FOLDS = 1.2e-5, 1.75
"""Seconds more that nets, which fold, need for an equilibrium: a factor, and a power of nodes."""
FRONT = 2e-10
"""Seconds of a factorisation for each unknown of its widest front, cubed."""
FACTORED = {"static": 2.0, "linear static": 1.0, "modes": 3.2, "exact modes": 3.2, "step": 0.0}
"""Factorisations, and what is solved with them in their seconds."""


@dataclass
class Patience:
    """Foretells seconds of answers, corrected by how long others took."""

    warm: bool = False
    """Whether running scenes find their kernels in the disk cache."""
    _ratios: deque[float] = field(default_factory=lambda: deque(maxlen=5))
    _statics: deque[float] = field(default_factory=lambda: deque(maxlen=3))
    """Of static answers alone: how many steps they take is the scene's."""
    _seen: set[tuple[str, ...]] = field(default_factory=set)

    def needs(self, what: str, kind: tuple[str, ...], size: Mapping[str, Any]) -> float:
        """Seconds of "static", "modes", "exact modes" or "step" of an element and a model."""
        slowness = self.slowness
        if what == "static" and self._statics:
            slowness = max(slowness, *self._statics)
        supposed = self._supposed(what, kind, size)
        # That small answers are soon there tells little of large ones.
        return supposed * (max(slowness, LARGE) if supposed > 1.0 else slowness)

    def timing(self, kind: tuple[str, ...]) -> float:
        """Seconds of a timing of an element, model, precision and integrator."""
        compiles = 0.0
        if ("timing", *kind) not in self._seen:
            compiles = max(TIMING.get(word, 8.0) for word in kind[0].split("+"))
            compiles += TOUCHING if kind[-1].startswith("touching") else 0.0
        return (0.8 + compiles * (WARM if self.warm else 1.0)) * self.slowness

    @property
    def slowness(self) -> float:
        """How many times slower than the table this machine is now."""
        return min(20.0, max(0.3, median(self._ratios))) if self._ratios else 1.0

    def took(
        self, what: str, kind: tuple[str, ...], size: Mapping[str, Any], seconds: float
    ) -> None:
        """Learn from an answer."""
        if what in NODE:
            supposed = self._supposed(what, kind, size)
        elif what == "timing":
            supposed = self.timing(kind) / self.slowness
        else:
            self._seen.add(("timing", *kind))
            return
        is_first = what == "static" and (what, *kind) not in self._seen  # a law is compiled too
        if supposed > 0.2 and not is_first:
            self._ratios.append(seconds / supposed)
            if what == "static":
                self._statics.append(seconds / supposed)
        self._seen.add((what, *kind))

    def _supposed(self, what: str, kind: tuple[str, ...], size: Mapping[str, Any]) -> float:
        first = (what, *kind) not in self._seen
        compiles = COMPILED.get(kind[:2], {}).get(what, 0.0) if first else 0.0
        factor = FACTORED[what] * FRONT * float(size.get("front", 0.0))
        nodes = int(size.get("nodes", 0))
        folds = FOLDS[0] * nodes ** FOLDS[1] if (what, kind[0]) == ("static", "spring") else 0.0
        return 0.1 + compiles + NODE[what] * nodes + folds + factor
