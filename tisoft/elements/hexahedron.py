# mypy: ignore-errors
"""Hexahedron of 8 nodes with one point and assumed-strain stabilisation: it neither locks nor rings
(Flanagan and Belytschko 1981; Belytschko and Bindeman 1993, CMAME 105, 225: ASQBI).

    H = Σ u_a ⊗ b_a,   b_a = 1/V ∫ ∇N_a dV                        the mean gradient, F = I + H
    q_h = Σ γ_ha u_a,  γ_h = (Γ_h − Σ_j (Γ_h·X_j) b_j)/8          the four hourglass modes
    Γ_0..3 = ηζ, ξζ, ξη, ξηζ at the nodes;   z_h = Fᵀ q_h         (pulled back: objective)
    W = V Ψ(H) + W_hg(z),   f_a = −∂W/∂u_a = −[V P + Σ q_h ⊗ R_h] b_a − Σ (F R_h) γ_ha
    W_hg = Σ_k V/6 [p (e_i² + e_j² + 2ν e_i e_j) + μ g²] + V E/18 Σ_i (s_i z_3i)²,
    R_h = ∂W_hg/∂z_h
    (i, j) the two axes but k:   e_i = s_i z_ji,   e_j = s_j z_ij,   g = s_j z_ii + s_i z_jj

with p = E/(1 − ν²) and edge lengths a_i = 2/s_i: each part of the field that is linear in one local
coordinate is a plate in plane stress, which bends as it should with one element through the
thickness.  Linear bodies take z = q, and laws that stand strong compression the rotation of F for
F (`pull_back`).  Viscosity acts on dz/dt with the same formula of φ and η.

Nodes are counted as a lattice does: corner c at (c & 1, c >> 1 & 1, c >> 2).  All sums are done on
the sums and differences û_k = Σ_a sign(k, a) u_a of the eight nodes (Walsh and Hadamard), k a bit
mask of local axes: H = Σ_k û_k ⊗ β_k, and û_6, û_5, û_3, û_7 are Γ_0..3·u.

What differs between a hexahedron whose sides lie along the axes (`brick`) and any other (`hex8`) is
how they make H and q_h: `lift`, its transpose `drop`, and the turn to local axes and back.

| symbol | name                  | unit |
| ------ | --------------------- | ---- |
| s_i    | `rest[0..2]`          | 1/m  |
| V      | `rest[3]`             | m³   |
| p, pν, μ, E | m[n−10..n−7], of φ and η m[n−6..n−3] | Pa, Pa·s |
"""

from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from tisoft.elements.matrices import each, hooke_blocks, top
from tisoft.elements.pull_back import (
    pulled,
    pulling,
    pulling_curvature,
    pulling_rate,
    pushed,
    turner,
    turns,
)
from tisoft.geometry.cells import SIGNS
from tisoft.laws.base import (
    cofactor,
    green_strain,
    least_square,
    stretch_square,
    volume_change,
)

Floats = NDArray[np.float64]

MODES = np.array([6, 5, 3, 7])
"""k of Γ_0..3."""


@ti.func
def differences(u: ti.template(), lane):
    """û_1..7 of corner columns u, shape (7, 3)."""
    z = 0.0 * u[0, lane]
    hat = ti.Matrix([[z, z, z] for _ in range(7)])
    for r in range(3):
        a, b = u[r, lane] + u[3 + r, lane], u[3 + r, lane] - u[r, lane]
        c, d = u[6 + r, lane] + u[9 + r, lane], u[9 + r, lane] - u[6 + r, lane]
        e, f = u[12 + r, lane] + u[15 + r, lane], u[15 + r, lane] - u[12 + r, lane]
        g, h = u[18 + r, lane] + u[21 + r, lane], u[21 + r, lane] - u[18 + r, lane]
        low, high = b + d, f + h
        hat[0, r], hat[4, r] = low + high, high - low
        low, high = c - a, g - e
        hat[1, r], hat[5, r] = low + high, high - low
        low, high = d - b, h - f
        hat[2, r], hat[6, r] = low + high, high - low
        hat[3, r] = (e + g) - (a + c)
    return hat


