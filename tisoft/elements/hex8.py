# mypy: ignore-errors
"""Any hexahedron: H = Σ û_k ⊗ β_k, q_h = û_h/8 − H (Γ_h·X/8) (see `hexahedron`).

Its numbers are free: a cell that is filled in part gives its own mean gradient and volume.

| symbol | name                  | unit |
| ------ | --------------------- | ---- |
| s_i    | `rest[0..2]`          | 1/m  |
| V      | `rest[3]`             | m³   |
| β_k    | `rest[4..24]`, k = 1..7 | 1/m |
| Γ_h·X_j/8 | `rest[25..36]`     | m    |
| local axes (columns) | `rest[37..45]` | 1 |
"""

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from tisoft.elements.brick import Brick
from tisoft.elements.hexahedron import MODES, Hexahedron
from tisoft.geometry.cells import HEX_POINTS, SIGNS, hex_jacobians

Floats = NDArray[np.float64]

BRICK = 1e-10
"""Share of the size up to which a hexahedron is a brick."""


class Hex8(Hexahedron):
    """Any hexahedron."""

    numbers = 46

    @staticmethod
    def rest(points: Floats, cells: NDArray[np.integer]) -> Floats:
        """`rest` of each cell, shape (cells, 46), from rest points [m]."""
        X = points[cells]
        b, V, axes, s = geometry(X)
        beta = np.einsum("ka,eaj->ekj", SIGNS[1:], b) / 8.0
        offsets = np.einsum("ha,eaj->ehj", SIGNS[MODES], X - X.mean(axis=1)[:, None]) / 8.0
        flat = [a.reshape(len(cells), -1) for a in (s, V[:, None], beta, offsets, axes)]
        return np.concatenate(flat, axis=1)

    @staticmethod
    def filled(points: Floats, cells: NDArray[np.integer], moments: Floats) -> Floats:
        """`rest` of cells of a lattice that are filled in part, shape (cells, 46).

        With s_i ê_i the slopes of the local axes, m the means over the filled part,
        β_k = Σ_{i in k} s_i ê_i m(the other axes of k)/8 is its mean gradient; V = φ V_cell.

        Args:
            points, cells: as of `rest`.
            moments: φ; means of ξ, η, ζ; of ηζ, ξζ, ξη over the filled part, shape (cells, 7).
        """
        rest = Hex8.rest(points, cells)
        rest[:, 3] *= moments[:, 0]
        beta = rest[:, 4:25].reshape(-1, 7, 3)
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            slope = beta[:, (1 << i) - 1].copy()
            beta[:, (1 << i | 1 << j) - 1] += slope * moments[:, 1 + j, None]
            beta[:, (1 << i | 1 << k) - 1] += slope * moments[:, 1 + k, None]
            beta[:, 6] += slope * moments[:, 4 + i, None]
        rest[:, 4:25] = beta.reshape(-1, 21)
        return rest

    @staticmethod
    def means(rest: Floats) -> Floats:
        """β_1..7 [1/m], shape (cells, 7, 3)."""
        return rest[:, 4:25].reshape(-1, 7, 3)

    @staticmethod
    def offsets(rest: Floats) -> Floats:
        """Γ_h·X_j/8 [m], shape (cells, 4, 3)."""
        return rest[:, 25:37].reshape(-1, 4, 3)

    @staticmethod
    def axes(rest: Floats) -> Floats:
        """Local axes in the columns, shape (cells, 3, 3)."""
        return rest[:, 37:].reshape(-1, 3, 3)

    @staticmethod
    @ti.func
    def lift(rest: ti.template(), hat, lane):
        """H and q_h of the differences."""
        z = 0.0 * hat[0, 0]
        H = ti.Matrix([[z, z, z], [z, z, z], [z, z, z]])
        q = ti.Matrix([[z, z, z], [z, z, z], [z, z, z], [z, z, z]])
        for r in range(3):
            for d in range(3):
                for k in range(7):
                    H[r, d] += hat[k, r] * rest[4 + 3 * k + d, lane]
            for h in ti.static(range(4)):
                a = 0.125 * hat[ti.static(int(MODES[h]) - 1), r]
                for d in range(3):
                    a -= rest[25 + 3 * h + d, lane] * H[r, d]
                q[h, r] = a
        return H, q

    @staticmethod
    @ti.func
    def drop(rest: ti.template(), P, f, lane):
        """c_1..7 of P b_a + Σ γ_ha f_h."""
        z = 0.0 * P[0, 0]
        c = ti.Matrix([[z, z, z] for _ in range(7)])
        for r in range(3):
            for d in range(3):
                a = P[r, d]
                for h in range(4):
                    a -= f[h, r] * rest[25 + 3 * h + d, lane]
                for k in range(7):
                    c[k, r] += a * rest[4 + 3 * k + d, lane]
            for h in ti.static(range(4)):
                c[ti.static(int(MODES[h]) - 1), r] += 0.125 * f[h, r]
        return c

    @staticmethod
    @ti.func
    def local(rest: ti.template(), z, lane):
        """Amplitudes along local axes."""
        a = 0.0 * z
        for h in range(4):
            for i in range(3):
                for j in range(3):
                    a[h, i] += rest[37 + 3 * j + i, lane] * z[h, j]
        return a

    @staticmethod
    @ti.func
    def world(rest: ti.template(), z, lane):
        """Amplitudes along the world's axes."""
        a = 0.0 * z
        for h in range(4):
            for i in range(3):
                for j in range(3):
                    a[h, i] += rest[37 + 3 * i + j, lane] * z[h, j]
        return a


def geometry(X: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """b_a [1/m], V [m³], local axes and s_i [1/m] of hexahedra with corners X [m]."""
    d, J = hex_jacobians(X, HEX_POINTS)
    det = np.linalg.det(J)
    V = det.sum(axis=1)
    slopes = np.einsum("qaj,eqji->eqai", d, np.linalg.inv(J))
    b = np.einsum("eq,eqai->eai", det, slopes) / V[:, None, None]
    center = hex_jacobians(X, np.zeros((1, 3)))[1][:, 0]
    left, _, right = np.linalg.svd(center)
    axes = left @ right
    s = 1.0 / np.einsum("eji,eji->ei", axes, center)
    return b, V, axes, s


def element_of(points: Floats, cells: NDArray[np.integer]) -> type[Hexahedron]:
    """`Brick` where all sides of all cells lie along the axes, else `Hex8`."""
    X = points[cells]
    low, size = X[:, 0], X[:, 7] - X[:, 0]
    corner = np.array([[c & 1, c >> 1 & 1, c >> 2] for c in range(8)])
    away = np.abs(X - (low[:, None] + corner * size[:, None])).max(axis=(1, 2))
    straight = (size > 0.0).all() and (away <= BRICK * np.abs(size).max(axis=1)).all()
    return Brick if straight else Hex8
