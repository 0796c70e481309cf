"""What a variant costs: timed, or predicted from one that was.

    cost = s g t + r (k t₁ + b),   t₁ = n e + a,   t = min(t₁, n e/p + w)

in seconds of computing a simulated second, of n elements in whole batches; s substeps at rest and r
frames a second; g is how many more substeps a body takes that swings, or is looked at now and then;
e is what an element takes in a substep, and k how many substeps of one thread a frame is worth; p
is how much faster several threads are, which wait w for one another.
Ratios between elements and laws are in the tables below, measured on bars of 3 to 12,800 cells of
each element, law and precision.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from tisoft.model.layout import LANES

TET = 2.0e-8
"""Seconds of a substep of one linear St. Venant-Kirchhoff tet in f32, where nothing is timed."""
SUBSTEP = {"tet4": 1.0, "tet10": 4.5, "hex8": 2.2, "spring": 0.37}
"""e of an element, against that tet."""
MODELS = {
    "viscoelastic": 1.0, "neo-hookean": 0.98, "linear": 0.74, "mass-tensor": 0.8,
    "mass-spring": 1.0,
}  # fmt: skip
"""e of a model, against St. Venant-Kirchhoff."""
NEO_HEX = 6.9
"""e of a neo-Hookean hexahedron, beyond what its element and its model alone come to."""
DOUBLE, DOUBLE_SPRINGS = 1.7, 1.2
"""f64 against f32."""
SMALL_STRAINS = ("linear", "mass-tensor")
LOOKED_AT, SWINGING = 1.05, 1.15
"""g of these, and of all others."""
EACH_SUBSTEP, EACH_FRAME = 8e-8, 4e-6
"""a and b: seconds that a substep and a frame take however few elements there are."""
SUBSTEPS_A_FRAME = 0.6
"""k"""
FASTER, WAITING = 0.75, 3e-6
"""What each further thread adds to p, and w [s]."""

SAME = 0.1
"""1/w of a timed variant of another size alone; one that differs in one word has 1/w = 1.1."""
TABLES = 0.3
"""w of the tables as they are: how fast this machine is, and what else a scene has, they do not
know."""


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
        small = set(self.model.split("+")) <= set(SMALL_STRAINS)
        alone = self._work() + EACH_SUBSTEP
        frame = SUBSTEPS_A_FRAME * alone + EACH_FRAME
        grows = LOOKED_AT if small else SWINGING
        return self.substeps * grows * self.substep() + self.frame_rate * frame

    def substep(self) -> float:
        """Seconds of a substep by the tables alone."""
        work = self._work()
        alone = work + EACH_SUBSTEP
        return min(alone, self._faster * work + WAITING) if self.threads > 1 else alone

    def _work(self) -> float:
        """n e [s]"""
        words, laws = self.element.split("+"), self.model.split("+")
        each = sum(SUBSTEP.get(word, SUBSTEP["hex8"]) for word in words) / len(words)
        each *= max(MODELS.get(law, 1.0) for law in laws)
        if "hex8" in words and "neo-hookean" in laws:
            each *= NEO_HEX
        if self.precision == "f64":
            each *= DOUBLE_SPRINGS if words == ["spring"] else DOUBLE
        return TET * each * LANES * math.ceil(self.elements / LANES)

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
    the more it counts.

    Args:
        kind: what decides it.
        timed: kinds that were timed, with their costs.
    """
    weights = [1.0 / (SAME + kind.unlike(other) / 100.0) for other, _ in timed]
    slow = [math.log(cost / other.supposed()) for other, cost in timed]
    whole = sum(w * s for w, s in zip(weights, slow, strict=True)) / (TABLES + sum(weights))
    return kind.supposed() * math.exp(whole)
