# mypy: ignore-errors
"""Contact of nodes with obstacles: velocities are corrected, so no penalty stiffness and no
smaller step.

A node that would end the substep inside an obstacle loses what leads it past the surface,

    v·n ≥ −max(gap, 0)/h,

and the impulse J of that lets Coulomb friction take at most μ J from the tangential velocity.  A
node that starts inside is put onto the surface.

| symbol | where                             | unit |
| ------ | --------------------------------- | ---- |
| gap, n | `distance` of the obstacle's file | m, 1 |
| μ      | `obstacle[row, 7]`                | 1    |
"""

import taichi as ti

from tisoft.obstacles import OBSTACLES

DISTANCES = [ti.func(shape.distance) for shape in OBSTACLES.values()]


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
def collide(state: ti.template(), i, h, v):
    """Velocity v of node i after contact, and the push that puts it onto a surface [m].

    Reads rest, displacement, body, obstacle*.
    """
    x = state.rest[i] + state.displacement[i]
    push = 0.0 * v
    body = state.body[i]
    for row in range(state.obstacle_start[body], state.obstacle_start[body + 1]):
        gap, normal = gap_and_normal(state, row, x)
        along = normal.dot(v)
        allowed = -ti.max(gap, 0.0 * gap) / h  # the velocity that just reaches the surface
        if along < allowed:
            impulse = allowed - along
            tangential = v - along * normal
            speed = tangential.norm()
            keep = 0.0 * speed
            if speed > 0.0:
                keep = ti.max(1.0 - state.obstacle[row, 7] * impulse / speed, 0.0 * speed)
            v = keep * tangential + allowed * normal
        if gap < 0.0:
            push -= gap * normal
    return v, push
