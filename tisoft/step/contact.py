# mypy: ignore-errors
"""Contact of nodes with obstacles: velocities are corrected, so no penalty stiffness and no
smaller step.

A node that would end the substep inside an obstacle loses what leads it past the surface,

    (v − w)·n ≥ −max(gap, 0)/h,   w the velocity of the surface there,

and the impulse J of that lets Coulomb friction take at most μ J from the tangential velocity v − w.
A node that starts inside is put onto the surface, no faster than the obstacle may push.

| symbol | where                             | unit |
| ------ | --------------------------------- | ---- |
| gap, n | `distance` of the obstacle's file | m, 1 |
| μ      | `obstacle[row, 7]`                | 1    |
| w₀, ω  | `obstacle[row, 9..14]`, w₀ + ω × x | m/s, 1/s |
"""

import taichi as ti

from tisoft.obstacles import OBSTACLES

DISTANCES = [ti.func(shape.distance) for shape in OBSTACLES.values()]

CORNERS = [ti.func(shape.corner) for shape in OBSTACLES.values()]


@ti.func
def corner_place(state: ti.template(), row, local):
    """Place [m] of a point of the obstacle in a row, from its own coordinates."""
    a = ti.Vector([state.obstacle[row, 0], state.obstacle[row, 1], state.obstacle[row, 2]])
    b = ti.Vector([state.obstacle[row, 3], state.obstacle[row, 4], state.obstacle[row, 5]])
    x = 0.0 * local
    for kind in ti.static(range(len(CORNERS))):
        if state.obstacle_kind[row] == kind:
            x = CORNERS[kind](a, b, state.obstacle[row, 6], local)
    return x


@ti.func
def gap_and_normal(state: ti.template(), row, x):
    """Signed distance [m] from the surface of the obstacle in a row to x, and where it grows."""
    a = ti.Vector([state.obstacle[row, 0], state.obstacle[row, 1], state.obstacle[row, 2]])
    b = ti.Vector([state.obstacle[row, 3], state.obstacle[row, 4], state.obstacle[row, 5]])
    gap, normal = 0.0 * x[0], 0.0 * x
    for kind in ti.static(range(len(DISTANCES))):
        if state.obstacle_kind[row] == kind:
            gap, normal = DISTANCES[kind](a, b, state.obstacle[row, 6], x)
    return gap, normal


@ti.func
def surface_velocity(state: ti.template(), row, x):
    """w [m/s] of the surface of the obstacle in a row at x."""
    w = ti.Vector([state.obstacle[row, 9], state.obstacle[row, 10], state.obstacle[row, 11]])
    spin = ti.Vector([state.obstacle[row, 12], state.obstacle[row, 13], state.obstacle[row, 14]])
    return w + spin.cross(x)


@ti.func
def collide(state: ti.template(), i, h, v):
    """Velocity v of node i after contact, and the push that puts it onto a surface [m].

    Reads rest, displacement, body, obstacle*; writes carried.
    """
    carried = 0.0 * h
    x = state.rest[i] + state.displacement[i]
    push = 0.0 * v
    body = state.body[i]
    for row in range(state.obstacle_start[body], state.obstacle_start[body + 1]):
        gap, normal = gap_and_normal(state, row, x)
        w = surface_velocity(state, row, x)
        along = normal.dot(v - w)
        allowed = -ti.max(gap, 0.0 * gap) / h  # the velocity that just reaches the surface
        if along < allowed:
            impulse = allowed - along
            tangential = v - w - along * normal
            speed = tangential.norm()
            keep = 0.0 * speed
            if speed > 0.0:
                keep = ti.max(1.0 - state.obstacle[row, 7] * impulse / speed, 0.0 * speed)
            met = w + keep * tangential + allowed * normal
            carried += w.dot(met - v)
            v = met
        if gap < 0.0:
            push += ti.min(-gap, state.obstacle[row, 8] * h) * normal
    state.carried[i] = carried
    return v, push
