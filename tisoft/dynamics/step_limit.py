"""The stable step of a running scene: what it is, and which element sets it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tisoft import runtime
from tisoft.dynamics.sharp_step import sharp_step
from tisoft.dynamics.stable_step import (
    DAMPING_FACTOR,
    longest_step,
    node_limits,
    spring_frequencies,
)
from tisoft.dynamics.system import Part, System
from tisoft.models.laws import NEO_HOOKEAN, ST_VENANT

SHARE = 0.9
"""Share of the sharp limit that step = "auto" uses."""
SAFETY = 0.95
"""Share of the guaranteed bound that it uses away from rest: room to stiffen within a frame."""
DRIFT = 0.05
"""Relative change of the bound up to which the sharp limit at rest is trusted."""
ROUNDING = 1.0 - 1e-5
"""The tets' limits are computed in f32 at the least; this keeps their rounding on the safe side."""


@dataclass(frozen=True)
class Limit:
    """A bound on the step and the element that sets it."""

    step: float
    """[s]; inf where nothing oscillates."""
    part: Part | None
    element: int
    """Number of the tet, or spring, in the body's own order."""
    kind: str
    """"tet", "spring" or "nothing"."""
    node: int = -1
    """Row of the body's `mesh.points` at which the tet does so."""


class StepLimit:
    """Bounds of the tets, followed as they deform, and of the springs, which never stiffen."""

    def __init__(self, system: System, integrator: int) -> None:
        self.system = system
        self.integrator = integrator
        self._moves = any(law in (ST_VENANT, NEO_HOOKEAN) for law in system.all_laws)
        self.factor = DAMPING_FACTOR[integrator]
        self._launch: Callable[..., None] | None = None
        self._bound: float | None = None
        self.refresh()

    def refresh(self) -> None:
        """Compute the rest-state numbers again (after a material changed)."""
        s = self.system
        shape = (max(1, s.batches), s.lanes)
        table = np.stack([a.reshape(shape) for a in s.element_frequencies()]).astype(s.real)
        if self._launch is None:
            self._modes = runtime.array(table)
            self._now = runtime.array(table[:2].copy())
            self._limits = runtime.array(np.full(s.count, np.inf, s.real))
            if s.tets:
                self._launch = runtime.bind(
                    node_limits, s.all_laws, s.lanes, self.factor, s.law_starts, s.nodes, s.shapes,
                    s.owner, s.material, s.u, self._modes, self._now, s.body, s.starts, s.corners,
                    self._limits,
                )  # fmt: skip
        else:
            runtime.write(self._modes, table)
        self._rest_bound = self._tets_at_rest()
        self.__dict__.pop("_at_rest", None)
        self._bound = None
        self.springs = [self._spring_limits(part) for part in s.parts]
        still = [*self.springs, *(self.tensor_limits(p) for p in s.parts if p.is_tensor)]
        self.spring_step = min((float(a.min()) for a in still if len(a)), default=np.inf)

    def _tets_at_rest(self) -> float:
        """The tets' bound with every node at its rest point [s]."""
        if self._launch is None:
            return np.inf
        u = runtime.read(self.system.u).copy()
        runtime.write(self.system.u, np.zeros_like(u))
        self._launch()
        least = float(runtime.read(self._limits).min()) * ROUNDING
        runtime.write(self.system.u, u)
        self._launch()
        return least

    def _spring_limits(self, part: Part) -> NDArray[np.float64]:
        if not len(part.springs):
            return np.empty(0)
        omega2, rate = spring_frequencies(part.springs, part.spring_numbers, 1.0 / part.mass)
        return longest_step(omega2, self.factor * (rate + part.body.model.point_damping))

    def follow(self) -> None:
        """Bring the tets' limits up to date with the present state."""
        if self._launch is not None:
            self._launch()

    def bound(self) -> float:
        """A step [s] that is never above the limit, in the present state."""
        if self._bound is None:
            self.follow()
            self._bound = min(float(runtime.read(self._limits).min()) * ROUNDING, self.spring_step)
        return self._bound

    def moved(self) -> None:
        """Say that the state is another one now."""
        if self._moves:
            self._bound = None

    @cached_property
    def _at_rest(self) -> tuple[float, float]:
        """The sharp limit at rest and the bound there [s]."""
        bound = min(self._rest_bound, self.spring_step)
        return max(bound, sharp_step(self.system, integrator=self.integrator)), bound

    def sharp(self) -> float:
        """The stable limit at rest [s], damping included: never above the true one, within 1 %."""
        return self._at_rest[0]

    def rest_limits(self) -> tuple[float, float]:
        """The sharp limit and the guaranteed bound at rest [s]."""
        return self._at_rest

    def set_rest_limits(self, sharp: float, bound: float) -> None:
        """Take both from a checkpoint, so that the same bits follow."""
        self.__dict__["_at_rest"] = (sharp, bound)

    def chosen(self) -> float:
        """The step [s] that "auto" takes in the present state.

        Near the rest state (by the bound) that is SHARE of the sharp limit; where the body's bound
        has moved by more than DRIFT, the bound itself, with room to stiffen within a frame.
        """
        bound = self.bound()
        sharp, rest = self._at_rest
        if abs(bound / rest - 1.0) <= DRIFT:
            return max(SHARE * sharp * min(1.0, bound / rest), SAFETY * bound)
        return SAFETY * bound

    def accepted(self) -> float:
        """The longest step [s] with which a frame may have come to the present state."""
        if not self._moves:
            return np.inf
        sharp, rest = self._at_rest
        return self.bound() * sharp / rest

    def tensor_limits(self, part: Part) -> NDArray[np.float64]:
        """The nodes' limits of a mass-tensor body: its tets are in no node's list of corners."""
        omega2, rate = (runtime.read(self._modes)[k].ravel()[part.place] for k in (0, 1))
        mean = [
            np.bincount(part.tets.ravel(), np.repeat(a * part.volume, 4))
            / np.bincount(part.tets.ravel(), np.repeat(part.volume, 4))
            for a in (omega2, rate)
        ]
        return longest_step(mean[0], self.factor * (mean[1] + part.body.model.point_damping))

    def limit(self) -> Limit:
        """The bound and the element that sets it."""
        self.follow()
        limits = np.array(runtime.read(self._limits), np.float64)
        for part in self.system.parts:
            if part.is_tensor:
                limits[part.nodes] = self.tensor_limits(part)
        node = int(np.argmin(np.where(np.isnan(limits), 0.0, limits)))
        springs = [float(a.min(initial=np.inf)) for a in self.springs]
        if min(springs) < limits[node]:
            index = int(np.argmin(springs))
            part = self.system.parts[index]
            return Limit(springs[index], part, int(np.argmin(self.springs[index])), "spring")
        if not self.system.tets:
            return Limit(np.inf, None, -1, "nothing")
        part = self.system.parts[int(runtime.read(self.system.body)[node])]
        around = np.flatnonzero((part.tets == node - part.start).any(axis=1))
        modes = runtime.read(self._now)[0].ravel()[part.place[around]]
        worst = around[int(np.argmax(np.where(np.isnan(modes), np.inf, modes)))]
        row = int(part.order[node - part.start])
        step = float(limits[node]) * ROUNDING
        return Limit(step, part, int(part.tet_order[worst]), "tet", row)

    def culprit(self) -> str:
        """The element that sets the limit, or that is no longer finite, as words."""
        here = self.limit()
        if here.part is None:
            return "a node without springs"
        return f"{here.kind} {here.element} of {here.part.body.name!r}"
