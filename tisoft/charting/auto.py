"""model = "auto" in a scene file: what is good enough is found before the scene is loaded.

    [[body]]
    model = "auto"        # young, poisson, density as of a solid
    tolerance = 0.02      # relative error of sag and frequencies (0.02)

Meshes without nodes where the probes are stay out, so that results tell of the same points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tisoft import checks
from tisoft.checks import inside
from tisoft.scene_file import document_of

if TYPE_CHECKING:
    from tisoft.charting.advice import Advice

TOLERANCE = 0.02
SOLID = "viscoelastic"
"""What a body of model "auto" is at first."""


@dataclass(frozen=True)
class Settled:
    """Settings with which a scene file has no model = "auto" any more."""

    settings: list[str]
    advice: Advice | None = None

    def sentences(self) -> list[str]:
        """What was chosen, to be told; empty where nothing had to be."""
        if self.advice is None:
            return []
        chosen = self.advice.choice
        first = f'model = "auto": {chosen.name} ({chosen.model}, {chosen.element}) is taken'
        return [first, *self.advice.reasons, *self.advice.warnings]


def settled(path: str | Path, settings: Sequence[str], known: Any = None) -> Settled:
    """The settings, and those that stand for model = "auto".

    Args:
        path: of the scene file.
        settings: KEY=VALUE of the command line.
        known: what was chosen before, as `Advice.result` has it: taken again.

    Raises:
        SceneError: a wrong tolerance; what `advise` refuses.
    """
    tables = document_of(path, settings).get("body", [])
    bodies = tables if isinstance(tables, list) else []
    own = [i for i, b in enumerate(bodies) if isinstance(b, dict) and b.get("model") == "auto"]
    if not own:
        return Settled(list(settings))
    from tisoft.charting.advice import advise  # only here: a run without it starts sooner

    tolerances = []
    for i in own:
        with inside(f"body[{i}]"):
            given = bodies[i].get("tolerance", TOLERANCE)
            tolerances.append(checks.number("tolerance", given, above=0.0, below=1.0))
    plain = [*settings, *(f'body.{i}.model="{SOLID}"' for i in own)]
    if known is not None:
        return Settled([*plain, *(f"{k}={v}" for k, v in known["choice"]["set"].items())])
    advice = advise(path, min(tolerances), settings=plain, bodies=own, same_probes=True)
    return Settled([*plain, *advice.choice.settings], advice)
