# mypy: ignore-errors
"""Which bodies are near each other, and the boxes of their patches.

    reach = thickness + (margin_a + margin_b)/2,
    margin of a patch = 16 or 24 h v within .25 … 4 edges, of an obstacle that stands still 0

A patch is a run of points, triangles or edges of one body that lie beside each other, and v the
speed of its fastest point, or a share of its body's: a blow travels.  Candidates hold until a point
has gone half of its patch's margin.  The reach of bodies that are pushed out of each other is as
much wider as they are deep.
"""

import taichi as ti

from tisoft.model.threads import share
from tisoft.touch import fields as f
from tisoft.touch.flat import fan_normal, is_flat

AHEAD, FAR_AHEAD = 16.0, 24.0
"""Substeps for which a search is to last; the latter where the last one found fewer pairs than
there are points: longer lists cost little there.
"""
BLOCK = 8
"""Patches that are left out together where they are far."""
SPREADS = 0.5
"""Share of its fastest point's speed that any of a body's points may soon have.  (What is hit stops
or starts within a substep or two, so margins along the way that patches go, or in a frame that
falls with a body, were tried and list no fewer pairs.)
"""


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
            if touch.trait[touch.patch[k, f.OWNER], f.SELF]:
                touch.facing[p] = fan_normal(touch, p).normalized(1e-30)
        touch.patch_low[k], touch.patch_high[k], touch.patch_speed[k] = lo, hi, ti.sqrt(fast)


@ti.func
def measure_bodies(touch: ti.template(), q, t, threads, h):
    """Thread t's bodies: their boxes, and the margins of their patches of points.

    Args: h: the substep [s].
    """
    low, high = touch.order[q, f.BODY], touch.order[q, f.BODY_END]
    least, most = touch.length[q, f.LEAST], touch.length[q, f.MOST]
    ahead = ti.cast(AHEAD, touch.real)
    if touch.order[q, f.COUNT] < touch.order[q, f.POINT_END] - touch.order[q, f.POINT]:
        ahead = ti.cast(FAR_AHEAD, touch.real)
    for b in range(share(low, high, t, threads), share(low, high, t + 1, threads)):
        lo, hi = 0.0 * touch.place[0] + 1e30, 0.0 * touch.place[0] - 1e30
        fast = ti.cast(0.0, touch.real)
        for k in range(touch.trait[b, f.OWN_POINTS], touch.trait[b, f.OWN_POINTS + 1]):
            lo, hi = ti.min(lo, touch.patch_low[k]), ti.max(hi, touch.patch_high[k])
            fast = ti.max(fast, touch.patch_speed[k])
        touch.low[b], touch.high[b] = lo - touch.number[b, f.GROW], hi + touch.number[b, f.GROW]
        touch.number[b, f.AHEAD] = 0.0
        for k in range(touch.trait[b, f.OWN_POINTS], touch.trait[b, f.OWN_POINTS + 1]):
            margin = ahead * h * ti.max(touch.patch_speed[k], SPREADS * fast)
            margin = ti.max(margin, ti.cast(least, touch.real))
            if touch.trait[b, f.OBSTACLE] and touch.order[q, f.MOVING] == 0:
                margin = 0.0 * margin
            own = 0.5 * ti.min(margin, ti.cast(most, touch.real))
            touch.patch_ahead[k] = own
            for p in range(touch.patch[k, f.BEGIN], touch.patch[k, f.END]):
                touch.ahead[p] = own
            touch.number[b, f.AHEAD] = ti.max(touch.number[b, f.AHEAD], own)


@ti.func
def measure_edges(touch: ti.template(), q, t, threads):
    """Boxes and margins of thread t's patches of edges."""
    low, high = touch.order[q, f.EDGE_PATCH], touch.order[q, f.PATCH_END]
    for k in range(share(low, high, t, threads), share(low, high, t + 1, threads)):
        lo, hi = 0.0 * touch.place[0] + 1e30, 0.0 * touch.place[0] - 1e30
        ahead = 0.0 * touch.ahead[0]
        for e in range(touch.patch[k, f.BEGIN], touch.patch[k, f.END]):
            u, v = touch.seen[touch.edge[e, 0]], touch.seen[touch.edge[e, 1]]
            lo, hi = ti.min(lo, u, v), ti.max(hi, u, v)
            for d in ti.static(range(3)):
                touch.ball[e][d] = 0.5 * (u[d] + v[d])
            touch.ball[e][3] = 0.5 * (v - u).norm()
            ahead = ti.max(ahead, touch.ahead[touch.edge[e, 0]], touch.ahead[touch.edge[e, 1]])
        touch.patch_low[k], touch.patch_high[k], touch.patch_ahead[k] = lo, hi, ahead


