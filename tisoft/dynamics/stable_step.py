# mypy: ignore-errors
"""The stable step: bounds from elements and springs that are never above the true limit.

The lectures' scheme v += h a(x, v), x += h v is stable exactly while 4M − 2hC − h²K is positive
definite.  Element by element, with the element's own lumped masses, that is sufficient: for a tet
whose stiffest mode has ω² and damping rate d = 2ζω, and point damping g [1/s],

    h²ω² + 2h (d + g) ≤ 4   ⟸   h ≤ 4 / (d + g + √((d + g)² + 4ω²))

While a tet deforms (F, Green strain E, second Piola-Kirchhoff stress S), its tangent obeys

    St. Venant-Kirchhoff   ω² ≤ ω₀² λ_max(FᵀF) + (4γ/ρ) max(0, λ_max(S)),   d ≤ d₀ λ_max(FᵀF)
    neo-Hookean            ω² ≤ (4γ/ρ) [3/2 μ' + λ' (|cof F|² + |J − α| |F|)]

with γ = λ_max(∇N_a·∇N_b) and λ_max(A) ≤ m + 2√(|dev A|²/6), m = tr A/3 (exact in tension).
Velocity Verlet sees damping twice as much: h²ω² + 4h (d + g) ≤ 4 (`DAMPING_FACTOR`).
A spring between i and j, masses shared out by stiffness: ω² ≤ K_i/m_i + K_j/m_j with K_i the sum
of the stiffnesses at i; neither compression nor tension makes a spring stiffer than k.
"""

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from tisoft.dynamics.nodes import EXPLICIT_EULER, SYMPLECTIC_EULER, VELOCITY_VERLET
from tisoft.models.laws import (
    LINEAR,
    NEO_HOOKEAN,
    ST_VENANT,
    TENSOR,
    cofactor,
    green_strain,
    hooke,
    volume_change,
)

Floats = NDArray[np.float64]


DAMPING_FACTOR = {SYMPLECTIC_EULER: 1, VELOCITY_VERLET: 2, EXPLICIT_EULER: 1}


def longest_step(omega2: Floats, rate: Floats) -> Floats:
    """h [s] of ω² [1/s²] and damping rate d + g [1/s]; inf where neither acts."""
    with np.errstate(divide="ignore"):
        out: Floats = 4.0 / (rate + np.sqrt(rate * rate + 4.0 * omega2))
    return out


def spring_frequencies(
    springs: NDArray[np.int64], numbers: Floats, inverse_mass: Floats
) -> tuple[Floats, Floats]:
    """ω² and damping rate of each spring's bound; `numbers` has columns k, L₀, c."""
    nodes = len(inverse_mass)
    share = []
    for column in (0, 2):
        total = np.bincount(springs.ravel(), np.repeat(numbers[:, column], 2), minlength=nodes)
        share.append((total * inverse_mass)[springs].sum(axis=1))
    return share[0], share[1]


@ti.func
def largest_eigenvalue(A):
    """An upper bound of λ_max of a symmetric 3×3 matrix, exact for uniaxial tension."""
    m = A.trace() / 3.0
    off = A[0, 1] * A[0, 1] + A[0, 2] * A[0, 2] + A[1, 2] * A[1, 2]
    a, b, c = A[0, 0] - m, A[1, 1] - m, A[2, 2] - m
    return m + 2.0 * ti.sqrt((a * a + b * b + c * c + 2.0 * off) / 6.0)


@ti.func
def place_limit(
    b,
    lane,
    law: ti.template(),
    nodes: ti.template(),
    shapes: ti.template(),
    owner: ti.template(),
    material: ti.template(),
    u: ti.template(),
    rest_modes: ti.template(),
    factor: ti.template(),
):
    """Longest stable step [s] of the tet in batch b, lane `lane`."""
    N = ti.Matrix([[shapes[b, 3 * c + d, lane] for d in range(3)] for c in range(3)])
    i = nodes[b, 0, lane]
    du = ti.Matrix([[u[nodes[b, c + 1, lane], d] - u[i, d] for c in range(3)] for d in range(3)])
    H = du @ N
    m = owner[b]
    lam, mu, damping = material[m, 0], material[m, 1], material[m, 4]
    omega2 = rest_modes[0, b, lane]
    rate = rest_modes[1, b, lane]
    stretch = 1.0 + 0.0 * lam
    if ti.static(law != LINEAR and law != TENSOR):
        E = green_strain(H)
        stretch = ti.max(1.0 + 2.0 * largest_eigenvalue(E), 0.0 * lam)
        if ti.static(law == ST_VENANT):
            top = largest_eigenvalue(hooke(E, lam, mu))
            omega2 = omega2 * stretch + rest_modes[2, b, lane] * ti.max(top, 0.0 * top)
        if ti.static(law == NEO_HOOKEAN):
            K = cofactor(H)
            t = H.trace()
            cof = K - H.transpose()
            for d in ti.static(range(3)):
                cof[d, d] += 1.0 + t
            j = volume_change(H, K) - 0.75 * mu / lam
            size = ti.sqrt(3.0 + 2.0 * t + (H.transpose() @ H).trace())
            grown = 1.5 * mu + lam * ((cof.transpose() @ cof).trace() + ti.abs(j) * size)
            omega2 = rest_modes[2, b, lane] * grown
    total = factor * (rate * stretch + damping)
    return 4.0 / (total + ti.sqrt(total * total + 4.0 * omega2))


@ti.kernel
def batch_limits(
    laws: ti.template(),
    lanes: ti.template(),
    factor: ti.template(),
    law_starts: ti.types.ndarray(),
    nodes: ti.types.ndarray(),
    shapes: ti.types.ndarray(),
    owner: ti.types.ndarray(),
    material: ti.types.ndarray(),
    u: ti.types.ndarray(),
    rest_modes: ti.types.ndarray(),
    limits: ti.types.ndarray(),
):
    """Longest stable step [s] of each batch, shape (batches,)."""
    for law in ti.static(laws):
        for b in range(law_starts[law], law_starts[law + 1]):
            least = place_limit(b, 0, law, nodes, shapes, owner, material, u, rest_modes, factor)
            for lane in range(1, lanes):
                here = place_limit(
                    b, lane, law, nodes, shapes, owner, material, u, rest_modes, factor
                )
                if not here >= least:  # also where it is not a number
                    least = here
            limits[b] = least
