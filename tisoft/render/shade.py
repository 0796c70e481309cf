# mypy: ignore-errors
"""From what every sample sees to the picture: materials, light, and averaging in linear light.

A pixel is shaded once for each surface in it, at the middle of the samples that see it; two
surfaces are told apart, by item, normal and depth, and further ones join the second.
"""

from functools import cache
from typing import Any

import taichi as ti

from tisoft.render.backdrop import Colors, Pixels, encode
from tisoft.render.geometry import (
    Integers,
    Keys,
    Primitives,
    Rows,
    Tables,
    Vertices,
    affine,
    on,
    safe_unit,
    vec3,
    vec4,
)
from tisoft.render.ground import bilinear, dimness
from tisoft.render.layout import (
    DIM,
    GROUND_SIZE,
    ITEMS,
    LAMP_SIZE,
    ON_GROUND_X,
    ON_GROUND_Y,
    ON_LAMP_X,
    ON_LAMP_Y,
    PLACES,
    SHADOW,
    SIZES,
    TILE,
)
from tisoft.render.light import depth_below, lit
from tisoft.render.surfaces import (
    add,
    alike,
    nothing,
    on_capsule,
    on_triangle,
    ray,
    sight_of,
)

KEY = 0.80  # of the lamp on a surface that faces it
AMBIENT = 0.40  # of the sky on the ground
HOLLOW, HOLLOW_REACH = 0.4, 24.0  # share of the sky that hollows lose; texels where they have
THROUGH, THROUGH_REACH = 1.0, 40.0  # light through thin parts, and texels that take most of it
COOL = vec3(0.96, 0.99, 1.05)  # tint of what the lamp does not reach
DARK = 0.999  # factor below which the ground is drawn anew
SINK = 0.9998  # a body at rest on the ground may sink in a little

AlphaPixels = ti.types.ndarray(dtype=ti.types.vector(4, ti.u8), ndim=1)


@ti.func
def reflected(s: ti.template(), to_eye, up, lamp, light, material):
    """Light towards the eye from a satin surface.

    `light`: shares of the lamp that is seen, of the sky that the ground and that hollows hide, and
    of the lamp's light that comes through from behind.
    """
    n, base, share, dim = s.normal, s.base, light[0], light[1]
    facing = ti.max(n.dot(to_eye), 0.0)
    # Light enters and leaves soft matter elsewhere: the terminator is wide and saturated.
    # This is (n·l + w)/(1 + w) with w = .08 + .22 base, without the division.
    direct = ti.max(1.0 - (1.0 - n.dot(lamp)) * (0.926 - 0.157 * base), 0.0)
    key = KEY * vec3(1.0, 0.97, 0.92) * direct * (0.04 + 0.96 * share)
    height = 0.5 + 0.5 * n.dot(up)
    ambient = vec3(0.30, 0.34, 0.40) * height * (1.0 - HOLLOW * light[2])
    ambient += vec3(0.24, 0.23, 0.215) * (1.0 - height) * (1.0 - 0.85 * dim)
    half = ti.max(n.dot(safe_unit(lamp + to_eye)), 0.0) ** 2
    broad = half * half * half * half
    gloss = broad * broad * broad * broad * broad * broad * broad * broad
    edge = (1.0 - facing) ** 2
    rim = edge * edge * 0.18 * height * (1.0 - 0.7 * dim) * vec3(0.85, 0.93, 1.0)
    spark = (0.30 * gloss + 0.05 * broad) * share
    through = THROUGH * light[3] * material[3] * base  # tinted twice by what it passed
    return base * (key + ambient + 0.10 * facing + through) + material[1] * (spark + rim)


