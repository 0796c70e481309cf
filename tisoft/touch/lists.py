# mypy: ignore-errors
"""Which pairs may come to touch: a hashed uniform grid, looked at again when something has moved.

    cell = edge/2 + reach,   reach = thickness + (margin_a + margin_b)/2,
    margin of a body = 16 h v within .25 … 1 edge, of an obstacle that stands still 0

Points are sorted by the bucket of their cell (counting sort).  Every triangle asks the cells that
its box, wider by the reach, covers; every edge those where middles of near edges may lie.  Pairs
come out by triangle and then by point, by edge and then by edge, whatever the grid: with them all
sums have the same order.  Candidates hold until a point has gone half of its body's margin.  The
reach of bodies that are pushed out of each other is as much wider as they are deep.
"""

import taichi as ti

from tisoft.model.threads import meet, share
from tisoft.touch import fields as f
from tisoft.touch.closest import between_edges, nearest_on_line, on_triangle

AHEAD = 16.0
"""Substeps for which a search is to last."""
BLUR = 0.02
"""Of a core's radius, see `nearest_on_line`."""
LEAST_SHRUNK = 0.01
"""Share of their margins below which candidates that find no room are let go."""
MOST_CELLS = 4096.0
"""Cells that a triangle or an edge may ask: at 8 times its size in all directions it has blown up,
and nothing is listed; others watch over that."""


@ti.func
def shift(touch: ti.template(), body):
    """Origin of a body from the scene's middle [m]."""
    return ti.cast(touch.origin[body], touch.real)


@ti.func
def hashed(c, mask):
    """Bucket of a cell."""
    return ((c[0] * 73856093) ^ (c[1] * 19349663) ^ (c[2] * 83492791)) & mask


@ti.func
def measure(touch: ti.template(), q, t, threads, h):
    """Thread t's bodies: their boxes, and their margins by their fastest points; where those are.

    Args: h: the substep [s].
    """
    low, high = touch.order[q, f.BODY], touch.order[q, f.BODY_END]
    least, most = touch.length[q, f.LEAST], touch.length[q, f.MOST]
    for b in range(share(low, high, t, threads), share(low, high, t + 1, threads)):
        lo, hi = 0.0 * touch.place[0] + 1e30, 0.0 * touch.place[0] - 1e30
        fast = ti.cast(0.0, touch.real)
        for p in range(touch.trait[b, f.FIRST], touch.trait[b, f.LAST]):
            x = touch.place[p] + shift(touch, b)
            touch.seen[p] = x
            lo, hi = ti.min(lo, x), ti.max(hi, x)
            fast = ti.max(fast, touch.velocity[p].norm_sqr())
            touch.listed[p] = touch.place[p]
        margin = ti.max(AHEAD * h * ti.sqrt(fast), ti.cast(least, touch.real))
        if touch.trait[b, f.OBSTACLE] and touch.order[q, f.MOVING] == 0:
            margin = 0.0 * margin
        touch.number[b, f.AHEAD] = 0.5 * ti.min(margin, ti.cast(most, touch.real))
        touch.number[b, f.WAY], touch.number[b, f.SPEED] = 0.0, 0.0
        touch.low[b], touch.high[b] = lo - touch.number[b, f.GROW], hi + touch.number[b, f.GROW]


@ti.func
def couple_of(touch: ti.template(), q, b, c):
    """Row of two bodies in `may` and `sunk`."""
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
def gap_of(touch: ti.template(), b, c):
    """Gap of two bodies' boxes [m], below 0 where they overlap."""
    apart = ti.max(touch.low[b] - touch.high[c], touch.low[c] - touch.high[b])
    return ti.max(apart[0], apart[1], apart[2])


