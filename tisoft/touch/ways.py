# mypy: ignore-errors
"""How far points may go before lists are made anew, and how fast they are thought to become.

    way = |x − x_listed| + h s,   s = min(|v*|, 2 |v| + START) at first, after contact the most of
                                  that and of what came out

What rests is kicked hard, v*, and held: lists need not reach as far as its kicks.  What does come
out faster than s, or is thrown by contact, is looked at again.
"""

import taichi as ti

from tisoft.model.state import TOUCH_SCENE
from tisoft.model.threads import share
from tisoft.touch import fields as f

BLOW = 0.5
"""Share of the thickness: what contact throws no farther in a substep is not looked at again.  A
sheet that sinks in by a thickness is crossed."""
START = 0.125
"""Of the least margin."""
SAFE = 0.98
"""Share of the allowed way after which lists are made anew."""


@ti.func
def outcome(touch: ti.template(), p):
    """Velocity of point p after contact, as far as it has been found [m/s]."""
    v = touch.kicked[p]
    if touch.met[p]:
        v = touch.velocity[p]
    return v


@ti.func
def throw_of(touch: ti.template(), p):
    """How fast contact throws point p [m/s]: it comes out at that, or that much unlike its kick,
    whichever is less.
    """
    v = outcome(touch, p)
    return ti.sqrt(ti.min((v - touch.kicked[p]).norm_sqr(), v.norm_sqr()))


@ti.func
def left(s: ti.template(), i, p, h):
    """How far node i may have gone by the end of the next substep, in which it may become twice as
    fast, as a share of what it may.
    """
    way = (s.state.rest[i] + s.state.displacement[i] - s.surfaces.listed[p]).norm()
    way += 2.0 * h * s.state.velocity[i].norm()
    return way / s.surfaces.allowed[p]


@ti.func
def left_standing(s: ti.template(), q, t, threads, h):
    """The like of `left` of thread t's points of obstacles, placed when the substep began."""
    most = 0.0 * h
    low, high = s.surfaces.order[q, f.STANDING], s.surfaces.order[q, f.POINT_END]
    for p in range(share(low, high, t, threads), share(low, high, t + 1, threads)):
        way = (s.surfaces.place[p] - s.surfaces.listed[p]).norm()
        way += 3.0 * h * s.surfaces.velocity[p].norm()
        most = ti.max(most, way / s.surfaces.allowed[p])
    return most


@ti.func
def note_point(s: ti.template(), q, p, look, h):
    """Write how fast point p of a body may be and what contact has made of its velocity; returns
    how far it will have gone since the search, 0 where no other body is near [m], the same as a
    share of what it may, and whether it is kicked harder than pairs are looked for: what rests is
    kicked hard, and held.
    """
    fast = s.surfaces.sent[p]
    flung = 0.0 * h
    if look == 0:
        slow = s.surfaces.velocity[p].norm()
        most = 2.0 * slow + START * ti.cast(s.surfaces.length[q, f.LEAST], s.surfaces.real) / h
        if fast > most:
            fast, flung = most, 1.0 + 0.0 * h
    else:
        v = outcome(s.surfaces, p)
        fast = ti.max(fast, v.norm())
        swing = v - s.surfaces.kicked[p]
        under, over = 0.0 * swing, 0.0 * swing
        if look > 1:
            under, over = s.surfaces.under[p], s.surfaces.over[p]
        s.surfaces.under[p], s.surfaces.over[p] = ti.min(under, swing), ti.max(over, swing)
        thin = ti.cast(s.surfaces.length[q, f.THIN], s.surfaces.real)
        is_swung = h * throw_of(s.surfaces, p) > BLOW * thin
        s.surfaces.swung[p] = ti.cast(is_swung, ti.i32)
    s.surfaces.sent[p] = fast
    gone = (s.surfaces.place[p] - s.surfaces.listed[p]).norm() + h * fast
    part = gone / s.surfaces.allowed[p]
    if s.surfaces.trait[s.surfaces.body[p], f.NEAR] == 0:
        gone = 0.0 * h
    s.surfaces.gone[p] = gone
    return ti.Vector([gone, part, flung])


@ti.func
def note_points(s: ti.template(), scene, q, t, threads, look, h):
    """`note_point` of thread t's points: the most, into `most`."""
    most = ti.Vector([0.0 * h, 0.0 * h, 0.0 * h])
    if ti.static(s.contact):
        if s.surfaces.order[q, f.MOVING] or look > 0:
            low, high = s.surfaces.order[q, f.STANDING], s.surfaces.order[q, f.POINT_END]
            for p in range(share(low, high, t, threads), share(low, high, t + 1, threads)):
                most = ti.max(most, note_point(s, q, p, look, h))
    low, high = s.state.ranges[scene, 0], s.state.ranges[scene, 1]
    base = s.surfaces.order[q, f.NODE] - low
    for i in range(share(low, high, t, threads), share(low, high, t + 1, threads)):
        p = s.surfaces.point[i + base]
        if p >= 0:
            most = ti.max(most, note_point(s, q, p, look, h))
    own = s.surfaces.order[q, f.THREAD] + t
    for k in ti.static(range(3)):
        s.surfaces.most[own, ti.static([f.GONE, f.STALE, f.FLUNG][k])] = most[k]


@ti.func
def note_flung(s: ti.template(), scene, q, t, threads):
    """Write whether one of thread t's nodes comes out faster than pairs were looked for."""
    low, high = s.state.ranges[scene, 0], s.state.ranges[scene, 1]
    base, flung = s.surfaces.order[q, f.NODE] - low, 0.0 * s.surfaces.sent[0]
    for i in range(share(low, high, t, threads), share(low, high, t + 1, threads)):
        p = s.surfaces.point[i + base]
        if p >= 0:
            if outcome(s.surfaces, p).norm() > s.surfaces.sent[p]:
                flung = 1.0 + 0.0 * flung
    s.surfaces.most[s.surfaces.order[q, f.THREAD] + t, f.FLUNG] = flung


@ti.func
def most_of(s: ti.template(), q, threads, column: ti.template()):
    """The most that a thread has found, of a column of `Touch.most`."""
    thread = s.surfaces.order[q, f.THREAD]
    most = s.surfaces.most[thread, column]
    for k in range(1, threads):
        most = ti.max(most, s.surfaces.most[thread + k, column])
    return most


@ti.func
def is_stale(s: ti.template(), scene, threads):
    """Whether some point may leave its list's reach in the substep, or the list has become dear."""
    q = s.state.ranges[scene, TOUCH_SCENE]
    is_dear = s.surfaces.order[q, f.WASTED] > s.surfaces.order[q, f.WORK]
    return most_of(s, q, threads, f.STALE) > SAFE or is_dear
