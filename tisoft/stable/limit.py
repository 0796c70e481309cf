"""The stable step of a running scene: what it is, and which element sets it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.equilibrium.at_rest import AtRest
from tisoft.equilibrium.operators import Operators, operators_of
from tisoft.model.part import Part
from tisoft.model.system import System
from tisoft.stable.bound import NO_LIMIT, limits_at_rest, make_look
from tisoft.stable.sharp import sharp_limit
from tisoft.step.stepper import INTEGRATORS

SHARE = 0.9
"""Share of the sharp limit that step = "auto" uses."""
SAFETY = 0.95
"""Share of the guaranteed bound that it uses away from rest: room to stiffen within a frame."""
DRIFT = 0.1
"""Relative change of the bound up to which the last sharp limit is trusted."""
SPARE = 200
"""Substeps between two sharp limits, per product with the whole scene that the last took (a product
in f64 costs up to eight substeps): 4 % of the run.  The first one after that at rest waits as long,
so that no frame of a short run waits for it."""
FALLEN, SOON = 0.6, 10
"""Share of the bound of the last sharp limit below which so many substeps, per product, are enough:
a few tets squashed by contact let the bound fall to a fifth, and the limit not at all."""
PATIENCE = 2000
"""Substeps through which a longer step must have been allowed before it is taken."""
ASSEMBLED = 30_000
"""Cells up to which a matrix is sooner made than a kernel compiled."""
ROUNDING = 1.0 - 1e-5
"""The tets' limits are computed in f32 at the least; this keeps their rounding on the safe side."""


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


