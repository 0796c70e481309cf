# mypy: ignore-errors
"""Strain and stress of tets, in the precision of their rest data."""

import taichi as ti

from tisoft.models.laws import (
    LINEAR,
    NEO_HOOKEAN,
    ST_VENANT,
    TENSOR,
    cofactor,
    green_strain,
    hooke,
    stress,
    symmetric,
    volume_change,
)

A = ti.types.ndarray


@ti.kernel
def tet_measures(
    law: ti.template(),
    tets: A(),
    gradient: A(),
    numbers: A(),
    u: A(),
    strain: A(),
    second_piola: A(),
    cauchy: A(),
    von_mises: A(),
    volume_ratio: A(),
):
    """Strain, stresses [Pa] and J of each tet; `numbers` holds λ' and μ' of its law."""
    for e in range(tets.shape[0]):
        N = ti.Matrix([[gradient[e, c, d] for d in range(3)] for c in range(3)])
        i = tets[e, 0]
        du = ti.Matrix([[u[tets[e, c + 1], d] - u[i, d] for c in range(3)] for d in range(3)])
        H = du @ N
        lam, mu = numbers[0], numbers[1]
        K = cofactor(H)
        change = volume_change(H, K)
        J = 1.0 + change
        P = stress(law, False, H, 0.0 * H, lam, mu, 0.0 * lam, 0.0 * lam)
        E = symmetric(H)
        S = P
        T = P
        if ti.static(law != LINEAR and law != TENSOR):
            E = green_strain(H)
            T = 0.0 * P
            if J != 0.0:
                T = (P + P @ H.transpose()) / J  # P Fᵀ/J
            if ti.static(law == ST_VENANT):
                S = hooke(E, lam, mu)
            if ti.static(law == NEO_HOOKEAN):
                S = 0.0 * P
                if J != 0.0:
                    F = H
                    for d in ti.static(range(3)):
                        F[d, d] += 1.0
                    S = cofactor(F).transpose() @ P / J  # F⁻¹P
        mean = T.trace() / 3.0
        dev = T
        for d in ti.static(range(3)):
            dev[d, d] -= mean
        von_mises[e] = ti.sqrt(1.5 * (dev.transpose() @ dev).trace())
        volume_ratio[e] = J
        for r, c in ti.static(ti.ndrange(3, 3)):
            strain[e, r, c] = E[r, c]
            second_piola[e, r, c] = S[r, c]
            cauchy[e, r, c] = T[r, c]
