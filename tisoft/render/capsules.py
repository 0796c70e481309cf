# mypy: ignore-errors
"""Springs and points, as capsules: what samples see of them, and their shadow."""

import taichi as ti

from tisoft.render.geometry import (
    Integers,
    Keys,
    Primitives,
    Rows,
    Tables,
    Vertices,
    affine,
    head,
    vec4,
)
from tisoft.render.layout import (
    ACROSS,
    CORNER,
    DOWN,
    EYE,
    ITEMS,
    LAMP_SIZE,
    NEAR,
    PLACE,
    PLACES,
    SIZES,
    TILE,
    TO_W,
    TO_X,
    TO_Y,
)
from tisoft.render.raster import key_of, place_of


@ti.func
def capsule_hit(eye, d, a, b, r):
    """Depth along the ray eye + t d of its first point on a capsule, and whether it is hit.

    Rays that pass by get the depth of their closest approach, which shading wants at silhouettes.
    """
    dd = d.norm_sqr()
    near = (0.5 * (a + b) - eye).dot(d) / dd  # start near the capsule: keeps the digits
    o = eye + near * d
    ab, oa, ob = b - a, o - a, o - b
    length, along, reach = ab.norm_sqr(), ab.dot(d), ab.dot(oa)
    qa = length * dd - along * along
    qb = length * d.dot(oa) - reach * along
    qc = length * oa.norm_sqr() - reach * reach - r * r * length
    root = qb * qb - qa * qc
    t = 0.0
    if qa > 0.0:
        t = (-qb - ti.sqrt(ti.max(root, 0.0))) / qa
    u = reach + t * along
    if not 0.0 < u < length:
        oc = oa
        if u >= length:
            oc = ob
        root = oc.dot(d) ** 2 - dd * (oc.norm_sqr() - r * r)
        t = (-oc.dot(d) - ti.sqrt(ti.max(root, 0.0))) / dd
    return near + t, root >= 0.0


@ti.func
def ball_span(x, w, r):
    """Least and greatest x/w of a ball about (x, w), all in front of the eye."""
    root = ti.sqrt(ti.max(x * x + w * w - r * r, 0.0))
    return (x * w - r * root) / (w * w - r * r), (x * w + r * root) / (w * w - r * r)


@ti.func
def ball_box(stage: ti.template(), q, r):
    """Rectangle x0, y0, x1, y1 in pixels around a ball; x0 > x1 when it is not in front."""
    w = affine(stage[TO_W], q)
    box = vec4(1.0, 0.0, -1.0, 0.0)
    if w > r + NEAR:
        half = 0.5 * stage[SIZES]
        # Pixels a unit at depth 1, to the right and down.
        sx, sy = 1.0 / head(stage[ACROSS]).norm(), 1.0 / head(stage[DOWN]).norm()
        x = (affine(stage[TO_X], q) - half[0] * w) / sx
        y = (affine(stage[TO_Y], q) - half[1] * w) / sy
        x0, x1 = ball_span(x, w, r)
        y0, y1 = ball_span(y, w, r)
        box = vec4(x0 * sx + half[0], y0 * sy + half[1], x1 * sx + half[0], y1 * sy + half[1])
    return box


@ti.func
def slab(y, p, q):
    """Interval of x in line y within reach of the line between two boxes' centres."""
    dx = 0.5 * (q[0] + q[2] - p[0] - p[2])
    dy = 0.5 * (q[1] + q[3] - p[1] - p[3])
    reach = 0.75 * ti.max(p[2] - p[0], p[3] - p[1], q[2] - q[0], q[3] - q[1]) + 1.0
    lo, hi = ti.min(p[0], q[0]), ti.max(p[2], q[2])
    if ti.abs(dy) > reach:
        middle = 0.5 * (p[0] + p[2]) + (y - 0.5 * (p[1] + p[3])) * dx / dy
        half = reach * ti.sqrt(dx * dx + dy * dy) / ti.abs(dy)
        lo, hi = ti.max(lo, middle - half), ti.min(hi, middle + half)
    return lo, hi