@ti.func
def body_light(
    x, y, total: ti.template(), sight: ti.template(), stage: ti.template(), tables: ti.template()
):  # fmt: skip
    """Light of a surface in the pixel with the middle (x, y), times its weight."""
    d = ray(sight, x, y)
    to_eye = -d.normalized()
    s = nothing()
    q = sight.eye + total.depth / total.weight * d
    n = safe_unit(total.normal)
    s.normal = safe_unit(n + ti.max(0.02 - n.dot(to_eye), 0.0) * to_eye)  # it may look away
    s.base = total.base / total.weight
    facing = s.normal.dot(sight.lamp)
    share, through = 0.0, 0.0
    if facing > -0.2:  # start off the surface, which would shade itself
        p = q + 2.0 * sight.texel * (s.normal + sight.lamp)
        place = vec3(affine(sight.lamp_x, p), affine(sight.lamp_y, p), affine(sight.lamp_z, p))
        share = lit(place, stage, tables) * ti.min(1.0 + 5.0 * facing, 1.0)
    place = vec3(affine(sight.lamp_x, q), affine(sight.lamp_y, q), affine(sight.lamp_z, q))
    material = stage[ITEMS + total.item]
    depth = depth_below(place, stage, tables) / sight.texel
    if material[3] > 0.0:
        through = ti.exp(-depth / THROUGH_REACH) * ti.min(ti.max(0.4 - facing, 0.0), 1.0)
    dim = dimness(q, sight.ground_x, sight.ground_y, stage[GROUND_SIZE][0], tables)
    deep = ti.min(depth / HOLLOW_REACH, 1.0)
    light = vec4(share, dim, deep, through)
    return total.weight * reflected(s, to_eye, sight.up, sight.lamp, light, material)


@ti.func
def ground_light(x, y, sight: ti.template(), stage: ti.template(), tables: ti.template()):
    """Factor on the background in the pixel with the middle (x, y); 1 without ground."""
    factor, floor = 1.0, on(sight.floor, x, y)
    if floor > 0.0:
        w = 1.0 / floor
        u, v = on(stage[ON_LAMP_X], x, y) * w, on(stage[ON_LAMP_Y], x, y) * w
        share = ti.min(bilinear(u, v, stage[LAMP_SIZE][0], SHADOW, tables), 1.0)
        u, v = on(stage[ON_GROUND_X], x, y) * w, on(stage[ON_GROUND_Y], x, y) * w
        hidden = ti.min(bilinear(u, v, stage[GROUND_SIZE][0], DIM, tables), 1.0)
        part = KEY * ti.max(sight.up.dot(sight.lamp), 0.0)
        factor = 1.0 - (part * share + 0.9 * AMBIENT * hidden) / (part + AMBIENT)
    return factor


@cache
def _blend(alpha: bool) -> Any:
    """The function that puts light of bodies before the background, or before nothing."""

    @ti.func
    def before_nothing(color, rest, factor, sight: ti.template(), base, tables: ti.template()):
        solid = 1.0 - rest / sight.samples
        rgb = encode(color / (solid * sight.samples), tables)
        return ti.Vector([rgb[0], rgb[1], rgb[2], ti.cast(255.0 * solid + 0.5, ti.u8)])

    @ti.func
    def before_sky(color, rest, factor, sight: ti.template(), base, tables: ti.template()):
        """`rest`: samples that see the background, darkened by a factor."""
        tint = COOL * (1.0 - factor) + factor
        return encode((color + rest * tint * base) / sight.samples, tables)

    return before_nothing if alpha else before_sky


