# mypy: ignore-errors
"""From what every sample sees to the picture: materials, light, and averaging in linear light.

Like multisampling on a GPU, a pixel is shaded once for every primitive that its samples see, at
the middle of those samples.
"""

import taichi as ti

from tisoft.render.geometry import (
    Integers,
    Keys,
    Scalars,
    Triples,
    Vectors,
    View,
    ray,
    row,
    safe_unit,
    to_samples,
    vec3,
    vec3d,
    vector,
)
from tisoft.render.ground import FADE, TILE, Ground, dimness, inverse_depth, tiles
from tisoft.render.light import Lamp, bilinear, lit
from tisoft.render.raster import capsule_hit, edge_functions

SKY, FLOOR = -1, -2  # what a sample sees besides primitives
KEY = 0.80  # of the lamp on a surface that faces it
AMBIENT = 0.40  # of the sky on the ground
LINE = 0.55  # half width of a wireframe's lines, in pixels of a picture 720 high

Bytes = ti.types.ndarray(dtype=ti.u8, ndim=1)
Pixels = ti.types.ndarray(dtype=ti.u8, ndim=2)
Surfel = ti.types.struct(normal=vec3, base=vec3, shine=ti.f32)


@ti.func
def backdrop(x, y):
    """Linear colour of the background; x and y run over the picture from 0 to 1."""
    u = ti.min(ti.max(y, 0.0), 1.0)
    u = u * u * (3.0 - 2.0 * u)
    color = vec3(0.46, 0.55, 0.66) * (1.0 - u) + vec3(0.80, 0.81, 0.82) * u
    return color * (1.0 - 0.30 * ((x - 0.5) ** 2 + (y - 0.55) ** 2))


@ti.func
def reflected(s: ti.template(), to_eye, up, lamp: ti.template(), share, dim):
    """Light towards the eye from a satin surface, of which a share of the lamp is seen."""
    n = s.normal
    facing = ti.max(n.dot(to_eye), 0.0)
    # Light enters and leaves soft matter elsewhere: the terminator is wide and saturated.
    wrap = 0.08 + 0.22 * s.base
    direct = ti.max((n.dot(lamp.direction) + wrap) / (1.0 + wrap), 0.0)
    key = KEY * vec3(1.0, 0.97, 0.92) * direct * (0.04 + 0.96 * share)
    height = 0.5 + 0.5 * n.dot(up)
    sky, bounce = vec3(0.30, 0.34, 0.40), vec3(0.24, 0.23, 0.215)
    ambient = sky * height + bounce * (1.0 - height) * (1.0 - 0.85 * dim)
    fill = 0.10 * facing
    half = safe_unit(lamp.direction + to_eye)
    gloss = ti.max(n.dot(half), 0.0) ** 2
    gloss = gloss * gloss * gloss * gloss
    broad = gloss
    gloss = gloss * gloss
    gloss = gloss * gloss
    gloss = gloss * gloss
    edge = (1.0 - facing) ** 2
    rim = edge * edge * 0.30 * height * (1.0 - 0.7 * dim)
    spark = (0.22 * gloss + 0.05 * broad) * share
    return s.base * (key + ambient + fill) + s.shine * (spark + rim * vec3(0.85, 0.93, 1.0))


@ti.func
def knee(c):
    """Rolls off what is brighter than the picture can show."""
    out = c
    for k in ti.static(range(3)):
        if c[k] > 0.75:
            out[k] = 1.0 - 0.25 * ti.exp(-(c[k] - 0.75) / 0.25)
    return out


