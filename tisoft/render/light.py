# mypy: ignore-errors
"""Shadows of one broad lamp, and the dimness of the ground close to what stands on it.

A map holds, on a square grid, the largest third coordinate of an affine frame over what is drawn:
towards the lamp for the shadow map, towards the ground for the map of undersides. Penumbrae widen
with the distance from what casts them (percentage-closer soft shadows, Fernando 2005).
"""

import taichi as ti

from tisoft.render.geometry import Scalars, Triples, Vectors, mat34, row, vec3, vec3d, vector
from tisoft.render.raster import clamped, edge_functions, vec4i

EMPTY = -1e9  # of a texel above which there is nothing
CELL = 32  # texels along a coarse cell, which knows the largest value in its neighbourhood
REACH = 24.0  # widest penumbra on the ground, in texels; below CELL: a neighbourhood holds it
REACH_ON_BODIES = 9.0
LAMP = 0.075  # tangent of the lamp's half angle
SEARCH = 120  # samples in search of what casts a penumbra on the ground
SEARCH_ON_BODIES = 12
TAPS = 24  # samples of a penumbra on a body
STRIDE = 2  # every so many samples, one is taken first
SHARPEST = 1.5  # narrowest penumbra, in texels
GROUND_TAPS = 64  # on the ground, whose shadow is wide and is computed once a texel

Grid = Vectors

# The lamp: unit direction towards it, the frame of its map (third row: towards the lamp), and the
# side of a texel; lengths in distances from the eye to the target.
Lamp = ti.types.struct(direction=vec3, frame=mat34, texel=ti.f32)


@ti.kernel
def map_triangles(points: Vectors, triangles: Triples, count: ti.i32, frame: mat34, grid: Grid):
    ti.loop_config(block_dim=64)
    for t in range(count):
        a = vector(points, triangles[t, 0])
        b = vector(points, triangles[t, 1])
        c = vector(points, triangles[t, 2])
        p0, p1, p2 = on_map(frame, a), on_map(frame, b), on_map(frame, c)
        e0, e1, e2, det = edge_functions(p0, p1, p2)
        height = vec3d(row(frame, 2, a), row(frame, 2, b), row(frame, 2, c)) / det
        box = vec4i(0, 0, 0, 0)
        if det > 0.0:
            box = clamped(
                ti.min(p0[0], p1[0], p2[0]), ti.min(p0[1], p1[1], p2[1]),
                ti.max(p0[0], p1[0], p2[0]), ti.max(p0[1], p1[1], p2[1]),
                grid.shape[1], grid.shape[0],
            )  # fmt: skip
        for y in range(box[1], box[3]):
            for x in range(box[0], box[2]):
                s = vec3d(ti.cast(x, ti.f64) + 0.5, ti.cast(y, ti.f64) + 0.5, 1.0)
                inside = vec3d(e0.dot(s), e1.dot(s), e2.dot(s))
                if inside.min() >= 0.0:
                    ti.atomic_max(grid[y, x], ti.cast(inside.dot(height), ti.f32))


@ti.func
def on_map(frame: ti.template(), q):
    return vec3d(row(frame, 0, q), row(frame, 1, q), 1.0)


@ti.kernel
def map_capsules(
    points: Vectors,
    first_end: ti.i32,
    radii: Scalars,
    count: ti.i32,
    frame: mat34,
    texel: ti.f32,
    grid: Grid,
):
    """Capsules as flat bands as wide as they are: enough for their shadow."""
    ti.loop_config(block_dim=64)
    for i in range(count):
        a, b = vector(points, first_end + 2 * i), vector(points, first_end + 2 * i + 1)
        ax, ay, az = row(frame, 0, a), row(frame, 1, a), row(frame, 2, a)
        bx, by, bz = row(frame, 0, b), row(frame, 1, b), row(frame, 2, b)
        r = ti.max(radii[i] / texel, 0.6)  # thin springs keep a shadow without holes
        box = clamped(
            ti.min(ax, bx) - r, ti.min(ay, by) - r, ti.max(ax, bx) + r, ti.max(ay, by) + r,
            grid.shape[1], grid.shape[0],
        )  # fmt: skip
        dx, dy = bx - ax, by - ay
        length = ti.max(dx * dx + dy * dy, 1e-12)
        for y in range(box[1], box[3]):
            for x in range(box[0], box[2]):
                px, py = ti.cast(x, ti.f32) + 0.5 - ax, ti.cast(y, ti.f32) + 0.5 - ay
                u = ti.min(ti.max((px * dx + py * dy) / length, 0.0), 1.0)
                if (px - u * dx) ** 2 + (py - u * dy) ** 2 <= r * r:
                    ti.atomic_max(grid[y, x], az + u * (bz - az))


