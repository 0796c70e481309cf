# mypy: ignore-errors
"""Tangent stiffness of tets and springs, matrix-free, beside the force and energy it belongs to.

    K(u) w = −∂f/∂u · w,   f = −∂V/∂u

Tets: H = Σ u_a ⊗ ∇N_a, G = Σ w_a ⊗ ∇N_a, (K w)_a = V dP ∇N_a with dP = ∂P/∂F : G (laws.py has P):

| law         | dP                                                                           |
| ----------- | ---------------------------------------------------------------------------- |
| LINEAR      | λ tr(e) I + 2μ e,  e = (G + Gᵀ)/2                                            |
| ST_VENANT   | G S + F dS,  dS = λ tr(dE) I + 2μ dE,  dE = (FᵀG + GᵀF)/2                     |
| NEO_HOOKEAN | μ'(1 − 1/(I_C + 1)) G + μ' dI_C/(I_C + 1)² F + λ' dJ cof F + λ'(J − α) dcof,  |
|             | dI_C = 2 F:G,  dJ = cof F : G,  dcof = ∂cof F/∂F : G                          |

Spring along n = y/L with tension T = k (L − L₀) (rows.py has its force):

    (K w)_i = Σ_j [k n nᵀ + T/L (1 − n nᵀ)] (w_i − w_j)

Elements write to their own slots and nodes sum them in element order, so bits never depend on the
number of threads.  Everything is meant for f64 arrays.
"""

import taichi as ti

from tisoft.models.laws import (
    NEO_HOOKEAN,
    ST_VENANT,
    cofactor,
    energy_density,
    green_strain,
    hooke,
    stress,
    symmetric,
    volume_change,
)
from tisoft.models.rows import spring_force

FORCE, PRODUCT, RATE = 0, 1, 2
"""What a launch computes: f(u), K(u) w, or C(u) w, the viscous resistance to velocities w."""

A = ti.types.ndarray


@ti.func
def diagonal(t):
    """t I."""
    z = 0.0 * t
    return ti.Matrix([[t, z, z], [z, t, z], [z, z, t]])


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
def neo_hookean_tangent(H, G, lam, mu):
    """dP of the stable neo-Hookean law; lam and mu are λ' and μ'."""
    one = diagonal(0.0 * lam + 1.0)
    F = one + H
    K = cofactor(H)
    cof = one * (1.0 + H.trace()) - H.transpose() + K
    size = 4.0 + 2.0 * H.trace() + (H.transpose() @ H).trace()  # I_C + 1
    excess = volume_change(H, K) - 0.75 * mu / lam  # J − α
    grown = 2.0 * (G.trace() + (H.transpose() @ G).trace())  # dI_C
    swelling = (cof.transpose() @ G).trace()  # dJ
    spread = diagonal(G.trace()) - G.transpose() + cofactor_rate(H, G)  # dcof
    return (
        mu * (1.0 - 1.0 / size) * G
        + (mu * grown / (size * size)) * F
        + lam * swelling * cof
        + lam * excess * spread
    )


@ti.func
def tangent(law: ti.template(), H, G, lam, mu):
    """dP [Pa] = ∂P/∂F : G at the displacement gradient H; `law` is static."""
    dP = hooke(symmetric(G), lam, mu)
    if ti.static(law == ST_VENANT):
        dS = hooke(symmetric(G + H.transpose() @ G), lam, mu)
        dP = G @ hooke(green_strain(H), lam, mu) + dS + H @ dS
    if ti.static(law == NEO_HOOKEAN):
        dP = neo_hookean_tangent(H, G, lam, mu)
    return dP


@ti.func
def tet_gradient(e, tets: ti.template(), N, w: ti.template()):
    """Σ w_a ⊗ ∇N_a of tet e; N holds ∇N_1..3 as rows."""
    i = tets[e, 0]
    d = ti.Matrix([[w[tets[e, c + 1], r] - w[i, r] for c in range(3)] for r in range(3)])
    return d @ N


@ti.func
def spring_product(
    i,
    starts: ti.template(),
    neighbours: ti.template(),
    data: ti.template(),
    u: ti.template(),
    w: ti.template(),
):
    """Σ_j [k n nᵀ + T/L (1 − n nᵀ)] (w_i − w_j) of node i [N]."""
    ui = ti.Vector([u[i, 0], u[i, 1], u[i, 2]])
    wi = ti.Vector([w[i, 0], w[i, 1], w[i, 2]])
    out = 0.0 * ui
    for q in range(starts[i], starts[i + 1]):
        j = neighbours[q]
        d = ti.Vector([data[q, 0], data[q, 1], data[q, 2]])
        change = ti.Vector([u[j, 0], u[j, 1], u[j, 2]]) - ui
        y = d + change
        length = y.norm()
        if length > 0.0:
            elongation = (2.0 * d.dot(change) + change.dot(change)) / (length + data[q, 3])
            pull = data[q, 5] * (elongation + data[q, 4]) / length  # T/L
            n = y / length
            across = wi - ti.Vector([w[j, 0], w[j, 1], w[j, 2]])
            along = n.dot(across)
            out += pull * (across - along * n) + data[q, 5] * along * n
    return out


