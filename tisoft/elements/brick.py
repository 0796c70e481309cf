# mypy: ignore-errors
"""The hexahedron whose sides lie along the axes: b_ai = ±s_i/8, γ_h = Γ_h/8 (see `hexahedron`).

| symbol | name         | unit |
| ------ | ------------ | ---- |
| s_i    | `rest[0..2]` | 1/m  |
| V      | `rest[3]`    | m³   |
"""

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from tisoft.elements.hexahedron import MODES, Hexahedron

Floats = NDArray[np.float64]


class Brick(Hexahedron):
    """A hexahedron with its sides along the axes: four numbers."""

    numbers = 4

    @staticmethod
    def rest(points: Floats, cells: NDArray[np.integer]) -> Floats:
        """`rest` of each cell, shape (cells, 4), from rest points [m]."""
        size = points[cells[:, 7]] - points[cells[:, 0]]
        return np.concatenate([2.0 / size, size.prod(axis=1)[:, None]], axis=1)

    @staticmethod
    def means(rest: Floats) -> Floats:
        """β_1..7 [1/m], shape (cells, 7, 3)."""
        beta = np.zeros((len(rest), 7, 3))
        for d in range(3):
            beta[:, (1 << d) - 1, d] = rest[:, d] / 8.0
        return beta

    @staticmethod
    def offsets(rest: Floats) -> Floats:
        """Γ_h·X_j/8 [m], shape (cells, 4, 3)."""
        return np.zeros((len(rest), 4, 3))

    @staticmethod
    def axes(rest: Floats) -> Floats:
        """Local axes in the columns, shape (cells, 3, 3)."""
        return np.broadcast_to(np.eye(3), (len(rest), 3, 3))

    @staticmethod
    @ti.func
    def lift(rest: ti.template(), hat, lane):
        """H and q_h of the differences."""
        z = 0.0 * hat[0, 0]
        H = ti.Matrix([[z, z, z], [z, z, z], [z, z, z]])
        q = ti.Matrix([[z, z, z], [z, z, z], [z, z, z], [z, z, z]])
        for r in range(3):
            for d in ti.static(range(3)):
                H[r, d] = 0.125 * rest[d, lane] * hat[ti.static((1 << d) - 1), r]
            for h in ti.static(range(4)):
                q[h, r] = 0.125 * hat[ti.static(int(MODES[h]) - 1), r]
        return H, q

    @staticmethod
    @ti.func
    def drop(rest: ti.template(), P, f, lane):
        """c_1..7 of P b_a + Σ γ_ha f_h."""
        z = 0.0 * P[0, 0]
        c = ti.Matrix([[z, z, z] for _ in range(7)])
        for r in range(3):
            for d in ti.static(range(3)):
                c[ti.static((1 << d) - 1), r] = 0.125 * rest[d, lane] * P[r, d]
            for h in ti.static(range(4)):
                c[ti.static(int(MODES[h]) - 1), r] = 0.125 * f[h, r]
        return c

    @staticmethod
    @ti.func
    def local(rest: ti.template(), z, lane):
        """Amplitudes along local axes."""
        return z

    @staticmethod
    @ti.func
    def world(rest: ti.template(), z, lane):
        """Amplitudes along the world's axes."""
        return z
