"""Displacements anywhere in a mesh: the cell that holds a point, and its shape functions there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tisoft.geometry.cells import QUADRATIC_EDGES
from tisoft.geometry.mesh import Mesh

Floats = NDArray[np.float64]

NEAR = 24
"""Cells, by the distance of their middles, among which a point looks for its own."""
SAME = 1e-9
"""Share of the body's size within which a point is a node."""
SIGNS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1],
     [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], float,
)  # fmt: skip
"""Corners of the unit hexahedron, in the order of VTK."""


def carrier(mesh: Mesh, point: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Nodes and weights that give values at a point [m] of a body at rest: Σ w_k u_k."""
    off = np.linalg.norm(mesh.points - point, axis=1)
    node = int(off.argmin())
    if off[node] <= SAME * float(np.ptp(mesh.points, axis=0).max()) or not mesh.cells:
        return np.array([node]), np.ones(1)
    best: tuple[float, NDArray[np.int64], Floats] | None = None
    for word, cells in mesh.cells.items():
        middles = mesh.points[cells].mean(axis=1)
        near = np.argsort(np.linalg.norm(middles - point, axis=1))[:NEAR]
        for nodes in cells[near].astype(np.int64):
            outside, weights = _shares(word, mesh.points[nodes], point)
            if best is None or outside < best[0]:
                best = outside, nodes, weights
    assert best is not None
    return best[1], best[2]


def _shares(word: str, X: Floats, point: Floats) -> tuple[float, Floats]:
    """How far the point lies outside of a cell, in its size, and the shape functions there."""
    if word == "hex8":
        return _of_hex(X, point)
    local = np.linalg.solve((X[1:4] - X[0]).T, point - X[0])
    L = np.concatenate([[1.0 - local.sum()], local])
    outside = float(max(0.0, -L.min()))
    if word == "tet4":
        return outside, L
    a, b = QUADRATIC_EDGES.T
    return outside, np.concatenate([L * (2.0 * L - 1.0), 4.0 * L[a] * L[b]])


def _of_hex(X: Floats, point: Floats) -> tuple[float, Floats]:
    """By Newton's method on the trilinear map."""
    r = np.zeros(3)
    for _ in range(12):
        factors = 1.0 + SIGNS * r
        N = factors.prod(axis=1) / 8.0
        grad = np.stack(
            [SIGNS[:, k] * np.delete(factors, k, axis=1).prod(axis=1) / 8.0 for k in range(3)]
        )
        r = np.clip(r + np.linalg.solve((grad @ X).T, point - N @ X), -3.0, 3.0)
    N = (1.0 + SIGNS * r).prod(axis=1) / 8.0
    return float(max(0.0, np.abs(r).max() - 1.0)) / 2.0, N
