"""The branch of equilibria from rest to the full load, in steps that are known not to jump.

From a state at load factor s to one at s + Δs, the tangents at both ends predict the way:

    a = K(u₀)⁻¹ ΔL,   b = K(u₁)⁻¹ ΔL,   |(u₁ − u₀) − (a + b)/2| ≤ SMOOTH |u₁ − u₀|

which on a smooth branch holds to third order in Δs, and fails where u₁ lies on another one: beyond
a limit load Newton's method, if it finds anything, finds a state that a jump at fixed load leads
to.  The step is then shortened until the limit is known to within SHORTEST of itself.

A rest shape that the load finds a mechanism in (a flat net, a hanging chain) has no tangent to
start along; there `settle` takes the lowest potential at the full load instead.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tisoft.equilibrium.balance import Balance, largest, no_equilibrium
from tisoft.equilibrium.linear_solve import Solver
from tisoft.equilibrium.newton import Corrected, correct
from tisoft.equilibrium.settle import settle

Floats = NDArray[np.float64]

SMOOTH = 0.15
SHORTEST = 1e-4
"""Load steps below this share of the load reached end the search."""
FIRST = 1e-8
"""Load steps below this share of the full load end the search at rest."""
BESIDE = 0.5
"""Share of the displacements within which an answer is that of a coarser mesh."""
ROUGH = 0.2
"""The same where displacements that were carried over press cells so far that they are unstable."""
INCONSISTENT = 1e-3
"""Share of the load that falls on mechanisms, above which the rest shape cannot be left along a
tangent."""


@dataclass(frozen=True)
class Answer:
    """One body's equilibrium."""

    state: Corrected
    iterations: int
    """Linear systems that were solved."""
    stable: bool
    """Whether every small disturbance dies out (True also where that was not looked at)."""


def balance_body(balance: Balance, near: Floats | None = None) -> Answer:
    """The body's equilibrium at load factor 1.

    Args:
        balance: the body.
        near: displacements [m] that it lies near, as those of a coarser mesh, if at all.

    Raises:
        NoEquilibrium: with the last load factor that had one.
    """
    zero = np.zeros_like(balance.load)
    if not balance.free.any() or not (
        balance.load[balance.free].any() or balance.start.any() or balance.moves
    ):
        u = balance.place(1.0)
        r, reactions = balance.out_of_balance(u, 1.0)
        return Answer(Corrected(u, largest(r), reactions), 0, True)
    balance.check_holds()
    solver = Solver(balance)
    if near is not None and (found := _beside(balance, solver, near)) is not None:
        return found
    solver.refresh(zero, 0.0)
    if solver.negative or _finds_mechanism(balance, solver):
        if balance.linear:
            raise no_equilibrium(
                f"the pins let {balance.part.body.name!r} turn, and a linear body that turns "
                "balances no load; pin it further or use another model",
                0.0,
            )
        return Answer(settle(balance, solver), solver.iterations, True)
    return _follow(balance, solver)


def _beside(balance: Balance, solver: Solver, near: Floats) -> Answer | None:
    """The stable state next to displacements that a coarser mesh came to along its branch; None
    where there is none, or they are no use."""
    if balance.linear or balance.held.patches:
        return None
    u = np.where(balance.free, near, balance.place(1.0))
    if not balance.is_admissible(u):
        return None
    solver.refresh(u, 1.0)
    rough = solver.negative > 0  # cells of a ν near .5 mind the least change of their volume
    most = ROUGH if rough else BESIDE
    new = correct(balance, solver, u, 1.0, reach=most * float(np.abs(u).max()))
    if new is None or np.linalg.norm(new.u - u) > most * np.linalg.norm(u):
        return None
    if rough:
        solver.refresh(new.u, 1.0)
        if solver.negative:
            return None
    return Answer(new, solver.iterations, solver.negative == 0)


def _finds_mechanism(balance: Balance, solver: Solver) -> bool:
    """Whether some of the load meets no stiffness at rest."""
    zero = np.zeros_like(balance.load)
    right = _drive(balance, zero, 0.0, 0.0, 1.0)
    size = np.linalg.norm(right)
    if size == 0.0:
        return False
    d = solver.solve(zero, 0.0, right, tolerance=1e-6)
    left = solver.gather(right - balance.tangent_times(d))
    return bool(np.linalg.norm(left) > INCONSISTENT * size)


def _drive(balance: Balance, u: Floats, at: float, factor: float, new_factor: float) -> Floats:
    """Change of the forces on free axes [N] from one load factor to another, pins' motion too, by
    the loads and the tangent of the state u at load factor `at`.
    """
    change = balance.external(u, new_factor) - balance.external(u, factor)
    moved = balance.place(new_factor) - balance.place(factor)
    if moved.any():
        balance.look(u, at)
        change = change - balance.tangent_times(moved)
    return np.where(balance.free, change, 0.0)


def _follow(balance: Balance, solver: Solver) -> Answer:
    u = np.zeros_like(balance.load)
    state = Corrected(u, 0.0, u)
    factor, step = 0.0, 1.0
    stable, failed = True, False
    while factor < 1.0:
        new_factor = min(1.0, factor + step)
        if new_factor > 1.0 - 1e-9:
            new_factor = 1.0
        new = _step(balance, solver, state.u, factor, new_factor)
        if new is not None:
            step = (new_factor - factor) * (1.0 if failed else 2.0)
            state, factor, failed = new, new_factor, False
            stable = solver.negative == 0
            continue
        failed = True
        step = 0.5 * (new_factor - factor)
        solver.refresh(state.u, factor)
        if step < max(FIRST, SHORTEST * factor):
            raise no_equilibrium(
                f"{balance.part.body.name!r} has no equilibrium that leads from rest to the full "
                f"load: the last one found is at load factor {factor:.6g}",
                factor,
            )
    return Answer(state, solver.iterations, stable)


def _step(
    balance: Balance, solver: Solver, u: Floats, factor: float, new_factor: float
) -> Corrected | None:
    """The state at `new_factor` that the branch leads to, or None where the step is too long."""
    change = _drive(balance, u, factor, factor, new_factor)
    ahead = solver.solve(u, factor, change, tolerance=1e-6)
    reach = float(np.abs(ahead).max())
    guess = u + ahead + (balance.place(new_factor) - balance.place(factor))
    new = correct(balance, solver, guess, new_factor, reach=2.0 * reach if reach else np.inf)
    if new is None or balance.linear:
        return new
    solver.refresh(new.u, new_factor)
    change = _drive(balance, new.u, new_factor, factor, new_factor)
    behind = solver.solve(new.u, new_factor, change, tolerance=1e-6)
    way = np.where(balance.free, new.u - u, 0.0)
    gap = way - 0.5 * (ahead + behind)
    smooth = largest(gap) <= SMOOTH * largest(way) and np.linalg.norm(
        gap
    ) <= SMOOTH * np.linalg.norm(way)
    return new if smooth else None