@ti.kernel
def coarsen(grid: Grid, coarse: Grid):
    """Largest value of a cell and of the cells around it."""
    for i, j in ti.ndrange(coarse.shape[0], coarse.shape[1]):
        top = EMPTY
        for y in range(ti.max(0, (i - 1) * CELL), ti.min(grid.shape[0], (i + 2) * CELL)):
            for x in range(ti.max(0, (j - 1) * CELL), ti.min(grid.shape[1], (j + 2) * CELL)):
                top = ti.max(top, grid[y, x])
        coarse[i, j] = top


@ti.func
def closer(grid: ti.template(), x, y, height):
    """Share of the four texels around (x, y) that lie above a height, bilinear."""
    x0, y0 = ti.floor(x - 0.5), ti.floor(y - 0.5)
    fx, fy = x - 0.5 - x0, y - 0.5 - y0
    j0, i0 = ti.cast(x0, ti.i32), ti.cast(y0, ti.i32)
    share = 0.0
    for di, dj in ti.static(ti.ndrange(2, 2)):
        i = ti.min(ti.max(i0 + di, 0), grid.shape[0] - 1)
        j = ti.min(ti.max(j0 + dj, 0), grid.shape[1] - 1)
        if grid[i, j] > height:
            share += (fx if dj else 1.0 - fx) * (fy if di else 1.0 - fy)
    return share


@ti.func
def penumbra(
    x, y, plane, reach, first, count, lamp: ti.template(), grid: ti.template(),
    disc: ti.template(),
):  # fmt: skip
    """Radius, in texels, of what casts a shadow on the place (x, y) of a plane of the map.

    The plane has the height plane·(x, y, 1); the samples of the disc are `count` from `first` on.
    """
    last = grid.shape[0] - 1
    total, found = 0.0, 0
    for k in range(first, first + count):
        px, py = x + reach * disc[k, 0], y + reach * disc[k, 1]
        j = ti.min(ti.max(ti.cast(px, ti.i32), 0), last)
        i = ti.min(ti.max(ti.cast(py, ti.i32), 0), last)
        above = grid[i, j] - (plane[0] * px + plane[1] * py + plane[2])
        # Only what is far enough above to throw its penumbra as far as this sample counts.
        if above > 0.0 and above * LAMP >= (disc[k, 2] * reach - 2.0) * lamp.texel:
            total += above
            found += 1
    return ti.min(ti.max(LAMP * total / (ti.max(found, 1) * lamp.texel), SHARPEST), reach)


@ti.func
def covered(x, y, plane, radius, first, count, grid: ti.template(), disc: ti.template()):
    """Share of a disc around the place (x, y) of the map that lies above a plane."""
    share, few = 0.0, count // STRIDE
    for n in range(few):
        share += above_plane(x, y, radius, first + STRIDE * n, plane, grid, disc)
    if 0.0 < share < few:
        for k in range(first, first + count):
            if (k - first) % STRIDE != 0:
                share += above_plane(x, y, radius, k, plane, grid, disc)
    else:  # most places are wholly lit or wholly dark: the first few samples tell
        share *= STRIDE
    return share / count


@ti.func
def above_plane(x, y, radius, k, plane, grid: ti.template(), disc: ti.template()):
    """Share of the texels at sample k of a disc that lie above a plane."""
    px, py = x + radius * disc[k, 0], y + radius * disc[k, 1]
    return closer(grid, px, py, plane[0] * px + plane[1] * py + plane[2])