@ti.func
def spread_differences(c, first: ti.template(), lane, out: ti.template()):
    """Σ_k sign(k, a) c_k, k = 1..7, of each corner a into rows of `out` from `first` on."""
    for r in range(3):
        c1, v2, v3 = c[0, r], c[1, r] - c[2, r], c[1, r] + c[2, r]
        v4, v5 = c[3, r] - c[4, r], c[3, r] + c[4, r]
        v6, v7 = c[5, r] - c[6, r], c[5, r] + c[6, r]
        low, high = -c1 - v2, v4 - v6
        out[first + r, lane], out[first + 12 + r, lane] = low - high, low + high
        low, high = c1 - v3, v5 - v7
        out[first + 3 + r, lane], out[first + 15 + r, lane] = low - high, low + high
        low, high = v2 - c1, v4 + v6
        out[first + 6 + r, lane], out[first + 18 + r, lane] = low - high, low + high
        low, high = c1 + v3, v5 + v7
        out[first + 9 + r, lane], out[first + 21 + r, lane] = low - high, low + high


@ti.func
def hooke_of_modes(rest: ti.template(), lane, z, m, at: ti.template()):
    """R_h = ∂W_hg/∂z_h [N·m/m²] of amplitudes z along local axes, shape (4, 3); p, pν, μ, E stand
    in m from `at` on.
    """
    R = 0.0 * z
    c = rest[3, lane] / 3.0
    for k in ti.static(range(3)):
        i, j = ti.static((k + 1) % 3, (k + 2) % 3)
        si, sj = rest[i, lane], rest[j, lane]
        ei, ej, g = si * z[j, i], sj * z[i, j], sj * z[i, i] + si * z[j, j]
        R[j, i] = c * si * (m[at] * ei + m[at + 1] * ej)
        R[i, j] = c * sj * (m[at] * ej + m[at + 1] * ei)
        R[i, i] += c * m[at + 2] * sj * g
        R[j, j] += c * m[at + 2] * si * g
        R[3, k] = c / 3.0 * m[at + 3] * rest[k, lane] * rest[k, lane] * z[3, k]
    return R


@ti.func
def outer(q, R):
    """Σ q_h ⊗ R_h [N·m]."""
    z = 0.0 * q[0, 0]
    M = ti.Matrix([[z, z, z], [z, z, z], [z, z, z]])
    for i in range(3):
        for j in range(3):
            for h in range(4):
                M[i, j] += q[h, i] * R[h, j]
    return M


@ti.func
def hex_forces(
    kind: ti.template(), law: ti.template(), rest: ti.template(), u: ti.template(),
    v: ti.template(), m, lane, out: ti.template(),
):  # fmt: skip
    """Corner forces [N]; rows 24..47 of `out`, where it has them, get the viscous share."""
    H, q = kind.lift(rest, differences(u, lane), lane)
    D, dq = kind.lift(rest, differences(v, lane), lane)
    T = pulling(law, H)
    Z = turner(law, H, T)
    k = ti.static(m.n - 10)
    V = rest[3, lane]
    z = kind.local(rest, pulled(q, T), lane)
    dz = kind.local(rest, pulled(dq, T) + pulled(q, pulling_rate(law, T, Z, D)) - q, lane)
    Rv = kind.world(rest, hooke_of_modes(rest, lane, dz, m, k + 4), lane)
    R = kind.world(rest, hooke_of_modes(rest, lane, z, m, k), lane) + Rv
    Pv = law.viscosity.stress(H, D, m[k + 8], m[k + 9])
    P = V * (law.stress(H, m) + Pv)
    Pv = V * Pv
    if ti.static(law.is_finite):
        P += pulling_rate(law, T, Z, outer(q, R))
    if ti.static(out.n > 24):
        if ti.static(law.is_finite):
            Pv += pulling_rate(law, T, Z, outer(q, Rv))
        spread_differences(kind.drop(rest, -Pv, -pushed(Rv, T), lane), 24, lane, out)
    spread_differences(kind.drop(rest, -P, -pushed(R, T), lane), 0, lane, out)


