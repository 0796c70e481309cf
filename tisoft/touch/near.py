# mypy: ignore-errors
"""Which bodies are near each other, and the boxes of their patches.

    reach = thickness + (margin_a + margin_b)/2,
    margin of a body = 16 h v within .25 … 1.5 edges, of an obstacle that stands still 0

A patch is a run of points, triangles or edges of one body that lie beside each other.  Candidates
hold until a point has gone half of its body's margin.  The reach of bodies that are pushed out of
each other is as much wider as they are deep.
"""

import taichi as ti

from tisoft.model.threads import share
from tisoft.touch import fields as f

AHEAD = 16.0
"""Substeps for which a search is to last."""


@ti.func
def shift(touch: ti.template(), body):
    """Origin of a body from the scene's middle [m]."""
    return ti.cast(touch.origin[body], touch.real)


@ti.func
def measure_points(touch: ti.template(), q, t, threads):
    """Boxes and fastest points of thread t's patches of points; where those are."""
    low, high = touch.order[q, f.POINT_PATCH], touch.order[q, f.FACE_PATCH]
    for k in range(share(low, high, t, threads), share(low, high, t + 1, threads)):
        lo, hi = 0.0 * touch.place[0] + 1e30, 0.0 * touch.place[0] - 1e30
        fast = ti.cast(0.0, touch.real)
        away = shift(touch, touch.patch[k, f.OWNER])
        for p in range(touch.patch[k, f.BEGIN], touch.patch[k, f.END]):
            x = touch.place[p] + away
            touch.seen[p] = x
            lo, hi = ti.min(lo, x), ti.max(hi, x)
            fast = ti.max(fast, touch.velocity[p].norm_sqr())
            touch.listed[p] = touch.place[p]
        touch.patch_low[k], touch.patch_high[k], touch.patch_speed[k] = lo, hi, ti.sqrt(fast)


@ti.func
def measure_bodies(touch: ti.template(), q, t, threads, h):
    """Thread t's bodies: their boxes, and their margins by their fastest points; and its patches of
    edges.

    Args: h: the substep [s].
    """
    low, high = touch.order[q, f.BODY], touch.order[q, f.BODY_END]
    least, most = touch.length[q, f.LEAST], touch.length[q, f.MOST]
    for b in range(share(low, high, t, threads), share(low, high, t + 1, threads)):
        lo, hi = 0.0 * touch.place[0] + 1e30, 0.0 * touch.place[0] - 1e30
        fast = ti.cast(0.0, touch.real)
        for k in range(touch.trait[b, f.OWN_POINTS], touch.trait[b, f.OWN_POINTS + 1]):
            lo, hi = ti.min(lo, touch.patch_low[k]), ti.max(hi, touch.patch_high[k])
            fast = ti.max(fast, touch.patch_speed[k])
        margin = ti.max(AHEAD * h * fast, ti.cast(least, touch.real))
        if touch.trait[b, f.OBSTACLE] and touch.order[q, f.MOVING] == 0:
            margin = 0.0 * margin
        touch.number[b, f.AHEAD] = 0.5 * ti.min(margin, ti.cast(most, touch.real))
        touch.number[b, f.WAY], touch.number[b, f.SPEED] = 0.0, 0.0
        touch.low[b], touch.high[b] = lo - touch.number[b, f.GROW], hi + touch.number[b, f.GROW]
    low, high = touch.order[q, f.EDGE_PATCH], touch.order[q, f.PATCH_END]
    for k in range(share(low, high, t, threads), share(low, high, t + 1, threads)):
        lo, hi = 0.0 * touch.place[0] + 1e30, 0.0 * touch.place[0] - 1e30
        for e in range(touch.patch[k, f.BEGIN], touch.patch[k, f.END]):
            low_e, high_e = box_of(touch, e, f.OWN_EDGES)
            lo, hi = ti.min(lo, low_e), ti.max(hi, high_e)
        touch.patch_low[k], touch.patch_high[k] = lo, hi