@ti.func
def near_shadow(x, y, height, coarse: ti.template()):
    """Whether anything close to the place (x, y) of the map lies above a height."""
    i, j = ti.cast(y, ti.i32) // CELL, ti.cast(x, ti.i32) // CELL
    answer = False
    if x >= 0.0 and y >= 0.0 and i < coarse.shape[0] and j < coarse.shape[1]:
        answer = coarse[i, j] > height
    return answer


@ti.func
def lit(q, lamp: ti.template(), grid: ti.template(), coarse: ti.template(), disc: ti.template()):
    """Share of the lamp that a point of a body sees."""
    x, y, height = row(lamp.frame, 0, q), row(lamp.frame, 1, q), row(lamp.frame, 2, q)
    share = 1.0
    if near_shadow(x, y, height, coarse):
        level = vec3(0.0, 0.0, height)
        radius = penumbra(x, y, level, REACH_ON_BODIES, 0, SEARCH_ON_BODIES, lamp, grid, disc)
        share -= covered(x, y, level, radius, SEARCH_ON_BODIES, TAPS, grid, disc)
    return share


@ti.func
def bilinear(grid: ti.template(), x, y):
    """Value of a map at a place of it, between texels; 0 outside."""
    u, v = x - 0.5, y - 0.5
    value = 0.0
    if 0.0 <= u < grid.shape[1] - 1 and 0.0 <= v < grid.shape[0] - 1:
        j, i = ti.cast(u, ti.i32), ti.cast(v, ti.i32)
        fx, fy = u - j, v - i
        low = grid[i, j] * (1.0 - fx) + grid[i, j + 1] * fx
        high = grid[i + 1, j] * (1.0 - fx) + grid[i + 1, j + 1] * fx
        value = low * (1.0 - fy) + high * fy
    return value


@ti.func
def near_plane_shadow(x, y, plane, coarse: ti.template()):
    slack = CELL * (ti.abs(plane[0]) + ti.abs(plane[1]))  # how much lower it may be near by
    return near_shadow(x, y, plane[0] * x + plane[1] * y + plane[2] - slack, coarse)


@ti.kernel
def soften_plane(plane: vec3, lamp: Lamp, grid: Grid, coarse: Grid, disc: Vectors, radii: Grid):
    """Radii of the penumbrae on a plane, on a coarser map: they vary slowly."""
    ti.loop_config(block_dim=64)
    for place in range(radii.shape[0] * radii.shape[1]):
        i, j = place // radii.shape[1], place % radii.shape[1]
        step = ti.cast(grid.shape[0] // radii.shape[0], ti.f32)
        x, y = (j + 0.5) * step, (i + 0.5) * step
        radius = SHARPEST
        if near_plane_shadow(x, y, plane, coarse):
            first = SEARCH_ON_BODIES + TAPS
            radius = penumbra(x, y, plane, REACH, first, SEARCH, lamp, grid, disc)
        radii[i, j] = radius


@ti.kernel
def light_plane(plane: vec3, grid: Grid, coarse: Grid, disc: Vectors, radii: Grid, shade: Grid):
    """Share of the lamp hidden from a plane below all that is drawn, at every texel of the map."""
    ti.loop_config(block_dim=256)
    for texel in range(shade.shape[0] * shade.shape[1]):
        i, j = texel // shade.shape[1], texel % shade.shape[1]
        x, y = ti.cast(j, ti.f32) + 0.5, ti.cast(i, ti.f32) + 0.5
        share = 0.0
        if near_plane_shadow(x, y, plane, coarse):
            step = ti.cast(grid.shape[0] // radii.shape[0], ti.f32)
            radius = ti.max(bilinear(radii, x / step, y / step), SHARPEST)
            first = SEARCH_ON_BODIES + TAPS + SEARCH
            share = covered(x, y, plane, radius, first, GROUND_TAPS, grid, disc)
        shade[i, j] = share
