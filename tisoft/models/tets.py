"""Linear tets at rest: gradients, lumped masses, batches of lanes, and their stiffest mode.

    ∇N_1..3 = rows of [X_1 − X_0, X_2 − X_0, X_3 − X_0]⁻¹,  ∇N_0 = −Σ ∇N_1..3,  m_a = Σ ρ V/4

The largest frequency of one tet with its own lumped mass bounds that of any mesh it stands in
(Rayleigh quotients: a sum of quotients never exceeds the largest).  With the strain operator B,
λ_max(V Bᵀ C B) = λ_max(V √C (B Bᵀ) √C), a 6×6 problem instead of a 12×12 one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tisoft.geometry.topology import incidence

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


def gradients(points: Floats, tets: NDArray[np.integer]) -> tuple[Floats, Floats]:
    """∇N_1..3 [1/m], shape (tets, 3, 3), row c for corner c + 1, and volumes [m³], (tets,)."""
    corners = points[tets]
    edges = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
    return np.linalg.inv(edges), np.linalg.det(edges) / 6.0


def lumped_masses(tets: NDArray[np.integer], volumes: Floats, density: float, nodes: int) -> Floats:
    """Mass of each node [kg], shape (nodes,): a quarter of each of its tets."""
    quarters = np.repeat(density * volumes / 4.0, 4)
    return np.bincount(tets.ravel(), quarters, minlength=nodes).astype(np.float64)


def stiffest(gradient: Floats, lam: float, mu: float) -> Floats:
    """λ_max of Bᵀ C B per unit volume [Pa/m²] for Lamé constants lam, mu, shape (tets,)."""
    g = np.concatenate([-gradient.sum(axis=1, keepdims=True), gradient], axis=1)  # (tets, 4, 3)
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


def spread(gradient: Floats) -> Floats:
    """γ = λ_max of the 4×4 matrix ∇N_a·∇N_b [1/m²], shape (tets,)."""
    g = np.concatenate([-gradient.sum(axis=1, keepdims=True), gradient], axis=1)
    top: Floats = np.linalg.eigvalsh(np.einsum("eai,eaj->eij", g, g))[:, -1]
    return top


@dataclass(frozen=True)
class Batches:
    """Tets in rows of lanes, bodies kept apart; the last batch of a body is filled with tets of
    no volume.
    """

    nodes: Ints
    """Nodes, shape (batches, 4, lanes)."""
    shapes: Floats
    """∇N_1..3 row by row [1/m] and the volume [m³], shape (batches, 10, lanes)."""
    place: Ints
    """Where each tet lies, batch · lanes + lane, shape (tets,)."""


def batches(tets: Ints, gradient: Floats, volumes: Floats, lanes: int) -> Batches:
    """One body's tets in batches."""
    count = -(-len(tets) // lanes)
    filled = np.zeros((count * lanes, 4), np.int32)
    filled[:] = tets[0]
    filled[: len(tets)] = tets
    shapes = np.zeros((count * lanes, 10))
    shapes[: len(tets), :9] = gradient.reshape(-1, 9)
    shapes[: len(tets), 9] = volumes
    return Batches(
        np.ascontiguousarray(filled.reshape(count, lanes, 4).transpose(0, 2, 1)),
        np.ascontiguousarray(shapes.reshape(count, lanes, 10).transpose(0, 2, 1)),
        np.arange(len(tets), dtype=np.int32),
    )


def corner_lists(tets: Ints, place: Ints, nodes: int, lanes: int) -> tuple[Ints, Ints]:
    """For each node its tets' x-force slots in element order (starts, corners).

    The y and z forces lie `lanes` and 2 `lanes` further on; see `incidence` for the lists.
    """
    starts, slots = incidence(tets, nodes)
    where, corner = place[slots // 4], slots % 4
    flat = (where // lanes) * (12 * lanes) + 3 * corner * lanes + where % lanes
    return starts, flat.astype(np.int32)
