"""Charts: a scene's variants, error against cost; and what they say in sentences."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tisoft import checks
from tisoft.charting.doubting import doubts
from tisoft.charting.estimate import Error
from tisoft.charting.judged import Judged
from tisoft.charting.steps import StepSide, step_side
from tisoft.charting.survey import Survey
from tisoft.errors import SceneError
from tisoft.scene import Scene

TOLERANCES = (0.01, 0.02, 0.05, 0.1)
MOST_DEARER = 4.0
"""Times the scene's cost, up to which something better is worth a sentence."""
WORDS = {"sag": "in its sag", "frequency": "in its frequencies", "path": "along its path"}


@dataclass(frozen=True)
class Chart:
    """Variants of a scene with predicted errors and costs."""

    variants: list[Judged]
    """The scene itself first."""
    warnings: list[str] = field(default_factory=list)
    """What a user should know of it, a sentence each."""
    steps: StepSide | None = None
    """How error and cost depend on the step."""

    @property
    def current(self) -> Judged:
        """The scene as it is."""
        return next(v for v in self.variants if v.current)

    @property
    def pareto(self) -> list[Judged]:
        """The variants that no other beats in both, from cheap to dear."""
        return sorted((v for v in self.variants if v.pareto), key=lambda v: v.cost)

    @property
    def quantities(self) -> list[str]:
        """Of which there are errors."""
        return list(self.current.errors)

    def least(self, tolerance: float) -> Judged | None:
        """The cheapest variant whose error with its bar is within a tolerance."""
        good = [v for v in self.variants if v.worst.most <= tolerance]
        return min(good, key=lambda v: v.cost, default=None)

    def sentences(self) -> list[str]:
        """What the chart says, in two sentences."""
        now = self.current
        parts = [f"{told(e)} {WORDS[q]}" for q, e in now.errors.items() if q in now.decides]
        how = "as it was run" if now.ran and now.decides == ("path",) else "as predicted"
        first = f"Your scene errs by {' and '.join(parts)}, {how}."
        same = [v for v in self.variants if not v.current and v.worst.most <= now.worst.most]
        best = min(same, key=lambda v: v.cost, default=None)
        if best is not None and best.cost < 0.8 * now.cost:
            share = now.cost / best.cost
            return [first, f"No larger an error costs 1/{share:.3g} with {best.name}."]
        better = [v for v in self.variants if v.worst.most < 0.8 * now.worst.most]
        equal = [v for v in better if v.cost <= 1.02 * now.cost]
        if equal:
            best = min(equal, key=lambda v: v.worst.most)
            return [first, f"At no higher a cost {best.name} errs by {told(best.worst)}."]
        near = [v for v in better if v.cost < MOST_DEARER * now.cost]
        if near:
            best = min(near, key=lambda v: v.cost * v.worst.most)
            share = best.cost / now.cost
            second = f"For {share:.2g} times the cost {best.name} errs by {told(best.worst)}."
            return [first, second]
        return [
            first,
            "None of the variants that were tried is much cheaper at no larger an error.",
        ]

    def result(self) -> dict[str, Any]:
        """The object of --json and of chart.json."""
        return {
            "status": "done",
            "quantities": self.quantities,
            "variants": [_as_dict(v) for v in self.variants],
            "current": self.current.name,
            "best": {f"{t:g}": v.name if (v := self.least(t)) else None for t in TOLERANCES},
            "sentences": self.sentences(),
            "step": self.steps.result() if self.steps else None,
            "warnings": self.warnings,
        }

    def table(self) -> list[dict[str, Any]]:
        """A flat row for each variant, as chart.csv has them."""
        rows = []
        for v in self.variants:
            row = _as_dict(v)
            errors, row["set"] = row.pop("error"), " ".join(f"--set {s}" for s in v.settings)
            bars = row.pop("bars")
            row |= {f"{q}_error": errors[q] for q in errors} | {f"{q}_bar": bars[q] for q in bars}
            rows.append(row)
        return rows

    def plot(self, ax: Any) -> None:
        """Draw it into a Matplotlib Axes."""
        from tisoft.charting.picture import draw

        draw(ax, self)


def told(error: Error) -> str:
    """An error with its bar, in per cent."""
    if error.below:
        return f"less than {percent(error.most)} %"
    return f"{percent(error.value)} % (± {percent(error.bar)} %)"


def percent(share: float) -> str:
    """A share in per cent, to two digits, without an exponent where it is large."""
    return f"{100.0 * share:.2g}" if share < 1.0 else f"{100.0 * share:.0f}"


def _as_dict(v: Judged) -> dict[str, Any]:
    return {
        "name": v.name, "model": v.model, "element": v.element, "elements": v.elements,
        "nodes": v.nodes, "step": v.step, "stable_step": v.stable_step, "cost": v.cost,
        "error": {q: e.value for q, e in v.errors.items()}, "bar": v.worst.bar,
        "bars": {q: e.bar for q, e in v.errors.items()}, "pareto": v.pareto,
        "current": v.current, "set": list(v.settings), "timed": v.timed, "path_ran": v.ran,
    }  # fmt: skip


def chart(scene: str | Path | Scene, *, budget: float = 60.0) -> Chart:
    """Chart a scene's variants, error against cost on this machine.

    Args:
        scene: a scene file, or a Scene.
        budget: seconds that it may take.

    Raises:
        SceneError: no variants, no ruler, or a budget too small for two variants.
    """
    budget = checks.number("budget", budget, unit="s")
    if not budget > 0.0:
        raise SceneError(f"budget is {budget:g}; give seconds above 0")
    survey = Survey(scene, budget)
    survey.measure()
    return chart_of(survey)


def chart_of(survey: Survey, share: float = 1.0) -> Chart:
    """The chart of what a survey has found so far; raises SceneError where that is too little.

    Args:
        survey: what was asked.
        share: of the whole budget, which the survey had.
    """
    found = survey.judged()
    if len(found) < 2:
        needs = math.ceil(2.0 * max(survey.budget, survey.asking.spent()) / share)
        raise SceneError(
            f"a budget of {survey.budget / share:g} s is too small for two variants of this scene; "
            f"give {needs} or more"
        )
    steps = step_side(survey, found[0])
    return Chart(found, list(dict.fromkeys([*doubts(survey), *survey.warnings])), steps)
