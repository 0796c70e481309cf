"""With which shares the nodes of a cell carry a point in it: the cell's shape functions there.

x = Σ N_a(ξ) X_a,   ξ by Newton's method;   hexahedra: N_a = Π (1 + ξ_i ξ_ai)/8;
quadratic tets: N_a = L_a (2 L_a − 1), N_ab = 4 L_a L_b, ξ = L_1..3
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tisoft.geometry.cells import LATTICE, QUADRATIC_EDGES, SIGNS, tet10_slopes

Floats = NDArray[np.float64]

ROUNDING = 1e-12
"""Distance from its place, in sizes of the cell, at which a point is found."""
MOST_STEPS = 20

_CORNERS = np.eye(4)
PLACES: dict[str, Floats] = {
    "tet4": _CORNERS[:, 1:],
    "tet10": np.concatenate([_CORNERS, _CORNERS[QUADRATIC_EDGES].mean(axis=1)])[:, 1:],
    "hex8": SIGNS[[1, 2, 4]].T[LATTICE].astype(float),
}
"""ξ of the nodes of a cell, shape (corners, 3)."""


def shape(word: str, at: Floats) -> tuple[Floats, Floats]:
    """N_a at ξ and ∂N_a/∂ξ, shapes (points, corners) and (points, corners, 3)."""
    if word == "hex8":
        corner = PLACES["hex8"]
        f = 1.0 + corner * at[:, None]
        turn = [(i, (i + 1) % 3, (i + 2) % 3) for i in range(3)]
        slopes = [corner[:, i] * f[..., j] * f[..., k] / 8.0 for i, j, k in turn]
        return f.prod(axis=2) / 8.0, np.stack(slopes, axis=2)
    L = np.column_stack([1.0 - at.sum(axis=1), at])
    i, j = QUADRATIC_EDGES.T
    return np.hstack([L * (2.0 * L - 1.0), 4.0 * L[:, i] * L[:, j]]), tet10_slopes(L)


def shares(word: str, X: Floats, places: Floats, start: Floats) -> Floats:
    """N_a of places [m] in cells with nodes X [m], shape (places, corners); nan where there is
    none, as far outside of a bent cell.

    Args:
        word: kind of the cells, "hex8" or "tet10".
        X: shape (places, corners, 3), in the mesh's order.
        places: shape (places, 3).
        start: a guess of ξ, shape (places, 3).
    """
    at = start.copy()
    size = np.ptp(X, axis=1).max(axis=1, initial=0.0)
    N, slopes = shape(word, at)
    for _ in range(MOST_STEPS):
        left = places - np.einsum("pa,pai->pi", N, X)
        if not (np.abs(left).max(axis=1, initial=0.0) > ROUNDING * size).any():
            break
        J = np.einsum("pai,paj->pij", X, slopes)
        J[np.abs(np.linalg.det(J)) < 1e-12 * size**3] = np.eye(3)
        at = at + np.linalg.solve(J, left[..., None])[..., 0]
        N, slopes = shape(word, np.clip(at, -10.0, 10.0))
    left = places - np.einsum("pa,pai->pi", N, X)
    N[np.abs(left).max(axis=1, initial=0.0) > 1e3 * ROUNDING * size] = np.nan
    return N
