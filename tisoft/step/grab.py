"""Hands: a point of a body drawn to a target, by a spring that acts inside every substep.

    f_j = w_j (k (y − Σ w x) − c Σ w v),   |Σ f| ≤ F

Against the masses it adds k s and c s to the largest eigenvalues at the most, s = Σ w²/m.  The
scheme is stable while 4M − 2hC − h²K is positive definite, and a step of r times the limit leaves
4 (1 − r) of the 4 at the least.  k and c share that, so a hand never shortens the step.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tisoft import checks
from tisoft.checks import FieldError
from tisoft.model.part import Part
from tisoft.model.state import HAND_NODES, HANDS
from tisoft.model.system import System
from tisoft.models.materials import MassSpring

if TYPE_CHECKING:
    from tisoft.body import Body

Floats = NDArray[np.float64]

MOST_SHARE = 0.4
"""Of the 4 of the stability condition: what a hand takes at the most."""
LEFT = 0.9
"""Share that it takes of what the step leaves."""
WEIGHTS = 3.0
"""Weights of the body that a hand can carry at least."""
LEAST_RADIUS = 0.05
"""Of the patch that it holds, as a share of the body's size: for the strength of its pull."""
CONSISTENT = 5.0
"""Inverse of the least eigenvalue of a consistent mass against the lumped one, linear tets."""


def patch_weights(points: Floats, mass: Floats, at: Floats) -> Floats:
    """Weights of nodes for a hand at a point between them, shape (n,).

    Σ w = 1 and Σ w X = `at`, so the point held stays the same point of the body however it turns;
    of all such weights those with the least Σ w²/m, which leave the hand the most stiffness.  Where
    the nodes do not span space (a net's single node, a flat patch seen from beside), as near as
    they can.

    Args:
        points: rest points X [m], shape (n, 3).
        mass: lumped masses [kg], shape (n,).
        at: the point held, in the rest shape [m], shape (3,).
    """
    size = max(float(np.ptp(points, axis=0).max()), 1e-300)
    rows = np.vstack([np.ones(len(points)), (points - at).T / size])
    weights = mass * (rows.T @ (np.linalg.pinv((rows * mass) @ rows.T, rcond=1e-9)[:, 0]))
    return np.asarray(weights / weights.sum())


class Grab:
    """A hand on a body, made by `Simulation.grab`."""

    def __init__(self, hands: Hands, part: Part, nodes: NDArray[np.int64], weights: Floats) -> None:
        self.body: Body = part.body
        """The body that is held."""
        self._hands = hands
        self._part = part
        self.nodes = nodes
        """Rows of the body's `mesh.points`."""
        self.weights = weights
        """Share of each in the point held; they add up to 1."""
        self._target = np.zeros(3)
        self._most = 0.0
        self._stiffness = np.inf

    @property
    def target(self) -> Floats:
        """Where the point is drawn to [m], world, shape (3,); may be set between frames."""
        return self._target.copy()

    @target.setter
    def target(self, value: Any) -> None:
        self._target = np.array(checks.vector("target", value))

    @property
    def point(self) -> Floats:
        """Where the point held is now [m], world, shape (3,)."""
        here = self._hands.system.world()[self._part.nodes][self._part.rank[self.nodes]]
        return self.weights @ here

    @property
    def force(self) -> Floats:
        """Force on the body in the last substep [N], shape (3,)."""
        return self._hands.force(self)

    @property
    def is_held(self) -> bool:
        """Whether it has not been let go."""
        return self in self._hands.held

    def release(self) -> None:
        """Let go; a second time does nothing."""
        self._hands.release(self)


class Hands:
    """All hands on the bodies of a scene."""

    def __init__(self, system: System) -> None:
        self.system = system
        self.held: list[Grab] = []
        self._first = system.lease.starts["hands"]

    def take(self, part: Part, nodes: Any, weights: Any, point: Any, weight: float) -> Grab:
        """A hand at `point` [m] of a body that weighs `weight` [N]."""
        if len(self.held) == HANDS:
            raise FieldError("grab", f"is one hand more than {HANDS}; release another first")
        count = len(part.body.mesh.points)
        rows = np.atleast_1d(np.asarray(nodes))
        if rows.ndim != 1 or rows.dtype.kind not in "iu" or not 0 < len(rows) <= HAND_NODES:
            raise FieldError("nodes", f"must be 1 to {HAND_NODES} whole numbers", nodes)
        if rows.min() < 0 or rows.max() >= count or len(np.unique(rows)) < len(rows):
            raise FieldError("nodes", f"must be different numbers from 0 to {count - 1}", nodes)
        shares = checks.array("weights", weights, checks.number)
        if shares.shape != rows.shape or abs(shares.sum() - 1.0) > 1e-3:
            problem = f"must be {len(rows)} numbers that add up to 1"
            raise FieldError("weights", problem, weights)
        grab = Grab(self, part, rows.astype(np.int64), shares / shares.sum())
        grab.target = checks.vector("point", point)
        grab._most = max(WEIGHTS * weight, self._strength(grab))
        self.held.append(grab)
        return grab

    def _strength(self, grab: Grab) -> float:
        """A force [N] that bends the body well: E r², or k r of a spring."""
        part, model = grab._part, grab.body.model
        x = part.body.mesh.points[grab.nodes]
        away = ((x - grab.weights @ x) ** 2).sum(axis=1)
        radius = max(float(np.sqrt(abs(grab.weights) @ away)), LEAST_RADIUS * part.size)
        if model.young is not None:
            return float(model.young * radius**2)
        assert isinstance(model, MassSpring)
        return float(np.nanmedian(model.stiffness)) * radius

    def begin(self, step: float, limit: float, factor: int) -> None:
        """Prepare a stretch of substeps of `step` [s] that are stable up to `limit` [s]; `factor`
        is the integrator's `damping_factor`.
        """
        share = min(MOST_SHARE, LEFT * 4.0 * max(0.0, 1.0 - step / limit))
        for number, grab in enumerate(self.held):
            part = grab._part
            inside = part.start + part.rank[grab.nodes]
            light = float((grab.weights**2 / self.system.mass[inside]).sum())
            if part.is_consistent:
                light *= CONSISTENT
            # What a step has once left is kept: a smaller one leaves more, and would feel harder.
            grab._stiffness = min(grab._stiffness, 0.5 * share / (step * step * light))
            damping = 0.5 * share / (2.0 * factor * step * light)
            rest = grab.weights @ part.body.mesh.points[grab.nodes] + part.shift
            numbers = np.array([*(grab._target - rest), grab._stiffness, damping, grab._most])
            self.system.write_hand(self._first + number, inside, grab.weights, numbers)
        self.system.hold(len(self.held))

    def release(self, grab: Grab) -> None:
        """Let go of one."""
        if grab in self.held:
            self.held.remove(grab)
            self.system.let_go()

    def force(self, grab: Grab) -> Floats:
        """Its force [N] in the last substep; 0 where it is released."""
        if grab not in self.held:
            return np.zeros(3)
        row = self._first + self.held.index(grab)
        return np.array([float(c) for c in self.system.state.hand_force[row]])
