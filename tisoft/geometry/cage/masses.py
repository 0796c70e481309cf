"""Masses of a cage's nodes: a factor that makes mass, centre and inertia the body's.

    m_a = w_a (1 + L tanh(p(x_a)/L)),   L = .3,   p a quadratic polynomial

Ten numbers, found by Newton's method, so that Σ m, Σ m x and Σ m x xᵀ are those of what the surface
encloses.  Where no factor within ± L reaches them, the second moments go as far as they can; mass
and centre stay exact.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

LIMIT = 0.3
"""How much a node may gain or lose."""
PAIRS = np.array([[0, 0], [1, 1], [2, 2], [1, 2], [0, 2], [0, 1]])
MOST_STEPS = 60
ROUNDING = 1e-12


def balanced(
    x: Floats, weights: Floats, moments: tuple[float, Floats, Floats]
) -> tuple[Floats, float]:
    """The factor of each node, and the largest relative error left of the three moments of inertia.

    Args:
        x: places of the nodes [m], shape (nodes, 3).
        weights: their masses before, of density 1 [m³].
        moments: V, ∫ x dV and ∫ x xᵀ dV of the body (`surface.solid_moments`).
    """
    volume, first, second = moments
    center = first / volume
    scale = np.ptp(x, axis=0) / 2.0
    y = (x - center) / scale
    basis = np.column_stack([np.ones(len(y)), y, *[y[:, i] * y[:, j] for i, j in PAIRS]])
    spread = (second - volume * np.outer(center, center)) / np.outer(scale, scale)
    wanted = np.concatenate([[volume], np.zeros(3), [spread[i, j] for i, j in PAIRS]])
    now = basis.T @ weights
    factor = np.full(len(x), volume / weights.sum())
    for share in np.linspace(1.0, 0.0, 11):
        aim = wanted.copy()
        aim[4:] = now[4:] + share * (wanted[4:] - now[4:])
        found = _solved(basis, weights, aim)
        if found is not None:
            factor = found
            break
    return factor, _inertia_error(x - center, weights * factor, second, center, volume)


def _solved(basis: Floats, weights: Floats, aim: Floats) -> Floats | None:
    """The factor with moments `aim`, where there is one."""
    k = np.zeros(basis.shape[1])

    def left(k: Floats) -> tuple[Floats, Floats]:
        swing = np.tanh(basis @ k / LIMIT)
        return aim - basis.T @ (weights * (1.0 + LIMIT * swing)), swing

    residual, swing = left(k)
    for _ in range(MOST_STEPS):
        size = np.abs(residual).max()
        if size < ROUNDING * aim[0]:
            return np.asarray(1.0 + LIMIT * swing)
        slope = basis.T @ ((weights * (1.0 - swing**2))[:, None] * basis)
        slope += 1e-14 * np.trace(slope) * np.eye(len(k))
        step = np.linalg.lstsq(slope, residual, rcond=None)[0]
        way = 1.0
        while np.abs(left(k + way * step)[0]).max() > size:
            way /= 2.0
            if way < 1e-3:
                return None
        k = k + way * step
        residual, swing = left(k)
    return None


def _inertia_error(
    arm: Floats, mass: Floats, second: Floats, center: Floats, volume: float
) -> float:
    own = np.einsum("n,ni,nj->ij", mass, arm, arm)
    body = second - volume * np.outer(center, center)
    turning = [np.linalg.eigvalsh(np.trace(C) * np.eye(3) - C) for C in (own, body)]
    return float(np.abs(turning[0] / turning[1] - 1.0).max())