@ti.func
def neighbours(touch: ti.template(), q):
    """Where bodies are near others, and how far each may go; returns the number of boxes.

    The reach is 0 where nobody is near anything but cores: that wants no grid.
    """
    widest = ti.cast(0.0, touch.real)
    low, high = touch.order[q, f.BODY], touch.order[q, f.BODY_END]
    first, room = touch.order[q, f.BOX], touch.order[q, f.BOX_END] - touch.order[q, f.BOX]
    n = 0
    for b in range(low, high):
        touch.trait[b, f.BOX_START] = first + n
        free = ti.cast(1e30, touch.real)
        near = 0
        own = ti.cast(touch.length[q, f.SHRUNK], touch.real) * touch.number[b, f.AHEAD]
        for c in range(low, high):
            if touch.may[couple_of(touch, q, b, c)]:
                gap, reach = gap_of(touch, b, c), reach_of(touch, q, b, c)
                free = ti.min(free, gap - reach)
                if gap < reach:
                    near = 1
                    if touch.trait[b, f.ROUND] == 0 and touch.trait[c, f.ROUND] == 0:
                        widest = ti.max(widest, reach)
                    if n < room:
                        touch.box_low[first + n] = ti.max(touch.low[b], touch.low[c] - reach)
                        touch.box_high[first + n] = ti.min(touch.high[b], touch.high[c] + reach)
                        n += 1
                    else:  # one box for all
                        touch.box_low[first + n - 1] = 0.0 * touch.low[b] - 1e30
                        touch.box_high[first + n - 1] = 0.0 * touch.low[b] + 1e30
        touch.trait[b, f.NEAR] = near
        touch.number[b, f.ALLOWED] = own + 0.5 * ti.max(free, 0.0 * free)
    touch.order[q, f.BOXES] = first + n
    touch.length[q, f.REACH] = widest
    return n


@ti.func
def is_crowded(touch: ti.template(), q, body, lo, hi):
    """Whether a box of something of a body lies where another body is near."""
    hit = 0
    stop = touch.order[q, f.BOXES]
    if body + 1 < touch.order[q, f.BODY_END]:
        stop = touch.trait[body + 1, f.BOX_START]
    k = touch.trait[body, f.BOX_START]
    while k < stop:
        if (lo <= touch.box_high[k]).all() and (hi >= touch.box_low[k]).all():
            hit = 1
            k = stop
        k += 1
    return hit


@ti.func
def sort_points(touch: ti.template(), q, per_cell):
    """Counting sort of the points near others by bucket."""
    first, mask = touch.order[q, f.BUCKET], touch.order[q, f.MASK]
    base = touch.order[q, f.POINT]
    for k in range(mask + 2):
        touch.bucket[first + k, 0] = 0
    for p in range(base, touch.order[q, f.POINT_END]):
        b = touch.body[p]
        if touch.trait[b, f.NEAR]:
            c = ti.floor(touch.seen[p] * per_cell, ti.i32)
            k = first + hashed(c, mask)
            touch.cell[p] = ti.Vector([c[0], c[1], c[2], k])
            if touch.bucket[k + 1, 0] == 0:
                touch.only[k] = b
            elif touch.only[k] != b:
                touch.only[k] = -1
            touch.bucket[k + 1, 0] = touch.bucket[k + 1, 0] + 1
    touch.bucket[first, 0] = base
    for k in range(first, first + mask + 1):
        touch.bucket[k + 1, 0] = touch.bucket[k, 0] + touch.bucket[k + 1, 0]
    for p in range(base, touch.order[q, f.POINT_END]):  # starts walk to their ends …
        if touch.trait[touch.body[p], f.NEAR]:
            k = touch.cell[p][3]
            touch.sorted[touch.bucket[k, 0]] = p
            touch.bucket[k, 0] = touch.bucket[k, 0] + 1
    for z in range(mask + 1):  # … and are put back
        k = first + mask + 1 - z
        touch.bucket[k, 0] = touch.bucket[k - 1, 0]
    touch.bucket[first, 0] = base


