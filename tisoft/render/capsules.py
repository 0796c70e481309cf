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
def capsule_hit(d, oa, ab, r, length):
    """How far along d the ray a + oa + t d first meets a capsule from a to a + ab, and whether it
    does; `length` is ab·ab.  The ray starts near the capsule, which keeps the digits.
    """
    dd, along, reach, slope = d.norm_sqr(), ab.dot(d), ab.dot(oa), d.dot(oa)
    qa = length * dd - along * along
    qb = length * slope - reach * along
    inside = oa.norm_sqr() - r * r
    root = qb * qb - qa * (length * inside - reach * reach)
    t, hit = 0.0, root >= 0.0
    if hit:  # outside the endless cylinder there are no balls
        if qa > 0.0:
            t = (-qb - ti.sqrt(root)) / qa
        u = reach + t * along
        if not 0.0 < u < length:
            if u >= length:  # the ball around b
                slope -= along
                inside += length - 2.0 * reach
            root = slope * slope - dd * inside
            t, hit = (-slope - ti.sqrt(ti.max(root, 0.0))) / dd, root >= 0.0
    return t, hit


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
def half_axis(stage: ti.template(), box, q, r):
    """The larger half axis A of the ellipse that a ball is seen as, in pixels: A² + B² is the sum
    of its box's half sides squared, and B = r/√(w² − r²) at depth w.
    """
    w, across = affine(stage[TO_W], q), head(stage[ACROSS])
    sides = (box[2] - box[0]) ** 2 + (box[3] - box[1]) ** 2
    small = r * r / ((w * w - r * r) * across.norm_sqr())
    return ti.sqrt(ti.max(0.25 * sides - small, small))


@ti.func
def slab(y, p, q, reach):
    """Interval of x of what line y of pixels has within reach of the line between two boxes'
    centres.
    """
    dx = 0.5 * (q[0] + q[2] - p[0] - p[2])
    dy = 0.5 * (q[1] + q[3] - p[1] - p[3])
    lo, hi = ti.min(p[0], q[0]), ti.max(p[2], q[2])
    if ti.abs(dy) > reach:
        middle = 0.5 * (p[0] + p[2]) + (y - 0.5 * (p[1] + p[3])) * dx / dy
        half = (reach + 0.5) * ti.sqrt(dx * dx + dy * dy) / ti.abs(dy)
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
            corner, across, down = head(stage[CORNER]), head(stage[ACROSS]), head(stage[DOWN])
            start = affine(stage[TO_W], 0.5 * (a + b))
            from_a, ab = head(stage[EYE]) - a, b - a
            length = ab.norm_sqr()
            reach = ti.max(half_axis(stage, p, a, r), half_axis(stage, q, b, r)) + 0.1
            y0 = ti.cast(ti.max(ti.min(p[1], q[1]), 0.0), ti.i32)
            y1 = ti.cast(ti.min(ti.max(p[3], q[3]), sizes[1] - 1.0), ti.i32)
            for y in range(y0, y1 + 1):
                lo, hi = slab(y + 0.5, p, q, reach)
                x0 = ti.cast(ti.max(lo, 0.0), ti.i32)
                x1 = ti.cast(ti.min(hi, sizes[0] - 1.0), ti.i32)
                for x in range(x0, x1 + 1):
                    for k in range(sizes[2]):
                        place = stage[PLACES + k]
                        d = corner + (x + place[0]) * across + (y + place[1]) * down
                        t, hit = capsule_hit(d, from_a + start * d, ab, r, length)
                        depth = start + t
                        if hit and depth > NEAR:
                            at = place_of(x, y, k, sizes[2], sizes[3])
                            key = key_of(1.0 / depth, i)
                            if key > keys[at]:
                                ti.atomic_max(keys[at], key)
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
            p, q = vec4(ax - r, ay - r, ax + r, ay + r), vec4(bx - r, by - r, bx + r, by + r)
            y0 = ti.max(ti.min(p[1], q[1]) - 0.5, 0.0)
            y1 = ti.min(ti.max(p[3], q[3]) + 0.5, size - 1.0)
            dx, dy = bx - ax, by - ay
            length = ti.max(dx * dx + dy * dy, 1e-12)
            for y in range(ti.cast(y0, ti.i32), ti.cast(y1, ti.i32) + 1):
                lo, hi = slab(y + 0.5, p, q, r)
                x0 = ti.cast(ti.max(lo - 0.5, 0.0), ti.i32)
                x1 = ti.cast(ti.min(hi + 0.5, size - 1.0), ti.i32)
                for x in range(x0, x1 + 1):
                    px, py = x + 0.5 - ax, y + 0.5 - ay
                    u = ti.min(ti.max((px * dx + py * dy) / length, 0.0), 1.0)
                    if (px - u * dx) ** 2 + (py - u * dy) ** 2 <= r * r:
                        ti.atomic_max(tables[table, y * size + x], az + u * (bz - az))
