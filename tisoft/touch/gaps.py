# mypy: ignore-errors
"""How far the points of a pair are apart, along which direction, and by which weights.

    distance = Σ w_k x_k · n,   w = 1 and −barycentric;  1 − s, s, −(1 − t), −t

Of a solid, outward normals tell the side; of a sheet, the side where the point was last seen
farther than 1.2 t away.  A point behind a solid's face belongs to it while it is no deeper than
`DEPTH` and the surface that it is part of looks against the face.
"""

import taichi as ti

from tisoft.obstacles.base import FLAT_LINE, POINT
from tisoft.touch import fields as f
from tisoft.touch.awake import SEEN
from tisoft.touch.closest import between_lines, nearest_on_line, on_triangle
from tisoft.touch.flat import fan_normal
from tisoft.touch.pairs import BLUR

CONE = 1e-4
"""Cosine by which a point may lie outside of a feature's normal cone."""
EDGEWISE = 0.05
"""Cosine below which two directions count as normal to each other."""


@ti.func
def in_corner(touch: ti.template(), p, d, solid):
    """Whether d points away from the surface around its point p."""
    inside = 1
    normal = 0.0 * d
    for k in range(touch.fan_start[p], touch.fan_start[p + 1]):
        y = touch.place[touch.fan[k, 0]] - touch.place[p]
        z = touch.place[touch.fan[k, 1]] - touch.place[p]
        normal += y.cross(z)
        if d.dot(y) > CONE * d.norm() * y.norm() or d.dot(z) > CONE * d.norm() * z.norm():
            inside = 0
    if solid and d.dot(normal) < 0.0:
        inside = 0
    return inside


@ti.func
def across_edge(touch: ti.template(), i, k, d, normal, solid):
    """Whether d, from the edge opposite corner k of triangle i, points away from both its faces."""
    inside = 1
    far = touch.across[i, k]
    if far >= 0:
        a = touch.place[touch.triangle[i, (k + 1) % 3]]
        b = touch.place[touch.triangle[i, (k + 2) % 3]]
        y = touch.place[far] - a
        if d.dot(y) > CONE * d.norm() * y.norm():
            inside = 0
        if solid and d.dot(normal + (a - b).cross(touch.place[far] - b).normalized()) < 0.0:
            inside = 0
    return inside


@ti.func
def is_own(touch: ti.template(), i, w, d, normal, solid):
    """Whether the feature of triangle i that w lies on is the one that sees d: its own, and d in
    its normal cone.
    """
    own, zeros, edge, corner = 1, 0, 0, 0
    for k in ti.static(range(3)):
        if w[k] == 0.0:
            zeros += 1
            edge = k
        else:
            corner = k
    if zeros == 1:
        own = ti.i32((touch.owned[i] & (1 << edge)) != 0)
        if own:
            own = across_edge(touch, i, edge, d, normal, solid)
    if zeros == 2:
        own = ti.i32((touch.owned[i] & (8 << corner)) != 0)
        if own:
            own = in_corner(touch, touch.triangle[i, corner], d, solid)
    return own


@ti.func
def is_behind(touch: ti.template(), p, depth, normal, body):
    """Whether a point behind a solid's face by `depth` [m] is held to be in front of it."""
    ok = ti.i32(depth < touch.number[body, f.DEPTH])
    if ok and touch.trait[touch.body[p], f.SOLID]:
        ok = ti.i32(fan_normal(touch, p).dot(normal) <= 0.0)
    return ok


@ti.func
def thickness(touch: ti.template(), p, other):
    """Distance [m] that the bodies of two points keep; of a core from its middle."""
    b, c = touch.body[p], touch.body[other]
    return (
        touch.number[b, f.HALF] * touch.number[c, f.SHARE]
        + touch.number[c, f.HALF] * touch.number[b, f.SHARE]
    )


