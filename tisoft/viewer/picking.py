"""Rays, what they hit, and the patch of nodes that carries a point of a body."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tisoft.step.grab import patch_weights

Floats = NDArray[np.float64]

PATCH = 16
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


def patch(points: Floats, mass: Floats, point: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Nodes near a point of the rest shape and their weights for a hand (`grab.patch_weights`).

    Args:
        points: of the body at rest [m], shape (nodes, 3).
        mass: lumped [kg], shape (nodes,).
        point: [m], shape (3,).
    """
    rows = np.argsort(np.linalg.norm(points - point, axis=1), kind="stable")[:PATCH]
    return rows, patch_weights(points[rows], mass[rows], point)
