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
    """λ_max of Bᵀ C B [Pa/m²] for Lamé constants lam, mu, shape (cells,), as that of the 6×6 matrix
    √C (B Bᵀ) √C; g: ∇N_a at one point of each cell [1/m], shape (cells, corners, 3).
    """
    gram = np.einsum("eai,eaj->eij", g, g)
    # B Bᵀ in Voigt order xx yy zz yz zx xy with engineering shears.
    size = np.zeros((len(g), 6, 6))
    pairs = [(0, 0), (1, 1), (2, 2), (1, 2), (2, 0), (0, 1)]
    for p, (i, j) in enumerate(pairs):
        for q, (k, m) in enumerate(pairs):
            total = (i == k) * gram[:, j, m] + (j == m) * gram[:, i, k]
            total = total + (i == m) * gram[:, j, k] + (j == k) * gram[:, i, m]
            size[:, p, q] = total / ((1 + (i == j)) * (1 + (k == m)))
    law = np.diag([2.0 * mu] * 3 + [mu] * 3)
    law[:3, :3] += lam
    values, vectors = np.linalg.eigh(law)
    root = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    top: Floats = np.linalg.eigvalsh(root @ size @ root)[:, -1]
    return top
