"""Quadratic tets with straight edges, and with edges of any shape (see `quadratic`).

g_b = ∂L_b/∂X = rows of (∂X/∂L)⁻¹,   V_q = det(∂X/∂L)/24   at each point, or once
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tisoft.elements.quadratic import Quadratic
from tisoft.geometry.cells import QUADRATIC_EDGES, tet10_jacobians

Floats = NDArray[np.float64]

STRAIGHT = 1e-10
"""Share of an edge's length by which its node may lie off its middle."""


class Tet10(Quadratic):
    """With straight edges."""

    numbers = 10
    stride = 0
    """Rest numbers from one point to the next."""

    @staticmethod
    def rest(points: Floats, cells: NDArray[np.integer]) -> Floats:
        """`rest` of each cell, shape (cells, 10), from rest points [m]."""
        return per_point(points[cells])[:, 0]

    @staticmethod
    def at_points(rest: Floats) -> tuple[Floats, Floats]:
        """g_1..3 [1/m], shape (cells, 4, 3, 3), and V_q [m³], shape (cells, 4)."""
        count = len(rest)
        g = np.broadcast_to(rest[:, None, :9].reshape(count, 1, 3, 3), (count, 4, 3, 3))
        return g, np.repeat(rest[:, 9:10], 4, axis=1)


class CurvedTet10(Quadratic):
    """With edges of any shape."""

    numbers = 40
    stride = 10

    @staticmethod
    def rest(points: Floats, cells: NDArray[np.integer]) -> Floats:
        """`rest` of each cell, shape (cells, 40), from rest points [m]."""
        return per_point(points[cells]).reshape(len(cells), -1)

    @staticmethod
    def at_points(rest: Floats) -> tuple[Floats, Floats]:
        """g_1..3 [1/m], shape (cells, 4, 3, 3), and V_q [m³], shape (cells, 4)."""
        rows = rest.reshape(-1, 4, 10)
        return rows[..., :9].reshape(-1, 4, 3, 3), rows[..., 9]


def per_point(X: Floats) -> Floats:
    """g_1..3 and V_q of each point, shape (cells, 4, 10), of nodes X [m]."""
    J = tet10_jacobians(X)
    rows = [np.linalg.inv(J).reshape(len(X), 4, 9), np.linalg.det(J)[..., None] / 24.0]
    return np.concatenate(rows, axis=2)


def element_of(points: Floats, cells: NDArray[np.integer]) -> type[Quadratic]:
    """`Tet10` where all edges are straight with their nodes in the middle, else `CurvedTet10`."""
    X = points[cells]
    a, b = X[:, QUADRATIC_EDGES[:, 0]], X[:, QUADRATIC_EDGES[:, 1]]
    off = np.linalg.norm(X[:, 4:] - 0.5 * (a + b), axis=2)
    straight = (off <= STRAIGHT * np.linalg.norm(b - a, axis=2)).all()
    return Tet10 if straight else CurvedTet10
