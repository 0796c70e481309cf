"""Rays, what they hit, and the patch of nodes that carries a point of a body."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

PATCH = 12
"""Nodes nearest to a grabbed point that carry it: about two rings of neighbours."""


def pick(
    origin: Floats, direction: Floats, positions: Floats, triangles: NDArray[np.int64]
) -> tuple[float, int, Floats] | None:
    """First triangle on a ray (Möller and Trumbore 1997): distance, its row, barycentric weights;
    None where the ray meets none.
    """
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    one, two = b - a, c - a
    p = np.cross(direction, two)
    s = origin - a
    q = np.cross(s, one)
    with np.errstate(all="ignore"):
        scale = 1.0 / np.einsum("ij,ij->i", one, p)
        u = scale * np.einsum("ij,ij->i", s, p)
        v = scale * (q @ direction)
        t = scale * np.einsum("ij,ij->i", two, q)
        hit = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1.0 + 1e-9) & (t > 0.0)
    if not hit.any():
        return None
    i = int(np.argmin(np.where(hit, t, np.inf)))
    return float(t[i]), i, np.array([1.0 - u[i] - v[i], u[i], v[i]])


def patch(points: Floats, point: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Nodes near a point of the rest shape and weights w, shape (n,): Σ w = 1 and Σ w X = point.

    Moving least squares of order one (Lancaster and Salkauskas 1981), so that Σ w x stays the same
    material point however the body turns and shears.  Where the nodes lie in a plane or on a line,
    this holds within it.
    """
    away = np.linalg.norm(points - point, axis=1)
    rows = np.argsort(away, kind="stable")[:PATCH]
    reach = max(float(away[rows[-1]]), 1e-300)
    d = (points[rows] - point) / reach
    bell = np.exp(-2.0 * (d * d).sum(axis=1))
    basis = np.column_stack([np.ones(len(rows)), d])
    normal = basis.T @ (bell[:, None] * basis)
    weights: Floats = bell * (basis @ np.linalg.pinv(normal, rcond=1e-6)[:, 0])
    return rows, weights / weights.sum()
