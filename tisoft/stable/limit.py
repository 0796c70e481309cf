"""The stable step of a running scene, and the one that `step = "auto"` takes."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import runtime
from tisoft.equilibrium.at_rest import AtRest
from tisoft.equilibrium.operators import Elastic, Operators, operators_of
from tisoft.model.part import Part
from tisoft.model.system import System
from tisoft.stable.bound import NO_LIMIT, limits_at_rest, make_look
from tisoft.stable.sharp import sharp_limit
from tisoft.stable.twins import first_twins
from tisoft.step.stepper import INTEGRATORS

Floats = NDArray[np.float64]

SHARE = 0.9
"""Share of the sharp limit that step = "auto" uses."""
SAFETY = 0.95
"""Share of the guaranteed bound that it uses away from rest: room to stiffen within a frame."""
DRIFT = 0.25
"""Relative fall of the bound up to which the last sharp limit is trusted, in proportion."""
SPARE, SOON = 25, 4
"""Substeps between two sharp limits, for each that the last took as long as: 4 % of the run, or a
quarter where bodies would have a step below FALLEN of what their last sharp limit allowed."""
FALLEN = 0.7
COST = {True: 3, False: 8}
"""Substeps that a product in f64 costs as much as, of an assembled matrix or of kernels."""
ON_DEVICE = 10
"""Times as many of a GPU: it makes substeps faster, while the processor seeks the limit."""
FIRST = 4e6
"""Cell-substeps before a first limit is sharpened, which compiles a kernel: no short run waits."""
PATIENCE = 500
"""Substeps through which a longer step must have been allowed before it is taken."""
ASSEMBLED = 30_000
"""Cells up to which a matrix is sooner made than a kernel compiled."""
ROUNDING = 1.0 - 1e-5
"""The tets' limits are computed in f32 at the least; this keeps their rounding on the safe side."""


