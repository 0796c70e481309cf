# mypy: ignore-errors
"""Stable neo-Hookean law: stands compression, and finds its way back from being inside out.

    Ψ = μ'/2 (I_C − 3) + λ'/2 (J − α)² − μ'/2 ln(I_C + 1) + const,   I_C = tr FᵀF
                                                          (Smith, de Goes and Kim 2018, eq. 14)

with μ' = 4μ/3, λ' = λ + 5μ/6, α = 1 + 3μ'/(4λ'), so that small strains see λ and μ.

    ∂P/∂F : G = μ'(1 − 1/(I_C + 1)) G + μ' dI_C/(I_C + 1)² F + λ' dJ cof F + λ'(J − α) dcof
    dI_C = 2 F:G,   dJ = cof F : G,   dcof = ∂cof F/∂F : G
    stiffening: a bound of |A(F) − A(I)|, A = ∂P/∂F

| symbol  | name      | unit |
| ------- | --------- | ---- |
| λ', μ'  | m[0], m[1] | Pa  |
"""

import taichi as ti

from tisoft.laws.base import (
    cofactor,
    cofactor_change,
    cofactor_rate,
    contracted,
    diagonal,
    green_strain,
    stretch_square,
    volume_change,
)
from tisoft.laws.viscous import GreenRate


class NeoHookean:
    """The law of `NeoHookean` bodies."""

    is_finite = True
    stands_compression = True
    viscosity = GreenRate

    @staticmethod
    def constants(lame_lambda: float, lame_mu: float) -> tuple[float, ...]:
        """λ' and μ' [Pa]."""
        return lame_lambda + 5.0 * lame_mu / 6.0, 4.0 * lame_mu / 3.0

    @staticmethod
    @ti.func
    def stress(H, m):
        """P [Pa]."""
        lam, mu = m[0], m[1]
        K = cofactor(H)
        i = 2.0 * H.trace() + contracted(H, H)  # I_C − 3
        j = volume_change(H, K)
        q = mu * i / (4.0 * (4.0 + i))
        turned = cofactor_change(H, K)
        return diagonal(q + lam * j) + q * H + 0.75 * mu * (H - turned) + lam * j * turned

    @staticmethod
    @ti.func
    def energy(H, m):
        """Ψ [J/m³]."""
        lam, mu = m[0], m[1]
        i = 2.0 * H.trace() + contracted(H, H)
        j = volume_change(H, cofactor(H))
        return 0.5 * mu * i + 0.5 * lam * j * j - 0.75 * mu * j - 0.5 * mu * ti.log(1.0 + 0.25 * i)

    @staticmethod
    @ti.func
    def tangent(H, G, m):
        """∂P/∂F : G [Pa]."""
        lam, mu = m[0], m[1]
        one = diagonal(0.0 * lam + 1.0)
        K = cofactor(H)
        cof = one + cofactor_change(H, K)
        size = 4.0 + 2.0 * H.trace() + contracted(H, H)  # I_C + 1
        excess = volume_change(H, K) - 0.75 * mu / lam  # J − α
        grown = 2.0 * (G.trace() + contracted(H, G))  # dI_C
        swelling = contracted(cof, G)  # dJ
        spread = diagonal(G.trace()) - G.transpose() + cofactor_rate(H, G)  # dcof
        return (
            mu * (1.0 - 1.0 / size) * G
            + (mu * grown / (size * size)) * (one + H)
            + lam * swelling * cof
            + lam * excess * spread
        )

    @staticmethod
    @ti.func
    def stiffening(H, m):
        """A bound of |A(F) − A(I)| [Pa]; 0 at rest."""
        lam, mu = m[0], m[1]
        K = cofactor(H)
        t = H.trace()
        square = contracted(H, H)
        change = ti.sqrt(square)  # |H|
        size = ti.sqrt(ti.max(3.0 + 2.0 * t + square, 0.0 * t))  # |F|
        root3 = ti.sqrt(3.0 + 0.0 * t)
        bend = cofactor_change(H, K)
        turn = ti.sqrt(contracted(bend, bend))
        a = 1.0 / (4.0 + 2.0 * t + square)  # 1/(I_C + 1)
        away = root3 * ti.abs(a - 0.25) + a * change
        shear = mu * (ti.max(0.25 - a, 0.0 * a) + 2.0 * away * (a * size + 0.25 * root3))
        # The derivative of cof F has a norm of (2/√3) |F| at the most, reached by F = s I.
        swollen = 2.0 / root3 * ti.abs(volume_change(H, K)) * size
        swell = lam * (turn * (turn + 2.0 * root3) + swollen)
        growth = shear + swell + 1.5 / root3 * mu * change
        return ti.Vector([1.0 + 0.0 * lam, growth, stretch_square(green_strain(H))])
