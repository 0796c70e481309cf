"""Mass-tensor model: linear elasticity with its stiffness stored on nodes and edges.

    f_i = −Σ_j K_ij u_j,   K_ab = V [λ ∇N_a ∇N_bᵀ + μ ∇N_b ∇N_aᵀ + μ (∇N_a·∇N_b) I]

summed over the tets that hold both nodes: the gradient of the strain energy, so the same force as
linear finite elements to rounding (Cotin, Delingette and Ayache 2000; Picinbono, Delingette and
Ayache 2003 carried the name to large displacements).  A tet mesh has about 14 neighbours a node:
where elements are linear and the material does not change, rows replace the loop over tets.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tisoft.models.consistent_mass import summed

Floats = NDArray[np.float64]


def tensor_blocks(gradient: Floats, volumes: Floats, lam: float, mu: float) -> Floats:
    """K_ab [N/m] of each tet for Lamé constants lam, mu, shape (tets, 4, 4, 3, 3)."""
    g = np.concatenate([-gradient.sum(axis=1, keepdims=True), gradient], axis=1)
    outer = np.einsum("eai,ebj->eabij", g, g)
    dot = np.einsum("eai,ebi->eab", g, g)
    blocks: Floats = lam * outer + mu * outer.transpose(0, 1, 2, 4, 3)
    blocks += mu * dot[..., None, None] * np.eye(3)
    return blocks * volumes[:, None, None, None, None]


def tensor_rows(
    tets: NDArray[np.integer], blocks: Floats
) -> tuple[NDArray[np.int64], NDArray[np.int64], Floats]:
    """Rows (node, neighbour, 3×3 block as 9 numbers), by node and neighbour, the node included."""
    rows = np.repeat(tets, 4, axis=1).ravel().astype(np.int64)
    columns = np.tile(tets, (1, 4)).ravel().astype(np.int64)
    return summed(rows, columns, blocks.reshape(-1, 9))
