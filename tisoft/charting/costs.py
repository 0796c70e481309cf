"""What a variant costs: timed, or predicted from one that was.

    cost = s g t + r (n c/p + b),   t = min(n e + a, n e/p + w)

in seconds of computing a simulated second, of n elements; s substeps at rest and r frames a
second; g is how many more substeps a body of a finite law takes that swings; e and c are what an
element takes in a substep, and in a frame where the stable step is followed; p is how much faster
several threads are, which wait w for one another.
Ratios between elements and laws are in the tables below, fitted to bars of 6 to 5,400 cells of each
element, law and precision.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

TET = 3.4e-8
"""Seconds of a substep of one linear St. Venant-Kirchhoff tet in f32, where nothing is timed."""
SUBSTEP = {"tet4": 1.0, "tet10": 4.6, "hex8": 2.6, "spring": 0.4}
"""e of an element, against that tet."""
FRAME = {"tet4": 11.0, "tet10": 120.0, "hex8": 25.0, "spring": 1.0}
"""c of an element, against a substep of that tet."""
MODELS = {
    "viscoelastic": (1.0, 1.0), "neo-hookean": (0.95, 1.0), "linear": (0.71, 0.5),
    "mass-tensor": (1.0, 0.7), "mass-spring": (1.0, 1.0),
}  # fmt: skip
"""e and c of a model, against St. Venant-Kirchhoff."""
SMALL_STRAINS = ("linear", "mass-tensor")
SWINGING = 1.15
"""g of all others."""
NEO_HEX = 7.6
"""e of a neo-Hookean hexahedron, beyond what its element and its model alone come to."""
DOUBLE, DOUBLE_SPRINGS = 1.85, 1.1
"""f64 against f32."""
EACH_SUBSTEP, EACH_FRAME = 2.7e-7, 7.7e-5
"""a and b: seconds that a substep and a frame take however few elements there are."""
FASTER, WAITING = 0.42, 1e-5
"""What each further thread adds to p, and w [s]."""

SAME = 0.1
"""1/w of a timed variant of another size alone, where the tables' own weight w is 1."""


@dataclass(frozen=True)
class Kind:
    """What decides the time of a substep."""

    element: str
    model: str
    precision: str
    integrator: str
    elements: int
    substeps: float
    """A simulated second."""
    frame_rate: float
    threads: int = 1

    def supposed(self) -> float:
        """The cost by the tables alone."""
        grows = 1.0 if set(self.model.split("+")) <= set(SMALL_STRAINS) else SWINGING
        frame = self._faster * self.elements * TET * self._ratio(1) + EACH_FRAME
        return self.substeps * grows * self.substep() + self.frame_rate * frame

    def substep(self) -> float:
        """Seconds of a substep by the tables alone."""
        work = self.elements * TET * self._ratio(0)
        words = self.element.split("+")
        if "hex8" in words and "neo-hookean" in self.model.split("+"):
            work *= NEO_HEX
        if self.precision == "f64":
            work *= DOUBLE_SPRINGS if words == ["spring"] else DOUBLE
        alone = work + EACH_SUBSTEP
        return min(alone, self._faster * work + WAITING) if self.threads > 1 else alone

    def _ratio(self, k: int) -> float:
        """e (k = 0) or c (1), against the tet's e."""
        words, table = self.element.split("+"), (SUBSTEP, FRAME)[k]
        law = max(MODELS.get(word, (1.0, 1.0))[k] for word in self.model.split("+"))
        return law * sum(table.get(word, table["hex8"]) for word in words) / len(words)

    @property
    def _faster(self) -> float:
        """1/p"""
        return 1.0 / (1.0 + FASTER * (self.threads - 1))

    def unlike(self, other: Kind) -> float:
        """How little the other tells of this one."""
        names = ("element", "model", "precision", "integrator", "threads")
        differs = [getattr(self, name) != getattr(other, name) for name in names]
        size = abs(math.log(max(1, self.elements) / max(1, other.elements)))
        return 100.0 * sum(differs) + size


def predicted(kind: Kind, timed: list[tuple[Kind, float]]) -> float:
    """The cost of a kind: that of the tables, in the scale of those that were timed, the more alike
    the more it counts; one that is little alike counts as much as the tables.

    Args:
        kind: what decides it.
        timed: kinds that were timed, with their costs.
    """
    weights = [1.0 / (SAME + kind.unlike(other) / 100.0) for other, _ in timed]
    slow = [math.log(cost / other.supposed()) for other, cost in timed]
    whole = sum(w * s for w, s in zip(weights, slow, strict=True)) / (1.0 + sum(weights))
    return kind.supposed() * math.exp(whole)
