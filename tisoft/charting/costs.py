"""What a variant costs: timed, or predicted from one that was.

    cost = s (n e / p + a) + r (n c / p + b)      [seconds of computing a simulated second]

n elements on p threads, s substeps and r frames a second; e and c are what an element takes in a
substep and in a frame, where the stable step is followed.  Their ratios between elements and laws
are in the tables below; the common scale is that of the timed variant that is most alike.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

TET = 2.4e-8
"""Seconds of a substep of one linear St. Venant-Kirchhoff tet in f32, where nothing is timed."""
SUBSTEP = {"tet4": 1.0, "tet10": 5.4, "hex8": 2.2, "spring": 0.72}
"""e of an element, against that tet."""
FRAME = {"tet4": 30.0, "tet10": 190.0, "hex8": 58.0, "spring": 4.0}
"""c of an element, against a substep of that tet."""
MODELS = {
    "viscoelastic": (1.0, 1.0), "neo-hookean": (1.15, 1.5), "linear": (0.67, 0.2),
    "mass-tensor": (0.9, 0.4), "mass-spring": (1.0, 1.0),
}  # fmt: skip
"""e and c of a model, against St. Venant-Kirchhoff."""
NEO_HEX = 6.0
"""e of a neo-Hookean hexahedron, beyond what its element and its model alone come to."""
DOUBLE = 1.6
"""f64 against f32."""
EACH_SUBSTEP, EACH_FRAME = 5e-7, 2.5e-4
"""a and b: seconds that a substep and a frame take however few elements there are."""
BARRIERS = 3e-6
"""Seconds of a substep in which several threads wait for one another."""


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
        words, laws = self.element.split("+"), self.model.split("+")
        e, c = (
            max(MODELS.get(law, (1.0, 1.0))[k] for law in laws)
            * sum(table.get(word, table["hex8"]) for word in words) / len(words)
            for k, table in enumerate((SUBSTEP, FRAME))
        )  # fmt: skip
        if "hex8" in words and "neo-hookean" in laws:
            e *= NEO_HEX
        tets = self.elements / self.threads * TET * (DOUBLE if self.precision == "f64" else 1.0)
        waiting = EACH_SUBSTEP + (BARRIERS if self.threads > 1 else 0.0)
        return self.substeps * (tets * e + waiting) + self.frame_rate * (tets * c + EACH_FRAME)

    def unlike(self, other: Kind) -> float:
        """How little the other tells of this one."""
        names = ("element", "model", "precision", "integrator", "threads")
        differs = [getattr(self, name) != getattr(other, name) for name in names]
        size = abs(math.log(max(1, self.elements) / max(1, other.elements)))
        return 100.0 * sum(differs) + size


def predicted(kind: Kind, timed: list[tuple[Kind, float]]) -> float:
    """The cost of a kind from those that were timed, with their costs."""
    if not timed:
        return kind.supposed()
    nearest, cost = min(timed, key=lambda pair: kind.unlike(pair[0]))
    return kind.supposed() * cost / nearest.supposed()
