"""The stable step of a running scene: what it is, and which element sets it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import runtime
from tisoft.dynamics.operators import Elastic
from tisoft.dynamics.part import Part
from tisoft.dynamics.sharp_step import sharp_limit
from tisoft.dynamics.stable_step import (
    DAMPING_FACTOR,
    longest_step,
    node_limits,
    spring_frequencies,
)
from tisoft.dynamics.system import System
from tisoft.models.laws import NEO_HOOKEAN, ST_VENANT

SHARE = 0.9
"""Share of the sharp limit that step = "auto" uses."""
SAFETY = 0.95
"""Share of the guaranteed bound that it uses away from rest: room to stiffen within a frame."""
DRIFT = 0.1
"""Relative change of the bound up to which the last sharp limit is trusted."""
SPARE = 200
"""Substeps between two sharp limits, per product that the last took (a product in f64 costs up to
eight substeps): 4 % of the run."""
PATIENCE = 2000
"""Substeps through which a longer step must have been allowed before it is taken."""
SMALL = 2000
"""Tets up to which one thread looks at them sooner than two can be called."""
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
            self._now = runtime.array(table.copy())
            self._limits = runtime.array(np.full(s.count, np.inf, s.real))
            if s.tets:
                self._launch = runtime.bind(
                    node_limits, s.all_laws, s.lanes, self.factor, s.tets < SMALL, s.law_starts,
                    s.nodes, s.shapes,
                    s.owner, s.material, s.u, self._modes, self._now, s.body, s.starts, s.corners,
                    self._limits,
                )  # fmt: skip
        else:
            runtime.write(self._modes, table)
        self._rest_bound = self._tets_at_rest()
        self.__dict__.pop("_sharp", None)
        self._elastic: dict[int, Elastic] = {}
        self._reference: tuple[float, float] | None = None
        self._next_look = 0
        self._held = np.inf
        self._window_start, self._window_least = 0, np.inf
        self._bound = None
        self.springs = [self._spring_limits(part) for part in s.parts]
        self.spring_step = min((float(a.min()) for a in self.springs if len(a)), default=np.inf)
        still = [float(self.tensor_limits(p).min()) for p in s.parts if p.is_tensor]
        self._still_step = min(still, default=np.inf)

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
            self._bound = float(runtime.read(self._limits).min()) * ROUNDING
        return min(self._bound, self._still_step, self.spring_step)

    def inverted(self) -> int:
        """Tets that are inside out (J ≤ 0) in the present state."""
        if self._launch is None:
            return 0
        self.bound()
        return int(np.count_nonzero(runtime.read(self._now)[2] <= 0.0))

    def moved(self) -> None:
        """Say that the state is another one now."""
        self._bound = None

    def _look(self, parts: list[Part], u: NDArray[np.float64] | None) -> tuple[float, int]:
        """The parts' sharp limit [s] at displacements u, or at rest, and the products it took."""
        step, products = np.inf, 0
        for part in parts:
            if part.index not in self._elastic:
                self._elastic[part.index] = Elastic(part)
            found = sharp_limit(
                part,
                integrator=self.integrator,
                u=None if u is None else u[part.nodes],
                elastic=self._elastic[part.index],
            )
            step, products = min(step, found.step), products + found.products
        return step, products

    @cached_property
    def _sharp(self) -> tuple[float, float]:
        """The sharp limits at rest of the solids and of the springs [s]."""
        solids = max(min(self._rest_bound, self._still_step), self._look(self._solids, None)[0])
        nets = [part for part in self.system.parts if part.is_springs]
        return solids, max(self.spring_step, self._look(nets, None)[0])

    @property
    def _solids(self) -> list[Part]:
        return [part for part in self.system.parts if not part.is_springs]

    def sharp(self) -> float:
        """The stable limit at rest [s], damping included: never above the true one, within 1 %."""
        return min(self._sharp)

    def rest_bound(self) -> float:
        """The guaranteed bound at rest [s]."""
        return min(self._rest_bound, self._still_step, self.spring_step)

    def chosen(self, substeps: int) -> float:
        """The step [s] that "auto" takes in the present state, after `substeps` of the run.

        It falls as soon as it must, and rises only to what would have served all the time during
        the last PATIENCE substeps.  Symplectic Euler conserves an energy that depends on the step:
        one that followed each swing of a body would pump energy into it.
        """
        allowed = min(self._allowed(substeps), self.spring_step * ROUNDING)
        if substeps - self._window_start >= PATIENCE:
            self._held = self._window_least
            self._window_start, self._window_least = substeps, np.inf
        self._window_least = min(self._window_least, allowed)
        self._held = min(self._held, allowed)
        return self._held

    def _allowed(self, substeps: int) -> float:
        """The step [s] that the solids' present state allows; springs have their bound, which holds
        in every state: a net whose springs line up is stiffer than at rest.

        Where the bound is near that of the last sharp limit, it is SHARE of that, in proportion;
        elsewhere the bound itself, with room to stiffen within a frame.  Now and then, as often as
        SPARE allows, the limit is sharpened in the present state.
        """
        bound = self._solid_bound()
        if not np.isfinite(bound):
            return np.inf
        if self._reference is None:
            self._reference = (self._sharp[0], min(self._rest_bound, self._still_step))
        if self._has_drifted(bound) and substeps >= self._next_look:
            u = np.array(runtime.read(self.system.u), np.float64)
            for part in self.system.parts:
                u[part.nodes] += part.shift
            sharp, products = self._look(self._solids, u)
            self._reference = (max(sharp, bound), bound)
            self._next_look = substeps + SPARE * products
        sharp, reference = self._reference
        if self._has_drifted(bound):
            return SAFETY * bound
        return max(SHARE * sharp * min(1.0, bound / reference), SAFETY * bound)

    def _solid_bound(self) -> float:
        """The bound of the tets alone, in the present state [s]."""
        self.bound()
        assert self._bound is not None
        least = min(self._bound, self._still_step)
        return least if self._solids else np.inf

    def _has_drifted(self, bound: float) -> bool:
        assert self._reference is not None
        return abs(bound / self._reference[1] - 1.0) > DRIFT

    def accepted(self) -> float:
        """The longest step [s] with which a frame may have come to the present state."""
        if not self._moves:
            return np.inf
        sharp, bound = self._reference or (
            self._sharp[0],
            min(self._rest_bound, self._still_step),
        )
        return self._solid_bound() * sharp / bound

    def state(self) -> dict[str, Any]:
        """What a checkpoint keeps, so that the same bits follow."""
        sharp, bound = self._reference or (None, None)
        return {
            "rest": self._sharp,
            "sharp": sharp,
            "bound": bound,
            "next": self._next_look,
            "held": self._held,
            "window_start": self._window_start,
            "window_least": self._window_least,
        }

    def set_state(self, state: dict[str, Any]) -> None:
        """Go on from what `state` told."""
        self.__dict__["_sharp"] = tuple(state["rest"])
        if state["sharp"] is not None:
            self._reference = (state["sharp"], state["bound"])
        self._next_look, self._held = state["next"], state["held"]
        self._window_start, self._window_least = state["window_start"], state["window_least"]
        self._bound = None

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
