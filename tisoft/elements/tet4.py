# mypy: ignore-errors
"""Linear tet: one stress, constant in the element (O'Brien and Hodgins 1999, section 3).

    ∇N_1..3 = rows of [X_1 − X_0, X_2 − X_0, X_3 − X_0]⁻¹,   ∇N_0 = −Σ ∇N_1..3
    H = Σ u_a ⊗ ∇N_a,   Ḣ = Σ v_a ⊗ ∇N_a,   F = I + H
    f_a = −V (P(H) + P_v(H, Ḣ)) ∇N_a,   V Ψ(H),   (K w)_a = V (∂P/∂F : Σ w_b ⊗ ∇N_b) ∇N_a

With P = F S these are O'Brien and Hodgins's nodal forces (their eq. 24, of σ = 2S and vol/2).

| symbol | name                        | unit |
| ------ | --------------------------- | ---- |
| ∇N_1..3 | `rest[0..8]`, row by row    | 1/m  |
| V      | `rest[9]`                   | m³   |
| m_a    | ρV/4 (`masses`)             | kg   |

Its stiffest mode bounds that of any mesh it stands in (Rayleigh quotients: a sum of quotients never
exceeds the largest).
"""

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from tisoft.elements.matrices import hooke_blocks, stiffest, top
from tisoft.laws.base import cofactor, volume_change

Floats = NDArray[np.float64]