@ti.func
def sort_edges(touch: ti.template(), q, per_cell):
    """The same of edges, by their middles."""
    first, mask = touch.order[q, f.BUCKET], touch.order[q, f.MASK]
    base = touch.order[q, f.EDGE]
    for k in range(mask + 2):
        touch.bucket[first + k, 1] = 0
    for e in range(base, touch.order[q, f.EDGE_END]):
        if touch.trait[touch.body[touch.edge[e, 0]], f.NEAR]:
            middle = 0.5 * (touch.seen[touch.edge[e, 0]] + touch.seen[touch.edge[e, 1]])
            c = ti.floor(middle * per_cell, ti.i32)
            k = first + hashed(c, mask)
            touch.edge_cell[e] = ti.Vector([c[0], c[1], c[2], k])
            touch.bucket[k + 1, 1] = touch.bucket[k + 1, 1] + 1
    touch.bucket[first, 1] = base
    for k in range(first, first + mask + 1):
        touch.bucket[k + 1, 1] = touch.bucket[k, 1] + touch.bucket[k + 1, 1]
    for e in range(base, touch.order[q, f.EDGE_END]):
        if touch.trait[touch.body[touch.edge[e, 0]], f.NEAR]:
            k = touch.edge_cell[e][3]
            touch.edge_sorted[touch.bucket[k, 1]] = e
            touch.bucket[k, 1] = touch.bucket[k, 1] + 1
    for z in range(mask + 1):
        k = first + mask + 1 - z
        touch.bucket[k, 1] = touch.bucket[k - 1, 1]
    touch.bucket[first, 1] = base


@ti.func
def may_touch(touch: ti.template(), q, b, c):
    """Whether two bodies may."""
    return touch.may[couple_of(touch, q, b, c)]


@ti.func
def keep(touch: ti.template(), q, n, begun, stop, ends, item, d):
    """Put a pair into row n, or tell that there is no room before row `stop`; returns the next."""
    after = n
    if n < stop:
        insert(touch, n, begun, ends, item, d)
        after = n + 1
    else:
        touch.order[q, f.FULL] = 1
    return after


@ti.func
def insert(touch: ti.template(), n, begun, ends, item, d):
    """Put a pair into row n, sorted among those from `begun` on by point, or second edge."""
    z = n
    while z > begun and is_later(touch, z - 1, ends, item):
        for k in range(4):
            touch.ends[z, k] = touch.ends[z - 1, k]
        for k in range(2):
            touch.item[z, k] = touch.item[z - 1, k]
        touch.distance[z] = touch.distance[z - 1]
        z -= 1
    for k in ti.static(range(4)):
        touch.ends[z, k] = ends[k]
    for k in ti.static(range(2)):
        touch.item[z, k] = item[k]
    touch.distance[z] = d


@ti.func
def is_later(touch: ti.template(), z, ends, item):
    """Whether the pair in row z, of the same triangle or first edge, comes after another one."""
    return touch.item[z, 1] > item[1] or (item[1] < 0 and touch.ends[z, 0] > ends[0])


@ti.func
def is_there(cell: ti.template(), k, at):
    """Whether what is sorted in k stands in the cell `at`, not in one with the same bucket."""
    return cell[k][0] == at[0] and cell[k][1] == at[1] and cell[k][2] == at[2]


@ti.func
def is_partner(touch: ti.template(), q, body, p, at):
    """Whether a point stands in the cell `at`, and may touch the triangles of a body there."""
    other = touch.body[p]
    ok = is_there(touch.cell, p, at) and may_touch(touch, q, body, other)
    return ok and touch.trait[other, f.ROUND] == 0  # cores: see pair_cores