@ti.func
def spring_rate(
    i,
    starts: ti.template(),
    neighbours: ti.template(),
    data: ti.template(),
    u: ti.template(),
    w: ti.template(),
):
    """Σ_j c n nᵀ (w_i − w_j) of node i [N]."""
    wi = ti.Vector([w[i, 0], w[i, 1], w[i, 2]])
    out = 0.0 * wi
    for q in range(starts[i], starts[i + 1]):
        j = neighbours[q]
        y = ti.Vector([data[q, d] + u[j, d] - u[i, d] for d in range(3)])
        across = wi - ti.Vector([w[j, 0], w[j, 1], w[j, 2]])
        if y.norm() > 0.0:
            out += (data[q, 6] * y.dot(across) / y.dot(y)) * y
    return out


@ti.kernel
def nodal(
    what: ti.template(),
    law: ti.template(),
    tets: ti.template(),
    springs: ti.template(),
    corner_nodes: A(),
    gradient: A(),
    volume: A(),
    constants: A(),
    slots: A(),
    starts: A(),
    corners: A(),
    spring_starts: A(),
    spring_ends: A(),
    spring_data: A(),
    u: A(),
    w: A(),
    out: A(),
):
    """out = f(u), K(u) w or C(u) w, shape (nodes, 3) [N]; constants are λ', μ', φ, η."""
    if ti.static(tets):
        for e in range(corner_nodes.shape[0]):
            lam, mu, phi, eta = constants[0], constants[1], constants[2], constants[3]
            N = ti.Matrix([[gradient[e, 3 * c + d] for d in range(3)] for c in range(3)])
            H = tet_gradient(e, corner_nodes, N, u)
            P = 0.0 * H
            if ti.static(what == FORCE):
                P = -stress(law, False, H, H, lam, mu, phi, eta)
            else:
                G = tet_gradient(e, corner_nodes, N, w)
                if ti.static(what == PRODUCT):
                    P = tangent(law, H, G, lam, mu)
                else:
                    P = stress(law, True, H, G, 0.0 * lam, 0.0 * mu, phi, eta)
            f = volume[e] * (P @ N.transpose())
            for d in ti.static(range(3)):
                slots[4 * e, d] = -(f[d, 0] + f[d, 1] + f[d, 2])
                for c in ti.static(range(3)):
                    slots[4 * e + c + 1, d] = f[d, c]
    for i in range(out.shape[0]):
        f = 0.0 * ti.Vector([u[i, 0], u[i, 1], u[i, 2]])
        if ti.static(tets):
            for q in range(starts[i], starts[i + 1]):
                for d in ti.static(range(3)):
                    f[d] += slots[corners[q], d]
        if ti.static(springs):
            if ti.static(what == FORCE):
                f += spring_force(i, False, spring_starts, spring_ends, spring_data, u, u)
            elif ti.static(what == PRODUCT):
                f += spring_product(i, spring_starts, spring_ends, spring_data, u, w)
            else:
                f += spring_rate(i, spring_starts, spring_ends, spring_data, u, w)
        for d in ti.static(range(3)):
            out[i, d] = f[d]


@ti.kernel
def energies(
    law: ti.template(),
    tets: ti.template(),
    springs: ti.template(),
    corner_nodes: A(),
    gradient: A(),
    volume: A(),
    constants: A(),
    spring_starts: A(),
    spring_ends: A(),
    spring_data: A(),
    u: A(),
    tet_energy: A(),
    node_energy: A(),
):
    """Elastic energy [J] of each tet, and of each node's springs (half of each spring's)."""
    if ti.static(tets):
        for e in range(corner_nodes.shape[0]):
            N = ti.Matrix([[gradient[e, 3 * c + d] for d in range(3)] for c in range(3)])
            H = tet_gradient(e, corner_nodes, N, u)
            tet_energy[e] = volume[e] * energy_density(law, H, constants[0], constants[1])
    if ti.static(springs):
        for i in range(node_energy.shape[0]):
            total = 0.0 * node_energy[i]
            for q in range(spring_starts[i], spring_starts[i + 1]):
                j = spring_ends[q]
                d = ti.Vector([spring_data[q, 0], spring_data[q, 1], spring_data[q, 2]])
                change = ti.Vector([u[j, c] - u[i, c] for c in range(3)])
                length = (d + change).norm()
                bend = (2.0 * d.dot(change) + change.dot(change)) / (length + spring_data[q, 3])
                elongation = bend + spring_data[q, 4]
                total += 0.25 * spring_data[q, 5] * elongation * elongation
            node_energy[i] = total