@ti.func
def hex_energy(
    kind: ti.template(), law: ti.template(), rest: ti.template(), u: ti.template(), m, lane
):
    """V Ψ + W_hg [J]."""
    H, q = kind.lift(rest, differences(u, lane), lane)
    z = kind.local(rest, pulled(q, pulling(law, H)), lane)
    R = hooke_of_modes(rest, lane, z, m, ti.static(m.n - 10))
    total = rest[3, lane] * law.energy(H, m)
    for h in range(4):
        for i in range(3):
            total += 0.5 * z[h, i] * R[h, i]
    return total


@ti.func
def hex_product(
    kind: ti.template(), law: ti.template(), rest: ti.template(), u: ti.template(),
    w: ti.template(), m, lane, out: ti.template(),
):  # fmt: skip
    """K(u) w [N]."""
    H, q = kind.lift(rest, differences(u, lane), lane)
    G, dq = kind.lift(rest, differences(w, lane), lane)
    T = pulling(law, H)
    Z = turner(law, H, T)
    dT = pulling_rate(law, T, Z, G)
    k = ti.static(m.n - 10)
    z = kind.local(rest, pulled(q, T), lane)
    dz = kind.local(rest, pulled(dq, T) + pulled(q, dT) - q, lane)
    R = kind.world(rest, hooke_of_modes(rest, lane, z, m, k), lane)
    dR = kind.world(rest, hooke_of_modes(rest, lane, dz, m, k), lane)
    P = rest[3, lane] * law.tangent(H, G, m)
    if ti.static(law.is_finite):
        P += pulling_curvature(law, H, T, Z, outer(q, R), outer(dq, R) + outer(q, dR), G, dT)
    spread_differences(kind.drop(rest, P, pushed(dR, T) + pushed(R, dT) - R, lane), 0, lane, out)


@ti.func
def hex_stiffened(
    kind: ti.template(), law: ti.template(), rest: ti.template(), u: ti.template(), m, known, lane
):
    """Bounds of ω² [1/s²] and of the damping rate [1/s] as deformed, and J.

    With u′ = Fᵀu the first-order parts are those at rest; the amplitudes q add to the hourglass
    part λ_A (4 |F| √(γ κ) |q| + γ |q|²) |u|², γ and κ the largest eigenvalues of b_a·b_c and of
    γ_ha γ_hc.
    """
    H, q = kind.lift(rest, differences(u, lane), lane)
    grown = law.stiffening(H, m)
    omega2 = grown[0] * known[0] + grown[1] * known[2]
    rate = grown[2] * known[1]
    if ti.static(law.is_finite):
        E = green_strain(H)
        square = stretch_square(E)
        size2 = contracted4(q)
        first = ti.sqrt(square * size2)
        if ti.static(turns(law)):
            # The rotation turns by |dF| over the sum of two stretches, and bends by its square.
            thin = least_square(E)
            first = ti.sqrt(size2 / thin)
            size2 = 4.0 * size2 / thin
        omega2 = ti.max(grown[0], square) * known[0] + grown[1] * known[2]
        omega2 += 4.0 * first * known[4] + size2 * known[5]
        rate = ti.max(grown[2], square) * known[1] + 2.0 * first * known[6] + size2 * known[7]
    return ti.Vector([omega2, rate, 1.0 + volume_change(H, cofactor(H))])


@ti.func
def contracted4(q):
    """Σ |q_h|² [m²]."""
    t = 0.0 * q[0, 0]
    for h in range(4):
        for i in range(3):
            t += q[h, i] * q[h, i]
    return t


