"""Advice: the least variant of a scene that is good enough, and why."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tisoft import checks
from tisoft.changes import scene_with
from tisoft.charting.chart import Chart, percent, told
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

NO_RUNS = (
    "only paths could tell what this scene errs by, and advice has no time to run them; chart it: "
    "tisoft chart SCENE -o DIR --budget 120"
)
UNKNOWN = "What the scene errs by was not found, so nothing is chosen in its place."


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
            **_numbers(self.choice),
            "current": _numbers(self.current),
            "reasons": self.reasons,
            "certain": self.certain,
            "warnings": self.warnings,
        }  # fmt: skip


def _numbers(one: Judged) -> dict[str, float | None]:
    """Error, bar and cost; nothing of an error that is not known."""
    known = math.isfinite(one.worst.value)
    return {
        "predicted_error": one.worst.value if known else None,
        "bar": one.worst.bar if known else None,
        "cost": one.cost,
    }


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
    if choice is not None and _turns_little(survey):
        survey.ask_linear(choice.name)


def _turns_little(survey: Survey) -> bool:
    """Whether no cell turns by more than linear elasticity stands."""
    return _turn(survey) < SMALL_TURN and not survey.may_turn()


def _turn(survey: Survey) -> float:
    """The largest rotation of a cell at rest [rad]; inf where it is not known."""
    static = survey.asking.known("static", survey.catalogue.current) or {}
    turn = static.get("turn")
    return math.inf if turn is None else float(turn)


def advice_of(survey: Survey, tolerance: float, *, whole: bool = True) -> Advice:
    """The choice from what was measured.

    Args:
        survey: what was asked.
        tolerance: relative error that is allowed.
        whole: whether all was asked that there was time for.
    """
    return _advice(survey, Chart(survey.judged(), survey.warnings), tolerance, whole)


def _advice(survey: Survey, chart: Chart, tolerance: float, whole: bool) -> Advice:
    if not chart.variants:
        return _nothing(survey, tolerance)
    choice, now = chart.least(tolerance), chart.current
    reserves = [] if whole else [CUT_SHORT]
    if choice is None:
        choice = _likeliest(survey, chart, tolerance)
        reserves.append(_short_of(survey, choice, tolerance))
    reserves += doubts(survey)
    own = survey.source if isinstance(survey.source, Scene) else str(survey.source)
    changed = scene_with(own, (*survey.settings, *choice.settings))
    reasons, warnings = _reasons(survey, chart, choice, tolerance), [*reserves, *chart.warnings]
    return Advice(
        changed, choice, now, tolerance, reasons, not reserves, list(dict.fromkeys(warnings))
    )


def _nothing(survey: Survey, tolerance: float) -> Advice:
    """The scene as it is, of whose errors nothing is known."""
    now = survey.judging.judge(survey.catalogue.current, always=True)
    if now is None:
        raise SceneError(NO_RUNS)
    warnings = list(dict.fromkeys([NO_RUNS, *doubts(survey), *survey.warnings]))
    return Advice(survey.scene, now, now, tolerance, [UNKNOWN], False, warnings)


def _likeliest(survey: Survey, chart: Chart, tolerance: float) -> Judged:
    """The cheapest that is likely good enough; none cheaper than the scene where the ruler is too
    blunt to tell one from another.
    """
    blunt = max((r.bar for r in survey.judging.rulers.values()), default=0.0) > tolerance
    least = chart.current.cost if blunt else 0.0
    likely = [v for v in chart.variants if v.likely <= tolerance and v.cost >= least]
    return min(likely, key=lambda v: v.cost) if likely else _best(chart)


def _best(chart: Chart) -> Judged:
    return min(chart.variants, key=lambda v: v.worst.most)


def _short_of(survey: Survey, choice: Judged, tolerance: float) -> str:
    bar = max((ruler.bar for ruler in survey.judging.rulers.values()), default=0.0)
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
            f"{_named(next_)} would be cheaper but {_coarse(next_, tolerance)}: it may err by "
            f"{percent(next_.worst.most)} %, more than {limit}."
        )
    now = chart.current
    if now.name != choice.name and now.cost > choice.cost:
        reasons.append(
            f"The scene as it is errs by {told(now.worst)} for {now.cost / choice.cost:.2g} times "
            "the cost."
        )
    elif now.name != choice.name:
        is_coarse = "is " * (now.least > tolerance) + _coarse(now, tolerance)
        reasons.append(f"The scene as it is {is_coarse}: it errs by {told(now.worst)}.")
    own = [v for v in chart.variants if v.model == now.model == "mass-spring"]
    if survey.catalogue.has_solid_twin and choice.model != "mass-spring" and own:
        finest = min(own, key=lambda v: v.worst.value)
        reasons.insert(
            1,
            f"Springs err as a model of the solid, whatever their mesh: the best of those tried by "
            f"{told(finest.worst)}.",
        )
    if _turns_little(survey) and choice.model != now.model == "viscoelastic":
        turn = _turn(survey)
        reasons.insert(
            1,
            f"No cell turns by more than {math.degrees(turn):.1g} degrees under the loads: linear "
            "elasticity is enough.",
        )
    return reasons[:3]


def _coarse(variant: Judged, tolerance: float) -> str:
    """That a variant errs by more than the tolerance, or may."""
    return "too coarse" if variant.least > tolerance else "may be too coarse"


def _named(variant: Judged) -> str:
    return "The scene as it is" if variant.current else variant.name
