# mypy: ignore-errors
"""Consistent mass: the matrix solve M a = f of the lecture, matrix-free.

    M_ab = Σ ρ V/20 (1 + δ_ab)   over the tets that hold nodes a and b

With D = diag M, the eigenvalues of D⁻¹M lie in [1/2, 5/2] for linear tets on any mesh (Wathen
1987), also with held nodes taken out.  So a fixed Chebyshev iteration solves it: its error falls
by 0.382 an iteration, without dot products or a factorisation.  Rows sum to the lumped masses.

    θ = 3/2, δ = 1, σ = θ/δ;   d₀ = r₀/θ;   a += d, r −= D⁻¹M d, d ← ρ'ρ d + (2ρ'/δ) r,
    ρ' = 1/(2σ − ρ),  r₀ = D⁻¹f        (Saad, Iterative methods for sparse linear systems, 12.1)
"""

from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray

CENTER = 1.5
ITERATIONS = {"f32": 18, "f64": 36}
"""0.382^k reaches the rounding of the precision."""


def mass_rows(
    tets: NDArray[np.integer], mass: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Entries (row, column, M_ab [kg]) of tets of the given masses [kg], each pair once, by row."""
    rows = np.repeat(tets, 4, axis=1).ravel().astype(np.int64)
    columns = np.tile(tets, (1, 4)).ravel().astype(np.int64)
    weight = np.full((4, 4), 1.0 / 20.0) + np.eye(4) / 20.0
    values = (mass[:, None] * weight.ravel()).ravel()
    row, column, entries = summed(rows, columns, values[:, None])
    return row, column, entries[:, 0]


def summed(
    rows: NDArray[np.int64], columns: NDArray[np.int64], blocks: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Entries of equal (row, column) added up, by row and column; blocks has shape (entries, k)."""
    span = int(columns.max(initial=0)) + 1
    keys, index = np.unique(rows * span + columns, return_inverse=True)
    total = np.stack([np.bincount(index, b, minlength=len(keys)) for b in blocks.T], axis=1)
    return keys // span, keys % span, total


def row_starts(rows: NDArray[np.int64], nodes: int) -> NDArray[np.int32]:
    """Where each node's entries begin among entries sorted by row, shape (nodes + 1,)."""
    starts = np.zeros(nodes + 1, np.int32)
    np.cumsum(np.bincount(rows, minlength=nodes), out=starts[1:])
    return starts


@ti.func
def begin_solve(
    i,
    f,
    held,
    diagonal: ti.template(),
    acceleration: ti.template(),
    residual: ti.template(),
    direction: ti.template(),
):
    """a = 0, r = D⁻¹f, d = r/θ at node i; held axes stay out."""
    for c in ti.static(range(3)):
        r = f[c] / diagonal[i]
        if held & (1 << c):
            r = 0.0 * r
        acceleration[i, c] = 0.0 * r
        residual[i, c] = r
        direction[0, i, c] = r / CENTER


@ti.func
def iterate_solve(
    i,
    k,
    held,
    starts: ti.template(),
    columns: ti.template(),
    entries: ti.template(),
    diagonal: ti.template(),
    acceleration: ti.template(),
    residual: ti.template(),
    direction: ti.template(),
):
    """Iteration k (from 0) at node i; reads direction[k % 2], writes direction[1 - k % 2]."""
    here = k % 2
    product = 0.0 * ti.Vector([entries[0], entries[0], entries[0]])
    for q in range(starts[i], starts[i + 1]):
        j = columns[q]
        for c in ti.static(range(3)):
            product[c] += entries[q] * direction[here, j, c]
    rho = 0.0 * entries[0] + 1.0 / CENTER
    for _ in range(k):
        rho = 1.0 / (2.0 * CENTER - rho)
    ahead = 1.0 / (2.0 * CENTER - rho)
    for c in ti.static(range(3)):
        d = direction[here, i, c]
        r = residual[i, c] - product[c] / diagonal[i]
        if held & (1 << c):
            r = 0.0 * r
        acceleration[i, c] = acceleration[i, c] + d
        residual[i, c] = r
        direction[1 - here, i, c] = ahead * rho * d + 2.0 * ahead * r


def residual_share(residual: Any, diagonal: Any, force: NDArray[np.float64]) -> float:
    """Largest |f − M a| of a solve over the largest |f|; 0 where nothing pushes."""
    left = np.abs(np.asarray(residual) * np.asarray(diagonal)[:, None]).max(initial=0.0)
    size = np.abs(force).max(initial=0.0)
    return float(left / size) if size > 0 else 0.0
