# mypy: ignore-errors
"""The ground: an endless plane that carries shadows and tiles and melts into the background.

It is no colour of its own but a factor on the background, so it has no horizon.
"""

import taichi as ti

from tisoft.render.geometry import Vectors, mat34, row, vec3
from tisoft.render.light import bilinear

AZIMUTHS = 12
STEPS = 7
HALO = 0.22  # how far things dim the ground around them, in distances from the eye to the target
TILE = 0.045  # how much darker every other tile is
FADE = 1.6  # distances over which the tiles fade

# Plane normal·q = level; coefficients of x, y and 1 for its inverse depth at a place (x, y) of the
# picture, zero where there is no ground to see; the frame of the map of undersides (texels, texels,
# minus height) and the side of a texel; the plane's coordinates in tiles.
Ground = ti.types.struct(
    normal=vec3, level=ti.f32, inverse=vec3, frame=mat34, texel=ti.f32, tiles=mat34
)


@ti.kernel
def dim_ground(undersides: Vectors, ground: Ground, dim: Vectors):
    """Share of the sky hidden from every texel of the ground, by azimuths (horizon-based)."""
    for i, j in ti.ndrange(dim.shape[0], dim.shape[1]):
        total = 0.0
        for a in range(AZIMUTHS):
            angle = 6.2831853 * (a + 0.5) / AZIMUTHS
            dx, dy = ti.cos(angle), ti.sin(angle)
            hidden = 0.0
            for k in range(STEPS):
                reach = (k + 0.5) / STEPS
                d = HALO * reach * reach
                x = ti.cast(j + 0.5 + dx * d / ground.texel, ti.i32)
                y = ti.cast(i + 0.5 + dy * d / ground.texel, ti.i32)
                if 0 <= x < undersides.shape[1] and 0 <= y < undersides.shape[0]:
                    h = -undersides[y, x]
                    if h < HALO:
                        h = ti.max(h, 0.0)
                        d2 = d * d + 1e-8
                        fade = (1.0 - reach * reach) * (1.0 - h / HALO)
                        hidden = ti.max(hidden, fade * d2 / (d2 + h * h))
            total += hidden
        dim[i, j] = total / AZIMUTHS


@ti.func
def dimness(q, ground: ti.template(), dim: ti.template()):
    """Share of the sky hidden from the ground below a point."""
    return bilinear(dim, row(ground.frame, 0, q), row(ground.frame, 1, q))


@ti.func
def inverse_depth(ground: ti.template(), x, y):
    """1/depth of the ground at a place of the picture; not positive where it is not seen."""
    return ground.inverse[0] * x + ground.inverse[1] * y + ground.inverse[2]


@ti.func
def stripes(x, width):
    """Square wave of period 2 averaged over a width: 1 on even unit intervals, -1 on odd ones."""
    return 2.0 * (ramp(x + 0.5 * width) - ramp(x - 0.5 * width)) / width


@ti.func
def ramp(x):
    """Half the integral of the square wave: a triangle wave."""
    u = 0.5 * x - ti.floor(0.5 * x)
    return 0.5 - ti.abs(u - 0.5)


@ti.func
def tiles(ground: ti.template(), q, qx, qy):
    """Checker in -1..1 filtered over a pixel, whose neighbours see qx and qy."""
    x, y = row(ground.tiles, 0, q), row(ground.tiles, 1, q)
    wx = ti.max(ti.abs(row(ground.tiles, 0, qx) - x), ti.abs(row(ground.tiles, 0, qy) - x), 1e-4)
    wy = ti.max(ti.abs(row(ground.tiles, 1, qx) - y), ti.abs(row(ground.tiles, 1, qy) - y), 1e-4)
    return stripes(x, wx) * stripes(y, wy)
