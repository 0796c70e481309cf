# mypy: ignore-errors
"""Quadratic tet: 10 nodes, its strain taken at 4 points; it bends and keeps its volume with ease
(Zienkiewicz and Taylor, The Finite Element Method, vol. 1; lumped mass after Hinton, Rock and
Zienkiewicz 1976).

    N_a = L_a (2 L_a − 1) at corners,  N_ab = 4 L_a L_b at edges,  L volume coordinates
    H_q = Σ_b (d_b − d_0) ⊗ g_b,  d_b = Σ_a u_a ∂N_a/∂L_b at point q,  b = 1..3,  F_q = I + H_q
    W = Σ_q V_q Ψ(H_q),   f_a = −Σ_q V_q P_q ∇N_a
    points: L_q = (5 + 3√5)/20, the others (5 − √5)/20;   mass: ρV/32 at corners, 7ρV/48 at edges

A mass that adds up the rows of the consistent one would be negative at the corners; 1/32 gives a
corner a quarter of the tet that its edges' middles cut off, and about the longest step.

With straight edges and their nodes in the middle g_b = ∇L_b and V_q = V/4 are the same at all
points, with others each has its own (`tet10`).

| symbol | name                          | unit |
| ------ | ----------------------------- | ---- |
| g_1..3 | `rest[0..8]` of each point, row by row | 1/m |
| V_q    | `rest[9]` of each point       | m³   |
"""

from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from tisoft.elements.matrices import each, hooke_blocks, stiffest, top
from tisoft.elements.pull_back import turns
from tisoft.geometry.cells import (
    QUADRATIC_EDGES,
    TET_POINTS,
    tet10_slopes,
)
from tisoft.laws.base import (
    cofactor,
    contracted,
    green_strain,
    least_square,
    volume_change,
)

Floats = NDArray[np.float64]

EDGES = tuple((int(a), int(b)) for a, b in QUADRATIC_EDGES)
SHARES = np.array([1.0 / 32.0] * 4 + [7.0 / 48.0] * 6)
"""Of the mass, by node."""


def in_two(value: float) -> tuple[float, float]:
    """The value as a float of f32 and what is left."""
    first = float(np.float32(value))
    return first, value - first


FARTHEST = 2.83
"""|R − R'| of two rotations at the most, 2√2."""

NEAR, STEP = in_two((5.0 - np.sqrt(5.0)) / 20.0), in_two(np.sqrt(0.2))


@ti.func
def near_and_step(z):
    """(5 − √5)/20 and 1/√5, in the precision of z = 0: literals have the digits of f32 alone."""
    return (z + NEAR[0]) + NEAR[1], (z + STEP[0]) + STEP[1]


@ti.func
def coordinates(rest: ti.template(), q, lane):
    """L of point q."""
    z = 0.0 * rest[0, lane]
    near, step = near_and_step(z)
    return ti.Vector([ti.select(q == a, near + step, near) for a in range(4)])


@ti.func
def gradient_at(kind: ti.template(), rest: ti.template(), u: ti.template(), q, lane):
    """H at point q of nodal columns u."""
    L = coordinates(rest, q, lane)
    z = 0.0 * rest[0, lane]
    H = ti.Matrix([[z, z, z], [z, z, z], [z, z, z]])
    for r in ti.static(range(3)):
        d = ti.Vector([z, z, z, z])
        for a in ti.static(range(4)):
            d[a] = (4.0 * L[a] - 1.0) * u[3 * a + r, lane]
        for k in ti.static(range(6)):
            a, b = ti.static(EDGES[k])
            x = 4.0 * u[12 + 3 * k + r, lane]
            d[a] += L[b] * x
            d[b] += L[a] * x
        for b in range(3):
            for j in range(3):
                H[r, j] += (d[b + 1] - d[0]) * rest[kind.stride * q + 3 * b + j, lane]
    return H


