# mypy: ignore-errors
"""Normals of surfaces, and which patches are too flat to touch each other (see `patches`).

|a − b| + r_a + r_b < FLAT,   a, b the mean normals of two patches, r how far theirs are from it
"""

import taichi as ti

from tisoft.model.threads import share
from tisoft.touch import fields as f

FLAT = 1.2
"""Chord of 74 degrees."""
NO_NORMAL = 4.0
"""Spread of a patch one of whose points has no normal."""


@ti.func
def fan_normal(touch: ti.template(), p):
    """Twice the area times outward normal [m²] of the triangles around a point; 0 without any."""
    n = 0.0 * touch.place[p]
    for k in range(touch.fan_start[p], touch.fan_start[p + 1]):
        b, c = touch.fan[k, 0], touch.fan[k, 1]
        n += (touch.place[b] - touch.place[p]).cross(touch.place[c] - touch.place[p])
    return n


@ti.func
def lean(touch: ti.template(), k, normal, spread):
    """The spread of a patch, `spread` so far, with one normal more."""
    far = ti.max(spread, (normal - touch.patch_axis[k]).norm())
    return far if normal.norm_sqr() > 0.5 else NO_NORMAL + 0.0 * far


@ti.func
def corner_of(touch: ti.template(), i, c, corners):
    """Corner c of point, edge or triangle i, which has 1, 2 or 3 of them."""
    p = i
    if corners == 2:
        p = touch.edge[i, c]
    if corners == 3:
        p = touch.triangle[i, c]
    return p


@ti.func
def measure_bends(touch: ti.template(), q, t, threads):
    """Axes and spreads of thread t's patches, by the normals of their corners; of bodies that touch
    themselves.
    """
    low, high = touch.order[q, f.POINT_PATCH], touch.order[q, f.PATCH_END]
    for k in range(share(low, high, t, threads), share(low, high, t + 1, threads)):
        if touch.trait[touch.patch[k, f.OWNER], f.SELF]:
            corners = 1
            if k >= touch.order[q, f.EDGE_PATCH]:
                corners = 2
            elif k >= touch.order[q, f.FACE_PATCH]:
                corners = 3
            axis, spread = ti.Vector([0.0, 0.0, 0.0]), 0.0 * touch.ahead[0]
            for twice in range(2):
                for i in range(touch.patch[k, f.BEGIN], touch.patch[k, f.END]):
                    for c in range(corners):
                        normal = touch.facing[corner_of(touch, i, c, corners)]
                        if twice == 0:
                            axis += normal
                        elif normal.norm_sqr() < 0.5:
                            spread = NO_NORMAL
                        else:
                            spread = ti.max(spread, (normal - axis).norm())
                axis = axis.normalized(1e-30)
            touch.patch_axis[k], touch.patch_spread[k] = axis, spread


@ti.func
def is_flat(touch: ti.template(), a, b):
    """Whether patches a and b of a body are kin and do not bend."""
    flat = False
    bends = (touch.patch_axis[a] - touch.patch_axis[b]).norm()
    if bends + touch.patch_spread[a] + touch.patch_spread[b] < FLAT:
        for k in range(touch.patch[a, f.KIN], touch.patch[a, f.KIN_END]):
            if touch.kin[k] == b:
                flat = True
    return flat
