"""Judging: what is known of variants, held against the rulers, becomes errors and costs."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tisoft.charting import estimate
from tisoft.charting.asking import Asking
from tisoft.charting.estimate import Error, Ruler
from tisoft.charting.judged import Judged, with_pareto
from tisoft.charting.linearly import LinearRuler
from tisoft.charting.paths import Paths
from tisoft.charting.travel import Travel
from tisoft.charting.variants import CURRENT, Catalogue, Variant

LIKE, LEAST_RATIO = ("element", "model", "precision", "integrator"), 1.2
"""What meshes have in common of which one's errors are foretold from the other's, and the least
ratio of their cells."""
FINE = 0.1
"""Largest error at rest of a variant whose path is to stay near a finer one's."""


@dataclass
class Judging:
    """The errors of what was asked."""

    asking: Asking
    catalogue: Catalogue
    rulers: dict[str, Ruler] = field(default_factory=dict)
    """By quantity: sag, frequency."""
    on_one_mesh: dict[str, bool] = field(default_factory=dict)
    """By quantity: whether its ruler is from linear and quadratic tets on one mesh."""
    linear: LinearRuler | None = None
    """Of sag as linear elasticity has it."""
    static: bool = False
    """Whether the scene has a static answer under a load."""

    def __post_init__(self) -> None:
        self.paths = Paths(self.asking.bench)
        self.travel = Travel(self)

    def shares_errors(self, variant: Variant) -> Variant:
        """The variant whose static answer and modes are this one's too."""
        alike = variant.kind in ("precision", "integrator", "step")
        return self.catalogue.current if alike else variant

    def named(self, name: str) -> Variant:
        """The variant of a name among those that are judged."""
        return next(v for v in self.asking.variants if v.name == name)

    def judged(self) -> list[Judged]:
        """All variants of which enough is known, the scene itself first."""
        found = [self.judge(variant) for variant in dict.fromkeys(self.asking.variants)]
        return with_pareto([one for one in found if one is not None])

    def judge(self, variant: Variant, *, always: bool = False) -> Judged | None:
        """One variant; None where not enough is known, `always`: of its errors or not."""
        size, step = self.asking.size(variant), self.asking.known("step", variant)
        errors = self.errors_at_rest(variant)
        if size is None or step is None or (len(errors) < len(self.rulers) and not always):
            return None
        if (path := self.travel.error(variant, errors)) is not None:
            errors["path"] = path
        cost, timed = self.asking.cost(variant)
        decides = [q for q in errors if q != "path" or self.by_path]
        if not decides and not always:
            return None
        return Judged(
            name=variant.name, settings=variant.settings[len(self.catalogue.given) :],
            model=size["model"], element=size["element"], elements=size["elements"],
            nodes=size["nodes"], step=step["step"], stable_step=step["stable_step"], cost=cost,
            errors=errors, timed=timed, decides=tuple(decides),
            ran=self.paths.has(variant) and self.travel.reference is not None,
            current=variant.name == CURRENT,
        )  # fmt: skip

    def errors_at_rest(self, variant: Variant) -> dict[str, Error]:
        """Of sag and frequency, those that are known."""
        errors: dict[str, Error] = {}
        shared = self.shares_errors(variant)
        for what, truth in self.rulers.items():
            value = self.asking.quantity(shared, what)
            own = None
            if value is None:
                own = self.foretold(shared, truth) if what == "frequency" else None
            elif np.shape(value) == np.shape(truth.value):
                by_mode = what == "frequency"
                own = estimate.frequency_error(value, truth) if by_mode else truth.error(value)
            linear = self.linearly(shared) if what == "sag" else None
            found = [error for error in (own, linear) if error is not None]
            if found:
                errors[what] = min(found, key=lambda error: error.bar)
        return errors

    def linearly(self, variant: Variant) -> Error | None:
        """The error of sag as linear elasticity tells it, where it does."""
        known = self.asking.known("linear static", variant)
        if self.linear is None or known is None:
            return None
        return self.linear.error(self.asking.sag_of(known))

    def foretold(self, variant: Variant, truth: Ruler) -> Error | None:
        """The error of frequencies from what coarser cells of the same kind err by; None where
        that was not measured of the element, or nothing coarser is known.
        """
        size, step = self.asking.size(variant), self.asking.known("step", variant)
        if size is None or step is None or size["element"] != "tet10":
            return None
        found = []
        for other in self.asking.variants:
            its, coarse = self.asking.size(other), self.asking.known("step", other)
            value = self.asking.quantity(other, "frequency")
            if its is None or coarse is None or np.shape(value) != np.shape(truth.value):
                continue
            ratio = coarse["stable_step"] / step["stable_step"]  # that of the smallest cells
            if all(its[key] == size[key] for key in LIKE) and ratio >= LEAST_RATIO:
                error = estimate.frequency_error(value, truth)
                found.append(estimate.foretold(error, ratio))
        return min(found, key=lambda error: error.most, default=None)

    @property
    def by_path(self) -> bool:
        """Whether the path decides: there is no static answer, or nothing to hold it against."""
        return not self.static or not self.rulers

    @property
    def dimension(self) -> int:
        """Of the bodies that vary: 2 for sheets."""
        bodies = self.catalogue.scene.bodies
        return 3 if any(bodies[i].mesh.elements for i in self.catalogue.varied) else 2

    def parted(self, frame_rate: float) -> float | None:
        """Time [s] at which the two finest paths part, which should not, or None."""
        ran = [v for v in self.asking.variants if self.paths.has(v)]
        if len(ran) < 2:
            return None
        finest, next_ = sorted(ran, key=self.travel.coarseness)[:2]
        at_rest = self.errors_at_rest(next_)
        if any(error.most > FINE for error in at_rest.values()):
            return None
        return self.paths.parting(next_, finest, frame_rate)