@ti.func
def pair_faces(touch: ti.template(), q, i, per_cell, wider, n, stop):
    """List triangle i's pairs with points at most `wider` [m] away from row n on, before row
    `stop`; returns the next row, and whether the triangle has blown up.
    """
    ids = ti.Vector([touch.triangle[i, 0], touch.triangle[i, 1], touch.triangle[i, 2]])
    a, b, c = touch.seen[ids[0]], touch.seen[ids[1]], touch.seen[ids[2]]
    body, begun = touch.body[ids[0]], n
    lo, hi = ti.min(a, b, c) - wider, ti.max(a, b, c) + wider
    most = ti.cast(MOST_CELLS, touch.real)
    if touch.trait[body, f.OBSTACLE]:
        most *= MOST_CELLS
    size, low = cells_of(lo, hi, per_cell, most)
    base, mask = touch.order[q, f.BUCKET], touch.order[q, f.MASK]
    itself = touch.trait[body, f.SELF]
    for x in range(low[0], low[0] + size[0]):
        for y in range(low[1], low[1] + size[1]):
            for z in range(low[2], low[2] + size[2]):
                at = ti.Vector([x, y, z])
                k = base + hashed(at, mask)
                begin, end = touch.bucket[k, 0], touch.bucket[k + 1, 0]
                if end > begin and touch.only[k] == body and itself == 0:
                    end = begin
                for row in range(begin, end):
                    p = touch.sorted[row]
                    u = touch.seen[p]
                    ok = (u >= lo).all() and (u <= hi).all() and is_partner(touch, q, body, p, at)
                    if ok and p != ids[0] and p != ids[1] and p != ids[2]:
                        w = on_triangle(u, a, b, c)
                        d = (u - w[0] * a - w[1] * b - w[2] * c).norm()
                        if d < reach_of(touch, q, body, touch.body[p]):
                            ends = ti.Vector([p, ids[0], ids[1], ids[2]])
                            n = keep(touch, q, n, begun, stop, ends, ti.Vector([i, -1]), d)
    return n, size[0] == 0


@ti.func
def pair_cores(touch: ti.template(), q, i, n, stop):
    """List triangle i's pairs with cores of obstacles from row n on; returns the next row."""
    begun = n
    ids = ti.Vector([touch.triangle[i, 0], touch.triangle[i, 1], touch.triangle[i, 2]])
    a, b, c = touch.seen[ids[0]], touch.seen[ids[1]], touch.seen[ids[2]]
    body = touch.body[ids[0]]
    lo, hi = ti.min(a, b, c), ti.max(a, b, c)
    for core in range(touch.order[q, f.CORES], touch.order[q, f.BODY_END]):
        reach = reach_of(touch, q, body, core)
        is_near = (lo - reach <= touch.high[core]).all() and (hi + reach >= touch.low[core]).all()
        if is_near and touch.trait[core, f.NEAR] and may_touch(touch, q, body, core):
            p, r = touch.trait[core, f.FIRST], touch.number[core, f.HALF]
            x = touch.seen[p]
            if touch.trait[core, f.LAST] > p + 1:
                x = nearest_on_line(x, touch.seen[p + 1], a, b, c, BLUR * r)
            w = on_triangle(x, a, b, c)
            d = (x - w[0] * a - w[1] * b - w[2] * c).norm() - r
            if d < reach:
                ends = ti.Vector([p, ids[0], ids[1], ids[2]])
                n = keep(touch, q, n, begun, stop, ends, ti.Vector([i, -1]), d)
    return n


@ti.func
def pair_edges(touch: ti.template(), q, i, per_cell, wider, n, stop):
    """List the pairs of edge i with later edges at most `wider` [m] away from row n on, before row
    `stop`; returns the next row, and whether the edge has blown up.
    """
    a, b = touch.edge[i, 0], touch.edge[i, 1]
    u, v, begun = touch.seen[a], touch.seen[b], n
    lo, hi = ti.min(u, v) - wider, ti.max(u, v) + wider
    half = 0.5 * ti.cast(touch.length[q, f.LONGEST], touch.real)
    size, low = cells_of(lo - half, hi + half, per_cell, ti.cast(MOST_CELLS, touch.real))
    base, mask, body = touch.order[q, f.BUCKET], touch.order[q, f.MASK], touch.body[a]
    for x in range(low[0], low[0] + size[0]):
        for y in range(low[1], low[1] + size[1]):
            for z in range(low[2], low[2] + size[2]):
                at = ti.Vector([x, y, z])
                k = base + hashed(at, mask)
                for row in range(touch.bucket[k, 1], touch.bucket[k + 1, 1]):
                    e = touch.edge_sorted[row]
                    c, d = touch.edge[e, 0], touch.edge[e, 1]
                    p, r = touch.seen[c], touch.seen[d]
                    ok = e > i and (ti.max(p, r) >= lo).all() and (ti.min(p, r) <= hi).all()
                    ok = (
                        ok
                        and is_there(touch.edge_cell, e, at)
                        and may_touch(touch, q, body, touch.body[c])
                    )
                    if ok and a != c and a != d and b != c and b != d:
                        far = between_edges(u, v, p, r)
                        if far < reach_of(touch, q, body, touch.body[c]):
                            ends = ti.Vector([a, b, c, d])
                            n = keep(touch, q, n, begun, stop, ends, ti.Vector([i, e]), far)
    return n, size[0] == 0


