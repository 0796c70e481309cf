"""Which element sets the stable step, and why, in words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.check.lengths import metres
from tisoft.elements.spring import frequencies
from tisoft.geometry.quality import smallest_altitudes
from tisoft.model.part import Part
from tisoft.simulation import Simulation
from tisoft.stable.bound import averages, longest_step

Floats = NDArray[np.float64]

UNUSUAL = 1.5
"""Factor from the usual at which a cause is worth naming."""


@dataclass(frozen=True)
class RestLimits:
    """What bounds the step at rest in one body: its nodes' cells, or its springs."""

    part: Part
    kind: str
    """"tet", "hex" or "spring"; "element" where cells are of several kinds."""
    weight: Floats
    """Volume of each cell, by which nodes average; empty for springs."""
    omega2: Floats
    rate: Floats
    """ω² [1/s²] and damping rate [1/s] of each element, point damping included."""

    def steps(self, *, damped: bool = True, without: int | None = None) -> Floats:
        """Bounds on the step [s], by node for cells and by spring for springs."""
        rate = self.rate if damped else np.zeros(len(self.rate))
        if self.kind == "spring":
            steps = longest_step(self.omega2, rate)
            return steps if without is None else np.delete(steps, without)
        weight = self.weight.copy()
        if without is not None:
            weight[without] = 0.0
        ends = np.cumsum([len(cells.nodes) for cells in self.part.solids])[:-1]
        values = np.split(np.column_stack([np.ones_like(rate), self.omega2, rate]), ends)
        mean = averages(self.part, weight, values)
        return longest_step(*mean[mean[:, 0] > 0.0, 1:].T)

    def worst(self) -> int:
        """The element that sets the bound: the stiffest at the node, or the spring."""
        if self.kind == "spring":
            return int(np.argmin(self.steps()))
        solids = self.part.solids
        used = np.unique(np.concatenate([cells.nodes.ravel() for cells in solids]))
        node = used[int(np.argmin(self.steps()))]
        around = np.concatenate([(c.nodes == node).any(axis=1) for c in solids]).nonzero()[0]
        return int(around[np.argmin(longest_step(self.omega2, self.rate)[around])])

    def number(self, element: int) -> int:
        """The element's number in its file."""
        return element if self.kind == "spring" else int(self.part.cell_order[element])


def rest_limits(sim: Simulation) -> list[RestLimits]:
    """Every body's bounds at rest."""
    found = []
    for part in sim.parts:
        drag = part.body.model.point_damping
        if part.is_springs:
            weight, kind = np.empty(0), "spring"
            modes = frequencies(part.springs, part.spring_numbers, 1.0 / part.mass)
        else:
            kinds = {cells.element.word for cells in part.solids}
            weight, kind = part.volume, kinds.pop() if len(kinds) == 1 else "element"
            known = np.concatenate([known[:, :2] for known in part.known()])
            modes = known[:, 0], known[:, 1]
        damping = sim.limit.factor * (modes[1] + drag)
        found.append(RestLimits(part, kind, weight, modes[0], damping))
    return found


def limiting_element(sim: Simulation) -> dict[str, Any] | None:
    """Body, element, kind and reason of the element that sets the step; None where nothing does."""
    limits = [limit for limit in rest_limits(sim) if len(limit.omega2)]
    least = min(limits, key=lambda limit: float(limit.steps().min()), default=None)
    if least is None or not np.isfinite(least.steps().min()):
        return None
    element = least.worst()
    return {
        "body": least.part.body.name,
        "element": least.number(element),
        "kind": least.kind,
        "reason": _reason(limits, least, element),
    }


def damping_cost(sim: Simulation) -> float:
    """How many times smaller damping makes the bound on the step; 1 without damping."""
    limits = [limit for limit in rest_limits(sim) if len(limit.omega2)]
    undamped = min((float(a.steps(damped=False).min()) for a in limits), default=np.inf)
    if not np.isfinite(undamped):
        return 1.0
    return undamped / min(float(a.steps().min()) for a in limits)


def _reason(limits: list[RestLimits], least: RestLimits, element: int) -> str:
    number = least.number(element)
    causes = _spring_causes if least.kind == "spring" else _cell_causes
    found = [*causes(least.part, number), *_material_causes(limits, least)]
    viscous = float(least.steps(damped=False).min() / least.steps().min())
    if viscous > UNUSUAL:
        found.append(f"damping makes the step {viscous:.2g} times smaller")
    many = "hexes" if least.kind == "hex" else f"{least.kind}s"
    why = " and ".join(found) or f"the body's {many} are much alike: the mesh size sets it"
    now = float(least.steps().min())
    others = [limit.steps().min() for limit in limits if limit is not least]
    gain = float(min([least.steps(without=element).min(initial=np.inf), *others])) / now
    return why + (f"; it costs {gain:.2g} times in speed" if 1.05 < gain < np.inf else "")


def _cell_causes(part: Part, element: int) -> list[str]:
    if not len(part.body.mesh.tets):
        return []
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
    own = [cells.solid for cells in part.solids]
    squares = [(model.lame_lambda + 2.0 * model.lame_mu) / model.density for model in own]
    return float(np.sqrt(max(squares))) if squares else None
