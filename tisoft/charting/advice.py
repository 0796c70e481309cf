"""Advice: the least variant of a scene that is good enough, and why."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tisoft import checks
from tisoft.changes import scene_with
from tisoft.charting.chart import Chart, told
from tisoft.charting.doubting import doubts
from tisoft.charting.estimate import ROUNDING
from tisoft.charting.judged import Judged
from tisoft.charting.survey import Survey
from tisoft.errors import SceneError
from tisoft.scene import Scene

SMALL_TURN = math.radians(2.0)
"""Rotation [rad] below which linear elasticity is enough."""
SECONDS = 8.5
"""Budget of one piece of advice [s of computing]."""

CUT_SHORT = "it was interrupted: variants that were not looked at yet may be better"


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
                "name": self.choice.name, "model": self.choice.model,
                "element": self.choice.element,
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
    bodies: Sequence[int] | None = None,
    same_probes: bool = False,
    tick: Callable[[str], Any] = lambda name: None,
) -> Advice:
    """The least variant of a scene that is good enough.

    Args:
        scene: a scene file, or a Scene.
        tolerance: relative error of sag and frequencies that is allowed.
        settings: KEY=VALUE, as --set takes them.
        bodies: numbers of those that may vary; left out, all.
        same_probes: leave out meshes that have no nodes where the probes are.
        tick: told the name of each variant before it is computed.

    Raises:
        SceneError: a tolerance that the precision cannot keep; no variants, or no ruler.
    """
    survey = survey_for(
        scene, tolerance, settings=settings, bodies=bodies, same_probes=same_probes, tick=tick
    )
    measure(survey, tolerance)
    return advice_of(survey, tolerance)


def survey_for(
    scene: str | Path | Scene,
    tolerance: float,
    *,
    settings: Sequence[str] = (),
    bodies: Sequence[int] | None = None,
    same_probes: bool = False,
    tick: Callable[[str], Any] = lambda name: None,
) -> Survey:
    """What advice rests on, nothing asked yet; arguments and errors are those of `advise`."""
    tolerance = checks.number("tolerance", tolerance)
    if not 0.0 < tolerance < 1.0:
        raise SceneError(f"tolerance is {tolerance:g}; give a relative error, as 0.02 for 2 %")
    survey = Survey(
        scene, SECONDS, settings, tick=tick, bodies=bodies, patient=True, same_probes=same_probes
    )
    least = ROUNDING[survey.scene.precision]
    if tolerance < least:
        raise SceneError(
            f"tolerance is {tolerance:g}, below what {survey.scene.precision} keeps ({least:g}); "
            'give a larger one, or precision = "f64"'
        )
    return survey


def measure(survey: Survey, tolerance: float) -> None:
    """Ask what the choice needs."""
    survey.measure(others=False, tolerance=tolerance)
    choice = Chart(survey.judged()).least(tolerance)
    turn = (survey.asking.known("static", survey.catalogue.current) or {}).get("turn")
    if choice is not None and turn is not None and turn < SMALL_TURN:
        survey.ask_linear(choice.name)


def advice_of(survey: Survey, tolerance: float, *, whole: bool = True) -> Advice:
    """The choice from what was measured.

    Args:
        survey: what was asked.
        tolerance: relative error that is allowed.
        whole: whether all was asked that there was time for.
    """
    return _advice(survey, Chart(survey.judged(), survey.warnings), tolerance, whole)


def _advice(survey: Survey, chart: Chart, tolerance: float, whole: bool) -> Advice:
    choice, now = chart.least(tolerance), chart.current
    reserves = [] if whole else [CUT_SHORT]
    if choice is None:
        likely = [v for v in chart.variants if v.worst.value <= tolerance]
        choice = min(likely, key=lambda v: v.cost) if likely else _best(chart)
        reserves.append(_short_of(survey, choice, tolerance))
    reserves += doubts(survey)
    own = survey.source if isinstance(survey.source, Scene) else str(survey.source)
    changed = scene_with(own, (*survey.settings, *choice.settings))
    told_before = [w for w in chart.warnings if w not in reserves]
    return Advice(
        changed, choice, now, tolerance, _reasons(survey, chart, choice, tolerance), not reserves,
        [*reserves, *told_before],
    )  # fmt: skip


def _best(chart: Chart) -> Judged:
    return min(chart.variants, key=lambda v: v.worst.most)


def _short_of(survey: Survey, choice: Judged, tolerance: float) -> str:
    bar = max(ruler.bar for ruler in survey.judging.rulers.values())
    if bar > tolerance:
        return (
            f"tolerance {tolerance:g} is below the ruler's own bar ({bar:.2g}): nothing can be "
            f"certain to keep it; the likeliest found is {choice.name}, which errs by "
            f"{told(choice.worst)}"
        )
    return (
        f"no variant is certain to err by less than {100 * tolerance:g} %: the likeliest that "
        f"the time reached is {choice.name}, which errs by {told(choice.worst)}"
    )


def _reasons(survey: Survey, chart: Chart, choice: Judged, tolerance: float) -> list[str]:
    limit = f"{100 * tolerance:g} %"
    reasons = [
        f"{_named(choice)} errs by {told(choice.worst)} and costs {choice.cost:.2g} s of computing "
        "a simulated second."
    ]
    coarser = [v for v in chart.variants if v.cost < choice.cost and v.worst.most > tolerance]
    if coarser and choice.worst.most <= tolerance:
        next_ = min(coarser, key=lambda v: v.worst.most)
        reasons.append(
            f"{_named(next_)} would be cheaper but too coarse: it may err by "
            f"{100 * next_.worst.most:.2g} %, more than {limit}."
        )
    now = chart.current
    if now.name != choice.name and now.cost > choice.cost:
        reasons.append(
            f"The scene as it is errs by {told(now.worst)} for {now.cost / choice.cost:.2g} times "
            "the cost."
        )
    elif now.name != choice.name:
        reasons.append(f"The scene as it is is too coarse: it errs by {told(now.worst)}.")
    turn = (survey.asking.known("static", survey.catalogue.current) or {}).get("turn")
    if turn is not None and turn < SMALL_TURN and choice.model != now.model == "viscoelastic":
        reasons.insert(
            1,
            f"No cell turns by more than {math.degrees(turn):.1g} degrees under the loads: linear "
            "elasticity is enough.",
        )
    return reasons[:3]


def _named(variant: Judged) -> str:
    return "The scene as it is" if variant.current else variant.name