@ti.func
def cells_of(lo, hi, per_cell, most):
    """How many cells a box [m] covers along each axis, 0 where they are more than `most`; the
    lowest.
    """
    low, high = ti.floor(lo * per_cell), ti.floor(hi * per_cell)
    wide = high - low + 1.0
    size, cell = ti.Vector([0, 0, 0]), ti.Vector([0, 0, 0])
    # What is not finite compares with nothing.
    if wide[0] * wide[1] * wide[2] <= most and ti.abs(low).max() < 1e9:
        size, cell = ti.cast(wide, ti.i32), ti.cast(low, ti.i32)
    return size, cell


@ti.func
def asks(touch: ti.template(), q, body, lo, hi):
    """Whether a face or an edge of a body, in a box [m], may have pairs."""
    ok = touch.trait[body, f.NEAR]
    if ok:
        ok = is_crowded(touch, q, body, lo, hi)
    return ok


@ti.func
def find_faces(touch: ti.template(), q, t, threads, per_cell):
    """Thread t's pairs of points and triangles."""
    own = touch.order[q, f.THREAD] + t
    base, room = touch.order[q, f.PAIR], touch.order[q, f.FACE_ROOM]
    low, high = touch.order[q, f.TRIANGLE], touch.order[q, f.TRIANGLE_END]
    wider = ti.cast(touch.length[q, f.REACH], touch.real)
    n, stop = base + share(0, room, t, threads), base + share(0, room, t + 1, threads)
    touch.segment[own, f.FACE_START] = n
    for i in range(share(low, high, t, threads), share(low, high, t + 1, threads)):
        a, b = touch.seen[touch.triangle[i, 0]], touch.seen[touch.triangle[i, 1]]
        c, body = touch.seen[touch.triangle[i, 2]], touch.body[touch.triangle[i, 0]]
        if touch.trait[body, f.BARE] == 0 and asks(
            touch, q, body, ti.min(a, b, c), ti.max(a, b, c)
        ):
            if touch.trait[body, f.OBSTACLE] == 0:
                n = pair_cores(touch, q, i, n, stop)
            if wider > 0.0:
                blown = False
                n, blown = pair_faces(touch, q, i, per_cell, wider, n, stop)
                if blown:
                    touch.most[own, f.BLOWN] = 1.0
    touch.segment[own, f.FACE_STOP] = n


@ti.func
def find_edges(touch: ti.template(), q, t, threads, per_cell):
    """Thread t's pairs of edges; obstacles' ask for none."""
    own = touch.order[q, f.THREAD] + t
    base, room = touch.order[q, f.PAIR] + touch.order[q, f.FACE_ROOM], touch.order[q, f.EDGE_ROOM]
    low, high = touch.order[q, f.EDGE], touch.order[q, f.EDGE_END]
    wider = ti.cast(touch.length[q, f.REACH], touch.real)
    n, stop = base + share(0, room, t, threads), base + share(0, room, t + 1, threads)
    touch.segment[own, f.EDGE_START] = n
    if wider > 0.0:
        for i in range(share(low, high, t, threads), share(low, high, t + 1, threads)):
            a, b = touch.seen[touch.edge[i, 0]], touch.seen[touch.edge[i, 1]]
            body = touch.body[touch.edge[i, 0]]
            bare = touch.trait[body, f.OBSTACLE]
            if bare == 0 and asks(touch, q, body, ti.min(a, b), ti.max(a, b)):
                blown = False
                n, blown = pair_edges(touch, q, i, per_cell, wider, n, stop)
                if blown:
                    touch.most[own, f.BLOWN] = 1.0
    touch.segment[own, f.EDGE_STOP] = n


