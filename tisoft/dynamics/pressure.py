# mypy: ignore-errors
"""Pressure that follows the surface: forces on a node from the loaded faces around it.

    f_i = −(p/6) Σ_faces (x_j − x_i) × (x_k − x_i)        face (i, j, k) seen from outside

is the exact integral of −p n over linear triangles, N_i inside; every substep has its own.

| symbol    | data column | unit |
| --------- | ----------- | ---- |
| X_j − X_i | 0..2        | m    |
| X_k − X_i | 3..5        | m    |
| p/6       | 6           | Pa   |
"""

import taichi as ti

PRESSURE_COLUMNS = 7


@ti.func
def pressure_force(
    i, starts: ti.template(), ends: ti.template(), data: ti.template(), u: ti.template()
):
    """Force of the pressure on node i [N]."""
    ui = ti.Vector([u[i, 0], u[i, 1], u[i, 2]])
    f = 0.0 * ui
    for q in range(starts[i], starts[i + 1]):
        j, k = ends[q, 0], ends[q, 1]
        a = ti.Vector([data[q, c] + (u[j, c] - ui[c]) for c in range(3)])
        b = ti.Vector([data[q, 3 + c] + (u[k, c] - ui[c]) for c in range(3)])
        f -= data[q, 6] * a.cross(b)
    return f