@ti.func
def seen_from(touch: ti.template(), p, body):
    """Place of a point from the origin of a body [m]."""
    x = touch.place[p]
    if touch.body[p] != body:
        x += ti.cast(touch.origin[touch.body[p]] - touch.origin[body], touch.real)
    return x


@ti.func
def face_gap(touch: ti.template(), z):
    """Drift [m/s], weights, direction and distance [m] of a point and a triangle; whether they
    count.
    """
    p, i = touch.ends[z, 0], touch.item[z, 0]
    body = touch.body[touch.ends[z, 1]]
    a, b, c = (
        touch.place[touch.ends[z, 1]],
        touch.place[touch.ends[z, 2]],
        touch.place[touch.ends[z, 3]],
    )
    x = seen_from(touch, p, body)
    other = touch.body[p]
    core = touch.trait[other, f.ROUND]
    if core > POINT:
        blur = BLUR * touch.number[other, f.HALF]
        x = nearest_on_line(x, seen_from(touch, p + 1, body), a, b, c, blur)
    w = on_triangle(x, a, b, c)
    d = x - w[0] * a - w[1] * b - w[2] * c
    distance = d.norm()
    n = (b - a).cross(c - a).normalized()
    side = d.dot(n)
    solid = touch.trait[body, f.SOLID]
    far = SEEN * thickness(touch, p, touch.ends[z, 1])
    if solid == 0 and (touch.side[z] == 0 or distance > far):
        touch.side[z] = 1 if side >= 0.0 else -1
    if solid == 0 and touch.trait[other, f.OBSTACLE] and core == 0:  # its corner looks at the sheet
        out = fan_normal(touch, p)
        if ti.abs(out.dot(n)) > EDGEWISE * out.norm():
            touch.side[z] = 1 if out.dot(n) < 0.0 else -1
    ok = is_own(touch, i, w, d, n, solid)
    if w[0] > 0.0 and w[1] > 0.0 and w[2] > 0.0:
        distance = side
        if solid == 0:
            distance *= touch.side[z]
            n *= touch.side[z]
        elif side < 0.0:
            ok = is_behind(touch, p, -side, n, body)
    elif distance > 0.0:
        n = d / distance
    if core == FLAT_LINE:  # its ends are for corners
        along = seen_from(touch, p + 1, body) - seen_from(touch, p, body)
        if ti.abs(n.dot(along)) > EDGEWISE * along.norm():
            ok = 0
    drift = 0.0 * n
    if core:
        arm = x - n * touch.number[other, f.HALF] - seen_from(touch, p, body)
        drift = touch.spin[other].cross(arm)
    return drift, ti.Vector([1.0 + 0.0 * side, -w[0], -w[1], -w[2]]), n, distance, ok


@ti.func
def edge_normal(touch: ti.template(), e):
    """Sum of the unit normals of an edge's faces."""
    a, b = touch.place[touch.edge[e, 0]], touch.place[touch.edge[e, 1]]
    n = 0.0 * a
    for k in range(2):
        far = touch.sides[e, k]
        if far >= 0:
            out = (b - a).cross(touch.place[far] - a).normalized()
            n += out if k == 0 else -out
    return n


@ti.func
def side_of(touch: ti.template(), z, side, thick, solid, facing):
    """On which side of each other the lines of pair z are, 1 or −1, and whether that counts.

    Args: side: their distance along n [m]; facing: n · outward normals of what is solid.
    """
    sign, ok = touch.side[z], 1
    if solid:
        sign = 1 if facing >= 0.0 else -1
        ok = ti.i32(side * sign > -thick)  # deeper ones are for points and faces
    elif sign == 0 or ti.abs(side) > SEEN * thick:
        sign = 1 if side >= 0.0 else -1
    return sign, ok


