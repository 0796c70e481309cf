# mypy: ignore-errors
"""What does not move: the sky and the ground's tiles, once per camera; and the curve to bytes."""

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from tisoft.render.geometry import Rows, Tables, affine, head, on, vec3
from tisoft.render.layout import (
    ACROSS,
    CORNER,
    CURVE,
    CURVE_LENGTH,
    DOWN,
    EYE,
    FLOOR,
    SIZES,
    TILES_X,
    TILES_Y,
)

CHECKER = 0.045  # how much darker every other tile is
FADE = 1.6  # distances over which the tiles fade
SHOULDER = 0.7  # of the tone curve: linear light up to here stays as it is

Colors = ti.types.ndarray(dtype=vec3, ndim=1)
Pixels = ti.types.ndarray(dtype=ti.types.vector(3, ti.u8), ndim=1)


def srgb_curve() -> NDArray[np.float32]:
    """sRGB bytes (IEC 61966-2-1) of linear light, rolled off above the shoulder as film does.

    Entry k belongs to the light (k/2047.5)²: fine steps in the dark, and up to 4.
    """
    light = (np.arange(CURVE_LENGTH) / 2047.5) ** 2
    rest = 1.0 - SHOULDER
    rolled = 1.0 - rest * np.exp(-(light - SHOULDER) / rest)
    light = np.where(light > SHOULDER, rolled, light)
    curve = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return np.round(255.0 * curve).astype(np.float32)


@ti.func
def byte(light, tables: ti.template()):
    at = ti.sqrt(ti.max(light, 0.0)) * 2047.5 + 0.5
    return ti.cast(tables[CURVE, ti.cast(ti.min(at, CURVE_LENGTH - 1.0), ti.i32)], ti.u8)


@ti.func
def encode(color, tables: ti.template()):
    return ti.Vector([byte(color[0], tables), byte(color[1], tables), byte(color[2], tables)])


@ti.func
def sky(x, y):
    """Linear colour of the background; x and y run over the picture from 0 to 1."""
    u = ti.min(ti.max(y, 0.0), 1.0)
    u = u * u * (3.0 - 2.0 * u)
    color = vec3(0.46, 0.55, 0.66) * (1.0 - u) + vec3(0.80, 0.81, 0.82) * u
    return color * (1.0 - 0.30 * ((x - 0.5) ** 2 + (y - 0.55) ** 2))


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
def checker(q, qx, qy, stage: ti.template()):
    """Tiles in -1..1 at a place of the ground, filtered over a pixel; its neighbours see qx, qy."""
    tx, ty = stage[TILES_X], stage[TILES_Y]
    u, v = affine(tx, q), affine(ty, q)
    wu = ti.max(ti.abs(affine(tx, qx) - u), ti.abs(affine(tx, qy) - u), 1e-4)
    wv = ti.max(ti.abs(affine(ty, qx) - v), ti.abs(affine(ty, qy) - v), 1e-4)
    return stripes(u, wu) * stripes(v, wv)


@ti.kernel
def paint_backdrop(stage: Rows, tables: Tables, base: Colors, picture: Pixels):
    """The empty picture, in linear light and in bytes."""
    for i in range(base.shape[0]):
        width, height = ti.cast(stage[SIZES][0], ti.i32), stage[SIZES][1]
        eye, across, down, floor = (
            head(stage[EYE]),
            head(stage[ACROSS]),
            head(stage[DOWN]),
            stage[FLOOR],
        )
        x, y = i % width + 0.5, i // width + 0.5
        color = sky(x / width, y / height)
        w, wx, wy = on(floor, x, y), on(floor, x + 1.0, y), on(floor, x, y + 1.0)
        if w > 0.0 and wx > 0.0 and wy > 0.0:
            d = head(stage[CORNER]) + x * across + y * down
            q, qx, qy = eye + d / w, eye + (d + across) / wx, eye + (d + down) / wy
            fade = ti.exp(-ti.max((q - eye).norm() - 1.0, 0.0) / FADE)
            color *= 1.0 + CHECKER * fade * checker(q, qx, qy, stage)
        for k in ti.static(range(3)):  # the inverse of the tone curve: the sky keeps its colour
            if color[k] > SHOULDER:
                rest = 1.0 - SHOULDER
                color[k] = SHOULDER - rest * ti.log(1.0 - (color[k] - SHOULDER) / rest)
        base[i] = color
        picture[i] = encode(color, tables)
