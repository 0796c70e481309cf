# mypy: ignore-errors
"""What the laws are written with; all of it in the displacement gradient H = F − I.

    e = (H + Hᵀ)/2,   E = (FᵀF − I)/2 = (H + Hᵀ + HᵀH)/2,   J = det F

Written in H, small strains keep their digits in f32.

A law is a class without state (see `st_venant` for a short one):

| member                | is                                                                     |
| --------------------- | ---------------------------------------------------------------------- |
| `constants(λ, μ)`     | what its formula takes [Pa], any number of them: the material row m     |
| `stress(H, m)`        | P = ∂Ψ/∂F, the first Piola-Kirchhoff stress [Pa]                        |
| `energy(H, m)`        | Ψ [J/m³], 0 at rest                                                     |
| `tangent(H, G, m)`    | ∂P/∂F : G [Pa]                                                          |
| `stiffening(H, m)`    | (a, b, c): as deformed, its tangent is at most a times that at rest plus |
|                       | b [Pa] in every direction, and its viscosity c times that at rest       |
| `viscosity`           | the viscous stress that goes with it (`viscous`)                        |
| `is_finite`           | whether it holds for large rotations (its strain is Green's)            |
| `stands_compression`  | optional, True where it keeps its stiffness however flat it is pressed: |
|                       | hexahedra then keep theirs (`elements.pull_back`)                       |
"""

import taichi as ti


@ti.func
def times(A, B):
    """A B.  (Loops at run time: Taichi would unroll A @ B while it reads the code, ten times as
    slowly; LLVM unrolls these.)
    """
    C = 0.0 * A
    for r in range(3):
        for c in range(3):
            for k in range(3):
                C[r, c] += A[r, k] * B[k, c]
    return C


@ti.func
def transposed_times(A, B):
    """Aᵀ B."""
    C = 0.0 * A
    for r in range(3):
        for c in range(3):
            for k in range(3):
                C[r, c] += A[k, r] * B[k, c]
    return C


@ti.func
def contracted(A, B):
    """A:B = tr AᵀB."""
    t = 0.0 * A[0, 0]
    for r in range(3):
        for c in range(3):
            t += A[r, c] * B[r, c]
    return t


@ti.func
def symmetric(A):
    """(A + Aᵀ)/2."""
    return 0.5 * (A + A.transpose())


@ti.func
def diagonal(t):
    """t I."""
    z = 0.0 * t
    return ti.Matrix([[t, z, z], [z, t, z], [z, z, t]])


@ti.func
def hooke(e, lam, mu):
    """λ tr(e) I + 2μ e."""
    return 2.0 * mu * e + diagonal(lam * e.trace())


@ti.func
def hooke_energy(e, lam, mu):
    """λ tr(e)²/2 + μ e:e of a symmetric e."""
    t = e.trace()
    return 0.5 * lam * t * t + mu * contracted(e, e)


@ti.func
def green_strain(H):
    """E = (FᵀF − I)/2."""
    return 0.5 * (H + H.transpose() + transposed_times(H, H))


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
def cofactor_change(H, K):
    """cof F − I, with K = cof H."""
    return diagonal(H.trace()) - H.transpose() + K


@ti.func
def cofactor_rate(B, G):
    """∂cof B/∂B : G."""
    rows = 0.0 * G
    for r in ti.static(range(3)):
        p, q = ti.static((r + 1) % 3, (r + 2) % 3)
        for c in ti.static(range(3)):
            s, t = ti.static((c + 1) % 3, (c + 2) % 3)
            rows[r, c] = (
                B[p, s] * G[q, t] + G[p, s] * B[q, t] - B[p, t] * G[q, s] - G[p, t] * B[q, s]
            )
    return rows


@ti.func
def volume_change(H, K):
    """J − 1, with K = cof H; no digits are lost at small H."""
    t = H.trace()
    det = H[0, 0] * K[0, 0] + H[0, 1] * K[0, 1] + H[0, 2] * K[0, 2]
    return t + 0.5 * (t * t - contracted(H, H.transpose())) + det


@ti.func
def largest_eigenvalue(A):
    """An upper bound of λ_max of a symmetric 3×3 matrix, exact for uniaxial tension:
    λ_max(A) ≤ m + 2 √(|dev A|²/6), m = tr A/3.
    """
    m = A.trace() / 3.0
    off = A[0, 1] * A[0, 1] + A[0, 2] * A[0, 2] + A[1, 2] * A[1, 2]
    a, b, c = A[0, 0] - m, A[1, 1] - m, A[2, 2] - m
    return m + 2.0 * ti.sqrt((a * a + b * b + c * c + 2.0 * off) / 6.0)


@ti.func
def eigenvalues(A):
    """Those of a symmetric 3×3 matrix, the largest first (Smith 1961)."""
    m = A.trace() / 3.0
    B = A - diagonal(m)
    p = ti.sqrt(contracted(B, B) / 6.0)
    det = B[0, 0] * (B[1, 1] * B[2, 2] - B[1, 2] * B[2, 1])
    det -= B[0, 1] * (B[1, 0] * B[2, 2] - B[1, 2] * B[2, 0])
    det += B[0, 2] * (B[1, 0] * B[2, 1] - B[1, 1] * B[2, 0])
    share = 0.5 * det / ti.max(p * p * p, 1e-30)
    angle = ti.acos(ti.min(ti.max(share, 0.0 * m - 1.0), 0.0 * m + 1.0)) / 3.0
    most, least = 2.0 * p * ti.cos(angle), 2.0 * p * ti.cos(angle + 2.0943951023931953)
    return ti.Vector([m + most, m - most - least, m + least])


@ti.func
def stretch_square(E):
    """An upper bound of λ_max(FᵀF), from Green's strain."""
    return ti.max(1.0 + 2.0 * largest_eigenvalue(E), 0.0 * E[0, 0])


@ti.func
def least_square(E):
    """A lower bound of λ_min(FᵀF), from Green's strain; .01 at the least, to divide by."""
    return ti.max(1.0 - 2.0 * largest_eigenvalue(-E), 0.01 + 0.0 * E[0, 0])
