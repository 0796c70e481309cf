# mypy: ignore-errors
"""Which listed pairs sleep: those that cannot have come together since the search.

    d ≥ SEEN thickness + way_a + way_b,   way = max over the points of |x − x_listed| + h |v*|

with d as listed.  Where ways have grown so that pairs are awake which need not be, lists are made
anew as soon as those have cost as much as a search.
"""

import taichi as ti

from tisoft.obstacles.base import POINT
from tisoft.touch import fields as f

SEEN = 1.2
"""Thicknesses beyond which a side is believed, and a pair does nothing: so deep points do not count
either."""
AWAKE_WORK = 12
"""Work of a pair that is awake in a substep, in that of a test of two boxes."""


@ti.func
def note_awake(touch: ti.template(), q, threads):
    """Count what pairs have cost that would sleep, had they been listed anew."""
    awake, thread = 0, touch.order[q, f.THREAD]
    for t in range(thread, thread + threads):
        awake += ti.cast(touch.most[t, f.LOOKED], ti.i32)
    if touch.order[q, f.AWAKE] < 0:
        touch.order[q, f.AWAKE] = awake
    more = ti.max(awake - touch.order[q, f.AWAKE], 0)
    touch.order[q, f.WASTED] = touch.order[q, f.WASTED] + AWAKE_WORK * more


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
