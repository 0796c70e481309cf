"""How true charts and advice are: seven scenes whose continuum is known, against what is told.

    errors    predicted and true, of linear and quadratic tets and hexahedra on the scene's mesh
    costs     predicted from the tables and from that of the scene alone, and timed
    advice    at three tolerances: the true error of what it chose, and its cost against that of the
              cheapest of all variants that keep the tolerance in truth

The truth is of 27-node hexahedra (beam, energy of the turned bar), Lamb's (1882) for the ball, else
of quadratic tets on three meshes up to four times as fine, extrapolated; bars stand beside it.
Advice is asked anew for each tolerance, as a user does; variants that decide are timed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from tisoft.charting import advice
from tisoft.charting.costs import Kind, predicted
from tisoft.charting.estimate import Ruler
from tisoft.charting.judged import Judged
from tisoft.charting.survey import Survey

TOLERANCES = (0.1, 0.03, 0.01)
ELEMENTS = ("tet4", "tet10", "hex8")
LOOK = 20.0
"""Seconds of processor time for the variants that no advice looked at."""
TIMED = 4
"""Cheapest variants that keep a tolerance, of which the cost is timed."""

CLAMPED = """
[[body.pin]]
where = { box = [[-1e-6, -1, -1], [1e-6, 1, 2]] }
"""
BAR = """
[[body]]
name = "bar"
young = 1e6
poisson = 0.3
density = 1000
[body.mesh]
box = { size = [1, 0.2, 0.2], cells = [10, 2, 2] }
""" + CLAMPED  # fmt: skip
TIP = '[[probe]]\nname = "tip"\nbody = "bar"\npoint = [1, 0.1, 0.1]\n'
TURNED = """
[[body.pin]]
where = { box = [[0.999, -1, -1], [1.001, 1, 1]] }
turn = { point = [0, 0.1, 0.1], axis = [1, 0, 0], rate = 1.5707963267948966 }
"""
SPRINGS = BAR.replace("poisson = 0.3", 'model = "mass-spring"')
PLATE = """
[[body]]
name = "plate"
young = 5e6
poisson = 0.3
density = 1200
[body.mesh]
box = { size = [1, 0.05, 1], cells = [12, 1, 12] }
[[body.pin]]
where = { box = [[0.999, -1, -1], [1.001, 1, 2]] }
""" + CLAMPED + """
[[probe]]
name = "middle"
body = "plate"
point = [0.5, 0, 0.5]
"""  # fmt: skip
BLOCK = """
[[body]]
name = "block"
model = "neo-hookean"
young = 2e4
poisson = 0.49
density = 1000
[body.mesh]
box = { size = [0.3, 0.2, 0.2], cells = [6, 4, 4] }
[[body.pin]]
where = { plane = { point = [0, 0.001, 0], normal = [0, 1, 0] } }
[[body.load]]
where = { plane = { point = [0, 0.199, 0], normal = [0, -1, 0] } }
force = [10, 0, 0]
[[probe]]
name = "corner"
body = "block"
point = [0.3, 0.2, 0.2]
"""
COLUMN = """
[[body]]
name = "column"
young = 2e5
poisson = 0.4
density = 1000
[body.mesh]
cylinder = { radius = 0.1, height = 0.5, resolution = 3 }
[[body.pin]]
where = { plane = { point = [0, 0.001, 0], normal = [0, 1, 0] } }
[[probe]]
name = "top"
body = "column"
point = [0, 0.5, 0]
"""
BALL = """
[[body]]
name = "ball"
young = 1e5
poisson = 0.3
density = 1000
[body.mesh]
ball = { radius = 0.1, resolution = 5 }
"""
HEAVY = "gravity = [0, 0, -9.81]\nduration = 1\n"


@dataclass(frozen=True)
class Case:
    """A scene and what it would be without an error of its mesh."""

    text: str
    """Of its file."""
    frequency: tuple[float, float, float]
    """[Hz]"""
    sag: Any = None
    """Displacement of its probe [m], or the elastic energy [J]."""
    bars: dict[str, float] = field(default_factory=dict)
    """Relative, by quantity."""

    def truth(self) -> dict[str, Ruler]:
        """By quantity."""
        told = {"sag": self.sag, "frequency": self.frequency}
        return {
            what: Ruler(np.asarray(value, np.float64), self.bars.get(what, 0.0))
            for what, value in told.items() if value is not None
        }  # fmt: skip


CASES: dict[str, Case] = {
    "beam": Case(
        HEAVY + BAR + TIP, (0.9995, 0.9995, 4.5176), [[-0.0697, 0.0, -0.3457]],
        {"sag": 1e-3, "frequency": 7e-4},
    ),
    "turned bar": Case(
        "gravity = [0, 0, 0]\nduration = 1\n" + BAR + TURNED, (5.3197, 5.3197, 9.0586), 107.83,
        {"sag": 4e-4, "frequency": 1e-3},
    ),
    "springs": Case(
        HEAVY + SPRINGS + TIP, (0.99783, 0.99783, 4.6040), [[-0.07012, 0.0, -0.34668]],
        {"sag": 6e-4, "frequency": 5e-4},
    ),
    "plate": Case(
        "gravity = [0, -9.81, 0]\nduration = 1\n" + PLATE, (3.3873, 3.9841, 6.4849),
        [[0.0, -0.023244, 0.0]], {"sag": 3.5e-3, "frequency": 6e-3},
    ),
    "soft block": Case(
        "gravity = [0, -9.81, 0]\nduration = 0.5\n" + BLOCK, (2.4166, 2.7023, 2.9272),
        [[0.01023, -0.01018, 0.00003]], {"sag": 3e-3, "frequency": 3e-3},
    ),
    "column": Case(
        "gravity = [4, -9.81, 0]\nduration = 1\n" + COLUMN, (1.4902, 1.4901, 4.2258),
        [[0.10272, -0.018242, 0.0]], {"sag": 9e-3, "frequency": 2.1e-3},
    ),
    "free ball": Case(
        "gravity = [0, 0, 0]\nduration = 0.5\n" + BALL, (24.687, 24.687, 24.687),
        bars={"frequency": 1e-4},
    ),
}  # fmt: skip


def measure(name: str) -> dict[str, Any]:
    """Errors, costs and advice of one case."""
    case = CASES[name]
    with TemporaryDirectory() as folder:
        path = Path(folder) / "scene.toml"
        path.write_text(case.text, encoding="utf-8")
        kept: dict[str, Any] = {}
        asked = {t: _advised(path, t, kept) for t in TOLERANCES}
        whole = Survey(path, LOOK, kept=kept, patient=True)
        whole.measure(others=False)
        judged = {v.name: v for v in whole.judged()}
        truth = dict(case.truth())
        whole.judging.rulers, whole.judging.linear = truth, None
        for variant in whole.asking.variants:  # those too that linear elasticity stood in for
            whole.asking.ask("static", variant, always=True)
        true = {v.name: v for v in whole.judged()}
        timed = _timed(whole, true, [found["choice"] for found in asked.values()])
        return {
            "scene": name,
            "errors": list(_errors(judged, true)),
            "costs": _costs(whole, timed),
            "advice": [_held(t, found, true, timed) for t, found in asked.items()],
        }


def _advised(path: Path, tolerance: float, kept: dict[str, Any]) -> dict[str, Any]:
    """Advice that knows nothing yet; what it finds out is added to what is kept."""
    survey = advice.survey_for(path, tolerance)
    advice.measure(survey, tolerance)
    found = advice.advice_of(survey, tolerance)
    kept |= survey.kept
    return {
        "choice": found.choice.name, "certain": found.certain, "most": found.choice.worst.most,
    }  # fmt: skip


def _errors(judged: dict[str, Judged], true: dict[str, Judged]) -> Iterator[dict[str, Any]]:
    """Of each element on the scene's own mesh."""
    current = next(v for v in judged.values() if v.current)
    for name, one in judged.items():
        if name not in (*ELEMENTS, current.name) or name not in true:
            continue
        for what in ("sag", "frequency"):
            if what not in one.errors or what not in true[name].errors:
                continue
            told, real = one.errors[what], true[name].errors[what]
            yield {
                "element": one.element, "quantity": what, "predicted": told.value,
                "bar": told.bar, "true": real.value, "true_bar": real.bar,
            }  # fmt: skip


