# mypy: ignore-errors
"""The pairs of a triangle with points and cores, and of an edge with others, near enough to be
listed: by triangle and then by point, by edge and then by edge.
"""

import taichi as ti

from tisoft.touch import fields as f
from tisoft.touch.closest import between_edges, from_triangle, nearest_on_line, on_triangle
from tisoft.touch.near import are_near, couple_of, meets, reach_of

BLUR = 0.02
"""Of a core's radius, see `nearest_on_line`."""
FAR_WORK = 6
"""Work to look how far a point is from a triangle, in that of a test of two boxes."""


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
    touch.side[n] = 0


@ti.func
def is_later(touch: ti.template(), z, ends, item):
    """Whether the pair in row z, of the same triangle or first edge, comes after another one."""
    same = touch.item[z, 1] == item[1]
    return touch.item[z, 1] > item[1] or (same and touch.ends[z, 0] > ends[0])


@ti.func
def pair_faces(touch: ti.template(), q, i, rows, n, stop):
    """List triangle i's pairs with the points listed by `find_near` from row n on, before row
    `stop`; returns the next row, and the work that it was.

    Args: rows: first and last of `candidate`.
    """
    ids = ti.Vector([touch.triangle[i, 0], touch.triangle[i, 1], touch.triangle[i, 2]])
    a, b, c = touch.seen[ids[0]], touch.seen[ids[1]], touch.seen[ids[2]]
    lo, hi, begun = ti.min(a, b, c), ti.max(a, b, c), n
    middle = 0.5 * (lo + hi)
    size = ti.max((a - middle).norm(), (b - middle).norm(), (c - middle).norm())
    across = (b - a).cross(c - a).normalized(1e-30)
    row, spare, work = rows[0], rows[1], 0
    while row < rows[1]:  # patch by patch
        work += 2
        end, k, reach = touch.group[row, 0], touch.group[row, 1], touch.reach[row]
        low, high = lo - reach, hi + reach
        if meets(low, high, touch.patch_low[k], touch.patch_high[k]):
            found, most = spare, (reach + size) ** 2
            for z in range(row, end):  # without branches, which would often be guessed wrong
                p = touch.candidate[z]
                way = touch.seen[p] - middle
                touch.candidate[found] = p
                is_near = (way.norm_sqr() < most) & (
                    ti.abs((touch.seen[p] - a).dot(across)) < reach
                )
                found += ti.cast(is_near, ti.i32)
            work += (end - row) // 2 + FAR_WORK * (found - spare)
            for z in range(spare, found):
                p = touch.candidate[z]
                if p != ids[0] and p != ids[1] and p != ids[2]:
                    square = from_triangle(touch.seen[p], a, b, c)
                    if square < reach * reach:
                        ends, d = ti.Vector([p, ids[0], ids[1], ids[2]]), ti.sqrt(square)
                        n = keep(touch, q, n, begun, stop, ends, ti.Vector([i, -1]), d)
        row = end
    return n, work


@ti.func
def pair_cores(touch: ti.template(), q, i, n, stop):
    """List triangle i's pairs with cores of obstacles from row n on, and those of its own edges
    with lines, −2 − k of the edge opposite corner k; returns the next row.
    """
    begun = n
    ids = ti.Vector([touch.triangle[i, 0], touch.triangle[i, 1], touch.triangle[i, 2]])
    a, b, c = touch.seen[ids[0]], touch.seen[ids[1]], touch.seen[ids[2]]
    body = touch.body[ids[0]]
    ahead = ti.max(touch.ahead[ids[0]], touch.ahead[ids[1]], touch.ahead[ids[2]])
    lo, hi = ti.min(a, b, c), ti.max(a, b, c)
    for core in range(touch.order[q, f.CORES], touch.order[q, f.BODY_END]):
        reach = reach_of(touch, q, body, core, ahead + touch.number[core, f.AHEAD])
        is_near = meets(lo - reach, hi + reach, touch.low[core], touch.high[core])
        if is_near and touch.may[couple_of(touch, q, body, core)]:
            p, r = touch.trait[core, f.FIRST], touch.number[core, f.HALF]
            x = touch.seen[p]
            if touch.trait[core, f.LAST] > p + 1:
                x = nearest_on_line(x, touch.seen[p + 1], a, b, c, BLUR * r)
            w = on_triangle(x, a, b, c)
            d = (x - w[0] * a - w[1] * b - w[2] * c).norm() - r
            if d < reach:
                ends = ti.Vector([p, ids[0], ids[1], ids[2]])
                n = keep(touch, q, n, begun, stop, ends, ti.Vector([i, -1]), d)
                if touch.trait[core, f.LAST] > p + 1:
                    for k in range(3):
                        if touch.owned[i] & (1 << k):
                            n = keep(touch, q, n, begun, stop, ends, ti.Vector([i, -2 - k]), d)
    return n


@ti.func
def pair_edges(touch: ti.template(), q, i, rows, n, stop):
    """List the pairs of edge i with later ones listed by `find_near` from row n on, before row
    `stop`; returns the next row, and the work that it was.
    """
    a, b = touch.edge[i, 0], touch.edge[i, 1]
    u, v, begun = touch.seen[a], touch.seen[b], n
    lo, hi = ti.min(u, v), ti.max(u, v)
    middle, size = 0.5 * (u + v), touch.ball[i][3]
    row, spare, work = rows[0], rows[1], 0
    while row < rows[1]:
        work += 2
        end, k, reach = touch.group[row, 0], touch.group[row, 1], touch.reach[row]
        low, high = lo - reach, hi + reach
        if touch.patch[k, f.END] > i and meets(low, high, touch.patch_low[k], touch.patch_high[k]):
            found = spare
            for z in range(row, end):
                e = touch.candidate[z]
                touch.candidate[found] = e
                found += are_near(touch.ball[e], middle, size + reach) & ti.cast(e > i, ti.i32)
            work += (end - row) // 2 + FAR_WORK * (found - spare)
            for z in range(spare, found):
                e = touch.candidate[z]
                c, d = touch.edge[e, 0], touch.edge[e, 1]
                if a != c and a != d and b != c and b != d:
                    square = between_edges(u, v, touch.seen[c], touch.seen[d])
                    if square < reach * reach:
                        ends, far = ti.Vector([a, b, c, d]), ti.sqrt(square)
                        n = keep(touch, q, n, begun, stop, ends, ti.Vector([i, e]), far)
        row = end
    return n, work
