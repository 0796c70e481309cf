# mypy: ignore-errors
"""What keeps a pair apart in a substep: the velocity that closes its gap; see `gaps` for w and n.

    Σ w_k v_k · n ≥ target,   target = −gap/h  (gap ≥ 0),   β min(−gap, t)/h  (gap < 0)

Bodies that begin inside each other are as much thinner at first, D₀, and grow back at a speed that
does not depend on h:  gap + D and target + V for those,  D = D₀ left,  V = −dD/dt.

Speculative: the gap is that of the substep's start, so no speed and no thin body slips through.
Kicks close gaps, and so does what contact makes of them: after a blow rows are looked for again,
with any velocity between the two.  Which rows there are does not depend on how old the lists are:
gaps wider than any list is sure to have, and points deeper than SEEN, make none.

| symbol   | where                         | unit |
| -------- | ----------------------------- | ---- |
| gap      | distance less the thickness t | m    |
| w        | `share`                       | 1    |
| β        | PUSH                          | 1    |
| D₀, left | `sunk`, `length[LEFT]`        | m, 1 |
"""

import taichi as ti

from tisoft.obstacles.base import POINT
from tisoft.touch import fields as f
from tisoft.touch.awake import longest_way, near_of, way_of
from tisoft.touch.gaps import CONE, gap_of, thickness
from tisoft.touch.near import couple_of
from tisoft.touch.ways import BLOW, outcome

WRITE, MEASURE, ASK = range(3)
"""What `find_rows` is to do."""
FIRM = 4.0
"""Solids have depth, and may sink in by so many times BLOW before a blow asks for new rows: two
thicknesses, after which they are less than SEEN behind a face."""
PUSH = 0.2
"""Share of a penetration that a substep takes back."""


@ti.func
def roughness(touch: ti.template(), b, c):
    """Coulomb's coefficient between two bodies: an obstacle's own, else the mean."""
    mu = 0.5 * (touch.number[b, f.FRICTION] + touch.number[c, f.FRICTION])
    if touch.trait[b, f.OBSTACLE]:
        mu = touch.number[b, f.FRICTION]
    elif touch.trait[c, f.OBSTACLE]:
        mu = touch.number[c, f.FRICTION]
    return mu


@ti.func
def ease(touch: ti.template(), q, b, c, h):
    """D [m] of two bodies and V [m/s], the mean over the substep."""
    eased = ti.Vector([0.0 * h, 0.0 * h])
    left = touch.length[q, f.LEFT]
    if left > 0.0:
        deep = touch.sunk[couple_of(touch, q, b, c)]
        falls = ti.min(touch.length[q, f.RATE], left / h)
        eased[0] = ti.cast(left, touch.real) * deep
        eased[1] = ti.cast(falls, touch.real) * deep
    return eased


@ti.func
def core_of(touch: ti.template(), z):
    """Radius of the core that pair z has, whose distance is that of its middle; 0 for none [m]."""
    body = touch.body[touch.ends[z, 0]]
    return touch.number[body, f.HALF] if touch.trait[body, f.ROUND] else 0.0 * touch.distance[z]


@ti.func
def closing_of(touch: ti.template(), q, z, w):
    """Velocity [m/s] up to which lists, however old, have the pair z, whose weights are w: faster
    kicks make no row.
    """
    most = 0.0 * w[0]
    for k in ti.static(range(4)):
        most += ti.abs(w[k]) * touch.sent[touch.ends[z, k]]
    if touch.order[q, f.MOVING]:
        if touch.trait[touch.body[touch.ends[z, 0]], f.ROUND] > POINT:  # between two points
            most += touch.sent[touch.ends[z, 0] + 1]
    return most


@ti.func
def aim(touch: ti.template(), corner, gap, eased, h):
    """Gap [m] between four points with what easing leaves of it, its target, and the share of that
    whose work is from outside [m/s].
    """
    gap += eased[0]
    target = -gap / h
    b, c = touch.body[corner[0]], touch.body[corner[3]]
    if gap < 0.0:
        most = ti.min(touch.number[b, f.EASE], touch.number[c, f.EASE])
        target = PUSH * ti.min(-gap, most) / h
    target += eased[1]
    outside = 0.0 * target
    if touch.trait[b, f.OBSTACLE] or touch.trait[c, f.OBSTACLE]:
        outside = ti.max(target, 0.0 * target)
    elif eased[1] > 0.0:  # both bodies' points count it
        outside = 0.5 * ti.max(target, 0.0 * target)
    return ti.Vector([gap, target, outside])


@ti.func
def least_rate(touch: ti.template(), corner, w, n, drift, look):
    """The least velocity [m/s] along n with which four points may part: by kicks alone, after a
    look by what contact makes of those too.
    """
    rate = drift
    for k in ti.static(range(4)):
        rate += w[k] * touch.kicked[corner[k]]
    least = rate.dot(n)
    if look > 0:
        for k in ti.static(range(4)):
            p, along = corner[k], w[k] * n
            least += ti.min(along * touch.under[p], along * touch.over[p]).sum()
    return least


@ti.func
def asks_for_row(touch: ti.template(), corner, w, n, drift, aims, h):
    """1 or 0, whether four points, as they come out of contact, would sink in by much."""
    rate = drift.dot(n)
    for k in ti.static(range(4)):
        rate += w[k] * outcome(touch, corner[k]).dot(n)
    may = BLOW * thickness(touch, corner[0], corner[3])
    if touch.trait[touch.body[corner[0]], f.SOLID] and touch.trait[touch.body[corner[3]], f.SOLID]:
        may *= FIRM
    return ti.cast(aims[0] >= 0.0 and h * (aims[1] - rate) > may, ti.i32)