@ti.func
def fill_slots(touch: ti.template(), q, threads):
    """The pairs and corners that each point is, in the order of the pairs; returns how many."""
    low, high = touch.order[q, f.POINT], touch.order[q, f.POINT_END]
    thread = touch.order[q, f.THREAD]
    for p in range(low, high + 1):
        touch.slot_start[p] = 0
    count = 0
    for kind in range(2):
        for t in range(thread, thread + threads):
            for z in range(touch.segment[t, 2 * kind], touch.segment[t, 2 * kind + 1]):
                count += 1
                touch.side[z] = 0
                touch.near[z] = 0
                for k in range(4):
                    p = touch.ends[z, k] + 1
                    touch.slot_start[p] = touch.slot_start[p] + 1
    touch.slot_start[low] = 4 * touch.order[q, f.PAIR]
    for p in range(low, high):
        touch.slot_start[p + 1] = touch.slot_start[p] + touch.slot_start[p + 1]
    for kind in range(2):
        for t in range(thread, thread + threads):
            for z in range(touch.segment[t, 2 * kind], touch.segment[t, 2 * kind + 1]):
                for k in range(4):
                    p = touch.ends[z, k]
                    place = touch.slot_start[p]
                    touch.slot[place >> 2, place & 3] = 4 * z + k
                    touch.slot_start[p] = place + 1
    for z in range(high - low):
        p = high - z
        touch.slot_start[p] = touch.slot_start[p - 1]
    touch.slot_start[low] = 4 * touch.order[q, f.PAIR]
    return count


@ti.func
def search(s: ti.template(), touch: ti.template(), scene, q, t, threads, phase, now):
    """List the candidates anew; returns the phase that it has come to."""
    measure(touch, q, t, threads, now.h)
    phase += 1
    meet(s, scene, phase, threads)
    shrunk = ti.cast(1.0, touch.real)
    again = 1
    while again:
        if t == 0:
            touch.order[q, f.FULL] = 0
            touch.length[q, f.SHRUNK] = shrunk
            touch.order[q, f.COUNT] = neighbours(touch, q)
        phase += 1
        meet(s, scene, phase, threads)
        reach = ti.cast(touch.length[q, f.REACH], touch.real)
        per_cell = 1.0 / (0.5 * ti.cast(touch.length[q, f.LONGEST], touch.real) + reach)
        if t == 0:
            if reach > 0.0:
                sort_points(touch, q, per_cell)
                sort_edges(touch, q, per_cell)
        phase += 1
        meet(s, scene, phase, threads)
        is_near = touch.order[q, f.COUNT] > 0
        if is_near:
            touch.most[touch.order[q, f.THREAD] + t, f.BLOWN] = 0.0
            find_faces(touch, q, t, threads, per_cell)
            find_edges(touch, q, t, threads, per_cell)
        phase += 1
        meet(s, scene, phase, threads)
        again, blown = 0, 0
        for k in range(threads):
            if is_near and touch.most[touch.order[q, f.THREAD] + k, f.BLOWN] > 0.0:
                blown = 1
        if touch.order[q, f.FULL] and shrunk > LEAST_SHRUNK and blown == 0:
            again = 1
            shrunk *= 0.5
        if t == 0 and again == 0:
            if blown:
                touch.order[q, f.COUNT] = 0
            elif is_near:
                touch.order[q, f.COUNT] = fill_slots(touch, q, threads)
            touch.order[q, f.BUILT] = threads
            touch.order[q, f.BUILDS] = touch.order[q, f.BUILDS] + 1
        phase += 1
        meet(s, scene, phase, threads)
    return phase