@ti.func
def measure_blocks(touch: ti.template(), q, t, threads):
    """Boxes of BLOCK patches each, from a body's first of a kind on, of thread t's bodies."""
    low, high = touch.order[q, f.BODY], touch.order[q, f.BODY_END]
    for b in range(share(low, high, t, threads), share(low, high, t + 1, threads)):
        for kind in range(2):
            column = f.OWN_POINTS + kind * (f.OWN_EDGES - f.OWN_POINTS)
            begin, end = touch.trait[b, column], touch.trait[b, column + 1]
            for block in range((end - begin + BLOCK - 1) // BLOCK):
                row = begin + block * BLOCK
                lo, hi = touch.patch_low[row], touch.patch_high[row]
                for k in range(row, ti.min(row + BLOCK, end)):
                    lo, hi = ti.min(lo, touch.patch_low[k]), ti.max(hi, touch.patch_high[k])
                touch.block_low[row], touch.block_high[row] = lo, hi


@ti.func
def couple_of(touch: ti.template(), q, b, c):
    """Row of two bodies in `may`, `sunk` and `partner`."""
    low, high = touch.order[q, f.BODY], touch.order[q, f.BODY_END]
    return touch.order[q, f.COUPLE] + (b - low) * (high - low) + c - low


@ti.func
def reach_of(touch: ti.template(), q, b, c, ahead):
    """Distance [m] up to which pairs of two bodies are listed, whose shares of the margin are
    `ahead` together [m].
    """
    thick = ti.cast(touch.length[q, f.THICK], touch.real)
    reach = thick + ti.cast(touch.length[q, f.SHRUNK], touch.real) * ahead
    if touch.length[q, f.SUNK] > 0.0:
        reach += touch.sunk[couple_of(touch, q, b, c)]
    return reach


@ti.func
def neighbours(touch: ti.template(), q, t, threads, h):
    """Which bodies thread t's are near, how far their points may go, and will have gone by the end
    of the substep h [s]; returns how many are near.
    """
    low, high = touch.order[q, f.BODY], touch.order[q, f.BODY_END]
    total, gone = 0, 0.0 * h
    for b in range(share(low, high, t, threads), share(low, high, t + 1, threads)):
        free = ti.cast(1e30, touch.real)
        row, n = couple_of(touch, q, b, low), 0
        for c in range(low, high):
            if touch.may[row + c - low]:
                apart = ti.max(touch.low[b] - touch.high[c], touch.low[c] - touch.high[b])
                ahead = touch.number[b, f.AHEAD] + touch.number[c, f.AHEAD]
                gap, reach = apart.max(), reach_of(touch, q, b, c, ahead)
                free = ti.min(free, gap - reach)
                if gap < reach:
                    touch.partner[row + n] = c
                    n += 1
        touch.trait[b, f.NEAR] = n
        shrunk, free = ti.cast(touch.length[q, f.SHRUNK], touch.real), ti.max(free, 0.0 * free)
        for p in range(touch.trait[b, f.FIRST], touch.trait[b, f.LAST]):
            touch.allowed[p] = shrunk * touch.ahead[p] + 0.5 * free
            touch.gone[p] = h * touch.sent[p] if n > 0 else 0.0
            gone = ti.max(gone, touch.gone[p])
        total += n
    touch.most[touch.order[q, f.THREAD] + t, f.GONE] = gone
    return total


@ti.func
def find_near(touch: ti.template(), q, own, kind: ti.template(), row):
    """List from `row` of `candidate` on what of near bodies may be within its reach of patch `own`,
    in their order: points, or edges from that patch's on; returns where the list ends, and the
    work that it was (`Touch.patch_work`).

    Args: kind: OWN_POINTS or OWN_EDGES.
    """
    body = touch.patch[own, f.OWNER]
    lo, hi, ahead = touch.patch_low[own], touch.patch_high[own], touch.patch_ahead[own]
    middle, size = 0.5 * (lo + hi), 0.5 * (hi - lo).norm()
    first, n, work = couple_of(touch, q, body, touch.order[q, f.BODY]), row, 0
    for z in range(first, first + touch.trait[body, f.NEAR]):
        c = touch.partner[z]
        most = reach_of(touch, q, body, c, ahead + touch.number[c, f.AHEAD])
        is_near = meets(lo - most, hi + most, touch.low[c], touch.high[c])
        work += 1
        if is_near and touch.trait[c, f.ROUND] == 0:
            begin, end = touch.trait[c, kind], touch.trait[c, kind + 1]
            start, blocks = begin, (end - begin + BLOCK - 1) // BLOCK
            if ti.static(kind == f.OWN_EDGES):
                start = ti.max(begin, own)
            work += blocks
            for block in range((start - begin) // BLOCK, blocks):
                row_of = begin + block * BLOCK
                low, high = touch.block_low[row_of], touch.block_high[row_of]
                if meets(lo - most, hi + most, low, high):
                    work += BLOCK
                    for k in range(ti.max(start, row_of), ti.min(row_of + BLOCK, end)):
                        reach = reach_of(touch, q, body, c, ahead + touch.patch_ahead[k])
                        low, high = lo - reach, hi + reach
                        looks = meets(low, high, touch.patch_low[k], touch.patch_high[k])
                        if looks and body == c:
                            looks = not is_flat(touch, own, k)
                        if looks:
                            begun = n
                            work += touch.patch[k, f.END] - touch.patch[k, f.BEGIN]
                            for i in range(touch.patch[k, f.BEGIN], touch.patch[k, f.END]):
                                touch.candidate[n] = i
                                if ti.static(kind == f.OWN_EDGES):
                                    n += are_near(touch.ball[i], middle, size + reach)
                                else:
                                    n += is_within(low, high, touch.seen[i])
                            if n > begun:
                                touch.group[begun, 0], touch.group[begun, 1] = n, k
                                touch.reach[begun] = reach
    return n, work


@ti.func
def meets(lo, hi, low, high):
    """Whether two boxes have a point in common; what is not finite has none."""
    return (lo <= high).all() and (hi >= low).all()


@ti.func
def is_within(lo, hi, x):
    """1 or 0, whether x is in a box; without branches, which the processor could not guess."""
    inside = (lo[0] <= x[0]) & (hi[0] >= x[0]) & (lo[1] <= x[1]) & (hi[1] >= x[1])
    return ti.cast(inside & (lo[2] <= x[2]) & (hi[2] >= x[2]), ti.i32)


@ti.func
def are_near(ball, x, most):
    """The same of whether a ball, (middle, radius), comes nearer to x than `most` [m]."""
    way, far = ti.Vector([ball[0], ball[1], ball[2]]) - x, most + ball[3]
    return ti.cast(way.norm_sqr() < far * far, ti.i32)
