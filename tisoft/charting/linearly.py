"""Sag as linear elasticity has it, for elements whose large displacements take long to compile.

    K(0) u = f,   e ≈ s e_lin,   s = e/e_lin of the scene itself

e is the error against the ruler, e_lin that of linear elasticity against a ruler of its own, on the
same pair of meshes.  Where the two differ much (s beyond 2/3 and 3/2), or the answers themselves do
(bodies that are turned), linear elasticity tells nothing.  The bar has the difference of the two
errors besides, and what s is off by as their bars are.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tisoft.charting.estimate import Error, Ruler
from tisoft.errors import NoEquilibrium
from tisoft.scene import Scene

MOST_APART = 1.5
MOST_OFF = 0.5
"""By which the linear answer may differ from that of large displacements, relative to it."""


@dataclass(frozen=True)
class LinearRuler:
    """The ruler of linear elasticity, and how its errors compare with those of large strains."""

    ruler: Ruler
    share: float
    """s"""
    unsure: float = 0.0
    """Relative bar of s."""

    def error(self, value: Any) -> Error:
        """The error of a variant, by its linear answer."""
        found = self.ruler.error(value)
        more = abs(self.share - 1.0) + self.share * self.unsure
        return Error(self.share * found.value, found.bar + more * found.value)


def is_near(linear: Any, large: Any) -> bool:
    """Whether the linear answer of a scene comes near that of large displacements."""
    return Ruler(np.asarray(large, np.float64), 0.0).error(linear).value <= MOST_OFF


def linear_ruler(truth: Ruler, error: Error, own: Any) -> LinearRuler | None:
    """The ruler, or None where linear elasticity tells nothing of the scene.

    Args:
        truth: the ruler of linear elasticity.
        error: of the scene itself, large displacements.
        own: the scene's own linear answer.
    """
    linear = truth.error(own)
    if error.below or linear.below:
        return LinearRuler(truth, 1.0) if error.below and linear.below else None
    share = error.value / linear.value
    unsure = error.bar / error.value + linear.bar / linear.value
    return LinearRuler(truth, share, unsure) if 1.0 / MOST_APART < share < MOST_APART else None


def linear_static(scene: Scene) -> tuple[list[np.ndarray], float]:
    """Displacements [m] of each body's nodes, shape (nodes, 3), and the elastic energy [J]; raises
    NoEquilibrium for a body that its pins let go."""
    from tisoft.equilibrium.at_rest import AtRest
    from tisoft.equilibrium.frontal import factorised
    from tisoft.equilibrium.held import Held
    from tisoft.gravity import gravity_at
    from tisoft.model.part import parts_of
    from tisoft.step.loading import external_forces

    parts = parts_of(scene.bodies)
    loads = external_forces(parts, scene.duration)
    moved, energy = [], 0.0
    for part in parts:
        stiffness = AtRest(part).stiffness()
        force = loads[part.nodes] + part.mass[:, None] * gravity_at(scene.gravity, scene.duration)
        held = Held(part, scene.duration)
        u = held.place(1.0).ravel()
        right = held.basis.T @ (force.ravel() - stiffness @ u)
        try:
            factor, _ = factorised(held.on_unknowns(stiffness), held)
        except RuntimeError:  # exactly singular
            raise NoEquilibrium("the pins let a body go") from None
        u += held.basis @ factor.solve(right)
        energy += 0.5 * float(u @ (stiffness @ u))
        own = np.empty((len(part.order), 3))
        own[part.order] = u.reshape(-1, 3)
        moved.append(own)
    return moved, energy