@ti.func
def edge_gap(touch: ti.template(), z):
    """Weights, direction and distance [m] of two edges; whether they count."""
    body, other = touch.body[touch.ends[z, 2]], touch.body[touch.ends[z, 0]]
    a, b = seen_from(touch, touch.ends[z, 0], body), seen_from(touch, touch.ends[z, 1], body)
    c, d = touch.place[touch.ends[z, 2]], touch.place[touch.ends[z, 3]]
    s, t = between_lines(b - a, d - c, a - c)
    w, n, distance = ti.Vector([1.0 - s, s, t - 1.0, -t]), 0.0 * a, 0.0 * s
    ok = ti.i32(s > 0.0 and s < 1.0 and t > 0.0 and t < 1.0)
    sign = 0  # the side of lines means nothing outside of the edges
    if ok:
        n = (b - a).cross(d - c).normalized()
        side = (a + s * (b - a) - c - t * (d - c)).dot(n)
        thick = thickness(touch, touch.ends[z, 0], touch.ends[z, 2])
        out = 0.0 * n
        if touch.trait[other, f.SOLID]:
            out -= edge_normal(touch, touch.item[z, 0])
        if touch.trait[body, f.SOLID]:
            out += edge_normal(touch, touch.item[z, 1])
        solid = touch.trait[other, f.SOLID] or touch.trait[body, f.SOLID]
        sign, ok = side_of(touch, z, side, thick, solid, n.dot(out))
        n, distance = n * sign, side * sign
    touch.side[z] = sign
    return w, n, distance, ok


@ti.func
def rod_gap(touch: ti.template(), z):
    """The same of the line of a core and an edge of a triangle.  A triangle meets a line by its
    nearest point; its other edges come as near as they like meanwhile, and are looked at by
    themselves.
    """
    p, i, k = touch.ends[z, 0], touch.item[z, 0], -2 - touch.item[z, 1]
    body, other = touch.body[touch.ends[z, 1]], touch.body[p]
    a, b = seen_from(touch, p, body), seen_from(touch, p + 1, body)
    c = touch.place[touch.triangle[i, (k + 1) % 3]]
    d = touch.place[touch.triangle[i, (k + 2) % 3]]
    s, t = between_lines(b - a, d - c, a - c)
    ok = ti.i32(s >= 0.0 and s <= 1.0 and t >= 0.0 and t <= 1.0)
    n, drift, distance = 0.0 * a, 0.0 * a, 0.0 * s
    w = ti.Vector([1.0 + distance, distance, distance, distance])
    sign = 0
    if ok:
        for h in ti.static(range(3)):
            if h == (k + 1) % 3:
                w[1 + h] = t - 1.0
            if h == (k + 2) % 3:
                w[1 + h] = -t
        x = a + s * (b - a)
        n = (b - a).cross(d - c).normalized()
        side = (x - c - t * (d - c)).dot(n)
        thick = thickness(touch, p, touch.ends[z, 1])
        out = 0.0 * n
        if touch.trait[body, f.SOLID]:
            far = touch.place[touch.triangle[i, k]]
            out += (d - c).cross(far - c).normalized()
            if touch.across[i, k] >= 0:
                far = touch.place[touch.across[i, k]]
                out -= (d - c).cross(far - c).normalized()
        sign, ok = side_of(touch, z, side, thick, touch.trait[body, f.SOLID], n.dot(out))
        n, distance = n * sign, side * sign
        drift = touch.spin[other].cross(x - n * touch.number[other, f.HALF] - a)
    touch.side[z] = sign
    return drift, w, n, distance, ok


@ti.func
def gap_of(touch: ti.template(), z, kind):
    """Drift [m/s], weights, direction and distance [m] of a pair; whether they count."""
    drift = 0.0 * touch.place[0]
    normal, distance, ok = drift, drift[0], 0
    w = ti.Vector([distance, distance, distance, distance])
    if kind == 0 and touch.item[z, 1] < -1:
        drift, w, normal, distance, ok = rod_gap(touch, z)
    elif kind == 0:
        drift, w, normal, distance, ok = face_gap(touch, z)
    else:
        w, normal, distance, ok = edge_gap(touch, z)
    return drift, w, normal, distance, ok
