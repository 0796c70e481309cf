"""Displacements of one mesh carried over to the nodes of another: where a finer answer is sought.

    u(x) ≈ a₀,   a minimises Σ_k w_k |u_k − Σ_i a_i p_i(x_k − x)|²,   w = 1/(|x_k − x|² + ε)²

with p the polynomials up to degree 2 (moving least squares, Lancaster and Salkauskas 1981): near
enough for Newton's method, and no cell has to be found, whatever the elements.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Floats = NDArray[np.float64]

NEIGHBOURS = 24
ON_NODE = 3e-2
"""√ε, as a share of the distance of the farthest neighbour."""
RIDGE = 1e-10
"""Of polynomials that the neighbours do not tell apart, as where all lie in a plane."""


def carried(points: Floats, u: Floats, to: Floats) -> Floats:
    """u at other points.

    Args:
        points: at rest [m], shape (nodes, 3).
        u: their displacements [m], shape (nodes, 3).
        to: other points [m], shape (n, 3).
    """
    count = min(NEIGHBOURS, len(points))
    off, near = cKDTree(points).query(to, k=[*range(1, count + 1)])
    size = np.maximum(off[:, -1:], 1e-300)
    d = (points[near] - to[:, None]) / size[:, :, None]
    x, y, z = np.moveaxis(d, 2, 0)
    p = np.stack([np.ones_like(x), x, y, z, x * x, y * y, z * z, x * y, y * z, z * x], axis=2)
    w = 1.0 / ((off / size) ** 2 + ON_NODE**2) ** 2
    weighted = p.transpose(0, 2, 1) * w[:, None, :]
    normal = weighted @ p
    largest = np.trace(normal, axis1=1, axis2=2)[:, None, None]
    found = np.linalg.solve(normal + RIDGE * largest * np.eye(10), weighted @ u[near])
    return np.asarray(found[:, 0])
