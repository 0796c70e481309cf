# mypy: ignore-errors
"""The ground: an endless plane that carries shadows and tiles and melts into the background.

It has no colour of its own but is a factor on the background, so it has no horizon.

Its shadow is soft by a pyramid: each texel of the lamp's map that something covers goes to the
level, or the two, whose blur is as wide as the penumbra that its height throws; levels are then
summed from coarse to fine.  Sharp where things touch the ground, and without noise.
"""

import taichi as ti

from tisoft.render.geometry import Rows, Tables, affine
from tisoft.render.layout import (
    DIM,
    EMPTY,
    GROUND_MAP,
    GROUND_SIZE,
    LAMP_MAP,
    LAMP_SIZE,
    MASK,
    PART,
    PLANE,
    RADIUS,
    SHADOW,
)
from tisoft.render.light import SPREAD

LEVELS = 5
LEAST = 0.6  # no shadow is sharper than this level
STRIP = 16  # texels that one iteration blurs
AZIMUTHS, STEPS = 8, 6
HALO = 0.22  # how far things dim the ground around them, in distances from the eye to the target


@ti.func
def offset(size, level):
    """Where a level of a pyramid of size² begins."""
    n = size >> level
    return 4 * (size * size - n * n) // 3


@ti.func
def log2(x):
    """Logarithm to the base 2, exact at powers of 2 and linear between."""
    bits = ti.bit_cast(x, ti.i32)
    return (bits >> 23) - 127 + (bits & 0x7FFFFF) / 8388608.0


@ti.func
def share_of_level(radius, level):
    """Levels blur by 1.9, 3.8, 7.6, … texels of the finest; a radius between goes to both."""
    at = ti.min(ti.max(log2(radius / 1.9), LEAST), LEVELS - 1.0)
    return ti.max(1.0 - ti.abs(at - level), 0.0)