@ti.func
def couple_of(touch: ti.template(), q, b, c):
    """Row of two bodies in `may`, `sunk` and `partner`."""
    low, high = touch.order[q, f.BODY], touch.order[q, f.BODY_END]
    return touch.order[q, f.COUPLE] + (b - low) * (high - low) + c - low


@ti.func
def reach_of(touch: ti.template(), q, b, c):
    """Distance [m] up to which pairs of two bodies are listed."""
    thick = ti.cast(touch.length[q, f.THICK], touch.real)
    shrunk = ti.cast(touch.length[q, f.SHRUNK], touch.real)
    reach = thick + shrunk * (touch.number[b, f.AHEAD] + touch.number[c, f.AHEAD])
    if touch.length[q, f.SUNK] > 0.0:
        reach += touch.sunk[couple_of(touch, q, b, c)]
    return reach


@ti.func
def neighbours(touch: ti.template(), q, t, threads):
    """Which bodies thread t's are near, and how far each may go; returns how many are near."""
    low, high = touch.order[q, f.BODY], touch.order[q, f.BODY_END]
    total = 0
    for b in range(share(low, high, t, threads), share(low, high, t + 1, threads)):
        free = ti.cast(1e30, touch.real)
        row, n = couple_of(touch, q, b, low), 0
        own = ti.cast(touch.length[q, f.SHRUNK], touch.real) * touch.number[b, f.AHEAD]
        for c in range(low, high):
            if touch.may[row + c - low]:
                apart = ti.max(touch.low[b] - touch.high[c], touch.low[c] - touch.high[b])
                gap, reach = ti.max(apart[0], apart[1], apart[2]), reach_of(touch, q, b, c)
                free = ti.min(free, gap - reach)
                if gap < reach:
                    touch.partner[row + n] = c
                    n += 1
        touch.trait[b, f.NEAR] = n
        touch.number[b, f.ALLOWED] = own + 0.5 * ti.max(free, 0.0 * free)
        total += n
    return total


@ti.func
def find_near(touch: ti.template(), q, body, lo, hi, kind: ti.template(), row):
    """List from `row` of `candidate` on which points or edges of near bodies are within their reach
    of a box of something of `body`, in their order; returns where the list ends.

    Args: kind: OWN_POINTS or OWN_EDGES.
    """
    first, n = couple_of(touch, q, body, touch.order[q, f.BODY]), row
    for z in range(first, first + touch.trait[body, f.NEAR]):
        c = touch.partner[z]
        reach = reach_of(touch, q, body, c)
        low, high = lo - reach, hi + reach
        if touch.trait[c, f.ROUND] == 0 and meets(low, high, touch.low[c], touch.high[c]):
            for k in range(touch.trait[c, kind], touch.trait[c, kind + 1]):
                if meets(low, high, touch.patch_low[k], touch.patch_high[k]):
                    begun = n
                    for i in range(touch.patch[k, f.BEGIN], touch.patch[k, f.END]):
                        least, most = box_of(touch, i, kind)
                        if meets(low, high, least, most):
                            touch.candidate[n], touch.reach[n] = i, reach
                            n += 1
                    if n > begun:
                        touch.group[begun, 0], touch.group[begun, 1] = n, k
    return n


@ti.func
def box_of(touch: ti.template(), i, kind: ti.template()):
    """Of point or edge i, as last seen."""
    lo = touch.seen[i]
    hi = lo
    if ti.static(kind == f.OWN_EDGES):
        u, v = touch.seen[touch.edge[i, 0]], touch.seen[touch.edge[i, 1]]
        lo, hi = ti.min(u, v), ti.max(u, v)
    return lo, hi


@ti.func
def meets(lo, hi, low, high):
    """Whether two boxes have a point in common; what is not finite has none."""
    return (lo <= high).all() and (hi >= low).all()
