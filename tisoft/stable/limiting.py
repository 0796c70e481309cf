"""Which element sets the stable step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tisoft.model.part import Part
from tisoft.stable.limit import ROUNDING, StepLimit


@dataclass(frozen=True)
class Limit:
    """A bound on the step and the element that sets it."""

    step: float
    """[s]; inf where nothing oscillates."""
    part: Part | None
    element: int
    """Number of the cell, or spring, in the body's own order."""
    kind: str
    """"tet", "hex", "spring" or "nothing"."""
    node: int = -1
    """Row of the body's `mesh.points` at which the tet does so."""


def limiting(limits: StepLimit) -> Limit:
    """The bound in the present state and the element that sets it."""
    limits.follow()
    system = limits.system
    now = np.empty(system.count, system.real)
    system.state.read_limits(system.first, now)
    found = [_of_part(limits, part, now[part.nodes].astype(np.float64)) for part in system.parts]
    return min(found, key=lambda limit: limit.step, default=Limit(np.inf, None, -1, "nothing"))


def culprit(limits: StepLimit) -> str:
    """The element that sets the limit, or that is no longer finite, as words."""
    here = limiting(limits)
    if here.part is None:
        return "a node without springs"
    return f"{here.kind} {here.element} of {here.part.body.name!r}"


def _of_part(limits: StepLimit, part: Part, now: NDArray[np.float64]) -> Limit:
    """One body's; `now` holds its nodes' limits in the present state."""
    steps = limits.limits_at_rest[part.index]
    if not len(steps):
        return Limit(np.inf, None, -1, "nothing")
    if part.is_springs:
        worst = int(np.argmin(steps))
        return Limit(float(steps[worst]), part, worst, "spring")
    nodes = steps if part.is_tensor else now
    node = int(np.argmin(np.where(np.isnan(nodes), 0.0, nodes)))
    around = np.concatenate([(c.nodes == node).any(axis=1) for c in part.solids]).nonzero()[0]
    stiffest = _stiffest(limits, part)[around]
    worst = around[int(np.argmax(np.where(np.isnan(stiffest), np.inf, stiffest)))]
    step = float(nodes[node]) * ROUNDING
    return Limit(
        step, part, int(part.cell_order[worst]), part.kind_of_cell(worst), int(part.order[node])
    )


def _stiffest(limits: StepLimit, part: Part) -> NDArray[np.float64]:
    """ω² [1/s²] of each of the body's cells in the state looked at last."""
    if part.is_tensor:
        return np.concatenate([known[:, 0] for known in part.known()])
    found = []
    for cells in part.solids:
        share = next(s for _, s in limits.shares if any(c is cells for _, c in s.members))
        out = np.empty((len(share.batches.owner), share.batches.lanes), limits.system.real)
        share.block.read_stiffest(share.row("batches"), out)
        found.append(out.ravel()[cells.place].astype(np.float64))
    return np.concatenate(found)
