# mypy: ignore-errors
"""Stress laws of linear tets: first Piola-Kirchhoff stress P of the displacement gradient H.

    x = X + u,  H = Σ u_a ⊗ ∇N_a,  F = I + H,  Ḣ = Σ v_a ⊗ ∇N_a,  force on corner a: −V P ∇N_a

    LINEAR       Ψ = λ/2 tr(e)² + μ e:e,  e = (H + Hᵀ)/2;  P = λ tr(e) I + 2μ e          (Hooke)
    ST_VENANT    Ψ = λ/2 tr(E)² + μ E:E,  E = (FᵀF − I)/2;  P = F S,  S = λ tr(E) I + 2μ E
                                                        (O'Brien and Hodgins 1999, eq. 7, 21)
    NEO_HOOKEAN  Ψ = μ'/2 (I_C − 3) + λ'/2 (J − α)² − μ'/2 ln(I_C + 1) + const, I_C = tr FᵀF
                                                        (Smith, de Goes and Kim 2018, eq. 14)

O'Brien and Hodgins write ε = FᵀF − I = 2E and σ = 2S, with half the volume in front of the force:
the same force.  Viscosity of the large-displacement laws is S_v = φ tr(Ė) I + 2η Ė with
Ė = (FᵀḢ + ḢᵀF)/2 (their eq. 8, 22: ν = 2Ė); the linear law uses ė = (Ḣ + Ḣᵀ)/2.

The neo-Hookean constants are μ' = 4μ/3, λ' = λ + 5μ/6, α = 1 + 3μ'/(4λ'), so that small strains
see λ and μ; the material table holds μ' and λ' where the others hold μ and λ (`law_constants`).
All terms are written in H, not F, so that small strains keep their digits in f32.
"""

import taichi as ti

LINEAR, ST_VENANT, NEO_HOOKEAN, TENSOR = 0, 1, 2, 3
"""TENSOR is the linear law of mass-tensor bodies, whose rows replace the loop over tets."""
LAWS = 4


def law_constants(law: int, lame_lambda: float, lame_mu: float) -> tuple[float, float]:
    """The two constants [Pa] that a law's formula takes, from λ and μ [Pa]."""
    if law == NEO_HOOKEAN:
        return lame_lambda + 5.0 * lame_mu / 6.0, 4.0 * lame_mu / 3.0
    return lame_lambda, lame_mu


@ti.func
def symmetric(A):
    """(A + Aᵀ)/2."""
    return 0.5 * (A + A.transpose())


@ti.func
def hooke(e, lam, mu):
    """λ tr(e) I + 2μ e."""
    t = lam * e.trace()
    return 2.0 * mu * e + ti.Matrix(
        [[t, 0.0 * t, 0.0 * t], [0.0 * t, t, 0.0 * t], [0.0 * t, 0.0 * t, t]]
    )


@ti.func
def cofactor(A):
    """cof A, with cof A = det(A) A⁻ᵀ where A is regular."""
    return ti.Matrix(
        [
            [
                A[1, 1] * A[2, 2] - A[1, 2] * A[2, 1],
                A[1, 2] * A[2, 0] - A[1, 0] * A[2, 2],
                A[1, 0] * A[2, 1] - A[1, 1] * A[2, 0],
            ],
            [
                A[0, 2] * A[2, 1] - A[0, 1] * A[2, 2],
                A[0, 0] * A[2, 2] - A[0, 2] * A[2, 0],
                A[0, 1] * A[2, 0] - A[0, 0] * A[2, 1],
            ],
            [
                A[0, 1] * A[1, 2] - A[0, 2] * A[1, 1],
                A[0, 2] * A[1, 0] - A[0, 0] * A[1, 2],
                A[0, 0] * A[1, 1] - A[0, 1] * A[1, 0],
            ],
        ]
    )


@ti.func
def volume_change(H, K):
    """J − 1 of F = I + H, with K = cof H; no digits are lost at small H."""
    t = H.trace()
    det = H[0, 0] * K[0, 0] + H[0, 1] * K[0, 1] + H[0, 2] * K[0, 2]
    return t + 0.5 * (t * t - (H @ H).trace()) + det


@ti.func
def green_strain(H):
    """E = (FᵀF − I)/2 of F = I + H."""
    return 0.5 * (H + H.transpose() + H.transpose() @ H)


@ti.func
def neo_hookean_stress(H, lam, mu):
    """P of the stable neo-Hookean law; lam and mu are λ' and μ'."""
    K = cofactor(H)
    i = 2.0 * H.trace() + (H.transpose() @ H).trace()  # I_C − 3
    j = volume_change(H, K)
    q = mu * i / (4.0 * (4.0 + i))
    t = H.trace()
    z = 0.0 * t
    spherical = ti.Matrix([[t, z, z], [z, t, z], [z, z, t]]) - H.transpose() + K  # cof F − I
    one = q + lam * j
    identity = ti.Matrix([[one, z, z], [z, one, z], [z, z, one]])
    return identity + q * H + 0.75 * mu * (H - spherical) + lam * j * spherical


@ti.func
def stress(law: ti.template(), viscous: ti.template(), H, D, lam, mu, phi, eta):
    """P [Pa] of the displacement gradient H and its rate D = Ḣ; `law` and `viscous` are static."""
    P = 0.0 * H
    if ti.static(law == LINEAR or law == TENSOR):
        P = hooke(symmetric(H), lam, mu)
        if ti.static(viscous):
            P += hooke(symmetric(D), phi, eta)
    if ti.static(law == ST_VENANT):
        S = hooke(green_strain(H), lam, mu)
        if ti.static(viscous):
            S += hooke(symmetric(D + H.transpose() @ D), phi, eta)
        P = S + H @ S
    if ti.static(law == NEO_HOOKEAN):
        P = neo_hookean_stress(H, lam, mu)
        if ti.static(viscous):
            S = hooke(symmetric(D + H.transpose() @ D), phi, eta)
            P += S + H @ S
    return P


@ti.func
def energy_density(law: ti.template(), H, lam, mu):
    """Ψ [J/m³], zero at rest."""
    psi = 0.0 * H[0, 0]
    if ti.static(law == NEO_HOOKEAN):
        i = 2.0 * H.trace() + (H.transpose() @ H).trace()
        j = volume_change(H, cofactor(H))
        psi = 0.5 * mu * i + 0.5 * lam * j * j - 0.75 * mu * j - 0.5 * mu * ti.log(1.0 + 0.25 * i)
    else:
        e = symmetric(H)
        if ti.static(law == ST_VENANT):
            e = green_strain(H)
        t = e.trace()
        psi = 0.5 * lam * t * t + mu * (e.transpose() @ e).trace()
    return psi
