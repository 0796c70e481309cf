# mypy: ignore-errors
"""Contact of nodes with obstacles: velocities are corrected, so no penalty stiffness and no
smaller step.

A node that would end the substep inside an obstacle loses what leads it past the surface,

    (v − w)·n ≥ −max(gap, 0)/h,   w the velocity of the surface there,

and the impulse J of that lets Coulomb friction take at most μ J from the tangential velocity v − w.
A node that starts inside is put onto the surface, no faster than the obstacle may push.

| symbol | where                                  | unit     |
| ------ | -------------------------------------- | -------- |
| gap, n | `distance` of the obstacle's file      | m, 1     |
| μ      | `obstacle[row, FRICTION]`              | 1        |
| w₀, ω  | `obstacle[row, VELOCITY..]`, w₀ + ω × x | m/s, 1/s |
| R      | `obstacle[row, FRAME..]`, see `turned` | 1        |
"""

import taichi as ti

from tisoft.obstacles import OBSTACLES
from tisoft.obstacles.base import FRAME, FRICTION, PUSH, VELOCITY

DISTANCES = [ti.func(shape.distance) for shape in OBSTACLES.values()]

CORNERS = [ti.func(shape.corner) for shape in OBSTACLES.values()]


FRAMED = [shape.has_frame for shape in OBSTACLES.values()]


@ti.func
def turned(c, x):
    """R x = x + (4 (1 − c²) c × x + 8 c × (c × x))/(1 + c²)²,  c = axis · tan(θ/4)."""
    square = c.dot(c)
    arm = c.cross(x)
    way = 4.0 * (1.0 - square) * arm + 8.0 * c.cross(arm)
    return x + way / ((1.0 + square) * (1.0 + square))


@ti.func
def three(state: ti.template(), row, first):
    """Three of an obstacle's numbers."""
    return ti.Vector([state.obstacle[row, first + d] for d in ti.static(range(3))])


@ti.func
def corner_place(state: ti.template(), row, local):
    """Place [m] of a point of the obstacle in a row, from its own coordinates."""
    a, b = three(state, row, 0), three(state, row, 3)
    x = 0.0 * local
    for kind in ti.static(range(len(CORNERS))):
        if state.obstacle_kind[row] == kind:
            if ti.static(FRAMED[kind]):
                own = CORNERS[kind](0.0 * a, b, state.obstacle[row, 6], local)
                x = a + turned(three(state, row, FRAME), own)
            else:
                x = CORNERS[kind](a, b, state.obstacle[row, 6], local)
    return x


@ti.func
def gap_and_normal(state: ti.template(), row, x):
    """Signed distance [m] from the surface of the obstacle in a row to x, and where it grows."""
    a, b = three(state, row, 0), three(state, row, 3)
    gap, normal = 0.0 * x[0], 0.0 * x
    own_kind = state.obstacle_kind[row]
    for kind in ti.static(range(len(DISTANCES))):
        if own_kind == kind:
            if ti.static(FRAMED[kind]):
                c = three(state, row, FRAME)
                own = turned(-c, x - a)
                gap, along = DISTANCES[kind](0.0 * a, b, state.obstacle[row, 6], own)
                normal = turned(c, along)
            else:
                gap, normal = DISTANCES[kind](a, b, state.obstacle[row, 6], x)
    return gap, normal


@ti.func
def surface_velocity(state: ti.template(), row, x):
    """w [m/s] of the surface of the obstacle in a row at x."""
    return three(state, row, VELOCITY) + three(state, row, VELOCITY + 3).cross(x)


@ti.func
def stop_of(state: ti.template(), i, h, v):
    """Normal of the obstacle that is the first to stop node i at velocity v, the velocity along it
    that just reaches its surface [m/s], that of the surface [m/s] and its friction; 0, −1e30, 0
    and 0 for none.  Reads as `collide`.
    """
    stop, bound, short = 0.0 * v, -1e30 + 0.0 * h, -1e30 + 0.0 * h
    surface, rough = 0.0 * v, 0.0 * h
    x = state.rest[i] + state.displacement[i]
    body = state.body[i]
    for row in range(state.obstacle_start[body], state.obstacle_start[body + 1]):
        gap, normal = gap_and_normal(state, row, x)
        w = surface_velocity(state, row, x)
        allowed = normal.dot(w) - ti.max(gap, 0.0 * gap) / h
        if allowed - normal.dot(v) > short:
            stop, bound, short = normal, allowed, allowed - normal.dot(v)
            surface, rough = w, state.obstacle[row, FRICTION]
    return stop, bound, surface, rough


@ti.func
def collide(state: ti.template(), i, h, v):
    """Velocity v of node i after contact, and the push that puts it onto a surface [m].

    Reads rest, displacement, body, obstacle*; writes carried, rubbed.
    """
    carried, rubbed = ti.Vector([0.0 * h, 0.0 * h]), 0.0 * v
    x = state.rest[i] + state.displacement[i]
    push = 0.0 * v
    body = state.body[i]
    for row in range(state.obstacle_start[body], state.obstacle_start[body + 1]):
        gap, normal = gap_and_normal(state, row, x)
        w = surface_velocity(state, row, x)
        along = normal.dot(v - w)
        if h * along < -ti.max(gap, 0.0 * gap):
            allowed = -ti.max(gap, 0.0 * gap) / h  # the velocity that just reaches the surface
            impulse = allowed - along
            tangential = v - w - along * normal
            speed = tangential.norm()
            keep = 0.0 * speed
            if speed > 0.0:
                keep = ti.max(1.0 - state.obstacle[row, FRICTION] * impulse / speed, 0.0 * speed)
            met = w + keep * tangential + allowed * normal
            rub = (keep - 1.0) * tangential
            carried += ti.Vector([w.dot(met - v), w.dot(rub)])
            rubbed += rub
            v = met
        if gap < 0.0:
            push += ti.min(-gap, state.obstacle[row, PUSH] * h) * normal
    state.carried[i], state.rubbed[i] = carried, rubbed
    return v, push
