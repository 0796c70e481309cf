"""Which element sets the stable step, and why, in words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.dynamics.stable_step import longest_step, spring_frequencies
from tisoft.dynamics.system import Part
from tisoft.geometry.quality import smallest_altitudes
from tisoft.models.materials import SolidModel
from tisoft.simulation import Simulation

Floats = NDArray[np.float64]

UNUSUAL = 1.5
"""Factor from the usual at which a cause is worth naming."""


@dataclass(frozen=True)
class RestLimits:
    """Bounds on the step [s] of one body's elements at rest, in its file's order."""

    part: Part
    kind: str
    """"tet" or "spring"."""
    steps: Floats
    undamped: Floats
    """Without viscosity, dampers and point damping."""


def rest_limits(sim: Simulation) -> list[RestLimits]:
    """Every body's bounds at rest."""
    omega2, rate, _ = sim.system.element_frequencies()
    found = []
    for part in sim.parts:
        if part.is_springs:
            w2, damping = spring_frequencies(part.springs, part.spring_numbers, 1.0 / part.mass)
            kind = "spring"
        else:
            order = np.argsort(part.tet_order)
            w2, damping = omega2[part.place][order], rate[part.place][order]
            kind = "tet"
        damping = sim.limit.factor * (damping + part.body.model.point_damping)
        steps, undamped = longest_step(w2, damping), longest_step(w2, np.zeros(len(w2)))
        found.append(RestLimits(part, kind, steps, undamped))
    return found


def limiting_element(sim: Simulation) -> dict[str, Any] | None:
    """Body, element, kind and reason of the element that sets the step; None where nothing does."""
    limits = [limit for limit in rest_limits(sim) if len(limit.steps)]
    least = min(limits, key=lambda limit: float(limit.steps.min()), default=None)
    if least is None or not np.isfinite(least.steps.min()):
        return None
    element = int(np.argmin(least.steps))
    return {
        "body": least.part.body.name,
        "element": element,
        "kind": least.kind,
        "reason": _reason(limits, least, element),
    }


def damping_cost(sim: Simulation) -> float:
    """How many times smaller damping makes the bound on the step; 1 without damping."""
    limits = [limit for limit in rest_limits(sim) if len(limit.steps)]
    if not limits:
        return 1.0
    with np.errstate(invalid="ignore"):
        undamped = min(float(limit.undamped.min()) for limit in limits)
        damped = min(float(limit.steps.min()) for limit in limits)
    return undamped / damped if np.isfinite(undamped) else 1.0


def _reason(limits: list[RestLimits], least: RestLimits, element: int) -> str:
    causes = _tet_causes if least.kind == "tet" else _spring_causes
    found = [*causes(least.part, element), *_material_causes(limits, least)]
    viscous = float(least.undamped[element] / least.steps[element])
    if viscous > UNUSUAL:
        found.append(f"damping makes its step {viscous:.2g} times smaller")
    why = " and ".join(found) or f"the body's {least.kind}s are much alike: the mesh size sets it"
    others = np.concatenate([limit.steps for limit in limits])
    rest = np.sort(others)[1] if len(others) > 1 else np.inf
    gain = float(rest / least.steps[element])
    end = f"; without it the step would be {gain:.2g} times larger" if 1.05 < gain < np.inf else ""
    return why + end


def _tet_causes(part: Part, element: int) -> list[str]:
    altitude = smallest_altitudes(part.body.mesh.points, part.body.mesh.tets)
    factor = float(np.median(altitude) / altitude[element])
    if factor < UNUSUAL:
        return []
    return [
        f"its smallest altitude is {metres(altitude[element])}, {factor:.2g} times below the median"
    ]


def _spring_causes(part: Part, element: int) -> list[str]:
    found = []
    masses, stiffness = part.mass[part.springs[element]], part.spring_numbers[:, 0]
    light = float(np.median(part.mass) / masses.min())
    if light > UNUSUAL:
        node = part.order[part.springs[element][np.argmin(masses)]]
        number = int(part.body.mesh.kept_nodes[node])
        found.append(f"its node {number} is {light:.2g} times lighter than the median")
    stiff = float(stiffness[element] / np.median(stiffness))
    if stiff > UNUSUAL:
        found.append(f"it is {stiff:.2g} times stiffer than the median")
    joined = np.bincount(part.springs.ravel(), minlength=len(part.mass))
    crowd = float(joined[part.springs[element]].max() / max(np.median(joined), 1))
    if not found and crowd > UNUSUAL:
        found.append(f"{joined[part.springs[element]].max()} springs meet at one of its nodes")
    return found


def _material_causes(limits: list[RestLimits], least: RestLimits) -> list[str]:
    """Whether the body is made of stuff in which waves run faster than in the other bodies."""
    speeds = {limit.part.index: _wave_speed(limit.part) for limit in limits}
    own = speeds.pop(least.part.index)
    known = [speed for speed in speeds.values() if speed is not None]
    if own is None or not known or own < UNUSUAL * max(known):
        return []
    factor = own / max(known)
    return [f"its body is stiff for its density: waves run {factor:.2g} times faster in it"]


def _wave_speed(part: Part) -> float | None:
    model = part.body.model
    if not isinstance(model, SolidModel):
        return None
    return float(np.sqrt((model.lame_lambda + 2.0 * model.lame_mu) / model.density))


def metres(length: float) -> str:
    """A length with a handy unit."""
    for factor, unit in ((1.0, "m"), (1e3, "mm"), (1e6, "µm")):
        if length * factor >= (0.1 if unit == "m" else 1.0):
            return f"{length * factor:.3g} {unit}"
    return f"{length:.3g} m"
