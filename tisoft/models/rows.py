# mypy: ignore-errors
"""Models whose force on a node is a sum over its neighbours: springs, and mass-tensors.

Spring between nodes i and j, rest vector d = X_j − X_i of length l, Δ = u_j − u_i, y = d + Δ:

    f_i = (k e + c ν) y/L,   L = |y|,   e = L − L₀,   ν = (v_j − v_i)·y/L,   f_j = −f_i

(Hooke's law and a damper along the spring: Choi's lecture on mass-spring systems).  The elongation
is computed as e = (2 d·Δ + |Δ|²)/(L + l) + (l − L₀), which keeps its digits at small strains.

Mass-tensor (Cotin, Delingette and Ayache 2000): f_i = −Σ_j (K_ij u_j + C_ij v_j), the 3×3 blocks of
the linear stiffness and viscosity stored on nodes (j = i) and edges.  Rows add up to nothing, so
u_j − u_i and v_j − v_i serve as well: a body that has moved far keeps its digits in f32.

| symbol | data column                | unit    |
| ------ | -------------------------- | ------- |
| d      | 0..2                       | m       |
| l      | 3                          | m       |
| l − L₀ | 4                          | m       |
| k, c   | 5, 6                       | N/m, N·s/m |
"""

import taichi as ti

SPRING_COLUMNS = 7


@ti.func
def spring_force(
    i,
    viscous: ti.template(),
    starts: ti.template(),
    neighbours: ti.template(),
    data: ti.template(),
    u: ti.template(),
    v: ti.template(),
):
    """Force of its springs on node i [N]."""
    ui = ti.Vector([u[i, 0], u[i, 1], u[i, 2]])
    vi = ti.Vector([v[i, 0], v[i, 1], v[i, 2]])
    f = 0.0 * ui
    for q in range(starts[i], starts[i + 1]):
        j = neighbours[q]
        d = ti.Vector([data[q, 0], data[q, 1], data[q, 2]])
        change = ti.Vector([u[j, 0], u[j, 1], u[j, 2]]) - ui
        y = d + change
        length = y.norm()
        if length > 0.0:
            inverse = 1.0 / length
            elongation = (2.0 * d.dot(change) + change.dot(change)) / (length + data[q, 3])
            tension = data[q, 5] * (elongation + data[q, 4])
            if ti.static(viscous):
                rate = (ti.Vector([v[j, 0], v[j, 1], v[j, 2]]) - vi).dot(y) * inverse
                tension += data[q, 6] * rate
            f += tension * inverse * y
    return f


@ti.func
def tensor_force(
    i,
    viscous: ti.template(),
    starts: ti.template(),
    neighbours: ti.template(),
    stiffness: ti.template(),
    viscosity: ti.template(),
    u: ti.template(),
    v: ti.template(),
):
    """Force of the mass-tensor rows on node i [N]."""
    f = 0.0 * ti.Vector([u[i, 0], u[i, 1], u[i, 2]])
    for q in range(starts[i], starts[i + 1]):
        j = neighbours[q]
        for r in ti.static(range(3)):
            for c in ti.static(range(3)):
                f[r] -= stiffness[q, 3 * r + c] * (u[j, c] - u[i, c])
                if ti.static(viscous):
                    f[r] -= viscosity[q, 3 * r + c] * (v[j, c] - v[i, c])
    return f


@ti.func
def row_force(
    i,
    viscous: ti.template(),
    springs: ti.template(),
    tensors: ti.template(),
    spring_starts: ti.template(),
    spring_ends: ti.template(),
    spring_data: ti.template(),
    tensor_starts: ti.template(),
    tensor_ends: ti.template(),
    stiffness: ti.template(),
    viscosity: ti.template(),
    u: ti.template(),
    v: ti.template(),
):
    """Force of springs and mass-tensor rows on node i [N]."""
    f = 0.0 * ti.Vector([u[i, 0], u[i, 1], u[i, 2]])
    if ti.static(springs):
        f += spring_force(i, viscous, spring_starts, spring_ends, spring_data, u, v)
    if ti.static(tensors):
        f += tensor_force(i, viscous, tensor_starts, tensor_ends, stiffness, viscosity, u, v)
    return f
