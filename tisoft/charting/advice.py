"""Advice: the least variant of a scene that is good enough, and why."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tisoft.changes import scene_with
from tisoft.charting.chart import Chart, told
from tisoft.charting.estimate import ROUNDING
from tisoft.charting.survey import Judged, Survey
from tisoft.errors import SceneError
from tisoft.scene import Scene

SMALL_TURN = math.radians(2.0)
"""Rotation [rad] below which linear elasticity is enough."""
SECONDS = 30.0
"""Budget [s] where the kernels are still to be compiled; a scene of 2,000 tets then takes ten."""


@dataclass(frozen=True)
class Advice:
    """The cheapest variant whose predicted error, with its bar, is within the tolerance."""

    scene: Scene
    """The scene so changed."""
    choice: Judged
    """The variant that was chosen."""
    current: Judged
    """The scene as it is."""
    tolerance: float
    """Relative error that is allowed [1]."""
    reasons: list[str]
    """Why, in three sentences at the most."""
    certain: bool
    """Whether the errors can be trusted; where not, a warning says why."""
    warnings: list[str]
    """What a user should know of it, a sentence each."""

    def result(self) -> dict[str, Any]:
        """The object of --json."""
        pairs = [setting.partition("=") for setting in self.choice.settings]
        return {
            "status": "done",
            "tolerance": self.tolerance,
            "choice": {
                "model": self.choice.model, "element": self.choice.element,
                "mesh": f"{self.choice.elements} elements, {self.choice.nodes} nodes",
                "set": {key: value for key, _, value in pairs},
            },
            "predicted_error": self.choice.worst.value,
            "bar": self.choice.worst.bar,
            "cost": self.choice.cost,
            "current": {
                "predicted_error": self.current.worst.value, "bar": self.current.worst.bar,
                "cost": self.current.cost,
            },
            "reasons": self.reasons,
            "certain": self.certain,
            "warnings": self.warnings,
        }  # fmt: skip


def advise(
    scene: str | Path | Scene,
    tolerance: float = 0.02,
    *,
    settings: Sequence[str] = (),
    tick: Callable[[str], Any] = lambda name: None,
) -> Advice:
    """The least variant of a scene that is good enough.

    Args:
        scene: a scene file, or a Scene.
        tolerance: relative error of sag and frequencies that is allowed.
        settings: KEY=VALUE, as --set takes them.
        tick: told the name of each variant before it is computed.

    Raises:
        SceneError: a tolerance that the precision cannot keep; no variants, or no ruler.
    """
    if not 0.0 < tolerance < 1.0:
        raise SceneError(f"tolerance is {tolerance:g}; give a relative error, as 0.02 for 2 %")
    survey = Survey(scene, SECONDS, settings, tick=tick)
    least = ROUNDING[survey.scene.precision]
    if tolerance < least:
        raise SceneError(
            f"tolerance is {tolerance:g}, below what {survey.scene.precision} keeps ({least:g}); "
            'give a larger one, or precision = "f64"'
        )
    chart = Chart(survey.measure(others=False), survey.warnings)
    return _advice(survey, chart, tolerance)


def _advice(survey: Survey, chart: Chart, tolerance: float) -> Advice:
    choice, now = chart.least(tolerance), chart.current
    doubts = []
    if choice is None:
        choice = min(chart.variants, key=lambda v: v.worst.most)
        doubts.append(
            f"no variant is certain to err by less than {100 * tolerance:g} %: the best that the "
            f"budget reached is {choice.name}, which errs by {told(choice.worst)}"
        )
    if survey.scene.obstacles:
        doubts.append("the scene has obstacles, and contact may decide its error: it is not in it")
    if survey.numbered:
        doubts.append("pins or loads select nodes by number, which finer meshes do not follow")
    if survey.springs:
        doubts.append("springs have no ruler but themselves: the model's own error is not counted")
    if not survey.static and not survey.free:
        doubts.append("there is no static answer to judge by: only frequencies were compared")
    own = survey.source if isinstance(survey.source, Scene) else str(survey.source)
    changed = scene_with(own, (*survey.settings, *choice.settings))
    return Advice(
        changed, choice, now, tolerance, _reasons(survey, chart, choice, tolerance), not doubts,
        [*doubts, *chart.warnings],
    )  # fmt: skip


def _reasons(survey: Survey, chart: Chart, choice: Judged, tolerance: float) -> list[str]:
    limit = f"{100 * tolerance:g} %"
    reasons = [
        f"{choice.name} errs by {told(choice.worst)} and costs {choice.cost:.3g} s a second."
    ]
    coarser = [v for v in chart.variants if v.cost < choice.cost and v.worst.most > tolerance]
    if coarser and choice.worst.most <= tolerance:
        next_ = max(coarser, key=lambda v: v.cost)
        reasons.append(
            f"The next cheaper, {next_.name}, may err by {100 * next_.worst.most:.2g} %, more than "
            f"{limit}."
        )
    now = chart.current
    if now is not choice and now.cost > choice.cost and now.worst.most > choice.worst.most:
        reasons.append(
            f"The scene as it is errs by {told(now.worst)} for {now.cost / choice.cost:.3g} times "
            "the cost."
        )
    elif survey.static:
        turn = survey.bench.ask("static", survey.catalogue.current).get("turn")
        if turn is not None and turn < SMALL_TURN:
            reasons.append(
                f'No cell turns by more than {math.degrees(turn):.1g} degrees: model = "linear" '
                "would be enough."
            )
    return reasons[:3]