class StepLimit:
    """Bounds of the tets, followed as they deform, and of the springs, which never stiffen."""

    def __init__(self, system: System, integrator: str) -> None:
        self.system = system
        self.integrator = integrator
        self.factor = INTEGRATORS[integrator].damping_factor
        self._shares = [(k, s) for k, s in enumerate(system.shares) if s.block.law is not None]
        self._moves = any(share.block.law.is_finite for _, share in self._shares)
        self._launch = self._kernel() if self._shares else None
        self._bound: float | None = None
        self._before: float | None = None
        """The bound that was known before the state became another one."""
        self._sharp: tuple[float, float] | None = None
        self._rest_bounds: tuple[float, float] = (np.inf, np.inf)
        self._next_look = self._next_soon = 0
        self.sharpens = True
        """Whether the sharp limit is found anew in states far from rest, which takes a while."""
        self.refresh()

    def _kernel(self) -> Any:
        numbers = tuple(k for k, _ in self._shares)
        blocks = tuple(share.block for _, share in self._shares)
        alone = self.system.is_small
        key = ("look", *blocks, numbers, self.factor, alone)
        return self.system.lease.arena.kernel(
            key, lambda: make_look(self.system.state, blocks, numbers, self.factor, alone)
        )

    def refresh(self) -> None:
        """Compute the rest-state numbers again (after a material changed).

        The sharp limit is scaled as the bound, until the next look finds it anew.
        """
        before = self._rest_bounds if self._sharp is not None else None
        self.limits_at_rest = [limits_at_rest(part, self.factor) for part in self.system.parts]
        least = [float(steps.min(initial=np.inf)) for steps in self.limits_at_rest]
        parts = self.system.parts
        solids = [a for a, p in zip(least, parts, strict=True) if not p.is_springs]
        nets = [a for a, p in zip(least, parts, strict=True) if p.is_springs]
        self._rest_bounds = min(solids, default=np.inf), min(nets, default=np.inf)
        self._still_step = min(
            (a for a, p in zip(least, parts, strict=True) if p.is_tensor), default=np.inf
        )
        if before is not None and self._sharp is not None:
            pairs = zip(self._sharp, self._rest_bounds, before, strict=True)
            solid, net = (s if now == old else s * now / old for s, now, old in pairs)
            self._sharp = solid, net
        self._elastic: dict[int, Operators] = {}
        self._reference: tuple[float, float] | None = None
        self._held = np.inf
        self._window_start, self._window_least = 0, np.inf
        self._bound, self._is_new = None, True

    @property
    def spring_step(self) -> float:
        """The springs' bound [s]."""
        return self._rest_bounds[1]

    def follow(self) -> None:
        """Bring the tets' limits up to date with the present state."""
        if self._launch is not None:
            self.system.check_alive()
            self._launch(self.system.scene)

    def bound(self) -> float:
        """A step [s] that is never above the limit, in the state looked at last."""
        return min(self._tets_bound(), self._still_step, self.spring_step)

    def present(self) -> float:
        """The same of the very present state, whenever it was looked at for the step."""
        return min(self._tets_now(), self._still_step, self.spring_step)

    def _tets_bound(self) -> float:
        if self._bound is None:
            self._bound = self._tets_now()
        return self._bound

    def _tets_now(self) -> float:
        if self._launch is None:
            return np.inf
        self.follow()
        least = float(self.system.state.least_limit[self.system.scene])
        return np.inf if least >= NO_LIMIT else least * ROUNDING

    def inverted(self) -> int:
        """Tets that are inside out (J ≤ 0) in the state looked at last."""
        if self._launch is None:
            return 0
        self._tets_bound()
        return int(self.system.state.inverted[self.system.scene])

    def moved(self) -> None:
        """Say that the state is another one now."""
        self._before, self._bound, self._is_new = self._bound, None, True

    def change(self) -> float:
        """Relative change of the bound since the last look; inf where that one is not known."""
        bound, before = self._tets_bound(), self._before
        if before is None:
            return np.inf
        return 0.0 if bound == before else abs(bound - before) / before if before > 0.0 else np.inf

    def _look(self, parts: list[Part], u: NDArray[np.float64] | None) -> tuple[float, int]:
        """The parts' sharp limit [s] at displacements u, or at rest, and the products with the
        whole scene that it took as much as.
        """
        step, products = np.inf, 0.0
        for part in parts:
            found = sharp_limit(
                part,
                integrator=self.integrator,
                u=None if u is None else u[part.nodes],
                elastic=self._operators(part, at_rest=u is None),
            )
            step = min(step, found.step)
            products += found.products * part.elements / max(1, self.system.elements)
        return step, math.ceil(products)

    def _operators(self, part: Part, *, at_rest: bool) -> Any:
        if at_rest and 0 < part.elements <= ASSEMBLED:
            return AtRest(part)
        if part.index not in self._elastic:
            self._elastic[part.index] = operators_of(part)
        return self._elastic[part.index]

    def _sharp_at_rest(self) -> tuple[float, float]:
        """The sharp limits at rest of the solids and of the springs [s]."""
        if self._sharp is None:
            nets = [part for part in self.system.parts if part.is_springs]
            solid, products = self._look(self._solids, None)
            self._sharp = (
                max(self._rest_bounds[0], solid),
                max(self._rest_bounds[1], self._look(nets, None)[0]),
            )
            self._wait(0, products)
        return self._sharp

    @property
    def _solids(self) -> list[Part]:
        return [part for part in self.system.parts if not part.is_springs]

    def sharp(self) -> float:
        """The stable limit at rest [s], damping included: never above the true one, within 1 %."""
        return min(self._sharp_at_rest())

    def rest_bound(self) -> float:
        """The guaranteed bound at rest [s]."""
        return min(self._rest_bounds)

    def chosen(self, substeps: int) -> float:
        """The step [s] that "auto" takes in the state looked at last, after `substeps` of the run.

        It falls as soon as it must, and rises only to what would have served all the time during
        the last PATIENCE substeps.  Symplectic Euler conserves an energy that depends on the step:
        one that followed each swing of a body would pump energy into it.
        """
        if self._bound is not None and not self._is_new:
            return self._held
        allowed = min(self._allowed(substeps), self.spring_step * ROUNDING)
        self._is_new = False
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
            self._reference = (self._sharp_at_rest()[0], self._rest_bounds[0])
        due = self._next_soon if bound < FALLEN * self._reference[1] else self._next_look
        if self.sharpens and self._has_drifted(bound) and substeps >= due:
            u = self.system.u.astype(np.float64)
            for part in self.system.parts:
                u[part.nodes] += part.shift
            sharp, products = self._look(self._solids, u)
            self._reference = (max(sharp, bound), bound)
            self._wait(substeps, products)
        sharp, reference = self._reference
        if self._has_drifted(bound):
            return SAFETY * bound
        return max(SHARE * sharp * min(1.0, bound / reference), SAFETY * bound)

    def _wait(self, substeps: int, products: int) -> None:
        """Say when the limit may be sharpened again, after so many substeps and products."""
        self._next_look, self._next_soon = substeps + SPARE * products, substeps + SOON * products

    def _solid_bound(self) -> float:
        """The bound of the tets alone, in the present state [s]."""
        least = min(self._tets_bound(), self._still_step)
        return least if self._solids else np.inf

    def _has_drifted(self, bound: float) -> bool:
        assert self._reference is not None
        return abs(bound / self._reference[1] - 1.0) > DRIFT

    def accepted(self) -> float:
        """The longest step [s] with which a frame may have come to the present state."""
        if not self._moves:
            return np.inf
        sharp, bound = self._reference or (self._sharp_at_rest()[0], self._rest_bounds[0])
        return self._solid_bound() * sharp / bound

    def nearest(self) -> float:
        """The limit [s] of all bodies in the state looked at last, as well as it is known."""
        solid, net = self._sharp_at_rest()
        return min(self.accepted() if self._moves else solid, net)

    def state(self) -> dict[str, Any]:
        """What a checkpoint keeps, so that the same bits follow."""
        sharp, bound = self._reference or (None, None)
        return {
            "rest": self._sharp_at_rest(),
            "sharp": sharp,
            "bound": bound,
            "next": self._next_look,
            "soon": self._next_soon,
            "held": self._held,
            "window_start": self._window_start,
            "window_least": self._window_least,
            "last": self._bound,
            "new": self._is_new,
        }

    def set_state(self, state: dict[str, Any]) -> None:
        """Go on from what `state` told."""
        self._sharp = (state["rest"][0], state["rest"][1])
        if state["sharp"] is not None:
            self._reference = (state["sharp"], state["bound"])
        self._next_look, self._next_soon = state["next"], state["soon"]
        self._held = state["held"]
        self._window_start, self._window_least = state["window_start"], state["window_least"]
        self._bound, self._is_new = state["last"], state["new"]

    def limit(self) -> Limit:
        """The bound and the element that sets it."""
        self.follow()
        now = np.empty(self.system.count, self.system.real)
        self.system.state.read_limits(self.system.first, now)
        found = [
            self._of_part(part, now[part.nodes].astype(np.float64)) for part in self.system.parts
        ]
        return min(found, key=lambda limit: limit.step, default=Limit(np.inf, None, -1, "nothing"))

    def _of_part(self, part: Part, now: NDArray[np.float64]) -> Limit:
        """One body's; `now` holds its nodes' limits in the present state."""
        steps = self.limits_at_rest[part.index]
        if not len(steps):
            return Limit(np.inf, None, -1, "nothing")
        if part.is_springs:
            worst = int(np.argmin(steps))
            return Limit(float(steps[worst]), part, worst, "spring")
        nodes = steps if part.is_tensor else now
        node = int(np.argmin(np.where(np.isnan(nodes), 0.0, nodes)))
        around = np.concatenate([(c.nodes == node).any(axis=1) for c in part.solids]).nonzero()[0]
        stiffest = self._stiffest(part)[around]
        worst = around[int(np.argmax(np.where(np.isnan(stiffest), np.inf, stiffest)))]
        step = float(nodes[node]) * ROUNDING
        return Limit(
            step, part, int(part.cell_order[worst]), part.kind_of_cell(worst), int(part.order[node])
        )

    def _stiffest(self, part: Part) -> NDArray[np.float64]:
        """ω² [1/s²] of each of the body's cells in the state looked at last."""
        if part.is_tensor:
            return np.concatenate([known[:, 0] for known in part.known()])
        found = []
        for cells in part.solids:
            share = next(s for _, s in self._shares if any(c is cells for _, c in s.members))
            out = np.empty((len(share.batches.owner), share.batches.lanes), self.system.real)
            share.block.read_stiffest(share.row("batches"), out)
            found.append(out.ravel()[cells.place].astype(np.float64))
        return np.concatenate(found)

    def culprit(self) -> str:
        """The element that sets the limit, or that is no longer finite, as words."""
        here = self.limit()
        if here.part is None:
            return "a node without springs"
        return f"{here.kind} {here.element} of {here.part.body.name!r}"
