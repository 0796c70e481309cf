"""Newton's linear systems K(u) d = r on the free axes: matrix-free preconditioned CG.

The preconditioner is a sparse factorisation of the tangent at an earlier state, made anew when it
has aged; a body too large for that takes the 3×3 blocks on the diagonal.  The factorisation keeps
its pivots on the diagonal, so that their signs count the negative eigenvalues of the tangent
(Sylvester's law of inertia): whether a state is stable.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from tisoft.dynamics.operators import Elastic

Floats = NDArray[np.float64]

FACTOR_LIMIT = 150_000
"""Unknowns above which no factorisation is made: it would take gigabytes."""
SHIFT = 1e-12
"""Added to the diagonal, as a share of its largest entry, so that mechanisms factorise."""
AGED = 25
"""CG iterations after which a factorisation is too old."""
MOST_ITERATIONS = 5000


def conjugate_gradients(
    times: Callable[[Floats], Floats],
    right: Floats,
    precondition: Callable[[Floats], Floats],
    *,
    tolerance: float,
    limit: int,
) -> tuple[Floats, int, bool]:
    """Solve K x = right; returns x, iterations, and whether the residual fell to `tolerance`.

    Stops at a direction of no positive curvature (Steihaug 1983) with what it has so far.
    """
    x = np.zeros_like(right)
    r = right.copy()
    goal = tolerance * np.linalg.norm(right)
    z = precondition(r)
    p = z
    slope = float(r @ z)
    for iteration in range(limit):
        if np.linalg.norm(r) <= goal:
            return x, iteration, True
        product = times(p)
        curvature = float(p @ product)
        if not (curvature > 0.0 and slope > 0.0):
            return x, iteration, False
        x = x + (slope / curvature) * p
        r = r - (slope / curvature) * product
        z = precondition(r)
        slope, before = float(r @ z), slope
        p = z + (slope / before) * p
    return x, limit, bool(np.linalg.norm(r) <= goal)


class Solver:
    """Solves with the tangent of one body on its free axes.

    Args:
        elastic: the body's operators.
        free: whether each node may move along each axis, shape (nodes, 3).
    """

    def __init__(self, elastic: Elastic, free: NDArray[np.bool_]) -> None:
        self.elastic = elastic
        self.free = np.flatnonzero(free.ravel())
        self.negative = 0
        """Negative eigenvalues of the tangent that was last factorised (0 where none was)."""
        self.iterations = 0
        self._fresh_at: Floats | None = None
        self._precondition: Callable[[Floats], Floats] = _nothing

    @property
    def factorises(self) -> bool:
        """Whether the body is small enough for a factorisation."""
        return len(self.free) <= FACTOR_LIMIT

    def refresh(self, u: Floats, *, shift: float = 0.0) -> None:
        """Make the preconditioner anew from K(u) + shift [N/m]."""
        matrix = self.elastic.stiffness(u)[self.free][:, self.free].tocsc()
        self.diagonal = float(np.abs(matrix.diagonal()).max(initial=0.0)) or 1.0
        self._fresh_at = u.copy()
        if self.factorises:
            self._factorise(matrix, shift)
        else:
            self._take_blocks(shift)

    def _factorise(self, matrix: sparse.csc_matrix, shift: float) -> None:
        least = SHIFT * self.diagonal
        one = sparse.identity(matrix.shape[0], format="csc")
        for _ in range(4):
            try:
                factor = splu(
                    (matrix + (shift + least) * one).tocsc(),
                    permc_spec="MMD_AT_PLUS_A",
                    diag_pivot_thresh=0.0,
                    options={"SymmetricMode": True},
                )
            except RuntimeError:  # exactly singular
                least *= 1e3
                continue
            break
        else:
            raise FloatingPointError("the tangent stiffness is not finite")
        self.negative = int(np.sum(factor.U.diagonal() < 0.0))
        self._precondition = factor.solve

    def _take_blocks(self, shift: float) -> None:
        nodes = self.elastic.nodes
        diagonal = self.elastic.stiffness_blocks(np.asarray(self._fresh_at))
        held = np.ones(3 * nodes, bool)
        held[self.free] = False
        held = held.reshape(nodes, 3)
        diagonal[held[:, :, None] | held[:, None, :]] = 0.0
        diagonal += np.eye(3) * (shift + SHIFT * self.diagonal)
        diagonal[held[:, :, None] & np.eye(3, dtype=bool)] = 1.0
        inverse = np.linalg.inv(diagonal)

        def precondition(r: Floats) -> Floats:
            full = np.zeros(3 * nodes)
            full[self.free] = r
            out: Floats = np.einsum("nij,nj->ni", inverse, full.reshape(nodes, 3))
            return out.ravel()[self.free]

        self.negative = 0
        self._precondition = precondition

    def times(self, w: Floats, shift: float = 0.0) -> Floats:
        """(K + shift) w on the free axes, at the state that `solve` was given."""
        full = np.zeros((self.elastic.nodes, 3))
        full.ravel()[self.free] = w
        product: Floats = self.elastic.stiffness_times(full).ravel()[self.free]
        return product + shift * w if shift else product

    def solve(
        self, u: Floats, right: Floats, *, tolerance: float = 1e-4, shift: float = 0.0
    ) -> Floats:
        """(K(u) + shift) d = right on the free axes: d, shape (nodes, 3), zero where held.

        With an indefinite tangent d is the Newton direction all the same, which need not lead
        downhill.
        """
        self.iterations += 1
        r = right.ravel()[self.free]
        self.elastic.stiffness_times(np.zeros_like(u), u)  # sets the state for the products
        limit = AGED if self.factorises else MOST_ITERATIONS

        def times(w: Floats) -> Floats:
            return self.times(w, shift)

        def attempt() -> tuple[Floats, int, bool]:
            return conjugate_gradients(
                times, r, self._precondition, tolerance=tolerance, limit=limit
            )

        x, used, done = attempt()
        fresh = self._fresh_at is not None and np.array_equal(self._fresh_at, u)
        if not done and not fresh:
            self.refresh(u, shift=shift)
            x, used, done = attempt()
        if not done and self.negative:
            x = self._refine(times, r)
        elif not done and used == 0:
            x = r * (np.linalg.norm(r) / max(abs(float(r @ times(r))), 1e-300))
        out = np.zeros_like(u)
        out.ravel()[self.free] = x
        return out

    def _refine(self, times: Callable[[Floats], Floats], r: Floats) -> Floats:
        """The factorisation of an indefinite tangent used directly, with two corrections."""
        x = self._precondition(r)
        for _ in range(2):
            x = x + self._precondition(r - times(x))
        return x


def _nothing(r: Floats) -> Floats:
    return r