def kernels_of(kind: Any) -> dict[str, Any]:
    """What kernels call of a kind of hexahedra; q, the number of the point, is always 0."""

    @ti.func
    def gradient(rest: ti.template(), u: ti.template(), q, lane):
        """H at the point."""
        H, _ = kind.lift(rest, differences(u, lane), lane)
        return H

    @ti.func
    def forces(
        law: ti.template(), rest: ti.template(), u: ti.template(), v: ti.template(), m, q, lane,
        out: ti.template(),
    ):  # fmt: skip
        hex_forces(kind, law, rest, u, v, m, lane, out)

    @ti.func
    def energy(law: ti.template(), rest: ti.template(), u: ti.template(), m, q, lane):
        return hex_energy(kind, law, rest, u, m, lane)

    @ti.func
    def product(
        law: ti.template(), rest: ti.template(), u: ti.template(), w: ti.template(), m, q, lane,
        out: ti.template(),
    ):  # fmt: skip
        hex_product(kind, law, rest, u, w, m, lane, out)

    @ti.func
    def stiffened(law: ti.template(), rest: ti.template(), u: ti.template(), m, known, lane):
        return hex_stiffened(kind, law, rest, u, m, known, lane)

    return {
        "gradient": gradient,
        "forces": forces,
        "energy": energy,
        "product": product,
        "stiffened": stiffened,
    }


