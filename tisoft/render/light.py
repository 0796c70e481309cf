# mypy: ignore-errors
"""The lamp: a map of what it sees, and what shadows and soft matter make of its light on bodies.

A map holds, on a square grid, the largest third coordinate of an affine frame over what is drawn:
towards the lamp for its shadows, downwards for the dimness of the ground.  Penumbrae widen with the
distance from what casts them (percentage-closer soft shadows, Fernando 2005).
"""

import taichi as ti

from tisoft.render.geometry import Primitives, Rows, Tables, Vertices, affine, vec2, vec3
from tisoft.render.layout import (
    CELLS,
    DISC,
    EMPTY,
    HOLLOWS,
    LAMP_MAP,
    LAMP_SIZE,
    PLACE,
    SEARCH,
    TAPS,
)
from tisoft.render.scanlines import first_at_least, gradient, slope, sorted_corners, span

SPREAD = 0.075  # tangent of the lamp's half angle
REACH = 9.0  # widest penumbra on a body, in texels
SHARPEST = 1.5  # narrowest
FEW = 4  # taps that settle most places, where they and the search agree
BORDER = 12.0  # texels that are empty around a map


@ti.kernel
def clear_map(size: ti.i32, table: ti.i32, tables: Tables):
    for i in range(size * size):
        tables[table, i] = EMPTY


@ti.kernel
def map_triangles(
    vertices: Vertices, primitives: Primitives, count: ti.i32, stage: Rows, rows: ti.i32,
    table: ti.i32, tables: Tables,
):  # fmt: skip
    """Put triangles on an empty map, whose frame is three rows of the stage from `rows` on."""
    for t in range(count):
        abc, size = primitives[t], ti.cast(stage[LAMP_SIZE + table][0], ti.i32)
        p = on_map(stage, rows, vertices[PLACE, abc[0]])
        q = on_map(stage, rows, vertices[PLACE, abc[1]])
        r = on_map(stage, rows, vertices[PLACE, abc[2]])
        zx, zy, good = gradient(p, q, r)
        p, q, r = sorted_corners(p, q, r)
        if good and p[1] > -1e6 and r[1] < 1e6:
            long, upper, lower = slope(p, r), slope(p, q), slope(q, r)
            side = ti.cast(size, ti.f32)
            y0 = first_at_least(p[1] - 0.5, 0.0, side)
            y1 = first_at_least(r[1] - 0.5, 0.0, side)
            for y in range(y0, y1):
                left, right = span(y + 0.5, p, q, long, upper, lower)
                x0 = first_at_least(left - 0.5, 0.0, side)
                x1 = first_at_least(right - 0.5, 0.0, side)
                z = p[2] + (y + 0.5 - p[1]) * zy + (0.5 - p[0]) * zx
                for x in range(x0, x1):
                    h = z + x * zx
                    if h > tables[table, y * size + x]:
                        ti.atomic_max(tables[table, y * size + x], h)


@ti.func
def on_map(stage: ti.template(), rows, p):
    return vec3(affine(stage[rows], p), affine(stage[rows + 1], p), affine(stage[rows + 2], p))


@ti.func
def share_above(x, y, size, height, tables: ti.template()):
    """Share of the four texels around a place of the lamp's map that lie above a height."""
    x0, y0 = ti.floor(x - 0.5), ti.floor(y - 0.5)
    fx, fy = x - 0.5 - x0, y - 0.5 - y0
    at = ti.cast(y0, ti.i32) * size + ti.cast(x0, ti.i32)
    low, high = 0.0, 0.0
    if tables[LAMP_MAP, at] > height:
        low += 1.0 - fx
    if tables[LAMP_MAP, at + 1] > height:
        low += fx
    if tables[LAMP_MAP, at + size] > height:
        high += 1.0 - fx
    if tables[LAMP_MAP, at + size + 1] > height:
        high += fx
    return low * (1.0 - fy) + high * fy


@ti.func
def inside(x, size):
    """A place of the map, moved away from its rim."""
    return ti.min(ti.max(x, BORDER), size - BORDER - 1.0)


