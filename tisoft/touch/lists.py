# mypy: ignore-errors
"""Which pairs may come to touch, looked at again when something has moved.

A patch of triangles looks which points are near its box, each of its triangles at those; edges
likewise.  Pairs come out by triangle and then by point, by edge and then by edge: with
them all sums have the same order.
"""

import taichi as ti

from tisoft.model.threads import meet, share
from tisoft.touch import fields as f
from tisoft.touch.flat import measure_bends
from tisoft.touch.near import (
    find_near,
    measure_blocks,
    measure_bodies,
    measure_edges,
    measure_points,
    neighbours,
)
from tisoft.touch.pairs import pair_cores, pair_edges, pair_faces

LEAST_SHRUNK = 0.01
"""Share of their margins below which candidates that find no room are let go."""
BLOWN = 8.0
"""Times the longest edge at rest: what is larger has blown up, and nothing is listed; others watch
over that."""
POINT_WORK = 4
"""Work of a point in a search, in that of a test of two boxes."""


@ti.func
def is_blown(touch: ti.template(), q, lo, hi):
    """Whether a box of a triangle or an edge is much larger than any at rest, or not finite."""
    return not ((hi - lo).max() <= BLOWN * ti.cast(touch.length[q, f.LONGEST], touch.real))


@ti.func
def face_box(touch: ti.template(), i):
    """Of triangle i, as last seen."""
    a, b = touch.seen[touch.triangle[i, 0]], touch.seen[touch.triangle[i, 1]]
    c = touch.seen[touch.triangle[i, 2]]
    return ti.min(a, b, c), ti.max(a, b, c)


@ti.func
def measure_faces(touch: ti.template(), q, k):
    """Box and margin of patch k of triangles; returns whether one of those has blown up."""
    lo, hi = face_box(touch, touch.patch[k, f.BEGIN])
    ahead, blown = 0.0 * lo[0], False
    free = touch.trait[touch.patch[k, f.OWNER], f.OBSTACLE] == 0
    for i in range(touch.patch[k, f.BEGIN], touch.patch[k, f.END]):
        low_i, high_i = face_box(touch, i)
        lo, hi = ti.min(lo, low_i), ti.max(hi, high_i)
        for c in range(3):
            ahead = ti.max(ahead, touch.ahead[touch.triangle[i, c]])
        if free and is_blown(touch, q, low_i, high_i):
            blown = True
    touch.patch_low[k], touch.patch_high[k], touch.patch_ahead[k] = lo, hi, ahead
    return blown


@ti.func
def share_patches(touch: ti.template(), q, t, threads, kind: ti.template()):
    """Give thread t its patches of triangles (FACE_PATCH) or edges (EDGE_PATCH), as much work as
    others have by the last search.
    """
    low, high = touch.order[q, kind], touch.order[q, kind + 1]
    column = ti.static(f.FACE_BEGIN if kind == f.FACE_PATCH else f.EDGE_BEGIN)
    whole = high - low
    for k in range(low, high):
        whole += touch.patch_work[k]
    own, done, k = touch.order[q, f.THREAD] + t, 0, low
    for end in range(2):
        while k < high and done < share(0, whole, t + end, threads):
            done += 1 + touch.patch_work[k]
            k += 1
        touch.segment[own, column + end] = k


@ti.func
def find_faces(touch: ti.template(), q, t, threads):
    """Thread t's pairs of points and triangles."""
    own = touch.order[q, f.THREAD] + t
    base, room = touch.order[q, f.PAIR], touch.order[q, f.FACE_ROOM]
    n, stop = base + share(0, room, t, threads), base + share(0, room, t + 1, threads)
    row = touch.order[q, f.CANDIDATE] + t * touch.order[q, f.WIDTH]
    touch.segment[own, f.FACE_START] = n
    for k in range(touch.segment[own, f.FACE_BEGIN], touch.segment[own, f.FACE_BEGIN + 1]):
        body, work = touch.patch[k, f.OWNER], 0
        if touch.trait[body, f.BARE] == 0 and touch.trait[body, f.NEAR]:
            begin, end = touch.patch[k, f.BEGIN], touch.patch[k, f.END]
            last = row
            if measure_faces(touch, q, k):
                touch.most[own, f.BLOWN] = 1.0
            if touch.most[own, f.BLOWN] == 0.0:
                last, work = find_near(touch, q, k, f.OWN_POINTS, row)
            for i in range(begin, end):
                if touch.trait[body, f.OBSTACLE] == 0:
                    n = pair_cores(touch, q, i, n, stop)
                if last > row:
                    n, more = pair_faces(touch, q, i, ti.Vector([row, last]), n, stop)
                    work += more
        touch.patch_work[k] = work
    touch.segment[own, f.FACE_STOP] = n