class Hexahedron:
    """What both kinds share; `lift` tells H and q_h of the corners' differences, `drop` is its
    transpose, `local` and `world` turn amplitudes into the local axes and back.
    """

    def __init_subclass__(cls) -> None:
        for name, function in kernels_of(cls).items():
            setattr(cls, name, staticmethod(function))

    corners = 8
    word = "hex"
    """What a cell is called in sentences."""
    points = 1
    rows = 24
    stresses = 0
    known = 8
    """Columns of `Block.modes`: ω², damping rate, 8γ/ρ, weight; 8/ρ V times λ_A √(γκ) and λ_A γ,
    elastic and viscous."""
    constants = 8
    """Columns of the material row that are the element's."""
    is_relative = False

    @staticmethod
    def of_material(lam: float, mu: float) -> tuple[float, ...]:
        """p, pν, μ, E [Pa] of Lamé constants [Pa] (or [Pa·s] of viscous ones)."""
        if lam + mu == 0.0:
            return 0.0, 0.0, 0.0, 0.0
        plate = 4.0 * mu * (lam + mu) / (lam + 2.0 * mu)
        nu = 0.5 * lam / (lam + mu)
        return plate, plate * nu, mu, mu * (3.0 * lam + 2.0 * mu) / (lam + mu)

    @staticmethod
    @ti.func
    def weight(rest: ti.template(), q, lane):
        """Share of the volume that point q stands for."""
        return 1.0 + 0.0 * rest[3, lane]

    @classmethod
    def volumes(cls, rest: Floats) -> Floats:
        """V [m³], shape (cells,)."""
        return rest[:, 3]

    @classmethod
    def masses(cls, rest: Floats, density: float) -> Floats:
        """Lumped masses of the corners [kg], shape (cells, 8)."""
        return np.repeat(density / 8.0 * rest[:, 3:4], 8, axis=1)

    @classmethod
    def products(cls, rest: Floats) -> Floats:
        """∫ N_a N_b dV [m³], shape (cells, 8, 8); of cells that are no parallelepipeds as if their
        Jacobian were the same everywhere.
        """
        corner = SIGNS[[1, 2, 4]].T
        shares = (1.0 + corner[:, None] * corner[None] / 3.0).prod(axis=2) / 64.0
        return cls.volumes(rest)[:, None, None] * shares

    @classmethod
    def gradients(cls, rest: Floats) -> Floats:
        """∇N of the corners at the point [1/m], shape (cells, 1, 8, 3)."""
        beta = cls.means(rest)
        return np.einsum("ka,ekj->eaj", SIGNS[1:], beta)[:, None]

    @classmethod
    def shapes(cls, rest: Floats) -> Floats:
        """γ_ha, shape (cells, 4, 8)."""
        b = cls.gradients(rest)[:, 0]
        return (SIGNS[MODES] / 8.0)[None] - np.einsum("ehj,eaj->eha", cls.offsets(rest), b)

    @classmethod
    def amplitudes(cls, rest: Floats) -> Floats:
        """z of unit displacements, shape (cells, 12, 24)."""
        shape, axes = cls.shapes(rest), cls.axes(rest)
        return np.einsum("eha,eji->ehiaj", shape, axes).reshape(len(rest), 12, 24)

    @staticmethod
    def hourglass(rest: Floats, lam: float, mu: float) -> Floats:
        """∂²W_hg/∂z² [N/m], shape (cells, 12, 12), of Lamé constants."""
        p, pn, shear, young = Hexahedron.of_material(lam, mu)
        s, c = rest[:, :3], rest[:, 3] / 3.0
        A = np.zeros((len(rest), 4, 3, 4, 3))
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            A[:, j, i, j, i] += c * s[:, i] ** 2 * p
            A[:, i, j, i, j] += c * s[:, j] ** 2 * p
            A[:, j, i, i, j] += c * s[:, i] * s[:, j] * pn
            A[:, i, j, j, i] += c * s[:, i] * s[:, j] * pn
            A[:, i, i, i, i] += c * s[:, j] ** 2 * shear
            A[:, j, j, j, j] += c * s[:, i] ** 2 * shear
            A[:, i, i, j, j] += c * s[:, i] * s[:, j] * shear
            A[:, j, j, i, i] += c * s[:, i] * s[:, j] * shear
            A[:, 3, k, 3, k] += c / 3.0 * young * s[:, k] ** 2
        return A.reshape(-1, 12, 12)

    @classmethod
    def matrices(cls, rest: Floats, lam: float, mu: float) -> Floats:
        """K_e at rest [N/m], shape (cells, 24, 24), of Lamé constants."""
        z = cls.amplitudes(rest)
        main = hooke_blocks(cls.gradients(rest), cls.volumes(rest)[:, None], lam, mu)
        extra: Floats = np.swapaxes(z, 1, 2) @ cls.hourglass(rest, lam, mu) @ z
        return main + extra

    @classmethod
    def frequency(cls, rest: Floats, lam: float, mu: float) -> Floats:
        """ω² [1/s²] of the stiffest mode of each cell with density 1 and lumped mass."""
        return 8.0 / cls.volumes(rest) * each(rest, lambda r: top(cls.matrices(r, lam, mu)))

    @classmethod
    def spread_square(cls, rest: Floats) -> Floats:
        """8 λ_max(b_a·b_c) [1/m²], shape (cells,)."""
        return 8.0 * each(rest, cls._gradient_square)

    @classmethod
    def _gradient_square(cls, rest: Floats) -> Floats:
        b = cls.gradients(rest)[:, 0]
        return top(np.einsum("eai,eaj->eij", b, b))

    @classmethod
    def swinging(cls, rest: Floats, lam: float, mu: float) -> Floats:
        """8/V λ_A √(γκ) and 8/V λ_A γ of density 1, shape (cells, 2)."""
        gamma = each(rest, cls._gradient_square)
        kappa = each(rest, cls._shape_square)
        stiff = 8.0 / cls.volumes(rest) * each(rest, lambda r: top(cls.hourglass(r, lam, mu)))
        return np.stack([stiff * np.sqrt(gamma * kappa), stiff * gamma], axis=1)

    @classmethod
    def _shape_square(cls, rest: Floats) -> Floats:
        shape = cls.shapes(rest)
        return top(shape @ np.swapaxes(shape, 1, 2))
