"""Element matrices at rest, where every law is Hooke's, and their largest eigenvalues (NumPy, f64).

K_ab = Σ_q V_q [λ ∇N_a ∇N_bᵀ + μ ∇N_b ∇N_aᵀ + μ (∇N_a·∇N_b) I]
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

AT_ONCE = 4000
"""Element matrices that are made at a time."""
DIGITS = 10
"""Decimal digits to which elements must agree to count as the same."""


def hooke_blocks(gradients: Floats, volumes: Floats, lam: float, mu: float) -> Floats:
    """K_e [N/m], shape (cells, 3 corners, 3 corners).

    Args:
        gradients: ∇N_a at the points [1/m], shape (cells, points, corners, 3).
        volumes: V_q [m³], shape (cells, points).
        lam, mu: Lamé constants [Pa].
    """
    cells, _, corners, _ = gradients.shape
    weighted = gradients * volumes[:, :, None, None]
    outer = np.einsum("eqai,eqbj->eaibj", weighted, gradients, optimize=True)
    total = lam * outer + mu * outer.transpose(0, 1, 4, 3, 2)
    dot = np.einsum("eqai,eqbi->eab", weighted, gradients, optimize=True)
    for i in range(3):
        total[:, :, i, :, i] += mu * dot
    return np.asarray(total.reshape(cells, 3 * corners, 3 * corners), np.float64)


def top(matrices: Floats) -> Floats:
    """λ_max of symmetric matrices, shape (n, k, k)."""
    return np.asarray(np.linalg.eigvalsh(matrices)[:, -1], np.float64)


def each(rest: Floats, function: Callable[[Floats], Floats]) -> Floats:
    """function(rest) of each row, computed once for rows that agree."""
    if not len(rest):
        return np.empty(0)
    size = np.abs(rest).max(axis=0)
    size[size == 0.0] = 1.0
    _, first, index = np.unique(
        np.round(rest / size, DIGITS), axis=0, return_index=True, return_inverse=True
    )
    found = [function(rest[first[k : k + AT_ONCE]]) for k in range(0, len(first), AT_ONCE)]
    return np.concatenate(found)[index.reshape(-1)]


def stiffest(g: Floats, lam: float, mu: float) -> Floats:
    """λ_max of Bᵀ C B [Pa/m²] for Lamé constants lam, mu, shape (cells,).

    In the principal axes of G = Σ ∇N_a ∇N_aᵀ, with values γ, a shear stands alone: μ (γ_i + γ_j).
    The stretches meet in 2μ diag(γ) + λ √γ √γᵀ, whose characteristic polynomial asks for the
    invariants of G only.

    Args: g: ∇N_a at one point of each cell [1/m], shape (cells, corners, 3).
    """
    gram = np.einsum("eai,eaj->eij", g, g)
    first = np.trace(gram, axis1=1, axis2=2)
    second = (first**2 - np.einsum("eij,eij->e", gram, gram)) / 2.0
    third = np.linalg.det(gram)
    _, stretch = _roots(
        (2.0 * mu + lam) * first,
        4.0 * mu * (mu + lam) * second,
        4.0 * mu**2 * (2.0 * mu + 3.0 * lam) * third,
    )
    if lam >= 0.0:
        return stretch
    least, _ = _roots(first, second, third)
    return np.maximum(stretch, mu * (first - least))


def _roots(a: Floats, b: Floats, c: Floats) -> tuple[Floats, Floats]:
    """The least and the largest of the three real roots of x³ − a x² + b x − c (Viète)."""
    middle = a / 3.0
    spread = np.sqrt(np.maximum(middle**2 - b / 3.0, 0.0))
    skew = middle**3 - 0.5 * b * middle + 0.5 * c
    cosine = np.divide(skew, spread**3, out=np.ones_like(skew), where=spread > 0.0)
    angle = np.arccos(np.clip(cosine, -1.0, 1.0)) / 3.0
    return middle + 2.0 * spread * np.cos(
        angle + 2.0 / 3.0 * np.pi
    ), middle + 2.0 * spread * np.cos(angle)
