"""Newton's method for one body's balance at a fixed load factor, near a known state.

    K(u) d = r(u),   u += s d,   s = 1, 1/2, 1/4, …  until the potential V − L·u falls (Armijo)

Where the tangent is indefinite (past a bifurcation) d need not lead downhill, and loads that turn
with the surface have no potential; there s must bring |d·r| down (Matthies and Strang 1979).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tisoft.equilibrium.balance import ACCEPTED, Balance, largest
from tisoft.equilibrium.linear_solve import Solver

Floats = NDArray[np.float64]

MOST_STEPS = 30
HALVINGS = 8
ROUNDING = 1e-13
"""Relative changes of the potential that mean nothing."""


@dataclass(frozen=True)
class Corrected:
    """A state in balance."""

    u: Floats
    """Displacements [m], shape (nodes, 3)."""
    residual: float
    """Largest nodal force left over [N]."""
    reactions: Floats
    """Forces of the pins on held nodes [N], shape (nodes, 3)."""


def correct(
    balance: Balance, solver: Solver, u: Floats, factor: float, *, reach: float = np.inf
) -> Corrected | None:
    """Newton's method from `u`; None where it does not converge.

    Args:
        balance: the body.
        solver: its linear solver; the preconditioner may be of an earlier state.
        u: first guess [m], held axes already in place.
        factor: load factor.
        reach: how far from the guess the answer may lie [m], in the largest component.
    """
    start = u
    if not balance.is_admissible(u):
        return None
    best: Corrected | None = None
    for _ in range(MOST_STEPS):
        r, reactions = balance.out_of_balance(u, factor)
        residual, scale = largest(r), balance.scale(u, factor, reactions)
        here = Corrected(u, residual, reactions)
        if residual <= balance.target * scale:
            return here
        enough = max(ACCEPTED * scale, solver.rounding(u))
        if best is not None and best.residual <= enough and residual > 0.3 * best.residual:
            return best if best.residual < residual else here  # rounding allows no less
        best = here if best is None or residual < best.residual else best
        tolerance = 1e-11 if balance.linear else 1e-4
        d = solver.solve(u, factor, r, tolerance=tolerance)
        new = line_search(balance, u, d, r, factor)
        if new is None or np.abs(new - start).max() > reach:
            break
        u = new
    if best is None:
        return None
    scale = balance.scale(best.u, factor, best.reactions)
    return best if best.residual <= max(ACCEPTED * scale, solver.rounding(best.u)) else None


def line_search(balance: Balance, u: Floats, d: Floats, r: Floats, factor: float) -> Floats | None:
    """u + s d with the largest s = 1, 1/2, … that brings the body nearer to balance, or None."""
    slope = float((r * d).sum())  # minus the potential's slope along d
    has_potential = slope > 0.0 and not balance.followers
    before, size = balance.potential(u, factor)
    s = 1.0
    for _ in range(HALVINGS):
        new = u + s * d
        if balance.is_admissible(new):
            if has_potential:
                after, _ = balance.potential(new, factor)
                if after <= before - 1e-4 * s * slope + ROUNDING * size:
                    return new
            else:
                left = float((balance.out_of_balance(new, factor)[0] * d).sum())
                if abs(left) <= (1.0 - 1e-4 * s) * abs(slope):
                    return new
        s *= 0.5
    return None