@ti.func
def find_edges(touch: ti.template(), q, t, threads):
    """Thread t's pairs of edges; obstacles' ask for none."""
    own = touch.order[q, f.THREAD] + t
    base, room = touch.order[q, f.PAIR] + touch.order[q, f.FACE_ROOM], touch.order[q, f.EDGE_ROOM]
    n, stop = base + share(0, room, t, threads), base + share(0, room, t + 1, threads)
    row = touch.order[q, f.CANDIDATE] + t * touch.order[q, f.WIDTH]
    touch.segment[own, f.EDGE_START] = n
    for k in range(touch.segment[own, f.EDGE_BEGIN], touch.segment[own, f.EDGE_BEGIN + 1]):
        body, work = touch.patch[k, f.OWNER], 0
        blown = touch.most[own, f.BLOWN] > 0.0
        if touch.trait[body, f.OBSTACLE] == 0 and touch.trait[body, f.NEAR] and not blown:
            last, work = find_near(touch, q, k, f.OWN_EDGES, row)
            if last > row:
                for i in range(touch.patch[k, f.BEGIN], touch.patch[k, f.END]):
                    n, more = pair_edges(touch, q, i, ti.Vector([row, last]), n, stop)
                    work += more
        touch.patch_work[k] = work
    touch.segment[own, f.EDGE_STOP] = n


@ti.func
def count_pairs(touch: ti.template(), q, threads):
    """How many have been listed."""
    count, thread = 0, touch.order[q, f.THREAD]
    for kind in range(2):
        for t in range(thread, thread + threads):
            count += touch.segment[t, 2 * kind + 1] - touch.segment[t, 2 * kind]
    return count


@ti.func
def work_of(touch: ti.template(), q):
    """What the search had to do, in tests of two boxes."""
    work = POINT_WORK * (touch.order[q, f.POINT_END] - touch.order[q, f.POINT])
    for k in range(touch.order[q, f.FACE_PATCH], touch.order[q, f.PATCH_END]):
        work += touch.patch_work[k]
    return work


@ti.func
def fill_slots(touch: ti.template(), q, threads):
    """The pairs and corners that each point is, in the order of the pairs."""
    low, high = touch.order[q, f.POINT], touch.order[q, f.POINT_END]
    thread = touch.order[q, f.THREAD]
    for p in range(low, high + 1):
        touch.slot_start[p] = 0
    for kind in range(2):
        for t in range(thread, thread + threads):
            for z in range(touch.segment[t, 2 * kind], touch.segment[t, 2 * kind + 1]):
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


@ti.func
def search(s: ti.template(), scene, q, t, threads, phase, now):
    """List the candidates anew; returns the phase that it has come to."""
    touch = s.surfaces
    own = touch.order[q, f.THREAD]
    measure_points(touch, q, t, threads)
    phase += 1
    meet(s, scene, phase, threads)
    measure_bodies(touch, q, t, threads, now.h)
    phase += 1
    meet(s, scene, phase, threads)
    measure_edges(touch, q, t, threads)
    measure_bends(touch, q, t, threads)
    share_patches(touch, q, t, threads, f.FACE_PATCH)
    share_patches(touch, q, t, threads, f.EDGE_PATCH)
    shrunk = ti.cast(1.0, touch.real)
    again = 1
    while again:
        if t == 0:
            touch.order[q, f.FULL] = 0
            touch.length[q, f.SHRUNK] = shrunk
        phase += 1
        meet(s, scene, phase, threads)
        measure_blocks(touch, q, t, threads)
        touch.most[own + t, f.WORST] = neighbours(touch, q, t, threads, now.h)
        touch.most[own + t, f.BLOWN] = 0.0
        phase += 1
        meet(s, scene, phase, threads)
        is_near, blown = False, False
        for k in range(threads):
            if touch.most[own + k, f.WORST] > 0.0:
                is_near = True
        if is_near:
            find_faces(touch, q, t, threads)
            find_edges(touch, q, t, threads)
        phase += 1
        meet(s, scene, phase, threads)
        again = 0
        for k in range(threads):
            if touch.most[own + k, f.BLOWN] > 0.0:
                blown = True
        if is_near and touch.order[q, f.FULL] and shrunk > LEAST_SHRUNK and not blown:
            again = 1
            shrunk *= 0.5
        if t == 0 and again == 0:
            touch.order[q, f.COUNT] = 0
            if is_near and not blown:
                touch.order[q, f.COUNT] = count_pairs(touch, q, threads)
                if touch.length[q, f.SUNK] > 0.0:
                    fill_slots(touch, q, threads)
            touch.order[q, f.WORK] = work_of(touch, q)
            touch.order[q, f.AWAKE], touch.order[q, f.WASTED] = -1, 0
            touch.order[q, f.BUILT] = threads
            touch.order[q, f.BUILDS] = touch.order[q, f.BUILDS] + 1
        phase += 1
        meet(s, scene, phase, threads)
    return phase
