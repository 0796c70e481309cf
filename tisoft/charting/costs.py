"""What a variant costs: timed, or predicted from one that was.

    cost = n e s + a s + b r                      [seconds of computing a simulated second]

n elements, e seconds of an element's substep, s substeps a second, r frames a second.  The ratios
of e between elements and laws are in the table below; their common scale is that of the timed
variant that is most alike.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

TET = 2.4e-8
"""Seconds of a substep of one linear St. Venant-Kirchhoff tet in f32, where nothing is timed."""
ELEMENTS = {"tet4": 1.0, "tet10": 7.0, "hex8": 1.7, "spring": 0.44}
"""An element's substep, against that of a linear tet."""
MODELS = {"viscoelastic": 1.0, "neo-hookean": 1.0, "linear": 0.5, "mass-tensor": 0.6,
          "mass-spring": 1.0}  # fmt: skip
"""A model's, against St. Venant-Kirchhoff."""
DOUBLE = 1.6
"""f64 against f32."""
SUBSTEP, FRAME = 5e-7, 1.2e-4
"""Seconds that a substep and a frame take however few elements there are."""


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

    def supposed(self) -> float:
        """The cost by the table alone."""
        own = [ELEMENTS.get(word, 2.0) for word in self.element.split("+")]
        law = max(MODELS.get(word, 1.0) for word in self.model.split("+"))
        double = DOUBLE if self.precision == "f64" else 1.0
        each = TET * (sum(own) / len(own)) * law * double
        per_substep = self.elements * each + SUBSTEP
        return per_substep * self.substeps + FRAME * self.frame_rate

    def unlike(self, other: Kind) -> float:
        """How little the other tells of this one."""
        names = ("element", "model", "precision", "integrator")
        differs = [getattr(self, name) != getattr(other, name) for name in names]
        size = abs(math.log(max(1, self.elements) / max(1, other.elements)))
        return 100.0 * sum(differs) + size


def predicted(kind: Kind, timed: list[tuple[Kind, float]]) -> float:
    """The cost of a kind from those that were timed, with their costs."""
    if not timed:
        return kind.supposed()
    nearest, cost = min(timed, key=lambda pair: kind.unlike(pair[0]))
    return kind.supposed() * cost / nearest.supposed()