@cache
def draw_kernel(*, capsules: bool, wires: bool, alpha: bool, together: bool) -> Any:
    """The kernel that draws pictures with or without capsules and wires, and on a background or
    with alpha; `together`: a tile is one iteration, for a CPU, or else a pixel, for a GPU."""
    picture_type = AlphaPixels if alpha else Pixels
    blend = _blend(alpha)
    per_tile = 1 if together else TILE * TILE
    per_job = TILE * TILE // per_tile

    @ti.func
    def look_at(
        what, x, y, inverse_depth, sight: ti.template(), stage: ti.template(),
        vertices: ti.template(), primitives: ti.template(),
    ):  # fmt: skip
        """What a sample at (x, y) sees of a primitive."""
        s, abc = nothing(), primitives[what]
        s.item, s.depth = abc[3], 1.0 / inverse_depth
        if ti.static(not capsules):
            s.normal, s.base = on_triangle(abc, x, y, wires, sight, stage, vertices)
        elif abc[2] >= 0:
            s.normal, s.base = on_triangle(abc, x, y, wires, sight, stage, vertices)
        else:
            s.normal, s.base = on_capsule(abc, s.depth, x, y, sight, vertices)
        return s

    @ti.func
    def gather(
        start, x, y, sight: ti.template(), stage: ti.template(), vertices: ti.template(),
        primitives: ti.template(), keys: ti.template(),
    ):  # fmt: skip
        """The first surface that a pixel's samples see, and the others together; its keys begin at
        `start` and are left empty."""
        first, second = nothing(), nothing()
        seen, many, now = -1, 0.0, nothing()
        for k in range(sight.samples + 1):
            what, inverse, sx, sy = -1, 0.0, 0.0, 0.0
            if k < sight.samples:
                at = start + k * TILE * TILE
                key = keys[at]
                if key != 0:
                    keys[at] = 0
                    sx, sy = x + stage[PLACES + k][0], y + stage[PLACES + k][1]
                    inverse = ti.bit_cast(ti.cast(key >> 32, ti.i32), ti.f32)
                    if on(sight.floor, sx, sy) * SINK <= inverse:
                        what = ti.cast(key, ti.i32)
            if what != seen or k == sight.samples:
                if seen >= 0:
                    if alike(now, first):
                        add(many, now, first)
                    else:
                        add(many, now, second)
                seen, many = what, 0.0
                if what >= 0:
                    now = look_at(
                        what, sx, sy, inverse, sight, stage, vertices,
                        primitives,
                    )  # fmt: skip
            many += 1.0
        return first, second

    @ti.kernel
    def draw(
        stage: Rows, vertices: Vertices, primitives: Primitives, keys: Keys, tables: Tables,
        jobs: Integers, base: Colors, picture: picture_type,
    ):  # fmt: skip
        """Each job is a tile, or -1 for none."""
        for job in range(jobs.shape[0] * per_tile):
            tile = jobs[job // per_tile]
            if tile >= 0:
                sight = sight_of(stage)
                width, height = ti.cast(stage[SIZES][0], ti.i32), ti.cast(stage[SIZES][1], ti.i32)
                columns = ti.cast(stage[SIZES][3], ti.i32)
                left, top = tile % columns * TILE, tile // columns * TILE
                for p in range(job % per_tile * per_job, job % per_tile * per_job + per_job):
                    x, y = left + p % TILE, top + p // TILE
                    if x < width and y < height:
                        start = tile * sight.samples * TILE * TILE + p
                        first, second = gather(
                            start, x, y, sight, stage, vertices, primitives, keys
                        )  # fmt: skip
                        at, cx, cy = y * width + x, x + 0.5, y + 0.5
                        bodies = first.weight + second.weight
                        rest = sight.samples - bodies
                        color = vec3(0.0)
                        while first.weight > 0.0:
                            color += body_light(cx, cy, first, sight, stage, tables)
                            first = second
                            second.weight = 0.0
                        factor = 1.0
                        if rest > 0.0:
                            factor = ground_light(cx, cy, sight, stage, tables)
                        if bodies > 0.0 or factor < DARK:
                            rest *= factor
                            picture[at] = blend(color, rest, factor, sight, base[at], tables)

    return draw


@cache
def ground_kernel(*, alpha: bool) -> Any:
    """The kernel that draws tiles with nothing but ground in them."""
    picture_type = AlphaPixels if alpha else Pixels
    blend = _blend(alpha)

    @ti.kernel
    def draw_ground(
        stage: Rows, tables: Tables, jobs: Integers, base: Colors, picture: picture_type
    ):  # fmt: skip
        for job in range(jobs.shape[0]):
            tile = jobs[job]
            if tile >= 0:
                sight = sight_of(stage)
                width, height = ti.cast(stage[SIZES][0], ti.i32), ti.cast(stage[SIZES][1], ti.i32)
                columns = ti.cast(stage[SIZES][3], ti.i32)
                left, top = tile % columns * TILE, tile // columns * TILE
                for p in range(TILE * TILE):
                    x, y = left + p % TILE, top + p // TILE
                    if x < width and y < height:
                        factor = ground_light(x + 0.5, y + 0.5, sight, stage, tables)
                        if factor < DARK:
                            at, rest = y * width + x, factor * sight.samples
                            picture[at] = blend(vec3(0.0), rest, factor, sight, base[at], tables)

    return draw_ground
