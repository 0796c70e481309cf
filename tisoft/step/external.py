# mypy: ignore-errors
"""External forces on a node: f_ext of the lectures' M a = f_int + f_ext.

    a = (f_int + f_ext)/m + g − γ v

f_ext are loads that keep their direction (`State.load`), hands (`grab`) and pressures that follow
the surface:

    f_i = −p Σ c (x_j − x_i) × (x_k − x_i)

is the exact integral of −p N_i n over faces, c as `geometry.faces` tells (1/6 for a triangle
(i, j, k) seen from outside); every substep has its own.

| symbol    | where                       | unit |
| --------- | --------------------------- | ---- |
| X_j − X_i | `pressure_numbers[q, 0..2]` | m    |
| X_k − X_i | `pressure_numbers[q, 3..5]` | m    |
| p c       | `pressure_numbers[q, 6]`    | Pa   |
| γ         | `drag`, point damping       | 1/s  |
"""

import taichi as ti

from tisoft.model.state import HAND, HELD


@ti.func
def press(state: ti.template(), i):
    """Keep the pressures' force on node i [N] in state.pressed."""
    ui = state.displacement[i]
    f = 0.0 * ui
    for q in range(state.pressure_start[i], state.pressure_start[i + 1]):
        uj = state.displacement[state.pressure_ends[q][0]]
        uk = state.displacement[state.pressure_ends[q][1]]
        a, b = uj - ui, uk - ui
        for d in range(3):
            a[d] += state.pressure_numbers[q, d]
            b[d] += state.pressure_numbers[q, 3 + d]
        f -= state.pressure_numbers[q, 6] * a.cross(b)
    state.pressed[i] = f


@ti.func
def draw(state: ti.template(), scene):
    """Keep the hands' forces f_j = w_j (k (y − Σ w x) − c Σ w v) in state.drawn (see `grab`).

    One thread does it for all.  Reads hand_*, displacement, velocity; writes drawn, hand_force.
    """
    first = state.orders[scene, HAND]
    last = first + state.orders[scene, HELD]
    for hand in range(first, last):
        for k in range(state.hand_count[hand]):
            i = state.hand_node[hand, k]
            state.drawn[i] = 0.0 * state.drawn[i]
    for hand in range(first, last):
        f = state.hand_numbers[hand, 0] * state.hand_target[hand]
        for k in range(state.hand_count[hand]):
            i, w = state.hand_node[hand, k], state.hand_weight[hand, k]
            f -= w * state.hand_numbers[hand, 0] * state.displacement[i]
            f -= w * state.hand_numbers[hand, 1] * state.velocity[i]
        size = ti.sqrt(f.dot(f))
        if size > state.hand_numbers[hand, 2]:
            f *= state.hand_numbers[hand, 2] / size
        state.hand_force[hand] = f
        for k in range(state.hand_count[hand]):
            i = state.hand_node[hand, k]
            state.drawn[i] = state.drawn[i] + state.hand_weight[hand, k] * f


@ti.func
def force(state: ti.template(), i, now):
    """f_ext on node i [N].  Reads state.load, state.pressed, state.drawn."""
    f = 0.0 * state.load[i]
    if now.loaded:
        f = state.load[i] + state.pressed[i] + state.drawn[i]
    return f


@ti.func
def acceleration(state: ti.template(), i, f, now):
    """a [m/s²] of node i under the force f [N].  Reads inverse_mass, drag, velocity."""
    return f * state.inverse_mass[i] + now.gravity - state.drag[state.body[i]] * state.velocity[i]