@ti.kernel
def see_capsules(
    vertices: Vertices, primitives: Primitives, first: ti.i32, stage: Rows, keys: Keys,
    marks: Integers,
):  # fmt: skip
    """All primitives from the first on claim the samples that see them; their tiles are marked."""
    for i in range(first, primitives.shape[0]):
        ends, sizes = primitives[i], ti.cast(stage[SIZES], ti.i32)
        a, b = vertices[PLACE, ends[0]], vertices[PLACE, ends[1]]
        r = stage[ITEMS + ends[3]][2]
        p, q = ball_box(stage, a, r), ball_box(stage, b, r)
        if p[0] <= p[2] and q[0] <= q[2]:
            y0 = ti.cast(ti.max(ti.min(p[1], q[1]), 0.0), ti.i32)
            y1 = ti.cast(ti.min(ti.max(p[3], q[3]), sizes[1] - 1.0), ti.i32)
            for y in range(y0, y1 + 1):
                lo, hi = slab(y + 0.5, p, q)
                x0 = ti.cast(ti.max(lo, 0.0), ti.i32)
                x1 = ti.cast(ti.min(hi, sizes[0] - 1.0), ti.i32)
                for x in range(x0, x1 + 1):
                    for k in range(sizes[2]):
                        place = stage[PLACES + k]
                        d = head(stage[CORNER]) + (x + place[0]) * head(stage[ACROSS])
                        d += (y + place[1]) * head(stage[DOWN])
                        depth, hit = capsule_hit(head(stage[EYE]), d, a, b, r)
                        if hit and depth > NEAR:
                            at = place_of(x, y, k, sizes[2], sizes[3])
                            ti.atomic_max(keys[at], key_of(1.0 / depth, i))
                            marks[y // TILE * sizes[3] + x // TILE] = 1


@ti.kernel
def map_capsules(
    vertices: Vertices, primitives: Primitives, first: ti.i32, stage: Rows, rows: ti.i32,
    table: ti.i32, tables: Tables,
):  # fmt: skip
    """Capsules on a map as flat bands as wide as they are: enough for their shadow."""
    for i in range(first, primitives.shape[0]):
        ends, size = primitives[i], ti.cast(stage[LAMP_SIZE + table][0], ti.i32)
        a, b = vertices[PLACE, ends[0]], vertices[PLACE, ends[1]]
        ax, ay, az = affine(stage[rows], a), affine(stage[rows + 1], a), affine(stage[rows + 2], a)
        bx, by, bz = affine(stage[rows], b), affine(stage[rows + 1], b), affine(stage[rows + 2], b)
        # Thin springs keep a shadow without holes.
        r = ti.max(stage[ITEMS + ends[3]][2] / stage[LAMP_SIZE + table][1], 0.6)
        if ti.abs(ax) + ti.abs(ay) + ti.abs(bx) + ti.abs(by) < 1e6:
            y0 = ti.max(ti.min(ay, by) - r - 0.5, 0.0)
            y1 = ti.min(ti.max(ay, by) + r + 0.5, size - 1.0)
            x0 = ti.max(ti.min(ax, bx) - r - 0.5, 0.0)
            x1 = ti.min(ti.max(ax, bx) + r + 0.5, size - 1.0)
            dx, dy = bx - ax, by - ay
            length = ti.max(dx * dx + dy * dy, 1e-12)
            for y in range(ti.cast(y0, ti.i32), ti.cast(y1, ti.i32) + 1):
                for x in range(ti.cast(x0, ti.i32), ti.cast(x1, ti.i32) + 1):
                    px, py = x + 0.5 - ax, y + 0.5 - ay
                    u = ti.min(ti.max((px * dx + py * dy) / length, 0.0), 1.0)
                    if (px - u * dx) ** 2 + (py - u * dy) ** 2 <= r * r:
                        ti.atomic_max(tables[table, y * size + x], az + u * (bz - az))
