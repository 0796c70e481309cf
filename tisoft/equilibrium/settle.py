"""The lowest potential that a body without stiffness at rest comes to: flat nets, chains, hinges.

    (K(u) + σ) d = r(u),   u += d where V − L·u falls                (Levenberg 1944)

σ is raised until K + σ is positive definite and the potential falls as its quadratic model says,
and lowered again near the end, where Newton's method takes over.  Saddles are left by a small push
along their falling direction.  Where this does not come to an end, damped dynamics goes before it:
nodes of unequal mass, all about as fast, that lose their speed whenever it points uphill (Bitzek,
Koskinen, Gähler, Moseler and Gumbsch 2006).

What is very stiff beside its load lies in a valley too steep and too curved to walk down.  It goes
under a multiple of its load first, which shapes it about the same, and becomes lighter by tens.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tisoft.equilibrium.balance import ACCEPTED, TARGET, Balance, largest, no_equilibrium
from tisoft.equilibrium.linear_solve import Solver
from tisoft.equilibrium.newton import Corrected, correct

Floats = NDArray[np.float64]

MOST_TRIALS = 400
ROUNDS = 4
RELAXATION_STEPS = 20_000
SOFT = 1e-3
PUSH = 1e-3
"""A push that leaves a saddle, as a share of the body's size."""


def settle(balance: Balance, solver: Solver) -> Corrected:
    """The state of lowest potential at the full load that can be reached downhill from rest.

    Raises:
        NoEquilibrium: when none was found.
    """
    heaviest = _heaviest(balance, solver)
    for factors in (np.geomspace(heaviest, 1.0, 1 + round(np.log10(heaviest))), [1.0]):
        found = _settle_through(balance, solver, [float(factor) for factor in factors])
        if found is not None:
            return found
    raise no_equilibrium(
        f"{balance.part.body.name!r} found no equilibrium under its full load: it is loose at "
        "rest, and kept moving; pin it further",
        0.0,
    )


def _heaviest(balance: Balance, solver: Solver) -> float:
    """The multiple of the load, a power of ten, that stretches the body by some SOFT of itself."""
    stiffness = solver.diagonal * balance.part.size
    load = float(np.linalg.norm(balance.load, axis=1).sum())
    ratio = SOFT * stiffness / load if load else 1.0
    return float(10.0 ** np.floor(np.log10(max(ratio, 1.0))))


def _settle_through(balance: Balance, solver: Solver, factors: list[float]) -> Corrected | None:
    """Rest at each multiple of the load in turn, the last one 1."""
    u = balance.place(1.0)
    found: Corrected | None = None
    for factor in factors:
        found = _rest(balance, solver, u, factor, near=found is not None)
        if found is None:
            return None
        solver.refresh(found.u, factor)
        lighter = -0.9 * factor * np.where(balance.free, balance.loads(found.u), 0.0)
        ahead = found.u + solver.solve(found.u, factor, lighter, tolerance=1e-6)
        u = ahead if balance.is_admissible(ahead) else found.u
    return found


def _rest(
    balance: Balance, solver: Solver, u: Floats, factor: float, *, near: bool
) -> Corrected | None:
    """A stable state at a multiple of the load, by Newton's method where u is `near` it."""
    if near:
        found = correct(balance, solver, u, factor, reach=0.05 * balance.part.size)
        if found is not None:
            solver.refresh(found.u, factor)
            if solver.negative == 0:
                return found
    if not solver.factorises:
        u = relax(balance, u, factor)
    for _ in range(ROUNDS):
        down = descend(balance, solver, u, factor)
        if isinstance(down, Corrected):
            return down
        u = relax(balance, down, factor)
    return None