@ti.func
def write_row(touch: ti.template(), row, corner, w, n, aims, drift):
    """Make a row between four points."""
    for k in ti.static(range(4)):
        touch.corner[row, k] = corner[k]
        touch.share[row, k] = w[k]
    touch.normal[row], touch.target[row], touch.outside[row] = n, aims[1], aims[2]
    touch.impulse[row] = 0.0
    touch.grip[row] = 0.0 * n
    b, c = touch.body[corner[0]], touch.body[corner[3]]
    touch.drift[row], touch.rough[row] = drift, roughness(touch, b, c)
    for k in ti.static(range(4)):
        p = corner[k]
        touch.met[p] = 1 - touch.trait[touch.body[p], f.OBSTACLE]
        touch.root[p], touch.number_of[p] = p, -1


@ti.func
def is_swung(touch: ti.template(), z):
    """Whether contact has thrown a point of pair z."""
    some = 0
    for k in ti.static(range(4)):
        some |= touch.swung[touch.ends[z, k]]
    return some > 0


@ti.func
def is_nearest(touch: ti.template(), z):
    """Whether no face of the same body is nearer to the point of pair z, which is behind them.
    A core is not behind faces; edges meet when they are near.
    """
    nearest = 1
    p, body = touch.ends[z, 0], touch.body[touch.ends[z, 1]]
    if touch.item[z, 1] < 0 and touch.trait[touch.body[p], f.ROUND] == 0:
        for k in range(touch.slot_start[p], touch.slot_start[p + 1]):
            c = touch.slot[k >> 2, k & 3]
            y = c >> 2
            if (c & 3) == 0 and touch.item[y, 1] < 0 and touch.body[touch.ends[y, 1]] == body:
                if touch.behind[y] > -1e29 and touch.behind[y] < (1.0 - CONE) * touch.behind[z]:
                    nearest = 0
    return nearest


@ti.func
def find_rows(touch: ti.template(), q, t, threads, task, eases, look, h):
    """Thread t's rows of this substep; returns how many.  Pairs whose points have not gone far
    enough since the search sleep.

    Args:
        task: WRITE rows; or only MEASURE how deep pairs are, or ASK how many rows a blow asks for,
            without which surfaces would sink into each other by much.
        eases: whether bodies are pushed out of each other: points then by their nearest faces.
        look: how often rows have been found in this substep.
    """
    own = touch.order[q, f.THREAD] + t
    close, count, looked = near_of(touch, q), 0, 0
    far = close + longest_way(touch, q, threads)
    for kind in range(2):
        begin, n = touch.segment[own, 2 * kind], 0
        for z in range(begin, touch.segment[own, 2 * kind + 1]):
            behind = -1e30 + 0.0 * h
            awake = touch.distance[z] < far
            if awake:
                awake = touch.distance[z] < close + way_of(touch, q, z, kind)
            if awake and task == ASK:
                awake = is_swung(touch, z)
            if awake:
                looked += 1
                drift, w, normal, distance, ok = gap_of(touch, z, kind)
                if ok:
                    ok = ti.i32(-distance < close + core_of(touch, z))  # deeper ones may sleep
                if ok:
                    behind = thickness(touch, touch.ends[z, 0], touch.ends[z, 3]) - distance
                if ok and eases:
                    ok = is_nearest(touch, z)
                if ok and task != MEASURE and -behind < h * closing_of(touch, q, z, w):
                    corner = ti.Vector([touch.ends[z, k] for k in range(4)])
                    b, c = touch.body[corner[0]], touch.body[corner[3]]
                    aims = aim(touch, corner, -behind, ease(touch, q, b, c, h), h)
                    if task == ASK:
                        n += asks_for_row(touch, corner, w, normal, drift, aims, h)
                    else:
                        least = least_rate(touch, corner, w, normal, drift, look)
                        if least < aims[1] or aims[0] < 0.0:
                            write_row(touch, begin + n, corner, w, normal, aims, drift)
                            n += 1
            if task == MEASURE:
                touch.behind[z] = behind
        if task == WRITE:
            touch.segment[own, f.FACES_NEAR + kind] = n
        count += n
    if task == WRITE:
        touch.most[own, f.LOOKED] = looked
    return count


@ti.func
def find_depths(touch: ti.template(), q, h):
    """Write how deep couples are in each other by all the pairs that one thread has listed."""
    first = touch.order[q, f.COUPLE]
    bodies = touch.order[q, f.BODY_END] - touch.order[q, f.BODY]
    for k in range(bodies * bodies):
        touch.sunk[first + k] = 0.0
    own = touch.order[q, f.THREAD]
    if touch.order[q, f.COUNT] > 0:
        touch.most[own, f.GONE] = 0.0
        find_rows(touch, q, 0, 1, MEASURE, False, 0, h)
        for kind in range(2):
            for z in range(touch.segment[own, 2 * kind], touch.segment[own, 2 * kind + 1]):
                if touch.behind[z] > 0.0 and is_nearest(touch, z):
                    b, c = touch.body[touch.ends[z, 0]], touch.body[touch.ends[z, 3]]
                    for side in range(2):
                        k = couple_of(touch, q, b, c) if side == 0 else couple_of(touch, q, c, b)
                        touch.sunk[k] = ti.max(touch.sunk[k], touch.behind[z])