class Tet4:
    """The linear tet."""

    corners = 4
    word = "tet"
    """What a cell is called in sentences."""
    points = 1
    """Points at which its strain is taken."""
    rows = 12
    """Rows that `out` of `forces` has for each share."""
    stresses = 9
    """Numbers of its viscous stress, which is constant in it, for the ledger; 0 of elements whose
    viscous share of the corner forces it takes."""
    numbers = 10
    known = 4
    """Columns of `Block.modes`."""
    constants = 0
    """Columns of the material row that are the element's."""
    is_relative = False
    """Whether its energy wants displacements as seen from one of its body\'s nodes."""

    @staticmethod
    def rest(points: Floats, cells: NDArray[np.integer]) -> Floats:
        """`rest` of each cell, shape (cells, 10), from rest points [m]."""
        gradient, volume = gradients(points, cells)
        return np.concatenate([gradient.reshape(-1, 9), volume[:, None]], axis=1)

    @staticmethod
    @ti.func
    def gradient(rest: ti.template(), a: ti.template(), q, lane):
        """Σ a_c ⊗ ∇N_c of corner columns a at point q."""
        z = 0.0 * rest[0, lane]
        H = ti.Matrix([[z, z, z], [z, z, z], [z, z, z]])
        for c in range(3):
            for r in range(3):
                difference = a[3 * c + 3 + r, lane] - a[r, lane]
                for d in range(3):
                    H[r, d] += difference * rest[3 * c + d, lane]
        return H

    @staticmethod
    @ti.func
    def weight(rest: ti.template(), q, lane):
        """Share of the volume that point q stands for."""
        return 1.0 + 0.0 * rest[9, lane]

    @staticmethod
    @ti.func
    def spread(rest: ti.template(), P, first: ti.template(), lane, out: ti.template()):
        """P ∇N_c of each corner into rows of `out` from `first` on."""
        for r in range(3):
            total = 0.0 * P[0, 0]
            for c in range(3):
                f = 0.0 * P[0, 0]
                for d in range(3):
                    f += P[r, d] * rest[3 * c + d, lane]
                out[first + 3 * c + 3 + r, lane] = f
                total += f
            out[first + r, lane] = -total

    @staticmethod
    @ti.func
    def forces(
        law: ti.template(), rest: ti.template(), u: ti.template(), v: ti.template(), m, q, lane,
        out: ti.template(),
    ):  # fmt: skip
        """Corner forces [N].  Of `out`, where it has as many, rows 12..23 get the viscous share;
        or of 30 rows 12..20 −V P_v [N·m].
        """
        H, D = Tet4.gradient(rest, u, q, lane), Tet4.gradient(rest, v, q, lane)
        k = ti.static(m.n - 2)
        Pv = law.viscosity.stress(H, D, m[k], m[k + 1])
        P = law.stress(H, m) + Pv
        if ti.static(out.n == 30):
            for r in range(3):
                for d in range(3):
                    out[12 + 3 * r + d, lane] = -rest[9, lane] * Pv[r, d]
        if ti.static(out.n == 24):
            Tet4.spread(rest, -rest[9, lane] * Pv, 12, lane, out)
        Tet4.spread(rest, -rest[9, lane] * P, 0, lane, out)

    @staticmethod
    @ti.func
    def rate(rest: ti.template(), v: ti.template(), lane, out: ti.template()):
        """Ḣ [1/s] into rows 21..29 of `out`: f_v·v of the corners is −V P_v : Ḣ."""
        D = Tet4.gradient(rest, v, 0, lane)
        for r in range(3):
            for d in range(3):
                out[21 + 3 * r + d, lane] = D[r, d]

    @staticmethod
    @ti.func
    def energy(law: ti.template(), rest: ti.template(), u: ti.template(), m, q, lane):
        """V Ψ [J]."""
        return rest[9, lane] * law.energy(Tet4.gradient(rest, u, q, lane), m)

    @staticmethod
    @ti.func
    def product(
        law: ti.template(), rest: ti.template(), u: ti.template(), w: ti.template(), m, q, lane,
        out: ti.template(),
    ):  # fmt: skip
        """K(u) w [N]."""
        H, G = Tet4.gradient(rest, u, q, lane), Tet4.gradient(rest, w, q, lane)
        Tet4.spread(rest, rest[9, lane] * law.tangent(H, G, m), 0, lane, out)

    @staticmethod
    @ti.func
    def stiffened(law: ti.template(), rest: ti.template(), u: ti.template(), m, known, lane):
        """Bounds of ω² [1/s²] and of the damping rate [1/s] as deformed, and J."""
        H = Tet4.gradient(rest, u, 0, lane)
        grown = law.stiffening(H, m)
        omega2 = grown[0] * known[0] + grown[1] * known[2]
        return ti.Vector([omega2, grown[2] * known[1], 1.0 + volume_change(H, cofactor(H))])

    @staticmethod
    def of_material(lam: float, mu: float) -> tuple[float, ...]:
        """It needs no constants of its own."""
        return ()

    @staticmethod
    def volumes(rest: Floats) -> Floats:
        """V [m³], shape (cells,)."""
        return rest[:, 9]

    @staticmethod
    def gradients(rest: Floats) -> Floats:
        """∇N of the corners at the point [1/m], shape (cells, 1, 4, 3)."""
        return corner_gradients(rest[:, :9].reshape(-1, 3, 3))[:, None]

    @staticmethod
    def masses(rest: Floats, density: float) -> Floats:
        """Lumped masses of the corners [kg], shape (cells, 4)."""
        return np.repeat(density / 4.0 * rest[:, 9:], 4, axis=1)

    @staticmethod
    def products(rest: Floats) -> Floats:
        """∫ N_a N_b dV [m³] = V (1 + δ_ab)/20, shape (cells, 4, 4)."""
        return rest[:, 9, None, None] * (np.ones((4, 4)) + np.eye(4)) / 20.0

    @staticmethod
    def matrices(rest: Floats, lam: float, mu: float) -> Floats:
        """K_e at rest [N/m], shape (cells, 12, 12), of Lamé constants."""
        return hooke_blocks(Tet4.gradients(rest), rest[:, 9:], lam, mu)

    @staticmethod
    def frequency(rest: Floats, lam: float, mu: float) -> Floats:
        """ω² [1/s²] of the stiffest mode of each cell with density 1 and lumped mass."""
        return 4.0 * stiffest(Tet4.gradients(rest)[:, 0], lam, mu)

    @staticmethod
    def spread_square(rest: Floats) -> Floats:
        """4 λ_max(∇N_a·∇N_b) [1/m²], shape (cells,)."""
        g = Tet4.gradients(rest)[:, 0]
        return 4.0 * top(np.einsum("eai,eaj->eij", g, g))

    @staticmethod
    def swinging(rest: Floats, lam: float, mu: float) -> Floats:
        """No further numbers for `stiffened`, shape (cells, 0)."""
        return np.empty((len(rest), 0))


def gradients(points: Floats, cells: NDArray[np.integer]) -> tuple[Floats, Floats]:
    """∇N_1..3 [1/m], shape (cells, 3, 3), row c for corner c + 1, and volumes [m³], (cells,)."""
    corners = points[cells]
    edges = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
    return np.linalg.inv(edges), np.linalg.det(edges) / 6.0


def corner_gradients(gradient: Floats) -> Floats:
    """∇N_0..3 [1/m], shape (cells, 4, 3), from ∇N_1..3."""
    return np.concatenate([-gradient.sum(axis=1, keepdims=True), gradient], axis=1)