def _timed(whole: Survey, true: dict[str, Judged], chosen: list[str]) -> dict[str, float]:
    """Timed costs of the scene, of what was chosen, and of the cheapest that keep a tolerance."""
    wanted = [next(v.name for v in true.values() if v.current), *chosen]
    for tolerance in TOLERANCES:
        good = [v for v in true.values() if v.likely <= tolerance]
        wanted += [v.name for v in sorted(good, key=lambda v: v.cost)[:TIMED]]
    found = {}
    for name in dict.fromkeys(wanted):
        if name in true:
            timing = whole.asking.ask("timing", whole.judging.named(name), always=True)
            if timing is not None:
                found[name], _ = whole.asking.cost(whole.judging.named(name))
    return found


def _costs(whole: Survey, timed: dict[str, float]) -> list[dict[str, Any]]:
    """What costs are predicted from that of the scene alone, beside those that were timed."""
    kinds: dict[str, Kind] = {}
    for name in timed:
        kind = whole.asking.kind_of(whole.judging.named(name))
        if kind is not None:
            kinds[name] = kind
    first = next(iter(kinds))
    own = whole.asking.timed(whole.judging.named(first))
    assert own is not None
    return [
        {"name": name, "predicted": predicted(kind, [(kinds[first], own)]),
         "timed": timed[name]}
        for name, kind in kinds.items() if name != first
    ]  # fmt: skip