@ti.func
def keep(P, q, first: ti.template(), lane, out: ti.template()):
    """Keep V_q P_q in rows of `out` from `first` on."""
    for r in ti.static(range(3)):
        for j in ti.static(range(3)):
            out[first + 9 * q + 3 * r + j, lane] = P[r, j]


@ti.func
def spread(
    kind: ti.template(), rest: ti.template(), kept: ti.template(), first: ti.template(), lane,
    out: ti.template(),
):  # fmt: skip
    """Σ_q V_q P_q ∇N_a of each node into rows of `out` from `first` on; rows from `kept` on have
    the V_q P_q.

    With L_a = .138… + δ_aq/√5 all nodes' sums are made of h_b(q) = V_q P_q ∇L_b and their sums
    over q.
    """
    z = 0.0 * rest[0, lane]
    near, step = near_and_step(z)
    for r in ti.static(range(3)):
        h = ti.Matrix([[z, z, z, z] for _ in range(4)])
        total = ti.Vector([z, z, z, z])
        for q in ti.static(range(4)):
            for b in ti.static(range(3)):
                f = z
                for j in ti.static(range(3)):
                    row = kept + 9 * q + 3 * r + j
                    f += out[row, lane] * rest[kind.stride * q + 3 * b + j, lane]
                h[q, b + 1] = f
                h[q, 0] -= f
            for b in ti.static(range(4)):
                total[b] += h[q, b]
        for a in ti.static(range(4)):
            out[first + 3 * a + r, lane] = (4.0 * near - 1.0) * total[a] + 4.0 * step * h[a, a]
        for k in ti.static(range(6)):
            a, b = ti.static(EDGES[k])
            out[first + 12 + 3 * k + r, lane] = 4.0 * (
                near * (total[a] + total[b]) + step * (h[a, b] + h[b, a])
            )