@ti.kernel
def cover(size: ti.i32, stage: Rows, tables: Tables):
    """The finest level: which texels are covered, their penumbra, and their share of this level."""
    for i in range(size * size):
        plane = stage[PLANE]
        height = plane[0] * (i % size + 0.5) + plane[1] * (i // size + 0.5) + plane[2]
        part, radius, mask = 0.0, 0.0, 0.0
        if tables[LAMP_MAP, i] > 0.5 * EMPTY:
            part = 1.0
            radius = ti.max(SPREAD * (tables[LAMP_MAP, i] - height) / stage[LAMP_SIZE][1], 1e-3)
            mask = share_of_level(radius, 0)
        tables[PART, i] = part
        tables[RADIUS, i] = radius
        tables[MASK, i] = mask


@ti.func
def halve_texel(i, size, level, tables: ti.template()):
    n = size >> level
    here, finer = offset(size, level), offset(size, level - 1)
    part, radius, mask = 0.0, 0.0, 0.0
    for dy, dx in ti.static(ti.ndrange(2, 2)):
        j = finer + 2 * (2 * (i // n) + dy) * n + 2 * (i % n) + dx
        part += tables[PART, j]
        radius += tables[PART, j] * tables[RADIUS, j]
    if part > 0.0:
        radius /= part
        mask = 0.25 * part * share_of_level(radius, level)
    tables[PART, here + i] = 0.25 * part
    tables[RADIUS, here + i] = radius
    tables[MASK, here + i] = mask


@ti.kernel
def halve(size: ti.i32, level: ti.i32, tables: Tables):
    """A level from the next finer one."""
    for i in range((size >> level) * (size >> level)):
        halve_texel(i, size, level, tables)


@ti.func
def column(up, mid, down, x, tables: ti.template()):
    """A mask blurred along y, at three starts of lines."""
    return 0.25 * (tables[MASK, up + x] + tables[MASK, down + x]) + 0.5 * tables[MASK, mid + x]


@ti.func
def soften_strip(strip, size, level, tables: ti.template()):
    n = size >> level
    here, above = offset(size, level), offset(size, level + 1)
    y, first = strip * STRIP // n, strip * STRIP % n
    up, mid, down = here + ti.max(y - 1, 0) * n, here + y * n, here + ti.min(y + 1, n - 1) * n
    half = n // 2
    near = above + y // 2 * half
    far = above + ti.min(ti.max(y // 2 - 1 + 2 * (y % 2), 0), half - 1) * half
    coarse = ti.cast(level < LEVELS - 1, ti.f32)
    x = ti.max(first - 1, 0)
    before, now = column(up, mid, down, x, tables), column(up, mid, down, first, tables)
    left = coarse * (0.25 * tables[SHADOW, far + x // 2] + 0.75 * tables[SHADOW, near + x // 2])
    x = first // 2
    middle = coarse * (0.25 * tables[SHADOW, far + x] + 0.75 * tables[SHADOW, near + x])
    for c in range(STRIP // 2):
        x, beyond = first + 2 * c, ti.min(first + 2 * c + 2, n - 1)
        between = column(up, mid, down, x + 1, tables)
        after = column(up, mid, down, beyond, tables)
        right = 0.25 * tables[SHADOW, far + beyond // 2]
        right = coarse * (right + 0.75 * tables[SHADOW, near + beyond // 2])
        tables[SHADOW, mid + x] = (
            0.25 * (before + between) + 0.5 * now + 0.25 * left + 0.75 * middle
        )
        tables[SHADOW, mid + x + 1] = (
            0.25 * (now + after) + 0.5 * between + 0.75 * middle + 0.25 * right
        )
        before, now, left, middle = between, after, middle, right


@ti.kernel
def soften(size: ti.i32, level: ti.i32, tables: Tables):
    """The level's mask, blurred by a small tent, and the next coarser level, interpolated."""
    for strip in range((size >> level) * (size >> level) // STRIP):
        soften_strip(strip, size, level, tables)


@ti.kernel
def coarse_levels(size: ti.i32, finest: ti.i32, tables: Tables):
    """All of this for the levels from the finest on, by one thread: they are too small to share."""
    ti.loop_config(serialize=True)
    for level in range(finest, LEVELS):
        for i in range((size >> level) * (size >> level)):
            halve_texel(i, size, level, tables)
    ti.loop_config(serialize=True)
    for k in range(LEVELS - finest):
        level = LEVELS - 1 - k
        for strip in range((size >> level) * (size >> level) // STRIP):
            soften_strip(strip, size, level, tables)


@ti.kernel
def dim_ground(size: ti.i32, stage: Rows, tables: Tables):
    """Share of the sky hidden from every texel of the ground, by azimuths (horizon-based)."""
    for i in range(size * size):
        texel = stage[GROUND_SIZE][1]
        y, x = i // size, i % size
        total = 0.0
        for a in range(AZIMUTHS):
            angle = 6.2831853 * (a + 0.5) / AZIMUTHS
            dx, dy = ti.cos(angle) / texel, ti.sin(angle) / texel
            hidden = 0.0
            for k in range(STEPS):
                reach = (k + 0.5) / STEPS
                d = HALO * reach * reach
                u, v = ti.cast(x + 0.5 + dx * d, ti.i32), ti.cast(y + 0.5 + dy * d, ti.i32)
                if 0 <= u < size and 0 <= v < size:
                    h = -tables[GROUND_MAP, v * size + u]
                    if h < HALO:
                        h = ti.max(h, 0.0)
                        d2 = d * d + 1e-8
                        fade = (1.0 - reach * reach) * (1.0 - h / HALO)
                        hidden = ti.max(hidden, fade * d2 / (d2 + h * h))
            total += hidden
        tables[DIM, i] = total / AZIMUTHS


@ti.func
def bilinear(x, y, size, table: ti.template(), tables: ti.template()):
    """Value of a map at a place of it, between texels; 0 outside."""
    u, v = x - 0.5, y - 0.5
    value = 0.0
    if 0.0 <= u < size - 1 and 0.0 <= v < size - 1:
        j, i = ti.cast(u, ti.i32), ti.cast(v, ti.i32)
        fx, fy = u - j, v - i
        at = i * ti.cast(size, ti.i32) + j
        low = tables[table, at] * (1.0 - fx) + tables[table, at + 1] * fx
        at += ti.cast(size, ti.i32)
        high = tables[table, at] * (1.0 - fx) + tables[table, at + 1] * fx
        value = low * (1.0 - fy) + high * fy
    return value


@ti.func
def dimness(q, row_x, row_y, size, tables: ti.template()):
    """Share of the sky hidden from the ground below a point."""
    return bilinear(affine(row_x, q), affine(row_y, q), size, DIM, tables)
