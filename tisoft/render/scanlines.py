# mypy: ignore-errors
"""Triangles as scanlines, without gaps in f32.

Each edge's x(y) is computed from its upper to its lower end, so both triangles at an edge get the
same number, and take the places from ceil(left) up to ceil(right), exclusive.
"""

import taichi as ti


@ti.func
def below(p: ti.template(), q: ti.template()):
    """Whether p comes after q, from top to bottom."""
    return p[1] > q[1] or (p[1] == q[1] and p[0] > q[0])


@ti.func
def sorted_corners(p, q, r):
    if below(p, q):
        p, q = q, p
    if below(q, r):
        q, r = r, q
    if below(p, q):
        p, q = q, p
    return p, q, r


@ti.func
def slope(p, q):
    """dx/dy of an edge from its upper end p to its lower one."""
    dy = q[1] - p[1]
    s = 0.0
    if dy > 0.0:
        s = (q[0] - p[0]) / dy
    return s


@ti.func
def gradient(p, q, r):
    """dz/dx and dz/dy of the third coordinate, and whether the triangle has an area."""
    ax, ay, az = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    bx, by, bz = r[0] - p[0], r[1] - p[1], r[2] - p[2]
    area = ax * by - ay * bx
    good = ti.abs(area) > 1e-20
    inverse = 0.0
    if good:
        inverse = 1.0 / area
    return (az * by - ay * bz) * inverse, (ax * bz - az * bx) * inverse, good


@ti.func
def span(y, p: ti.template(), q: ti.template(), long, upper, lower):
    """Left and right end in the line y of a triangle with upper corner p and middle corner q.

    `long`, `upper` and `lower` are the slopes of its sides.
    """
    one = p[0] + (y - p[1]) * long
    two = p[0] + (y - p[1]) * upper
    if y >= q[1]:
        two = q[0] + (y - q[1]) * lower
    return ti.min(one, two), ti.max(one, two)


@ti.func
def first_at_least(x, low, high):
    """The least whole number that is not below x, within bounds."""
    return ti.cast(ti.ceil(ti.min(ti.max(x, low), high)), ti.i32)
