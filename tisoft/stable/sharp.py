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
from tisoft.equilibrium.pointwise import Pointwise
from tisoft.model.part import Part
from tisoft.model.system import System
from tisoft.stable.bound import longest_step
from tisoft.step.stepper import INTEGRATORS

Floats = NDArray[np.float64]
Operator = Callable[[Floats], Floats]

TOLERANCE, ROUGH = 1e-3, 1e-2
"""Relative accuracy of the eigenvalue; where a step is only looked at."""
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
    part: Part,
    *,
    integrator: str,
    u: Floats | None = None,
    elastic: Operators | None = None,
    most: float = np.inf,
) -> SharpLimit:
    """The stable limit of one body and the shape that sets it.

    Args:
        part, integrator: the body, and the rule by which it moves.
        u: displacements [m], inside order; at rest without them.
        elastic: spares making it anew.
        most: a step [s] beyond which the limit is of no interest: a viscous body is looked at there
            first, and roughly.
    """
    elastic = elastic or operators_of(part)
    here = np.zeros((elastic.nodes, 3)) if u is None else np.asarray(u, dtype=np.float64)
    factor = INTEGRATORS[integrator].damping_factor
    drag = factor * part.body.model.point_damping
    mass, pair = _Mass(part, elastic), _Pair(elastic, here, factor)
    mode = _start_vector(elastic.nodes)
    step, within = most, TOLERANCE if np.isinf(most) else ROUGH
    if not part.is_viscous() or not np.isfinite(step):
        value, mode, residual = _largest(mass, pair.stiffness, mode, within)
        step = float(longest_step(np.array(max(value + residual, 0.0)), np.array(drag)))
    if not part.is_viscous() or not np.isfinite(step):
        return SharpLimit(step, mode, pair.products)
    for _ in range(ROUNDS):
        h = step
        value, mode, residual = _largest(mass, pair.both(h), mode, within)
        k, c = np.vdot(mode, pair.stiffness(mode)), np.vdot(mode, pair.viscosity(mode))
        step = float(longest_step(np.array(k), np.array(c + drag)))
        if step >= h * (1.0 - within):
            break
    # Scaling h by s < 1 scales 2hC + h²K by s at the most.
    shortened = h * min(1.0, 4.0 / (value + residual + 2.0 * h * drag))
    return SharpLimit(shortened, mode, pair.products)


class _Pair:
    """K and C of a body in the state u, which count their products."""

    def __init__(self, elastic: Operators, u: Floats, factor: int) -> None:
        self.products = 0
        self._elastic, self._u, self._factor = elastic, u, factor
        self._matrices: tuple[Any, Any] | None = None
        if isinstance(elastic, Pointwise):  # the products with points take ten times as long
            self._matrices = elastic.stiffness(u).T, factor * elastic.viscosity(u).T

    def stiffness(self, w: Floats) -> Floats:
        """K w [N]."""
        self.products += 1
        if self._matrices is not None:
            return _times(self._matrices[0], w)
        return self._elastic.stiffness_times(w, self._u)

    def viscosity(self, w: Floats) -> Floats:
        """C w [N], as often as the integrator sees it."""
        if self._matrices is not None:
            return _times(self._matrices[1], w)
        return self._factor * self._elastic.viscosity_times(w, self._u)

    def both(self, h: float) -> Operator:
        """h²K + 2hC."""
        if self._matrices is not None:
            matrix = h * h * self._matrices[0] + 2.0 * h * self._matrices[1]

            def times(w: Floats) -> Floats:
                self.products += 1
                return _times(matrix, w)

            return times
        return lambda w: h * h * self.stiffness(w) + 2.0 * h * self.viscosity(w)


def _times(matrix: Any, w: Floats) -> Floats:
    product: Floats = (matrix @ w.ravel()).reshape(w.shape)
    return product


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


def _largest(
    mass: _Mass, operator: Operator, start: Floats, within: float
) -> tuple[float, Floats, float]:
    """λ_max of A w = λ M w, `within` a share of it, the vector (wᵀMw = 1), and the residual's M⁻¹
    norm.
    """
    shape = start.shape

    def held_out(w: Floats) -> Floats:
        return mass.free * operator(mass.free * w)

    if mass.free.sum() <= SMALLEST * 3:
        w = _dense(mass, held_out, shape)
    else:
        try:
            w = _lanczos(mass, held_out, start, within)
        except ArpackError as late:
            found = getattr(late, "eigenvectors", np.empty(0))
            if not found.size:
                return np.inf, start, 0.0  # nothing is known: the elements' bound has to do
            w = found[:, 0].reshape(shape)
            if mass.matrix is None:
                w = w / np.sqrt(mass.lumped)
    w = mass.free * w
    size = float(np.vdot(w, mass.times(w)))
    w = w / math.sqrt(size or 1.0)
    image = held_out(w)
    value = float(np.vdot(w, image))
    left = image - value * mass.times(w)
    return value, w, math.sqrt(max(float(np.vdot(left, mass.solve(left))), 0.0))


def _lanczos(mass: _Mass, operator: Operator, start: Floats, within: float) -> Floats:
    """The vector of λ_max, roughly; raises ArpackError."""

    def flat(function: Operator) -> LinearOperator:
        def apply(w: Floats) -> Floats:
            return function(w.reshape(start.shape)).ravel()

        return LinearOperator((start.size, start.size), matvec=apply, dtype=np.float64)

    rules: dict[str, Any] = {"k": 1, "which": "LA", "tol": within}
    if mass.matrix is None:  # M^½ w instead of w
        root = np.sqrt(mass.lumped)
        whole = flat(lambda y: operator(y / root) / root)
        found = eigsh(whole, v0=(mass.free * start * root).ravel(), **rules)
        return np.asarray(found[1][:, 0].reshape(start.shape) / root)
    # On held axes the mass of the eigenproblem is 1, and A is 0.
    found = eigsh(
        flat(operator),
        M=flat(lambda w: mass.times(w) + ~mass.free * w),
        Minv=flat(lambda r: mass.solve(r) + ~mass.free * r),
        v0=(mass.free * start).ravel(),
        **rules,
    )
    return np.asarray(found[1][:, 0].reshape(start.shape))


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