@ti.func
def on_triangle(
    t, x, y, wire, view: ti.template(), points: ti.template(), normals: ti.template(),
    colors: ti.template(), triangles: ti.template(),
):  # fmt: skip
    """Normal, colour and depth at a place of the picture; wire tells whether to draw the edges."""
    i0, i1, i2 = triangles[t, 0], triangles[t, 1], triangles[t, 2]
    p0 = to_samples(view, vector(points, i0))
    p1 = to_samples(view, vector(points, i1))
    p2 = to_samples(view, vector(points, i2))
    e0, e1, e2, det = edge_functions(p0, p1, p2)
    s = vec3d(x, y, 1.0)
    g = vec3d(e0.dot(s), e1.dot(s), e2.dot(s))
    total = ti.max(g.sum(), 1e-300)
    b = ti.cast(g / total, ti.f32)
    n = safe_unit(
        b[0] * vector(normals, i0) + b[1] * vector(normals, i1) + b[2] * vector(normals, i2)
    )
    base = b[0] * vector(colors, i0) + b[1] * vector(colors, i1) + b[2] * vector(colors, i2)
    if p0.dot(p1.cross(p2)) > 0.0:  # seen from behind: y runs downward in the picture
        n = -n
    if wire > 0.5:
        slope = e0 + e1 + e2
        gap = 1e9
        for k in ti.static(range(3)):
            e = (e0, e1, e2)[k]
            dx = (e[0] - b[k] * slope[0]) / total
            dy = (e[1] - b[k] * slope[1]) / total
            gap = ti.min(gap, b[k] / ti.cast(ti.sqrt(dx * dx + dy * dy) + 1e-30, ti.f32))
        half = LINE * ti.max(view.height / (720.0 * view.per_pixel), 1.0)
        ink = ti.min(ti.max(half + 0.5 - gap / view.per_pixel, 0.0), 1.0)
        base *= 1.0 - 0.82 * ink
    return n, base, ti.cast(det / total, ti.f32)


@ti.func
def floor_color(
    back, q, x, y, view: ti.template(), lamp: ti.template(), ground: ti.template(),
    floor_shadow: ti.template(), dim: ti.template(),
):  # fmt: skip
    step = ti.cast(view.per_pixel, ti.f32)
    color = back
    away = (q - view.eye).norm() - 1.0
    fade = ti.exp(-ti.max(away, 0.0) / FADE)
    wx, wy = inverse_depth(ground, x + step, y), inverse_depth(ground, x, y + step)
    if wx > 0.0 and wy > 0.0:
        qx, qy = view.eye + ray(view, x + step, y) / wx, view.eye + ray(view, x, y + step) / wy
        color *= 1.0 + TILE * fade * tiles(ground, q, qx, qy)
    lamp_part = KEY * ti.max(ground.normal.dot(lamp.direction), 0.0)
    share = 1.0 - bilinear(floor_shadow, row(lamp.frame, 0, q), row(lamp.frame, 1, q))
    hidden = dimness(q, ground, dim)
    light = (lamp_part * share + AMBIENT * (1.0 - 0.9 * hidden)) / (lamp_part + AMBIENT)
    cool = vec3(0.96, 0.99, 1.05)
    return color * light * (cool * (1.0 - light) + light)


@ti.func
def seen(key, x, y, ground: ti.template()):
    """Primitive that a sample sees, or FLOOR, or SKY."""
    what = ti.cast(key, ti.i32)  # the low half
    depth = ti.bit_cast(ti.cast(key >> 32, ti.i32), ti.f32)
    floor = inverse_depth(ground, x, y)
    if key == 0:
        what = SKY
    if floor * 0.9998 > depth:  # a body at rest on the ground may sink in a little
        what = FLOOR
    return what


@ti.func
def alike(
    what, k, left, top, view: ti.template(), keys: ti.template(), ground: ti.template()
):  # fmt: skip
    """How many samples of a pixel see the same, their middle, and whether one precedes sample k."""
    count, x, y, again = 0.0, 0.0, 0.0, False
    for j in range(view.per_pixel * view.per_pixel):
        xj, yj = left + j % view.per_pixel, top + j // view.per_pixel
        if what == seen(keys[yj * view.width + xj], xj + 0.5, yj + 0.5, ground):
            again = again or j < k
            count += 1.0
            x += xj + 0.5
            y += yj + 0.5
    return count, x / count, y / count, again


