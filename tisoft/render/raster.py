# mypy: ignore-errors
"""What every sample of the picture sees: an i64 key (1/depth, primitive), the largest one wins.

The maximum does not depend on the order of the primitives, so the picture does not depend on the
number of threads.  Keys lie tile by tile.  On the CPU triangles are first sorted into the tiles
that they may touch, and each tile is one thread's: no atomics.  On a GPU each triangle claims its
samples by an atomic maximum.
"""

import taichi as ti

from tisoft.render.geometry import (
    Integers,
    Keys,
    Primitives,
    Rows,
    Vertices,
    head,
    vec2,
    vec3d,
)
from tisoft.render.layout import NEAR, PLACE, PLACES, SCREEN, SIZES, TILE, TO_X
from tisoft.render.scanlines import first_at_least, gradient, slope, sorted_corners, span

vec4i = ti.types.vector(4, ti.i32)


@ti.func
def key_of(inverse_depth, primitive):
    """f32 numbers above 0 are in the order of their bits."""
    bits = ti.cast(ti.bit_cast(ti.max(inverse_depth, 1e-30), ti.i32), ti.i64)
    return (bits << 32) | ti.cast(primitive, ti.i64)


@ti.func
def place_of(x, y, k, samples, columns):
    """Where the keys hold sample k of a pixel."""
    return (((y // TILE * columns + x // TILE) * samples + k) * TILE + y % TILE) * TILE + x % TILE


@ti.func
def tiles_of(a, b, c, width, height):
    """Tiles x0, y0, x1, y1 (exclusive) that a triangle may touch; none where it is not all in
    front of the eye."""
    lo_x, hi_x = ti.min(a[0], b[0], c[0]), ti.max(a[0], b[0], c[0])
    lo_y, hi_y = ti.min(a[1], b[1], c[1]), ti.max(a[1], b[1], c[1])
    box = vec4i(0, 0, 0, 0)
    within = lo_x < width and lo_y < height and hi_x > 0.0 and hi_y > 0.0
    if within and ti.min(a[2], b[2], c[2]) > 0.0 and ti.max(a[2], b[2], c[2]) < 1.0 / NEAR:
        box = vec4i(
            ti.cast(ti.max(lo_x, 0.0), ti.i32) // TILE,
            ti.cast(ti.max(lo_y, 0.0), ti.i32) // TILE,
            ti.cast(ti.min(hi_x, width - 1.0), ti.i32) // TILE + 1,
            ti.cast(ti.min(hi_y, height - 1.0), ti.i32) // TILE + 1,
        )
    return box


@ti.kernel
def bin_triangles(
    vertices: Vertices, primitives: Primitives, count: ti.i32, stage: Rows,
    cursor: Integers, room: ti.i32, lists: Integers,
):  # fmt: skip
    """Every triangle takes a place in the list of each tile that it may touch; without room they
    are but counted."""
    for t in range(count):
        abc, sizes = primitives[t], stage[SIZES]
        a, b, c = vertices[SCREEN, abc[0]], vertices[SCREEN, abc[1]], vertices[SCREEN, abc[2]]
        box = tiles_of(a, b, c, sizes[0], sizes[1])
        for v in range(box[1], box[3]):
            for u in range(box[0], box[2]):
                place = ti.atomic_add(cursor[v * ti.cast(sizes[3], ti.i32) + u], 1)
                if place < room:
                    lists[place] = t


@ti.func
def scan(
    t, tile, stage: ti.template(), vertices: ti.template(), primitives: ti.template(),
    keys: ti.template(), shared: ti.template(),
):  # fmt: skip
    """Claim the samples of a tile that a triangle covers and is the nearest of.

    `shared` tells whether other threads claim samples of the tile too.
    """
    samples, columns = ti.cast(stage[SIZES][2], ti.i32), ti.cast(stage[SIZES][3], ti.i32)
    abc = primitives[t]
    p, q, r = vertices[SCREEN, abc[0]], vertices[SCREEN, abc[1]], vertices[SCREEN, abc[2]]
    zx, zy, good = gradient(p, q, r)
    p, q, r = sorted_corners(p, q, r)
    if good:
        long, upper, lower = slope(p, r), slope(p, q), slope(q, r)
        side, corner = ti.cast(TILE, ti.f32), vec2(tile % columns * TILE, tile // columns * TILE)
        for k in range(samples):
            ox, oy = corner[0] + stage[PLACES + k][0], corner[1] + stage[PLACES + k][1]
            y0, y1 = first_at_least(p[1] - oy, 0.0, side), first_at_least(r[1] - oy, 0.0, side)
            for y in range(y0, y1):
                left, right = span(y + oy, p, q, long, upper, lower)
                x0, x1 = first_at_least(left - ox, 0.0, side), first_at_least(right - ox, 0.0, side)
                z = p[2] + (y + oy - p[1]) * zy + (ox - p[0]) * zx
                at = ((tile * samples + k) * TILE + y) * TILE
                for x in range(x0, x1):
                    key = key_of(z + x * zx, t)
                    if key > keys[at + x]:
                        if ti.static(shared):
                            ti.atomic_max(keys[at + x], key)
                        else:
                            keys[at + x] = key


@ti.kernel
def see_tiles(
    vertices: Vertices, primitives: Primitives, stage: Rows, keys: Keys,
    jobs: Integers, first: Integers, lists: Integers,
):  # fmt: skip
    """Each job is a tile, or -1 for none; its triangles are lists[first[tile]...]."""
    for job in range(jobs.shape[0]):
        tile = jobs[job]
        if tile >= 0:
            for j in range(first[tile], first[tile + 1]):
                scan(lists[j], tile, stage, vertices, primitives, keys, False)


@ti.kernel
def see_triangles(
    vertices: Vertices, primitives: Primitives, count: ti.i32, stage: Rows, keys: Keys
):  # fmt: skip
    """The form for a GPU: every triangle visits its tiles."""
    for t in range(count):
        abc, sizes = primitives[t], stage[SIZES]
        a, b, c = vertices[SCREEN, abc[0]], vertices[SCREEN, abc[1]], vertices[SCREEN, abc[2]]
        box = tiles_of(a, b, c, sizes[0], sizes[1])
        for v in range(box[1], box[3]):
            for u in range(box[0], box[2]):
                tile = v * ti.cast(sizes[3], ti.i32) + u
                scan(t, tile, stage, vertices, primitives, keys, True)


@ti.func
def homogeneous(stage: ti.template(), p):
    """(x w, y w, w) in f64 of a place of the picture."""
    q = vec3d(0.0, 0.0, 0.0)
    for k in ti.static(range(3)):
        row = stage[TO_X + k]
        q[k] = ti.cast(head(row), ti.f64).dot(ti.cast(p, ti.f64)) + ti.cast(row[3], ti.f64)
    return q


@ti.kernel
def see_cut_triangles(
    vertices: Vertices, primitives: Primitives, count: ti.i32, stage: Rows, keys: Keys,
    marks: Integers,
):  # fmt: skip
    """Triangles that reach behind the eye; rare.

    In homogeneous coordinates (Olano and Greer 1997): with the corners p_i = (x w, y w, w), the
    edge functions e_i = p_j × p_k give e_i·(x, y, 1) ≥ 0 inside and Σ e_i·(x, y, 1) = det/w, so
    nothing is clipped.  Their tiles are marked.
    """
    for t in range(count):
        abc = primitives[t]
        a, b, c = vertices[SCREEN, abc[0]], vertices[SCREEN, abc[1]], vertices[SCREEN, abc[2]]
        least, most = ti.min(a[2], b[2], c[2]), ti.max(a[2], b[2], c[2])
        if (least <= 0.0 or most >= 1.0 / NEAR) and most > 0.0:
            p0 = homogeneous(stage, vertices[PLACE, abc[0]])
            p1 = homogeneous(stage, vertices[PLACE, abc[1]])
            p2 = homogeneous(stage, vertices[PLACE, abc[2]])
            e0, e1, e2 = p1.cross(p2), p2.cross(p0), p0.cross(p1)
            det = p0.dot(e0)
            if det < 0.0:
                e0, e1, e2, det = -e0, -e1, -e2, -det
            if det > 0.0:
                cover_cut(t, e0, e1, e2, det, stage, keys, marks)


@ti.func
def cover_cut(
    t, e0, e1, e2, det, stage: ti.template(), keys: ti.template(), marks: ti.template()
):  # fmt: skip
    sizes = ti.cast(stage[SIZES], ti.i32)
    for pixel in range(sizes[0] * sizes[1]):
        y, x = pixel // sizes[0], pixel % sizes[0]
        for k in range(sizes[2]):
            place = stage[PLACES + k]
            s = vec3d(ti.cast(x, ti.f64) + place[0], ti.cast(y, ti.f64) + place[1], 1.0)
            inverse = (e0 + e1 + e2).dot(s) / det
            inside = e0.dot(s) >= 0.0 and e1.dot(s) >= 0.0 and e2.dot(s) >= 0.0
            if inside and 0.0 < inverse < 1.0 / NEAR:
                at = place_of(x, y, k, sizes[2], sizes[3])
                ti.atomic_max(keys[at], key_of(ti.cast(inverse, ti.f32), t))
                marks[y // TILE * sizes[3] + x // TILE] = 1
