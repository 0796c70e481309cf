# mypy: ignore-errors
"""How the amplitudes of a hexahedron's hourglass modes are pulled back, so that they are objective.

    z_h = (I + T)ᵀ q_h,   T = H where Ψ is St. Venant-Kirchhoff's, R − I where it stands strong
    compression (R the rotation of F = R U), 0 for small strains

The pull-back by F is exact for St. Venant-Kirchhoff bodies to first order in q, but fades as F
does.  As F changes R turns by ω = (tr U I − U)⁻¹ a, a × · = Rᵀ dF − dFᵀ R; in place of
M = Σ q_h ⊗ R_h that adds R [y × ·] to V P, y = (tr U I − U)⁻¹ b, b × · = RᵀM − MᵀR.

| symbol | name         |
| ------ | ------------ |
| q_h    | rows of `q`  |
| R_h = ∂W_hg/∂z_h | rows of `R` in `pushed` |
"""

from typing import Any

import taichi as ti

from tisoft.laws.base import cofactor, diagonal, symmetric, times, transposed_times


def turns(law: Any) -> bool:
    """Whether amplitudes are pulled back by the rotation of F alone."""
    return bool(getattr(law, "stands_compression", False))


@ti.func
def rotation(F):
    """R of F = R U, by Newton's iteration R ← (R + R⁻ᵀ)/2 (Higham 1986)."""
    R = F
    for _ in range(9):
        C = cofactor(R)
        det = R[0, 0] * C[0, 0] + R[0, 1] * C[0, 1] + R[0, 2] * C[0, 2]
        if ti.abs(det) < 1e-12:
            det = 1e-12 + 0.0 * det
        R = 0.5 * (R + C / det)
    return R


@ti.func
def crossing(a):
    """The matrix of a × ·."""
    z = 0.0 * a[0]
    return ti.Matrix([[z, -a[2], a[1]], [a[2], z, -a[0]], [-a[1], a[0], z]])


@ti.func
def skewed(R, A):
    """a of RᵀA − AᵀR = a × ·."""
    B = transposed_times(R, A)
    return ti.Vector([B[2, 1] - B[1, 2], B[0, 2] - B[2, 0], B[1, 0] - B[0, 1]])


@ti.func
def pulling(law: ti.template(), H):
    """T."""
    T = 0.0 * H
    if ti.static(law.is_finite):
        T = H
        if ti.static(turns(law)):
            one = diagonal(0.0 * H[0, 0] + 1.0)
            T = rotation(one + H) - one
    return T


@ti.func
def turner(law: ti.template(), H, T):
    """(tr U I − U)⁻¹: how fast R turns, of what `skewed` tells of a change of F; 0 where T is not
    a rotation's.
    """
    Z = 0.0 * H
    if ti.static(law.is_finite and turns(law)):
        one = diagonal(0.0 * H[0, 0] + 1.0)
        U = symmetric(transposed_times(one + T, one + H))
        Y = diagonal(U.trace()) - U
        C = cofactor(Y)
        det = Y[0, 0] * C[0, 0] + Y[0, 1] * C[0, 1] + Y[0, 2] * C[0, 2]
        if ti.abs(det) < 1e-12:
            det = 1e-12 + 0.0 * det
        Z = C / det
    return Z


@ti.func
def pulling_rate(law: ti.template(), T, Z, G):
    """The derivative of T along the change G of H; Z of `turner`.

    It is its own transpose: of G = Σ q_h ⊗ R_h [N·m] it is ∂/∂F of G : (I + T), which the pull-back
    adds to V P.
    """
    dT = 0.0 * G
    if ti.static(law.is_finite):
        dT = G
        if ti.static(turns(law)):
            R = diagonal(0.0 * T[0, 0] + 1.0) + T
            dT = times(R, crossing(Z @ skewed(R, G)))
    return dT


@ti.func
def pulling_curvature(law: ti.template(), H, T, Z, M, dM, G, dT):
    """The derivative of `pulling_rate` of M along the change G of H, which changes M by dM and T by
    dT.
    """
    P = 0.0 * M
    if ti.static(law.is_finite):
        P = dM
        if ti.static(turns(law)):
            one = diagonal(0.0 * H[0, 0] + 1.0)
            R, F = one + T, one + H
            y = Z @ skewed(R, M)
            dU = symmetric(transposed_times(dT, F) + transposed_times(R, G))
            left = skewed(dT, M) + skewed(R, dM) - (dU.trace() * y - dU @ y)
            P = times(dT, crossing(y)) + times(R, crossing(Z @ left))
    return P


@ti.func
def pulled(q, T):
    """(I + T)ᵀ q_h of each mode, shape (4, 3)."""
    z = q
    for h in range(4):
        for i in range(3):
            for j in range(3):
                z[h, i] += q[h, j] * T[j, i]
    return z


@ti.func
def pushed(R, T):
    """(I + T) R_h of each mode, shape (4, 3)."""
    r = R
    for h in range(4):
        for i in range(3):
            for j in range(3):
                r[h, i] += T[i, j] * R[h, j]
    return r
