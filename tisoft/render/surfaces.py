# mypy: ignore-errors
"""What a pixel sees of surfaces: their normals, colours and depths, summed over its samples."""

import taichi as ti

from tisoft.render.geometry import head, safe_unit, vec3, vec4
from tisoft.render.layout import (
    ACROSS,
    COLOR,
    CORNER,
    DOWN,
    EYE,
    FLOOR,
    GROUND,
    GROUND_X,
    GROUND_Y,
    ITEMS,
    LAMP,
    LAMP_SIZE,
    LAMP_X,
    LAMP_Y,
    LAMP_Z,
    NORMAL,
    PLACE,
    SCREEN,
    SIZES,
)

LINE = 0.55  # half width of a wireframe's lines, in pixels of a picture 720 high
INK = 0.82  # share of the light that they take
ALIKE_NORMAL, ALIKE_DEPTH = 0.8, 0.01  # of two samples' surfaces that are shaded as one

Surface = ti.types.struct(normal=vec3, base=vec3, depth=ti.f32, item=ti.i32, weight=ti.f32)
"""Sums over the samples of a pixel that see one surface."""
Sight = ti.types.struct(
    eye=vec3, corner=vec3, across=vec3, down=vec3, floor=vec4, up=vec3,
    lamp=vec3, lamp_x=vec4, lamp_y=vec4, lamp_z=vec4, ground_x=vec4, ground_y=vec4,
    texel=ti.f32, samples=ti.i32,
)  # fmt: skip
"""Rows of the stage that every pixel needs, read once for many."""


@ti.func
def sight_of(stage: ti.template()):
    return Sight(
        eye=head(stage[EYE]), corner=head(stage[CORNER]), across=head(stage[ACROSS]),
        down=head(stage[DOWN]), floor=stage[FLOOR], up=head(stage[GROUND]),
        lamp=head(stage[LAMP]), lamp_x=stage[LAMP_X], lamp_y=stage[LAMP_Y], lamp_z=stage[LAMP_Z],
        ground_x=stage[GROUND_X], ground_y=stage[GROUND_Y], texel=stage[LAMP_SIZE][1],
        samples=ti.cast(stage[SIZES][2], ti.i32),
    )  # fmt: skip


@ti.func
def nothing():
    return Surface(normal=vec3(0.0), base=vec3(0.0), depth=0.0, item=-1, weight=0.0)


@ti.func
def ray(sight: ti.template(), x, y):
    return sight.corner + x * sight.across + y * sight.down


@ti.func
def on_triangle(
    abc, x, y, wires: ti.template(), sight: ti.template(), stage: ti.template(),
    vertices: ti.template(),
):  # fmt: skip
    """Normal and colour where the ray through (x, y) meets a triangle (Möller and Trumbore)."""
    d = ray(sight, x, y)
    a = vertices[PLACE, abc[0]]
    e1, e2, s = vertices[PLACE, abc[1]] - a, vertices[PLACE, abc[2]] - a, sight.eye - a
    h, g = d.cross(e2), s.cross(e1)
    det = e1.dot(h)
    inverse = 1.0 / (det if ti.abs(det) > 1e-30 else 1e-30)
    u = ti.min(ti.max(s.dot(h) * inverse, 0.0), 1.0)
    v = ti.min(ti.max(d.dot(g) * inverse, 0.0), 1.0 - u)
    w = 1.0 - u - v
    n = w * vertices[NORMAL, abc[0]] + u * vertices[NORMAL, abc[1]] + v * vertices[NORMAL, abc[2]]
    c = w * vertices[COLOR, abc[0]] + u * vertices[COLOR, abc[1]] + v * vertices[COLOR, abc[2]]
    if det < 0.0:  # seen from behind
        n = -n
    if ti.static(wires):
        if stage[ITEMS + abc[3]][0] > 0.5:
            c *= 1.0 - INK * edge_ink(abc, x, y, stage, vertices)
    return n, c


@ti.func
def edge_ink(abc, x, y, stage: ti.template(), vertices: ti.template()):
    """Share of a pixel that a line of even width along the nearest side of a triangle takes."""
    gap = 1e9
    for k in ti.static(range(3)):
        p, q = vertices[SCREEN, abc[k]], vertices[SCREEN, abc[(k + 1) % 3]]
        ex, ey = q[0] - p[0], q[1] - p[1]
        far = ti.abs(ex * (y - p[1]) - ey * (x - p[0]))
        gap = ti.min(gap, far / ti.sqrt(ex * ex + ey * ey + 1e-20))
    half = LINE * ti.max(stage[SIZES][1] / 720.0, 1.0)
    return ti.min(ti.max(half + 0.5 - gap, 0.0), 1.0)


@ti.func
def on_capsule(ends, depth, x, y, sight: ti.template(), vertices: ti.template()):
    """Normal and colour where the ray through (x, y) meets a capsule."""
    a, b = vertices[PLACE, ends[0]], vertices[PLACE, ends[1]]
    q = sight.eye + depth * ray(sight, x, y)
    u = (q - a).dot(b - a) / ti.max((b - a).norm_sqr(), 1e-20)
    u = ti.min(ti.max(u, 0.0), 1.0)
    color = (1.0 - u) * vertices[COLOR, ends[0]] + u * vertices[COLOR, ends[1]]
    return safe_unit(q - a - u * (b - a)), color


@ti.func
def add(many, new: ti.template(), total: ti.template()):
    total.normal += many * new.normal
    total.base += many * new.base
    total.depth += many * new.depth
    total.weight += many
    total.item = new.item


@ti.func
def alike(new: ti.template(), total: ti.template()):
    """Whether a sample sees the surface that others saw; yes where none did."""
    w = total.weight
    near = ti.abs(new.depth * w - total.depth) < ALIKE_DEPTH * w
    facing = new.normal.dot(total.normal) > ALIKE_NORMAL * w
    return w == 0.0 or (new.item == total.item and near and facing)
