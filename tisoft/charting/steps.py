"""The step side: what the step errs by and costs, up to the limit and past it.

Of each integrator the first modes are followed as oscillators that a sudden load sets going,

    x'' + ω² (x − 1) = 0,   x(0) = x'(0) = 0,   exactly x = 1 − cos ωt,

with the very recurrence that a substep is; the error is the root mean square over the scene's
duration.  Past the limit the stiffest mode grows without bound, whatever the first modes do.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from tisoft.charting.judged import Judged
    from tisoft.charting.survey import Survey

Floats = NDArray[np.float64]

SHARES = np.concatenate([np.geomspace(0.05, 0.98, 12), [1.05, 1.3, 1.6, 2.0]])
"""Steps that are drawn, as shares of the limit."""
MOST_SUBSTEPS = 200_000
"""Substeps that an oscillator is followed for."""
LOOKS = 4096
"""Moments at which it is looked at, at the most."""


@dataclass(frozen=True)
class Curve:
    """One integrator."""

    integrator: str
    limit: float
    """[s]"""
    steps: Floats
    """[s], shape (n,)"""
    errors: Floats
    """Relative, shape (n,); inf past the limit."""
    costs: Floats
    """Seconds of computing a simulated second, shape (n,)."""


@dataclass(frozen=True)
class StepSide:
    """The scene's own step among others."""

    curves: list[Curve]
    step: float
    """Used now [s]."""
    limit: float
    """[s]"""
    mesh: float
    """What the mesh and the model err by."""

    def result(self) -> dict[str, Any]:
        """The object of --json."""
        return {
            "step": self.step, "limit": self.limit, "share": self.step / self.limit,
            "curves": [
                {"integrator": c.integrator, "limit": c.limit, "steps": c.steps.tolist(),
                 "error": [e if np.isfinite(e) else None for e in c.errors.tolist()],
                 "cost": c.costs.tolist()}
                for c in self.curves
            ],
        }  # fmt: skip


def step_side(survey: Survey, now: Judged) -> StepSide | None:
    """The step side of a survey's scene; None where it has no modes or no limit."""
    own = survey.asking.known("modes", survey.catalogue.current) or {}
    ruler = survey.judging.rulers.get("frequency")
    found: Any = own.get("frequencies", []) if ruler is None else ruler.value
    if not len(found) or not np.isfinite(now.stable_step):
        return None
    modes = 2.0 * np.pi * np.abs(np.asarray(found))
    duration = survey.scene.duration
    words = dict.fromkeys([survey.scene.integrator, "symplectic-euler", "velocity-verlet"])
    curves = []
    for word in words:
        steps = SHARES * now.stable_step
        errors = np.array(
            [
                step_error(word, modes, h, duration) if share < 1.0 else np.inf
                for h, share in zip(steps, SHARES, strict=True)
            ]
        )
        curves.append(Curve(word, now.stable_step, steps, errors, now.cost * now.step / steps))
    return StepSide(curves, now.step, now.stable_step, now.worst.value)


def step_error(integrator: str, modes: Floats, h: float, duration: float) -> float:
    """Error of the step alone: root mean square of the modes over the duration [s], relative to
    their amplitude; inf where they grow.
    """
    count = int(min(max(duration / h, 8.0), MOST_SUBSTEPS))
    w2 = (modes * h) ** 2
    one, zero = np.ones_like(w2), np.zeros_like(w2)
    if integrator == "velocity-verlet":
        step = np.array([[1.0 - 0.5 * w2, one], [-w2 * (1.0 - 0.25 * w2), 1.0 - 0.5 * w2]])
    elif integrator == "explicit-euler":
        step = np.array([[one, one], [-w2, one]])
    else:  # v first, then x with it
        step = np.array([[1.0 - w2, one], [-w2, one]])
    values, vectors = np.linalg.eig(np.moveaxis(step, 2, 0))
    start = np.linalg.solve(vectors, np.stack([-one, zero], axis=1)[:, :, None].astype(complex))
    n = np.unique(np.linspace(0, count, min(count + 1, LOOKS)).round())
    worst = []
    for k in range(len(modes)):
        with np.errstate(over="ignore", invalid="ignore"):
            powers = values[k][None, :] ** n[:, None]
            x = (powers @ (vectors[k, 0] * start[k, :, 0])).real
        off = x + np.cos(modes[k] * h * n)
        worst.append(np.sqrt((off**2).mean()))
    found = float(np.sqrt(np.mean(np.square(worst))))
    return found if np.isfinite(found) else float("inf")
