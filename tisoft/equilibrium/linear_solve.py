"""Newton's linear systems K(u) d = r on the free axes: matrix-free preconditioned CG.

(With loads that turn with the surface K is the tangent of the whole balance, which need not be
symmetric, and GMRES takes the place of CG.)

The preconditioner is a sparse factorisation of the tangent at an earlier state, made anew when it
has aged; a body too large for that takes the 3×3 blocks on the diagonal.  The factorisation keeps
its pivots on the diagonal, so that their signs count the negative eigenvalues of the tangent
(Sylvester's law of inertia): whether a state is stable.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, gmres

from tisoft import runtime
from tisoft.equilibrium.balance import Balance
from tisoft.equilibrium.frontal import factorised
from tisoft.errors import OutOfTime

Floats = NDArray[np.float64]

FACTOR_LIMIT = 150_000
"""Unknowns above which no factorisation is made: it would take gigabytes."""
SHIFT = 1e-12
"""Added to the diagonal, as a share of its largest entry, so that mechanisms factorise."""
LOOSE_SHIFT = 1e-9
"""The same for bodies that can move as a whole, whose motion must not look like an instability."""
ROUNDING = 16 * np.finfo(np.float64).eps
AGED = 25
"""CG iterations after which a factorisation is too old."""
MOST_ITERATIONS = 5000


_latest: list[tuple[Callable[[], float], float]] = []


@contextmanager
def latest(seconds: float, clock: Callable[[], float] = time.perf_counter) -> Iterator[None]:
    """Let solves inside raise OutOfTime once so many seconds are over on a clock, compiling left
    out."""
    _latest.append((clock, clock() - runtime.compile_seconds + seconds))
    try:
        yield
    finally:
        _latest.pop()


def _is_late() -> bool:
    if not _latest:
        return False
    clock, end = _latest[-1]
    return clock() - runtime.compile_seconds > end


def conjugate_gradients(
    times: Callable[[Floats], Floats],
    right: Floats,
    precondition: Callable[[Floats], Floats],
    *,
    tolerance: float,
    limit: int,
) -> tuple[Floats, bool]:
    """Solve K x = right; returns x, and whether the residual fell to `tolerance`.

    Stops at a direction of no positive curvature (Steihaug 1983) with what it has so far.
    """
    x = np.zeros_like(right)
    r = right.copy()
    goal = tolerance * np.linalg.norm(right)
    z = precondition(r)
    p = z
    slope = float(r @ z)
    for _ in range(limit):
        if np.linalg.norm(r) <= goal:
            return x, True
        product = times(p)
        curvature = float(p @ product)
        if not (curvature > 0.0 and slope > 0.0):
            return x, False
        x = x + (slope / curvature) * p
        r = r - (slope / curvature) * product
        z = precondition(r)
        slope, before = float(r @ z), slope
        p = z + (slope / before) * p
    return x, bool(np.linalg.norm(r) <= goal)


class Solver:
    """Solves with the tangent of one body on its free axes."""

    def __init__(self, balance: Balance) -> None:
        self.balance = balance
        self.basis = balance.held.basis
        """T from unknowns to components of all nodes."""
        self.unknowns = self.basis.shape[1]
        self.negative = 0
        """Negative eigenvalues of the tangent that was last factorised (0 where none was)."""
        self.iterations = 0
        self.diagonal = 0.0
        """Largest stiffness on the tangent's diagonal [N/m]."""
        self._fresh_at: tuple[Floats, float] | None = None
        self._loose: Floats | None = None
        self._precondition: Callable[[Floats], Floats] = _nothing

    @property
    def factorises(self) -> bool:
        """Whether the body is small enough for a factorisation."""
        return self.unknowns <= FACTOR_LIMIT

    def refresh(self, u: Floats, factor: float, *, shift: float = 0.0) -> None:
        """Make the preconditioner anew from the tangent + shift [N/m]."""
        matrix = self.balance.held.on_unknowns(self.balance.tangent(u, factor))
        self.diagonal = float(np.abs(matrix.diagonal()).max(initial=0.0)) or 1.0
        self._fresh_at = u.copy(), factor
        motions = self.balance.rigid_motions(u) @ self.basis
        self._loose = motions if len(motions) else None
        if self.factorises:
            self._factorise(matrix, shift)
        else:
            self._take_blocks(u, shift)

    def rounding(self, u: Floats) -> float:
        """Forces [N] that rounding leaves at the displacements u."""
        return ROUNDING * self.diagonal * float(np.abs(u).max())

    def _factorise(self, matrix: sparse.csc_matrix, shift: float) -> None:
        least = (SHIFT if self._loose is None else LOOSE_SHIFT) * self.diagonal
        one = sparse.identity(matrix.shape[0], format="csc")
        for _ in range(4):
            try:
                factor, self.negative = factorised(
                    matrix + (shift + least) * one, self.balance.held
                )
            except RuntimeError:  # exactly singular
                least *= 1e3
                continue
            break
        else:
            raise FloatingPointError("the tangent stiffness is not finite")
        self._precondition = factor.solve

    def _take_blocks(self, u: Floats, shift: float) -> None:
        """The 3×3 blocks of the diagonal, with 1 on held axes."""
        diagonal = self.balance.elastic.stiffness_blocks(u)
        held = self.balance.held.axes
        diagonal[held[:, :, None] | held[:, None, :]] = 0.0
        diagonal += np.eye(3) * (shift + SHIFT * self.diagonal)
        diagonal[held[:, :, None] & np.eye(3, dtype=bool)] = 1.0
        inverse = np.linalg.inv(diagonal)

        def precondition(r: Floats) -> Floats:
            out: Floats = np.einsum("nij,nj->ni", inverse, self.spread(r))
            return self.gather(out)

        self.negative = 0
        self._precondition = precondition

    def times(self, w: Floats) -> Floats:
        """Tangent times w of the unknowns, at the state that `solve` was given last."""
        return self.gather(self.balance.tangent_times(self.spread(w)))

    def gather(self, forces: Floats) -> Floats:
        """Tᵀ of forces on all nodes, shape (unknowns,)."""
        return np.asarray(self.basis.T @ forces.ravel(), np.float64)

    def spread(self, unknowns: Floats) -> Floats:
        """T q, shape (nodes, 3)."""
        return np.asarray((self.basis @ unknowns).reshape(-1, 3), np.float64)

    def solve(
        self,
        u: Floats,
        factor: float,
        right: Floats,
        *,
        tolerance: float = 1e-4,
        shift: float = 0.0,
    ) -> Floats:
        """(tangent + shift) d = right on the free axes: d, shape (nodes, 3), zero where held.

        With an indefinite tangent d is the Newton direction all the same, which need not lead
        downhill.
        """
        self.iterations += 1
        if _is_late():
            raise OutOfTime("there was no time to find the equilibrium")
        r = self._bound(self.gather(right))
        self.balance.look(u, factor)

        def times(w: Floats) -> Floats:
            product = self.times(w)
            return product + shift * w if shift else product

        x, done = self._attempt(times, r, tolerance)
        fresh = self._fresh_at is not None and np.array_equal(self._fresh_at[0], u)
        if not done and not fresh:
            self.refresh(u, factor, shift=shift)
            x, done = self._attempt(times, r, tolerance)
        if not done and self.negative and not self.balance.followers:
            x = self._refine(times, r)
        elif not done and not x.any():
            x = r * (np.linalg.norm(r) / max(abs(float(r @ times(r))), 1e-300))
        return self.spread(self._bound(x))

    def _bound(self, w: Floats) -> Floats:
        """w without the rigid motions of pieces that nothing holds: they cost nothing, and any
        would do."""
        return w if self._loose is None else w - self._loose.T @ (self._loose @ w)

    def _attempt(
        self, times: Callable[[Floats], Floats], r: Floats, tolerance: float
    ) -> tuple[Floats, bool]:
        """One run of the iteration, and whether it came to its end."""
        limit = AGED if self.factorises else MOST_ITERATIONS
        if not self.balance.followers:
            return conjugate_gradients(
                times, r, self._precondition, tolerance=tolerance, limit=limit
            )
        # Loads that turn with the surface make the tangent unsymmetric: GMRES.
        size = (len(r), len(r))
        x, failed = gmres(
            LinearOperator(size, matvec=times, dtype=np.float64),
            r,
            M=LinearOperator(size, matvec=self._precondition, dtype=np.float64),
            rtol=tolerance,
            atol=0.0,
            restart=2 * AGED,
            maxiter=1 if self.factorises else MOST_ITERATIONS // (2 * AGED),
        )
        return x, failed == 0

    def _refine(self, times: Callable[[Floats], Floats], r: Floats) -> Floats:
        """The factorisation of an indefinite tangent used directly, with two corrections."""
        x = self._precondition(r)
        for _ in range(2):
            x = x + self._precondition(r - times(x))
        return x


def _nothing(r: Floats) -> Floats:
    return r
