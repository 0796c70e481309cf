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
from tisoft.charting.variants import CURRENT, Catalogue, Variant


@dataclass
class Judging:
    """The errors of what was asked."""

    asking: Asking
    catalogue: Catalogue
    rulers: dict[str, Ruler] = field(default_factory=dict)
    """By quantity: sag, frequency."""
    linear: LinearRuler | None = None
    """Of sag as linear elasticity has it."""
    static: bool = False
    """Whether the scene has a static answer under a load."""

    def __post_init__(self) -> None:
        self.paths = Paths(self.asking.bench)

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

    def judge(self, variant: Variant) -> Judged | None:
        """One variant; None where not enough is known."""
        size, step = self.asking.size(variant), self.asking.known("step", variant)
        errors = self._errors(variant)
        if size is None or step is None or not errors or len(errors) < len(self.rulers):
            return None
        self._add_path(variant, errors)
        cost, timed = self.asking.cost(variant)
        decides = [q for q in errors if q != "path"]
        if "path" in errors and self.paths.has(variant) and not self.static:
            decides.append("path")
        return Judged(
            name=variant.name, settings=variant.settings[len(self.catalogue.given) :],
            model=size["model"], element=size["element"], elements=size["elements"],
            nodes=size["nodes"], step=step["step"], stable_step=step["stable_step"], cost=cost,
            errors=errors, timed=timed, ran=self.paths.has(variant), decides=tuple(decides),
            current=variant.name == CURRENT,
        )  # fmt: skip

    def _errors(self, variant: Variant) -> dict[str, Error]:
        """By quantity: those that are known."""
        errors: dict[str, Error] = {}
        shared = self.shares_errors(variant)
        for what, truth in self.rulers.items():
            value = self.asking.quantity(shared, what)
            if value is None and what == "sag" and self.linear is not None:
                known = self.asking.known("linear static", shared)
                if known is not None:
                    errors[what] = self.linear.error(self.asking.sag_of(known))
            elif value is not None and np.shape(value) == np.shape(truth.value):
                by_mode = what == "frequency"
                errors[what] = (
                    estimate.frequency_error(value, truth) if by_mode else truth.error(value)
                )
        return errors

    def _add_path(self, variant: Variant, errors: dict[str, Error]) -> None:
        if "frequency" in errors:
            errors["path"] = self._predicted_path(errors.get("sag"), errors["frequency"])
        reference = self._reference()
        if reference is not None and self.paths.has(variant):
            its, worst = reference
            own = self.paths.error(variant, its)
            if own is not None and variant != its:
                errors["path"] = Error(own, worst)

    def _predicted_path(self, sag: Error | None, frequency: Error) -> Error:
        first = float(self.rulers["frequency"].value[0])
        return estimate.path_error(sag, frequency, first, self.asking.duration)

    def _reference(self) -> tuple[Variant, float] | None:
        """The finest variant that was run, and what it may err by itself."""
        ran = [v for v in self.asking.variants if self.paths.has(v)]
        if len(ran) < 2:
            return None
        most = {v: max((e.most for e in self._errors(v).values()), default=np.inf) for v in ran}
        best = min(ran, key=lambda v: most[v])
        if "frequency" not in self.rulers:
            return best, most[best]
        own = Error(most[best], 0.0)
        return best, min(1.0, self._predicted_path(own, own).value)

    def parted(self, frame_rate: float) -> float | None:
        """Time [s] at which the two finest paths part, or None."""
        judged = sorted((v for v in self.judged() if v.ran), key=lambda v: v.worst.most)
        if len(judged) < 2 or judged[1].worst.most > 0.1:
            return None
        finest, next_ = (self.named(v.name) for v in judged[:2])
        return self.paths.parting(next_, finest, frame_rate)
