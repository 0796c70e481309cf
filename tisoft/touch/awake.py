# mypy: ignore-errors
"""Which listed pairs sleep: those that cannot have come together since the search.

    d ≥ SEEN thickness + way_a + way_b,   way = max over the points of |x − x_listed| + h |v*|

with d as listed.
"""

import taichi as ti

from tisoft.obstacles.base import POINT
from tisoft.touch import fields as f

SEEN = 1.2
"""Thicknesses beyond which a side is believed, and a pair does nothing."""


@ti.func
def near_of(touch: ti.template(), q):
    """Distance [m] beyond which a pair does nothing."""
    near = SEEN * touch.length[q, f.THICK] + touch.length[q, f.SUNK]
    return ti.cast(near, touch.real)


@ti.func
def longest_way(touch: ti.template(), q, threads):
    """Way [m] of the points of any pair at the most."""
    thread = touch.order[q, f.THREAD]
    most = touch.most[thread, f.GONE]
    for t in range(1, threads):
        most = ti.max(most, touch.most[thread + t, f.GONE])
    return 2.0 * most


@ti.func
def way_of(touch: ti.template(), q, z, kind):
    """Way [m] by which the points of pair z may have come together."""
    one, other = touch.gone[touch.ends[z, 0]], touch.gone[touch.ends[z, 1]]
    far = ti.max(touch.gone[touch.ends[z, 2]], touch.gone[touch.ends[z, 3]])
    if kind == 0:
        far = ti.max(far, other)
        other = one
        if touch.order[q, f.MOVING]:
            if touch.trait[touch.body[touch.ends[z, 0]], f.ROUND] > POINT:
                other = touch.gone[touch.ends[z, 0] + 1]
    return ti.max(one, other) + far