def descend(balance: Balance, solver: Solver, u: Floats, factor: float) -> Corrected | Floats:
    """Downhill to a minimum, or as far as MOST_TRIALS systems lead."""
    solver.refresh(u, factor)
    shift = 1e-3 * solver.diagonal
    rng = np.random.default_rng(0)
    size = balance.part.size
    for _ in range(MOST_TRIALS):
        r, reactions = balance.out_of_balance(u, factor)
        scale = balance.scale(u, factor, reactions)
        if largest(r) <= 1e-3 * scale:
            solver.refresh(u, factor)
            if solver.negative == 0:
                found = correct(balance, solver, u, factor, reach=0.05 * size)
                if found is not None:
                    return found
            elif largest(r) <= ACCEPTED * scale:
                u = u + _fall(balance, solver, u, factor, PUSH * size, rng)
                continue
        u, shift = _levenberg(balance, solver, u, r, factor, shift)
    r, reactions = balance.out_of_balance(u, factor)
    if largest(r) <= TARGET * balance.scale(u, factor, reactions):
        return Corrected(u, largest(r), reactions)
    return u


def _levenberg(
    balance: Balance, solver: Solver, u: Floats, r: Floats, factor: float, shift: float
) -> tuple[Floats, float]:
    """One downhill step and the shift for the next."""
    before, rounding = balance.potential(u, factor)
    for _ in range(60):
        solver.refresh(u, factor, shift=shift)
        if solver.negative:
            shift = max(4.0 * shift, 1e-9 * solver.diagonal)
            continue
        d = solver.solve(u, factor, r, shift=shift)
        expected = 0.5 * float((r * d).sum())
        new = u + d
        if balance.is_admissible(new):
            fallen = before - balance.potential(new, factor)[0]
            if fallen > 0.05 * expected - 1e-14 * rounding:
                return new, shift * (0.25 if fallen > 0.5 * expected else 1.0)
        shift = max(4.0 * shift, 1e-9 * solver.diagonal)
    return u, shift


def _fall(
    balance: Balance,
    solver: Solver,
    u: Floats,
    factor: float,
    length: float,
    rng: np.random.Generator,
) -> Floats:
    """A push of `length` [m] mostly along the most negative direction of the tangent."""
    shift = 1e-9 * solver.diagonal
    solver.refresh(u, factor, shift=shift)
    while solver.negative:
        shift *= 2.0
        solver.refresh(u, factor, shift=shift)
    w = balance.held.balanced(rng.standard_normal(u.shape))
    for _ in range(4):
        w = solver.solve(u, factor, w / np.linalg.norm(w), shift=shift)
    return w * (length / np.abs(w).max())


def relax(balance: Balance, u: Floats, factor: float, steps: int = RELAXATION_STEPS) -> Floats:
    """Damped dynamics from rest at `u` under a multiple of the load; where it has come to."""
    # Masses in proportion to the stiffness at each node make 1 a safe step for every mode.
    blocks = balance.elastic.stiffness_blocks(u)
    mass = 4.0 * np.trace(blocks, axis1=1, axis2=2)[:, None]
    mass = np.maximum(mass, 1e-6 * mass.max())
    v = np.zeros_like(u)
    h, mixing, good = 0.3, 0.1, 0
    for step in range(steps):
        r, reactions = balance.out_of_balance(u, factor)
        if step % 50 == 0 and largest(r) <= 1e-6 * balance.scale(u, factor, reactions):
            break
        if (r * v).sum() > 0.0:
            good += 1
            if good > 5:
                h, mixing = min(1.1 * h, 1.0), 0.99 * mixing
        else:
            v[:] = 0.0
            h, mixing, good = max(0.5 * h, 0.02), 0.1, 0
        v += h * r / mass
        pull = np.sqrt((v * v * mass).sum() / max(float((r * r / mass).sum()), 1e-300))
        v = balance.held.balanced((1.0 - mixing) * v + mixing * pull * r / mass)
        new = u + h * v
        if not balance.is_admissible(new):
            v[:] = 0.0
            h *= 0.5
            if h < 1e-6:
                break
            continue
        u = new
    return u