@ti.func
def lit(place, stage: ti.template(), tables: ti.template()):
    """Share of the lamp that a place (texels, texels, height) of its map sees."""
    size, texel = ti.cast(stage[LAMP_SIZE][0], ti.i32), stage[LAMP_SIZE][1]
    x, y, height = inside(place[0], size), inside(place[1], size), place[2]
    at = ti.cast(y, ti.i32) * size + ti.cast(x, ti.i32)
    total, found = 0.0, 0
    for k in range(SEARCH):
        way = stage[DISC + k]
        above = tables[LAMP_MAP, at + ti.cast(way[3], ti.i32)] - height
        # Only what is far enough above to throw its penumbra as far as this.
        if above > 0.0 and above * SPREAD >= (way[2] - 2.0) * texel:
            total += above
            found += 1
    radius = ti.min(ti.max(SPREAD * total / (ti.max(found, 1) * texel), SHARPEST), REACH)
    hidden = 0.0
    for k in range(TAPS):
        way = stage[DISC + SEARCH + k]
        hidden += share_above(x + radius * way[0], y + radius * way[1], size, height, tables)
        if k == FEW - 1:
            bright, dark = hidden == 0.0 and found == 0, hidden == FEW and found == SEARCH
            if bright or dark:
                hidden *= TAPS / FEW
                break
    return 1.0 - hidden / TAPS


@ti.kernel
def average_cells(stage: Rows, tables: Tables):
    """Of the cells of the lamp's map: the share that is covered, and that times the mean height."""
    for i in range(CELLS * CELLS):
        size = ti.cast(stage[LAMP_SIZE][0], ti.i32)
        side = size // CELLS
        y, x = i // CELLS * side, i % CELLS * side
        many, total = 0.0, 0.0
        for v in range(y, y + side):
            for u in range(x, x + side):
                if tables[LAMP_MAP, v * size + u] > 0.5 * EMPTY:
                    many += 1.0
                    total += tables[LAMP_MAP, v * size + u]
        tables[HOLLOWS, 2 * i] = many / (side * side)
        tables[HOLLOWS, 2 * i + 1] = total / (side * side)


@ti.func
def blur_cell(i, source, target, tables: ti.template()):
    y = ti.min(ti.max(i // 2 // CELLS, 1), CELLS - 2)
    x = ti.min(ti.max(i // 2 % CELLS, 1), CELLS - 2)
    total = 0.0
    for dy, dx in ti.static(ti.ndrange((-1, 2), (-1, 2))):
        weight = 0.0625 * (2 - dy * dy) * (2 - dx * dx)
        total += weight * tables[HOLLOWS, source + 2 * ((y + dy) * CELLS + x + dx) + i % 2]
    tables[HOLLOWS, target + i] = total


@ti.kernel
def blur_cells(tables: Tables):
    """Two passes of a tent of 3 x 3 cells, to the second half of their room and back."""
    for i in range(2 * CELLS * CELLS):
        blur_cell(i, 0, 2 * CELLS * CELLS, tables)
    for i in range(2 * CELLS * CELLS):
        blur_cell(i, 2 * CELLS * CELLS, 0, tables)


@ti.func
def depth_below(place, stage: ti.template(), tables: ti.template()):
    """How far a place of the lamp's map lies below what surrounds it, blurred.

    It is the depth of hollows, and on the dark side about the matter that light passes.
    """
    per = CELLS / stage[LAMP_SIZE][0]
    u = ti.min(ti.max(place[0] * per - 0.5, 0.0), CELLS - 1.001)
    v = ti.min(ti.max(place[1] * per - 0.5, 0.0), CELLS - 1.001)
    j, i = ti.cast(u, ti.i32), ti.cast(v, ti.i32)
    fx, fy = u - j, v - i
    c = vec2(0.0, 0.0)
    for dy, dx in ti.static(ti.ndrange(2, 2)):
        at = 2 * ((i + dy) * CELLS + j + dx)
        share = (fx if dx else 1.0 - fx) * (fy if dy else 1.0 - fy)
        c += share * vec2(tables[HOLLOWS, at], tables[HOLLOWS, at + 1])
    return ti.max(c[1] - c[0] * place[2], 0.0)
