"""The stable step, sharply: Lanczos iteration on the whole body, in f64.

The lectures' scheme is stable exactly while 4M − 2hC − h²K is positive definite (velocity Verlet:
4M − 4hC − h²K), so the limit is the h at which the largest eigenvalue of M⁻¹(2hC + h²K) is 4.
For the eigenvector w found at some h, the Rayleigh quotients k = wᵀKw/wᵀMw and c = wᵀCw/wᵀMw give
a next h from h²k + 2hc = 4, never below the limit; a few rounds meet it.

Iterations find the largest eigenvalue from below, so from the unsafe side: the residual norm,
which bounds the distance to an eigenvalue, is added to it before the step is told.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh, splu

from tisoft.equilibrium.one_thread import one_thread
from tisoft.equilibrium.operators import Operators, operators_of
from tisoft.model.part import Part
from tisoft.model.system import System
from tisoft.stable.bound import longest_step
from tisoft.step.stepper import INTEGRATORS

Floats = NDArray[np.float64]
Operator = Callable[[Floats], Floats]

TOLERANCE = 1e-3
"""Relative accuracy of the eigenvalue."""
ROUNDS = 6
SMALLEST = 3
"""Nodes up to which a dense solver takes over: ARPACK wants more unknowns than a few."""


@dataclass(frozen=True)
class SharpLimit:
    """The limit of one body."""

    step: float
    """[s], residual taken off."""
    mode: Floats
    """The shape that grows first, shape (nodes, 3), inside order, wᵀMw = 1."""
    products: int = 0
    """Products with K and C that finding it took."""


def sharp_step(system: System, *, integrator: str, u: Floats | None = None) -> float:
    """The stable limit [s] of all bodies at the displacements u [m] (inside order); at rest
    without them.  Nodes pinned for good are left out.
    """
    limits = [
        sharp_limit(part, integrator=integrator, u=None if u is None else u[part.nodes]).step
        for part in system.parts
    ]
    return min(limits, default=np.inf)


@one_thread()
def sharp_limit(
    part: Part, *, integrator: str, u: Floats | None = None, elastic: Operators | None = None
) -> SharpLimit:
    """The stable limit of one body and the shape that sets it; `elastic` spares making it anew."""
    elastic = elastic or operators_of(part)
    products = 0
    here = np.zeros((elastic.nodes, 3)) if u is None else np.asarray(u, dtype=np.float64)
    factor = INTEGRATORS[integrator].damping_factor
    drag = factor * part.body.model.point_damping
    mass = _Mass(part, elastic)

    def stiffness(w: Floats) -> Floats:
        nonlocal products
        products += 1
        return elastic.stiffness_times(w, here)

    def viscosity(w: Floats) -> Floats:
        nonlocal products
        products += 1
        return factor * elastic.viscosity_times(w, here)

    def both(h: float) -> Operator:
        return lambda w: h * h * stiffness(w) + 2.0 * h * viscosity(w)

    mode = _start_vector(elastic.nodes)
    value, mode, residual = _largest(mass, stiffness, mode)
    step = float(longest_step(np.array(max(value + residual, 0.0)), np.array(drag)))
    if not part.is_viscous() or not np.isfinite(step):
        return SharpLimit(step, mode, products)
    for _ in range(ROUNDS):
        h = step
        value, mode, residual = _largest(mass, both(h), mode)
        k, c = np.vdot(mode, stiffness(mode)), np.vdot(mode, viscosity(mode))
        step = float(longest_step(np.array(k), np.array(c + drag)))
        if step >= h * (1.0 - TOLERANCE):
            break
    # Scaling h by s < 1 scales 2hC + h²K by s at the most.
    return SharpLimit(h * min(1.0, 4.0 / (value + residual + 2.0 * h * drag)), mode, products)


def _start_vector(nodes: int) -> Floats:
    """The same rough vector each time: results must not depend on a generator's state."""
    vector = np.random.default_rng(0).standard_normal((nodes, 3))
    return vector / np.linalg.norm(vector)


class _Mass:
    """M and M⁻¹ on the free axes of a body; held axes (for good) stay 0."""

    def __init__(self, part: Part, elastic: Operators) -> None:
        self.free = np.ones((elastic.nodes, 3), bool)
        for pin in part.body.pins:
            if pin.release is None:
                rows = part.rank[part.body.grip(pin.where)[0]]
                self.free[np.ix_(rows, pin.components)] = False
        self.lumped = part.mass[:, None]
        self.matrix = elastic.consistent_mass() if part.is_consistent else None
        self._factors = [self._factor(axis) for axis in range(3)]

    def _factor(self, axis: int) -> Any:
        if self.matrix is None or not self.free[:, axis].any():
            return None
        rows = np.flatnonzero(self.free[:, axis])
        return splu(self.matrix[rows][:, rows].tocsc())

    def times(self, w: Floats) -> Floats:
        """M w."""
        product = self.lumped * w if self.matrix is None else self.matrix @ w
        return self.free * product

    def solve(self, r: Floats) -> Floats:
        """M⁻¹ r."""
        if self.matrix is None:
            return self.free * r / self.lumped
        out = np.zeros_like(r)
        for axis, factor in enumerate(self._factors):
            if factor is not None:
                rows = self.free[:, axis]
                out[rows, axis] = factor.solve(r[rows, axis])
        return out


def _largest(mass: _Mass, operator: Operator, start: Floats) -> tuple[float, Floats, float]:
    """λ_max of A w = λ M w, the vector (wᵀMw = 1), and the residual's M⁻¹ norm."""
    shape = start.shape

    def flat(function: Operator) -> LinearOperator:
        def apply(w: Floats) -> Floats:
            return function(w.reshape(shape)).ravel()

        return LinearOperator((start.size, start.size), matvec=apply, dtype=np.float64)

    def held_out(w: Floats) -> Floats:
        return mass.free * operator(mass.free * w)

    if mass.free.sum() <= SMALLEST * 3:
        w = _dense(mass, held_out, shape)
    else:
        try:
            # On held axes the mass of the eigenproblem is 1, and A is 0.
            found = eigsh(
                flat(held_out),
                k=1,
                M=flat(lambda w: mass.times(w) + ~mass.free * w),
                Minv=flat(lambda r: mass.solve(r) + ~mass.free * r),
                which="LA",
                v0=(mass.free * start).ravel(),
                tol=TOLERANCE,
            )
            w = found[1][:, 0].reshape(shape)
        except ArpackError as late:
            found = getattr(late, "eigenvectors", np.empty(0))
            if not found.size:
                return np.inf, start, 0.0  # nothing is known: the elements' bound has to do
            w = found[:, 0].reshape(shape)
    w = mass.free * w
    size = float(np.vdot(w, mass.times(w)))
    w = w / math.sqrt(size or 1.0)
    image = held_out(w)
    value = float(np.vdot(w, image))
    left = image - value * mass.times(w)
    return value, w, math.sqrt(max(float(np.vdot(left, mass.solve(left))), 0.0))


def _dense(mass: _Mass, operator: Operator, shape: tuple[int, ...]) -> Floats:
    """The vector of λ_max of a body too small for ARPACK."""
    free = np.flatnonzero(mass.free)
    if not len(free):
        return np.zeros(shape)
    units = np.zeros((len(free), *shape))
    units.reshape(len(free), -1)[np.arange(len(free)), free] = 1.0
    matrix = np.array([operator(w).ravel()[free] for w in units])
    weight = np.array([mass.times(w).ravel()[free] for w in units])
    out = np.zeros(shape)
    out.ravel()[free] = eigh(0.5 * (matrix + matrix.T), weight)[1][:, -1]
    return out
