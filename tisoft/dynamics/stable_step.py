# mypy: ignore-errors
"""The stable step: bounds from elements and springs that are never above the true limit.

The lectures' scheme v += h a(x, v), x += h v is stable exactly while 4M − 2hC − h²K is positive
definite.  With ω² and d = 2ζω those of a tet's stiffest mode (with its own lumped masses m_e),
uᵀK_e u ≤ m_e ω² Σ_a |u_a|² and likewise for C, so that node by node it is sufficient to have

    h²ω² + 2h (d + g) ≤ 4   ⟺   h ≤ 4 / (d + g + √((d + g)² + 4ω²))

with ω² and d averaged over the tets at the node, by mass, and point damping g [1/s].  The average
is never worse than the worst tet alone, and much better around slivers, whose nodes are heavier
than the sliver is.

While a tet deforms (F, Green strain E, second Piola-Kirchhoff stress S), its tangent obeys

    St. Venant-Kirchhoff   ω² ≤ ω₀² λ_max(FᵀF) + (4γ/ρ) max(0, λ_max(S)),   d ≤ d₀ λ_max(FᵀF)
    neo-Hookean            ω² ≤ ω₀² + (4γ/ρ) |A(F) − A(I)|,  A = ∂P/∂F (`neo_hookean_growth`)

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
def neo_hookean_growth(H, lam, mu):
    """A bound of |A(F) − A(I)| [Pa], A = ∂P/∂F of the neo-Hookean law; 0 at rest."""
    K = cofactor(H)
    t = H.trace()
    square = (H.transpose() @ H).trace()
    change = ti.sqrt(square)  # |H|
    size = ti.sqrt(ti.max(3.0 + 2.0 * t + square, 0.0 * t))  # |F|
    root3 = ti.sqrt(3.0 + 0.0 * t)
    bend = K - H.transpose()  # cof F − I
    for d in ti.static(range(3)):
        bend[d, d] += t
    turn = ti.sqrt((bend.transpose() @ bend).trace())
    a = 1.0 / (4.0 + 2.0 * t + square)  # 1/(I_C + 1)
    away = root3 * ti.abs(a - 0.25) + a * change
    shear = mu * (ti.max(0.25 - a, 0.0 * a) + 2.0 * away * (a * size + 0.25 * root3))
    # The derivative of cof F has a norm of (2/√3) |F| at the most, reached by F = s I.
    swell = lam * (turn * (turn + 2.0 * root3) + 2.0 / root3 * ti.abs(volume_change(H, K)) * size)
    return shear + swell + 1.5 / root3 * mu * change


@ti.func
def place_modes(
    b,
    lane,
    law: ti.template(),
    nodes: ti.template(),
    shapes: ti.template(),
    owner: ti.template(),
    material: ti.template(),
    u: ti.template(),
    rest_modes: ti.template(),
):
    """ω² [1/s²] and damping rate [1/s] that bound the tet in batch b, lane `lane`, as deformed, and
    its J = det F.
    """
    N = ti.Matrix([[shapes[b, 3 * c + d, lane] for d in range(3)] for c in range(3)])
    i = nodes[b, 0, lane]
    du = ti.Matrix([[u[nodes[b, c + 1, lane], d] - u[i, d] for c in range(3)] for d in range(3)])
    H = du @ N
    m = owner[b]
    lam, mu = material[m, 0], material[m, 1]
    omega2 = rest_modes[0, b, lane]
    stretch = 1.0 + 0.0 * lam
    if ti.static(law != LINEAR and law != TENSOR):
        E = green_strain(H)
        stretch = ti.max(1.0 + 2.0 * largest_eigenvalue(E), 0.0 * lam)
        if ti.static(law == ST_VENANT):
            top = largest_eigenvalue(hooke(E, lam, mu))
            omega2 = omega2 * stretch + rest_modes[2, b, lane] * ti.max(top, 0.0 * top)
        if ti.static(law == NEO_HOOKEAN):
            omega2 += rest_modes[2, b, lane] * neo_hookean_growth(H, lam, mu)
    return omega2, rest_modes[1, b, lane] * stretch, 1.0 + volume_change(H, cofactor(H))


@ti.kernel
def node_limits(
    laws: ti.template(),
    lanes: ti.template(),
    factor: ti.template(),
    alone: ti.template(),
    law_starts: ti.types.ndarray(),
    nodes: ti.types.ndarray(),
    shapes: ti.types.ndarray(),
    owner: ti.types.ndarray(),
    material: ti.types.ndarray(),
    u: ti.types.ndarray(),
    rest_modes: ti.types.ndarray(),
    modes: ti.types.ndarray(),
    body: ti.types.ndarray(),
    starts: ti.types.ndarray(),
    corners: ti.types.ndarray(),
    limits: ti.types.ndarray(),
):
    """Longest stable step [s] by each node's tets, shape (nodes,); inf where it has none.

    `modes` holds what bounds each tet, ω² and damping rate, which nodes average by volume, and J.
    """
    for law in ti.static(laws):
        if ti.static(alone):
            ti.loop_config(serialize=True)
        for b in range(law_starts[law], law_starts[law + 1]):
            for lane in range(lanes):
                omega2, rate, J = place_modes(
                    b, lane, law, nodes, shapes, owner, material, u, rest_modes
                )
                modes[0, b, lane] = omega2
                modes[1, b, lane] = rate
                modes[2, b, lane] = J
    if ti.static(alone):
        ti.loop_config(serialize=True)
    for i in range(limits.shape[0]):
        volume = 0.0 * shapes[0, 9, 0]
        omega2, rate = 0.0 * volume, 0.0 * volume
        for q in range(starts[i], starts[i + 1]):
            b = corners[q] // (12 * lanes)
            lane = corners[q] % lanes
            part = shapes[b, 9, lane]
            volume += part
            omega2 += part * modes[0, b, lane]
            rate += part * modes[1, b, lane]
        limits[i] = 1e30
        if volume > 0.0:
            total = factor * (rate / volume + material[body[i], 4])
            limits[i] = 4.0 / (total + ti.sqrt(total * total + 4.0 * omega2 / volume))