class StepLimit:
    """Bounds of the tets, followed as they deform, and of the springs, which never stiffen."""

    def __init__(self, system: System, integrator: str) -> None:
        self.system = system
        self.integrator = integrator
        self.factor = INTEGRATORS[integrator].damping_factor
        self.shares = [(k, s) for k, s in enumerate(system.shares) if s.block.law is not None]
        """The solids' shares of blocks, each with its number."""
        self._moves = any(share.block.law.is_finite for _, share in self.shares)
        self._launch = self._kernel() if self.shares else None
        self._bound: float | None = None
        self._bounds: Floats | None = None
        """Of each solid, in the state in which `_bound` holds [s]."""
        self._before: float | None = None
        """The bound that was known before the state became another one."""
        self._at_rest: Floats | None = None
        """Sharp limit of each body at rest [s]."""
        self._rest_bounds = np.full(len(system.parts), np.inf)
        """The bound of each [s]."""
        self._next_look = self._next_soon = self._seen = 0
        self.sharpens = True
        """Whether the sharp limit is found anew in states far from rest, which takes a while."""
        self.certifying_seconds = 0.0
        """Wall time that finding the sharp limit at rest has taken."""
        self.refresh()

    def _kernel(self) -> Any:
        numbers = tuple(k for k, _ in self.shares)
        blocks = tuple(share.block for _, share in self.shares)
        alone = self.system.is_small
        key = ("look", *blocks, numbers, self.factor, alone)
        return self.system.lease.arena.kernel(
            key, lambda: make_look(self.system.state, blocks, numbers, self.factor, alone)
        )

    def refresh(self) -> None:
        """Compute the rest-state numbers again (after a material changed).

        The sharp limit is scaled as the bound, until the next look finds it anew.
        """
        before, parts = self._rest_bounds, self.system.parts
        self.limits_at_rest = [limits_at_rest(part, self.factor) for part in parts]
        least = [float(steps.min(initial=np.inf)) for steps in self.limits_at_rest]
        self._rest_bounds = np.array(least)
        self._still_step = min(
            (a for a, p in zip(least, parts, strict=True) if p.is_tensor), default=np.inf
        )
        if self._at_rest is not None:
            other = self._rest_bounds != before
            self._at_rest[other] *= self._rest_bounds[other] / before[other]
        self._elastic: dict[int, Operators] = {}
        self._references: Floats | None = None
        """Sharp limit and bound [s] of each solid when it was sharpened last, shape (solids, 2)."""
        self._held = np.inf
        self._window_start, self._window_least = 0, np.inf
        self._bound, self._bounds, self._is_new = None, None, True

    @property
    def spring_step(self) -> float:
        """The springs' bound [s]."""
        return self._least(self._rest_bounds, springs=True)

    def _least(self, steps: Floats, *, springs: bool) -> float:
        """The least of what bodies have each, of nets or of solids."""
        own = [part.is_springs == springs for part in self.system.parts]
        return float(steps[own].min(initial=np.inf))

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
        self._before, self._bound, self._bounds, self._is_new = self._bound, None, None, True

    def change(self) -> float:
        """Relative change of the bound since the last look; inf where that one is not known."""
        bound, before = self._tets_bound(), self._before
        if before is None:
            return np.inf
        return 0.0 if bound == before else abs(bound - before) / before if before > 0.0 else np.inf

    def _look(self, part: Part, u: Floats | None, most: float = np.inf) -> tuple[float, float]:
        """A body's sharp limit [s] at its displacements u [m], or at rest, and the substeps that it
        took as long as.

        Args: most: a step [s] beyond which it is of no interest.
        """
        elastic = self._operators(part, at_rest=u is None)
        found = sharp_limit(part, integrator=self.integrator, u=u, elastic=elastic, most=most)
        share = part.elements / max(1, self.system.elements)
        cost = COST[not isinstance(elastic, Elastic)] * (1 if runtime.on_cpu() else ON_DEVICE)
        return found.step, cost * found.products * share

    def _operators(self, part: Part, *, at_rest: bool) -> Any:
        if at_rest and 0 < part.elements <= ASSEMBLED:
            return AtRest(part)
        if part.index not in self._elastic:
            self._elastic[part.index] = operators_of(part)
        return self._elastic[part.index]

    def _sharp_at_rest(self) -> Floats:
        """The sharp limit of each body at rest [s]."""
        if self._at_rest is None:
            begun = time.perf_counter()
            twins = [part.index for part in first_twins(self.system.parts)]
            found = {k: self._look(self.system.parts[k], None)[0] for k in dict.fromkeys(twins)}
            self._at_rest = np.maximum([found[k] for k in twins], self._rest_bounds)
            self.certifying_seconds += time.perf_counter() - begun
        return self._at_rest

    @property
    def _solids(self) -> list[Part]:
        return [part for part in self.system.parts if not part.is_springs]

    @property
    def _numbers(self) -> list[int]:
        return [part.index for part in self._solids]

    def sharp(self) -> float:
        """The stable limit at rest [s], damping included: never above the true one, within 1 %."""
        return float(self._sharp_at_rest().min(initial=np.inf))

    def rest_bound(self) -> float:
        """The guaranteed bound at rest [s]."""
        return float(self._rest_bounds.min(initial=np.inf))

    def chosen(self, substeps: int) -> float:
        """The step [s] that "auto" takes in the state looked at last, after `substeps` of the run.

        It falls as soon as it must, and rises only to what would have served all the time during
        the last PATIENCE substeps.  Symplectic Euler conserves an energy that depends on the step:
        one that followed each swing of a body would pump energy into it.
        """
        self._seen = substeps
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

        Where a body's bound is near that of its last sharp limit, it is SHARE of that, in
        proportion; elsewhere the bound itself, with room to stiffen within a frame.  Now and then,
        as often as SPARE allows, the limits of those bodies that set the step are sharpened.
        """
        bounds = self._solid_bounds()
        if not np.isfinite(bounds.min(initial=np.inf)):
            return np.inf
        allowed = self._allowed_each(bounds)
        has_fallen = bool((allowed < FALLEN * SHARE * self._known()[:, 0]).any())
        is_due = substeps >= (self._next_soon if has_fallen else self._next_look)
        is_due = is_due and self._may_sharpen()
        spent = 0.0
        while True:
            worst = int(np.argmin(allowed))
            if not is_due or not self._has_drifted(bounds)[worst]:
                break
            spent += self._sharpen(worst, bounds[worst])
            allowed = self._allowed_each(bounds)
        if spent:
            self._wait(substeps, spent)
        return float(allowed.min())

    def _may_sharpen(self) -> bool:
        """Whether the run is long enough by now for sharp limits in states far from rest."""
        return self.sharpens and self._seen * self.system.elements >= FIRST

    def _sharpen(self, number: int, bound: float) -> float:
        """Find a solid's sharp limit in the present state, in which it has this bound [s]; returns
        the substeps that it took as long as.
        """
        known, part = self._known(), self._solids[number]
        u = self.system.u[part.nodes].astype(np.float64) + part.shift
        sharp, spent = self._look(part, u, float(self._sharp_at_rest()[part.index]))
        known[number] = max(sharp, bound), bound
        return spent

    def _known(self) -> Floats:
        """Sharp limit and bound [s] of each solid when it was sharpened last, shape (solids, 2)."""
        if self._references is None:
            columns = self._sharp_at_rest(), self._rest_bounds
            self._references = np.stack(columns, axis=1)[self._numbers]
        return self._references

    def _allowed_each(self, bounds: Floats) -> Floats:
        """The step [s] that each solid allows."""
        sharp, reference = self._known().T
        near = np.where(self._has_drifted(bounds), 0.0, SHARE * sharp)
        each: Floats = np.maximum(near * np.minimum(1.0, bounds / reference), SAFETY * bounds)
        return each

    def _wait(self, substeps: int, spent: float) -> None:
        """Say when the limit may be sharpened again, which took as long as `spent` substeps."""
        spent = math.ceil(spent)
        self._next_look, self._next_soon = substeps + SPARE * spent, substeps + SOON * spent

    def _solid_bounds(self) -> Floats:
        """The bound of each solid in the state looked at last [s]."""
        bound = min(self._tets_bound(), self._still_step)
        if self._bounds is None:
            self._bounds = self._each_bound(bound)
        return self._bounds

    def _each_bound(self, bound: float) -> Floats:
        """The same, of the least of them."""
        if len(self._numbers) < 2 or not np.isfinite(bound):
            return np.full(len(self._numbers), bound)
        now = np.empty(self.system.count, self.system.real)
        self.system.state.read_limits(self.system.first, now)
        return np.array([self._bound_of(part, now) for part in self._solids])

    def _bound_of(self, part: Part, now: NDArray[Any]) -> float:
        """One body's, of all nodes' limits `now`."""
        if part.is_tensor:
            return float(self._rest_bounds[part.index])
        least = float(now[part.nodes].min(initial=np.inf))
        return np.inf if least >= NO_LIMIT else least * ROUNDING

    def _has_drifted(self, bounds: Floats) -> NDArray[np.bool_]:
        """Which solids' bounds are far below those known with their sharp limits."""
        fallen: NDArray[np.bool_] = bounds < (1.0 - DRIFT) * self._known()[:, 1]
        return fallen

    def accepted(self, step: float = 0.0) -> float:
        """The longest step [s] with which a frame may have come to the present state; bodies whose
        bound says that `step` was too long are looked at sharply, which is sooner done than the
        frame once more.
        """
        if not self._moves:
            return np.inf
        bounds, known = self._solid_bounds(), self._known()
        for k in np.argsort(bounds * known[:, 0] / known[:, 1]):
            is_known = bounds[k] * known[k, 0] >= step * known[k, 1] or bounds[k] == known[k, 1]
            if is_known or not self._may_sharpen() or not bounds[k] > 0.0:
                break
            self._sharpen(int(k), bounds[k])
        return float((bounds * known[:, 0] / known[:, 1]).min(initial=np.inf))

    def nearest(self) -> float:
        """The limit [s] of all bodies in the state looked at last, as well as it is known."""
        at_rest = self._sharp_at_rest()
        solid = self.accepted() if self._moves else self._least(at_rest, springs=False)
        return min(solid, self._least(at_rest, springs=True))

    def state(self) -> dict[str, Any]:
        """What a checkpoint keeps, and who takes frames back, so that the same bits follow."""
        known = self._references
        return {
            "at_rest": self._sharp_at_rest().tolist(),
            "known": None if known is None else known.tolist(),
            "next": self._next_look,
            "soon": self._next_soon,
            "held": self._held,
            "window_start": self._window_start,
            "window_least": self._window_least,
            "last": self._bound,
            "each": None if self._bounds is None else self._bounds.tolist(),
            "new": self._is_new,
        }

    def set_state(self, state: dict[str, Any]) -> None:
        """Go on from what `state` told."""
        if "at_rest" in state:  # older ones knew the least of all bodies alone
            self._at_rest = np.array(state["at_rest"])
            self._references = None if state["known"] is None else np.array(state["known"])
        self._next_look, self._next_soon = state["next"], state["soon"]
        self._held = state["held"]
        self._window_start, self._window_least = state["window_start"], state["window_least"]
        self._bound, self._is_new = state["last"], state["new"]
        each = state.get("each")
        self._bounds = None if each is None else np.array(each)