def _held(
    tolerance: float, found: dict[str, Any], true: dict[str, Judged], timed: dict[str, float]
) -> dict[str, Any]:
    """A piece of advice against the truth."""
    name = found["choice"]
    good = [timed[v.name] for v in true.values() if v.likely <= tolerance and v.name in timed]
    cost = timed.get(name)
    real = true[name].likely if name in true else None
    return {
        "tolerance": tolerance, "choice": name, "certain": found["certain"],
        "predicted_most": found["most"], "true": real,
        "times_cheapest": cost / min(good) if good and cost is not None else None,
    }  # fmt: skip


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Counts over all scenes."""
    held = [one for row in rows for one in row["advice"]]
    certain = [one for one in held if one["certain"]]
    right = [one for one in certain if one["true"] is not None and one["true"] <= one["tolerance"]]
    likely = [one for one in held if one["true"] is not None and one["true"] <= one["tolerance"]]
    near = [one for one in certain if (one["times_cheapest"] or np.inf) <= 2.0]
    costs = [one["predicted"] / one["timed"] for row in rows for one in row["costs"]]
    return {
        "advice": len(held), "certain": len(certain), "certain_and_right": len(right),
        "right": len(likely), "certain_and_within_2_times_the_cheapest": len(near),
        "costs": len(costs), "costs_within_0.7_to_1.4": sum(0.7 <= c <= 1.4 for c in costs),
    }  # fmt: skip


@dataclass(frozen=True)
class Column:
    """One column of a table: its head, how wide it is, and what it tells of an item."""

    head: str
    width: int
    """Of texts that stand right; those that stand left have a negative one."""
    tell: Callable[[dict[str, Any]], str]

    def cell(self, text: str) -> str:
        """A text, as wide as the column."""
        return text.ljust(-self.width) if self.width < 0 else text.rjust(self.width)


def _below(one: dict[str, Any]) -> bool:
    return bool(one["predicted"] <= one["bar"])


def _error(one: dict[str, Any]) -> str:
    if _below(one):
        return f"below {100 * (one['predicted'] + one['bar']):.2g} %"
    return f"{100 * one['predicted']:.3g} % ± {100 * one['bar']:.2g}"


def _share(value: float | None) -> str:
    return "" if value is None else f"{100 * value:.2f} %"


def _times(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"


TABLES = {
    "errors": (
        Column("element", -9, lambda one: str(one["element"])),
        Column("error of", -11, lambda one: str(one["quantity"])),
        Column("predicted", 18, _error),
        Column("true", 9, lambda one: _share(one["true"])),
        Column("ratio", 8, lambda one: _times(
            None if _below(one) else one["predicted"] / max(one["true"], 1e-12))),
    ),
    "costs": (
        Column("variant", -31, lambda one: str(one["name"])),
        Column("cost predicted", 15, lambda one: f"{one['predicted']:.3g}"),
        Column("timed", 10, lambda one: f"{one['timed']:.3g}"),
        Column("ratio", 8, lambda one: _times(one["predicted"] / one["timed"])),
    ),
    "advice": (
        Column("within", 8, lambda one: f"{100 * one['tolerance']:g} %"),
        Column("  advised", -33, lambda one: f"  {one['choice']}"),
        Column("told", 9, lambda one: f"<{_share(one['predicted_most'])}"),
        Column("true", 9, lambda one: _share(one["true"])),
        Column("x cheapest", 12, lambda one: _times(one["times_cheapest"])),
        Column("", -13, lambda one: "" if one["certain"] else "  not certain"),
    ),
}  # fmt: skip
"""By what `measure` finds of a scene."""


def as_text(rows: list[dict[str, Any]]) -> str:
    """The tables."""
    lines = []
    for what, columns in TABLES.items():
        scene = Column("scene", -13, lambda row: str(row["scene"]))
        lines.append("".join(column.cell(column.head) for column in (scene, *columns)))
        lines += [
            scene.cell(scene.tell(row)) + "".join(c.cell(c.tell(one)) for c in columns)
            for row in rows for one in row[what]
        ]  # fmt: skip
        lines.append("")
    counts = summary(rows).items()
    lines += [f"{key.replace('_', ' ')}: {value}" for key, value in counts]
    return "\n".join(line.rstrip() for line in lines)