@ti.func
def tet10_forces(
    kind: ti.template(), law: ti.template(), rest: ti.template(), u: ti.template(),
    v: ti.template(), m, at, out: ti.template(),
):  # fmt: skip
    """Keep the stress of a point, and after it, where `out` has rows for two, its viscous share;
    at: point and lane.
    """
    q, lane = at[0], at[1]
    H, D = gradient_at(kind, rest, u, q, lane), gradient_at(kind, rest, v, q, lane)
    k = ti.static(m.n - 2)
    V = rest[kind.stride * q + 9, lane]
    Pv = law.viscosity.stress(H, D, m[k], m[k + 1])
    P = law.stress(H, m) + Pv
    shares = ti.static(out.n // kind.rows)
    keep(-V * P, q, 30 * shares, lane, out)
    if ti.static(shares == 2):
        keep(-V * Pv, q, 96, lane, out)


@ti.func
def tet10_product(
    kind: ti.template(), law: ti.template(), rest: ti.template(), u: ti.template(),
    w: ti.template(), m, at, out: ti.template(),
):  # fmt: skip
    """Keep what K(u) w is made of at a point."""
    q, lane = at[0], at[1]
    H, G = gradient_at(kind, rest, u, q, lane), gradient_at(kind, rest, w, q, lane)
    P = rest[kind.stride * q + 9, lane] * law.tangent(H, G, m)
    keep(P, q, 30 * ti.static(out.n // kind.rows), lane, out)


@ti.func
def tet10_stiffened(
    kind: ti.template(), law: ti.template(), rest: ti.template(), u: ti.template(), m, known, lane
):
    """Bounds of ω² [1/s²] and of the damping rate [1/s] as deformed, and the least J.

    With the first point's F for all, u′ = Fᵀu sees the stiffness at rest; what the others' F
    differ by, δ, adds to the square root: ω ≤ √a ω₀ + δ ω_Σ, ω_Σ² the sum of the points' own.
    Where the stiffness turns with F's rotation R alone, u′ = Rᵀu, and R differs by δ over the least
    stretch at the most (Li 1995).
    """
    H = gradient_at(kind, rest, u, 0, lane)
    grown = law.stiffening(H, m)
    least = 1.0 + volume_change(H, cofactor(H))
    away = 0.0 * least
    thin = 0.0 * least + 1.0
    if ti.static(turns(law)):
        thin = least_square(green_strain(H))
    for q in range(1, 4):
        other = gradient_at(kind, rest, u, q, lane)
        more = law.stiffening(other, m)
        for k in ti.static(range(3)):
            grown[k] = ti.max(grown[k], more[k])
        least = ti.min(least, 1.0 + volume_change(other, cofactor(other)))
        away = ti.max(away, contracted(other - H, other - H))
        if ti.static(turns(law)):
            thin = ti.min(thin, least_square(green_strain(other)))
    omega2, rate = grown[0] * known[0], grown[2] * known[1]
    if ti.static(law.is_finite):
        away = ti.sqrt(away)
        turned = away
        if ti.static(turns(law)):
            turned = ti.min(away / ti.sqrt(thin), 0.0 * away + FARTHEST)
        turned = ti.sqrt(omega2) + turned * ti.sqrt(known[4])
        omega2 = turned * turned
        turned = ti.sqrt(rate) + away * ti.sqrt(known[5])
        rate = turned * turned
    return ti.Vector([omega2 + grown[1] * known[2], rate, least])


def kernels_of(kind: Any) -> dict[str, Any]:
    """What kernels call of a kind of quadratic tets, at point q."""

    @ti.func
    def gradient(rest: ti.template(), u: ti.template(), q, lane):
        return gradient_at(kind, rest, u, q, lane)

    @ti.func
    def weight(rest: ti.template(), q, lane):
        """Share of the volume that point q stands for."""
        total = 0.0 * rest[9, lane]
        for k in range(4):
            total += rest[kind.stride * k + 9, lane]
        return rest[kind.stride * q + 9, lane] / ti.max(total, 1e-30)

    @ti.func
    def forces(
        law: ti.template(), rest: ti.template(), u: ti.template(), v: ti.template(), m, q, lane,
        out: ti.template(),
    ):  # fmt: skip
        tet10_forces(kind, law, rest, u, v, m, (q, lane), out)

    @ti.func
    def energy(law: ti.template(), rest: ti.template(), u: ti.template(), m, q, lane):
        """V_q Ψ [J]."""
        H = gradient_at(kind, rest, u, q, lane)
        return rest[kind.stride * q + 9, lane] * law.energy(H, m)

    @ti.func
    def product(
        law: ti.template(), rest: ti.template(), u: ti.template(), w: ti.template(), m, q, lane,
        out: ti.template(),
    ):  # fmt: skip
        tet10_product(kind, law, rest, u, w, m, (q, lane), out)

    @ti.func
    def finish(rest: ti.template(), lane, out: ti.template()):
        """Nodal forces of what the points have kept; of two shares, the viscous one too."""
        shares = ti.static(out.n // kind.rows)
        spread(kind, rest, 30 * shares, 0, lane, out)
        if ti.static(shares == 2):
            spread(kind, rest, 96, 30, lane, out)

    @ti.func
    def stiffened(law: ti.template(), rest: ti.template(), u: ti.template(), m, known, lane):
        return tet10_stiffened(kind, law, rest, u, m, known, lane)

    return {
        "gradient": gradient,
        "weight": weight,
        "forces": forces,
        "energy": energy,
        "product": product,
        "finish": finish,
        "stiffened": stiffened,
    }


def shape_products() -> Floats:
    """∫ N_a N_b dV / V over a tet with straight edges, shape (10, 10), by Gauss points collapsed
    from a cube.
    """
    x, w = np.polynomial.legendre.leggauss(4)
    a, b, c = np.meshgrid(0.5 * (x + 1.0), 0.5 * (x + 1.0), 0.5 * (x + 1.0), indexing="ij")
    weight = np.einsum("i,j,k->ijk", w, w, w) / 8.0 * (1.0 - a) ** 2 * (1.0 - b) * 6.0
    second, third = b * (1.0 - a), c * (1.0 - a) * (1.0 - b)
    L = np.stack([a, second, third, 1.0 - a - second - third], axis=-1).reshape(-1, 4)
    i, j = QUADRATIC_EDGES.T
    N = np.hstack([L * (2.0 * L - 1.0), 4.0 * L[:, i] * L[:, j]])
    return np.einsum("q,qa,qb->ab", weight.ravel(), N, N)


PRODUCTS = shape_products()


class Quadratic:
    """What both kinds share: rest numbers of the points are `stride` apart."""

    def __init_subclass__(cls) -> None:
        for name, function in kernels_of(cls).items():
            setattr(cls, name, staticmethod(function))

    word = "tet"
    """What a cell is called in sentences."""
    corners = 10
    points = 4
    rows = 66
    """Rows of `out`: forces of the nodes, and what is kept of four points."""
    stresses = 0
    known = 6
    """Columns of `Block.modes`: ω², damping rate, what growth adds, weight; ω_Σ² and its rate."""
    constants = 0
    is_relative = False

    @staticmethod
    def of_material(lam: float, mu: float) -> tuple[float, ...]:
        """It needs no constants of its own."""
        return ()

    @classmethod
    def volumes(cls, rest: Floats) -> Floats:
        """V [m³], shape (cells,)."""
        return cls.at_points(rest)[1].sum(axis=1)

    @classmethod
    def gradients(cls, rest: Floats) -> Floats:
        """∇N of the nodes at the points [1/m], shape (cells, 4, 10, 3)."""
        return np.einsum("qab,eqbj->eqaj", tet10_slopes(TET_POINTS), cls.at_points(rest)[0])

    @classmethod
    def masses(cls, rest: Floats, density: float) -> Floats:
        """Lumped masses of the nodes [kg], shape (cells, 10)."""
        return density * np.outer(cls.volumes(rest), SHARES)

    @classmethod
    def products(cls, rest: Floats) -> Floats:
        """∫ N_a N_b dV [m³], shape (cells, 10, 10); of curved cells as if their Jacobian were the
        same everywhere.
        """
        return cls.volumes(rest)[:, None, None] * PRODUCTS

    @classmethod
    def matrices(cls, rest: Floats, lam: float, mu: float) -> Floats:
        """K_e at rest [N/m], shape (cells, 30, 30), of Lamé constants."""
        return hooke_blocks(cls.gradients(rest), cls.at_points(rest)[1], lam, mu)

    @classmethod
    def light(cls, rest: Floats) -> tuple[Floats, Floats]:
        """Gradients over the root of each node's share of the mass, and the points' shares of V."""
        volumes = cls.at_points(rest)[1]
        shares = volumes / volumes.sum(axis=1, keepdims=True)
        return cls.gradients(rest) / np.sqrt(SHARES)[:, None], shares

    @classmethod
    def frequency(cls, rest: Floats, lam: float, mu: float) -> Floats:
        """ω² [1/s²] of the stiffest mode of each cell with density 1 and lumped mass."""
        return each(rest, lambda r: top(hooke_blocks(*cls.light(r), lam, mu)))

    @classmethod
    def spread_square(cls, rest: Floats) -> Floats:
        """λ_max of Σ_q V_q/V ∇N_a·∇N_b over the roots of the nodes' shares [1/m²]."""
        return each(rest, cls._spread)

    @classmethod
    def _spread(cls, rest: Floats) -> Floats:
        g, shares = cls.light(rest)
        return top(np.einsum("eq,eqai,eqbi->eab", shares, g, g, optimize=True))

    @classmethod
    def swinging(cls, rest: Floats, lam: float, mu: float) -> Floats:
        """ω_Σ² of density 1, shape (cells, 1)."""
        g, shares = cls.light(rest)
        alone = stiffest(g.reshape(-1, 10, 3), lam, mu).reshape(shares.shape)
        return (shares * alone).sum(axis=1)[:, None]
