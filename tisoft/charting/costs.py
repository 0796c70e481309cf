"""What a variant costs: timed, or predicted from one that was.

    cost = s g t + r b,   t₁ = n e + a,   t = min(t₁, n e/p + w),   b = k t₁ + d + c

in seconds of computing a simulated second, of n elements in whole batches; s substeps at rest and r
frames a second; e is what an element takes in a substep; p is how much faster several threads are,
which wait w for one another; b what a frame takes besides its substeps.  g is how many more
substeps bodies take that stiffen as they deform: what a timed variant shows holds for others of the
scene, in proportion to how much their elements do.
Ratios between elements and laws are in the tables below, measured on bars of 3 to 12,800 cells of
each element, law and precision.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from tisoft.charting.estimate import COMPRESSIBLE
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
WARPED = 4.7
"""e of a St. Venant-Kirchhoff hexahedron whose sides do not lie along the axes, against a brick."""
DOUBLE, DOUBLE_SPRINGS = 1.7, 1.2
"""f64 against f32."""
SMALL_STRAINS = ("linear", "mass-tensor")
GROWTH = 0.13
"""g − 1 of linear tets where nothing is timed."""
STIFFENS = {"tet10": (3.0, 7.0)}
"""g − 1 against that of linear tets, of compressible and of nearly incompressible bodies, measured
where they bend, twist and swing."""
EACH_SUBSTEP, EACH_FRAME = 8e-8, 2e-5
"""a and c: seconds that a substep and a frame take however few elements there are."""
SUBSTEPS_A_FRAME, FOLLOWING = 3.0, 1.2e-5
"""k and d of bodies that stiffen, whose limits are looked at; 0 of others."""
FASTER, WAITING = 0.75, 3e-6
"""What each further thread adds to p, and w [s]."""

SAME = 0.1
"""1/w of a timed variant of another size alone; one that differs in one word has 1/w = 1.1."""
LEAST_FRAME = 0.5
"""The least that frames are supposed to take, against c: what is timed of them is a difference."""
TABLES, OF_SCENES = 0.3, 0.01
"""w of the tables as they are: how fast this machine is they do not know, and even less what else a
scene has: what its frames take, and how far its bodies stiffen."""


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
    poisson: float = 0.0
    warped: bool = False
    """Whether it has hexahedra whose sides do not lie along the axes."""

    def supposed(self) -> float:
        """The cost by the tables alone."""
        return self.cost(self.substep(), self.frame(), GROWTH)

    def cost(self, substep: float, frame: float, growth: float) -> float:
        """The cost where a substep and a frame take so many seconds.

        Args:
            substep, frame: [s].
            growth: g − 1 of linear tets of the same scene.
        """
        more = 1.0 + growth * self.stiffens()
        return self.substeps * more * substep + self.frame_rate * frame

    def stiffens(self) -> float:
        """By how much limits follow what bodies do, against linear tets."""
        small = set(self.model.split("+")) <= set(SMALL_STRAINS)
        words = [word for word in self.element.split("+") if word != "spring"]
        each = [STIFFENS.get(word, (1.0, 1.0))[self.poisson > COMPRESSIBLE] for word in words]
        return 0.0 if small else max(each, default=0.0)

    def frame(self) -> float:
        """Seconds that a frame takes besides its substeps, by the tables alone."""
        return EACH_FRAME + self.looks()

    def looks(self) -> float:
        """Seconds of it in which limits are looked at."""
        steps = FOLLOWING * self.stiffens()
        return steps and steps + SUBSTEPS_A_FRAME * (self._work() + EACH_SUBSTEP)

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
        elif self.warped and "viscoelastic" in laws:
            each *= WARPED
        if self.precision == "f64":
            each *= DOUBLE_SPRINGS if words == ["spring"] else DOUBLE
        return TET * each * LANES * math.ceil(self.elements / LANES)

    @property
    def _faster(self) -> float:
        """1/p"""
        return 1.0 / (1.0 + FASTER * (self.threads - 1))

    def unlike(self, other: Kind) -> float:
        """How little the other tells of this one."""
        names = ("element", "model", "precision", "integrator")
        differs = [getattr(self, name) != getattr(other, name) for name in names]
        # Other programs slow several threads down, that wait for each other, more than one.
        differs += 3 * [self.threads != other.threads]
        size = abs(math.log(max(1, self.elements) / max(1, other.elements)))
        return 100.0 * sum(differs) + size


@dataclass(frozen=True)
class Timing:
    """What was timed of a variant."""

    cost: float
    """Seconds of computing a simulated second."""
    substep: float | None = None
    """[s]"""
    frame: float | None = None
    """What a frame takes besides [s]."""
    growth: float | None = None
    """g"""


def predicted(kind: Kind, timed: list[tuple[Kind, Timing]]) -> float:
    """The cost of a kind: that of the tables, in the scale of those that were timed, the more alike
    the more it counts.

    Args:
        kind: what decides it.
        timed: kinds that were timed.
    """
    weights = [1.0 / (SAME + kind.unlike(other) / 100.0) for other, _ in timed]
    whole = [timing.cost / other.supposed() for other, timing in timed]
    substeps = [
        w if timing.substep is None else timing.substep / other.substep()
        for w, (other, timing) in zip(whole, timed, strict=True)
    ]
    frames = [
        w if timing.frame is None else max((timing.frame - other.looks()) / EACH_FRAME, LEAST_FRAME)
        for w, (other, timing) in zip(whole, timed, strict=True)
    ]
    substep = kind.substep() * _scale(weights, substeps, TABLES)
    frame = kind.looks() + EACH_FRAME * _scale(weights, frames, OF_SCENES)
    return kind.cost(substep, frame, growth_of(kind, timed))


def growth_of(kind: Kind, timed: list[tuple[Kind, Timing]]) -> float:
    """g − 1 of linear tets, by those that were timed."""
    sums, weights = OF_SCENES * GROWTH, OF_SCENES
    for other, timing in timed:
        if timing.growth is not None and other.stiffens() > 0.0:
            weight = 1.0 / (SAME + kind.unlike(other) / 100.0)
            sums += weight * max(timing.growth - 1.0, 0.0) / other.stiffens()
            weights += weight
    return sums / weights


def _scale(weights: list[float], ratios: list[float], tables: float) -> float:
    """The mean of ratios, beside which the tables count as much as `tables`."""
    logs = (w * math.log(ratio) for w, ratio in zip(weights, ratios, strict=True))
    return math.exp(sum(logs) / (tables + sum(weights)))
