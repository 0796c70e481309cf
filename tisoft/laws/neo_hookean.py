# mypy: ignore-errors
"""Stable neo-Hookean law: stands compression, and finds its way back from being inside out.

    Ψ = μ'/2 (I_C − 3) + λ'/2 (J − α)² − μ'/2 ln(I_C + 1) + const,   I_C = tr FᵀF
                                                          (Smith, de Goes and Kim 2018, eq. 14)

with μ' = 4μ/3, λ' = λ + 5μ/6, α = 1 + 3μ'/(4λ'), so that small strains see λ and μ.

    ∂P/∂F : G = μ'(1 − 1/(I_C + 1)) G + μ' dI_C/(I_C + 1)² F + λ' dJ cof F + λ'(J − α) dcof
    dI_C = 2 F:G,   dJ = cof F : G,   dcof = ∂cof F/∂F : G
    stiffening: A = ∂P/∂F along the principal axes, with stretches s_k and q_k = λ'(J − α) s_k:
    shears μ'(1 − 1/(I_C + 1)) ± q_k, and stretches μ'(1 − 1/(I_C + 1)) δ_ij
    + 2μ'/(I_C + 1)² s_i s_j + λ' cof_i cof_j + q_k (i ≠ j ≠ k);  its growth is the largest
    eigenvalue of what is more than at s = 1, whatever the rotation
                                                        (Smith, de Goes and Kim 2019, section 4)

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
    eigenvalues,
    green_strain,
    largest_eigenvalue,
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
        """b = λ_max(A(F) − A(I)) [Pa], both as seen after F's rotation; 0 at rest."""
        lam, mu = m[0], m[1]
        E = green_strain(H)
        e = eigenvalues(E)
        j = volume_change(H, cofactor(H))
        s = ti.Vector([ti.sqrt(ti.max(1.0 + 2.0 * e[k], 0.0 * j)) for k in ti.static(range(3))])
        d = ti.Vector([2.0 * e[k] / (1.0 + s[k]) for k in ti.static(range(3))])  # s − 1
        if j < -1.0:
            s[2] = -s[2]
            d[2] = s[2] - 1.0
        size = 4.0 + 2.0 * E.trace()  # I_C + 1
        base = 0.5 * mu * E.trace() / size  # μ'(1/4 − 1/(I_C + 1))
        spread = 2.0 * mu / (size * size)
        g = 0.0 * d  # cof F − I
        swollen = 0.0 * d  # λ'(J − α) s_k less that at rest
        for k in ti.static(range(3)):
            p, q = ti.static((k + 1) % 3, (k + 2) % 3)
            g[k] = d[p] + d[q] + d[p] * d[q]
            swollen[k] = lam * j * s[k] - 0.75 * mu * d[k]
        swell = diagonal(0.0 * j)
        for k in ti.static(range(3)):
            p, q = ti.static((k + 1) % 3, (k + 2) % 3)
            swell[k, k] = base + spread * s[k] * s[k] - 0.125 * mu + lam * g[k] * (2.0 + g[k])
            shear = spread * s[p] * s[q] - 0.125 * mu + swollen[k]
            shear += lam * (g[p] + g[q] + g[p] * g[q])
            swell[p, q] = shear
            swell[q, p] = shear
        turn = base + ti.abs(swollen).max()
        growth = ti.max(largest_eigenvalue(swell), turn, 0.0 * j)
        return ti.Vector([1.0 + 0.0 * lam, growth, stretch_square(E)])