@ti.func
def on_capsule(
    i, first_end, eye, d, points: ti.template(), colors: ti.template(), radii: ti.template()
):  # fmt: skip
    """Normal, colour and depth where a ray meets capsule i."""
    end = first_end + 2 * i
    a, b = vector(points, end), vector(points, end + 1)
    t, _ = capsule_hit(eye, d, a, b, radii[i])
    q = eye + t * d
    u = (q - a).dot(b - a) / ti.max((b - a).norm_sqr(), 1e-20)
    u = ti.min(ti.max(u, 0.0), 1.0)
    base = (1.0 - u) * vector(colors, end) + u * vector(colors, end + 1)
    return safe_unit(q - a - u * (b - a)), base, t


@ti.func
def body_color(
    s: ti.template(), q, d, lamp: ti.template(), shadow: ti.template(), coarse: ti.template(),
    disc: ti.template(), ground: ti.template(), dim: ti.template(),
):  # fmt: skip
    """Light from a point of a body, against the ray d that met it."""
    to_eye = -d.normalized()
    bent = ti.max(0.02 - s.normal.dot(to_eye), 0.0)  # smooth normals may look away
    s.normal = safe_unit(s.normal + bent * to_eye)
    share = 0.0
    if s.normal.dot(lamp.direction) > -0.3:  # start off the surface, which would shade itself
        share = lit(q + 2.0 * lamp.texel * (s.normal + lamp.direction), lamp, shadow, coarse, disc)
    return knee(reflected(s, to_eye, ground.normal, lamp, share, dimness(q, ground, dim)))


@ti.kernel
def shade(
    keys: Keys, view: View, points: Vectors, normals: Vectors, colors: Vectors,
    triangles: Triples, item_of: Integers, items: Vectors, triangle_count: ti.i32,
    first_end: ti.i32, radii: Scalars, lamp: Lamp, shadow: Vectors, coarse: Vectors,
    disc: Vectors, ground: Ground, floor_shadow: Vectors, dim: Vectors, curve: Bytes,
    picture: Pixels,
):  # fmt: skip
    """Colour of every pixel, by the curve from linear to sRGB; the keys are left empty."""
    ti.loop_config(block_dim=256)
    for pixel in range(picture.shape[0]):
        side = view.per_pixel
        left, top = (pixel % (view.width // side)) * side, (pixel // (view.width // side)) * side
        empty, visits = True, 1
        for k in range(side * side):
            if keys[(top + k // side) * view.width + left + k % side] != 0:
                empty, visits = False, side * side
        total = vec3(0.0, 0.0, 0.0)
        for k in range(visits):
            xk, yk = left + k % side, top + k // side
            what = seen(keys[yk * view.width + xk], xk + 0.5, yk + 0.5, ground)
            count, x, y, again = 1.0, left + 0.5 * side, top + 0.5 * side, False
            if not empty:
                count, x, y, again = alike(what, k, left, top, view, keys, ground)
            if not again:
                color = backdrop(x / view.width, y / view.height)
                d = ray(view, x, y)
                if what == FLOOR:
                    floor = inverse_depth(ground, x, y)
                    if floor > 0.0:
                        q = view.eye + d / floor
                        color = floor_color(color, q, x, y, view, lamp, ground, floor_shadow, dim)
                if what >= 0:
                    s = Surfel(vec3(0.0, 0.0, 0.0), vec3(0.0, 0.0, 0.0), items[item_of[what], 1])
                    t = 0.0
                    if what < triangle_count:
                        wire = items[item_of[what], 0]
                        s.normal, s.base, t = on_triangle(
                            what, x, y, wire, view, points, normals, colors, triangles
                        )
                    else:
                        i = what - triangle_count
                        s.normal, s.base, t = on_capsule(
                            i, first_end, view.eye, d, points, colors, radii
                        )
                    q = view.eye + t * d
                    color = body_color(s, q, d, lamp, shadow, coarse, disc, ground, dim)
                total += count * color
        if not empty:
            for k in range(side * side):
                keys[(top + k // side) * view.width + left + k % side] = 0
        for c in ti.static(range(3)):
            level = total[c] / visits * (curve.shape[0] - 1) + 0.5
            picture[pixel, c] = curve[ti.cast(ti.min(ti.max(level, 0.0), 4095.0), ti.i32)]
