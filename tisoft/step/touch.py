# mypy: ignore-errors
"""Contact of a surface that a body carries with obstacles: its points meet them, not the nodes.

A point moves with the nodes of its cell, x = Σ N_a x_a, and weighs 1/m̄ = Σ N_a²/m_a there.  After
the nodes have moved, point after point gets back what led it past the surface,

    Δv = n Δ_n − t min(μ Δ_n, |v_t|),   Δv_a = N_a m̄/m_a Δv,   Δx_a = h Δv_a

with Δ_n the least that leaves the point outside (see `contact`), so that momentum changes by the
contact's impulse m̄ Δv alone.  One thread sees the points in their order: the bits do not depend on
how many there are.

Points that start inside come out together: the deepest of a body's at the speed at which its
obstacle may push (`pushing`), those less deep once it is where they are.

| symbol | name                 | unit |
| ------ | -------------------- | ---- |
| N_a    | `touch.share[p, a]`  | 1    |
| x_a    | `touch.corner[p, a]` |      |
"""

import taichi as ti

from tisoft.model.state import EASES, SLACK, TOUCH
from tisoft.moving import STILL
from tisoft.obstacles.base import FRICTION, PUSH
from tisoft.step.contact import gap_and_normal, surface_velocity
from tisoft.step.fixed import free


@ti.func
def driven_velocity(s: ti.template(), i):
    """The velocity that has moved node i [m/s].  Reads velocity, or half."""
    v = s.state.velocity[i]
    if ti.static(s.integrator.closing_passes > 0):
        v = s.state.half[i]
    return v


@ti.func
def meet(s: ti.template(), scene, now):
    """Let a scene's points meet the obstacles, all those of the same nodes at a time: most are far
    away.
    """
    first, last = s.state.ranges[scene, TOUCH], s.state.ranges[scene, TOUCH + 1]
    if s.state.orders[scene, EASES]:
        ease(s, first, last, now)
    p = first
    while p < last:
        end = p + s.touch.group[p]
        if is_near(s, p, now):
            for q in range(p, end):
                meet_obstacles(s, q, now)
        p = end


@ti.func
def ease(s: ti.template(), first, last, now):
    """Note how deep points may be after this pass in obstacles that push: as the deepest of their
    body is, less what it is pushed.  Writes obstacle.
    """
    for p in range(first, last):
        for row in range(s.touch.first[p], s.touch.last[p]):
            s.state.obstacle[row, SLACK] = 0.0
    for p in range(first, last):
        x = carried_place(s, p)
        for row in range(s.touch.first[p], s.touch.last[p]):
            if s.state.obstacle[row, PUSH] < STILL:
                gap, _ = gap_and_normal(s.state, row, x)
                deep = -gap - s.state.obstacle[row, PUSH] * now.h
                s.state.obstacle[row, SLACK] = ti.max(s.state.obstacle[row, SLACK], deep)


@ti.func
def carried_place(s: ti.template(), p):
    """x of point p from its body's origin [m]."""
    x = place(s, s.touch.corner[p, 0]) * 0.0
    for a in range(s.touch.corners):
        x += s.touch.share[p, a] * place(s, s.touch.corner[p, a])
    return x


@ti.func
def is_near(s: ti.template(), p, now):
    """Whether a point that the nodes of p carry may have come to an obstacle: from their middle it
    is at most Σ |N_a| times the way to the farthest of them.  First this is guessed at twice the
    way between two of them.
    """
    count = ti.static(s.touch.corners)
    x, last = place(s, s.touch.corner[p, 0]), place(s, s.touch.corner[p, count - 1])
    spread = 1.1 * s.touch.spread[p]  # a turning obstacle is not as fast everywhere
    near = away(s, p, x, now) < 2.0 * spread * (last - x).norm()
    if near:
        middle = 0.0 * x
        for a in range(count):
            middle += place(s, s.touch.corner[p, a]) / count
        farthest = 0.0 * now.h
        for a in range(count):
            way = place(s, s.touch.corner[p, a]) - middle
            farthest = ti.max(farthest, way.dot(way))
        near = away(s, p, middle, now) < spread * ti.sqrt(farthest)
    return near


@ti.func
def place(s: ti.template(), i):
    """x of node i from its body's origin [m]."""
    return s.state.rest[i] + s.state.displacement[i]


@ti.func
def away(s: ti.template(), p, x, now):
    """How far x is from the obstacles of point p [m]."""
    least = 1e30 + 0.0 * now.h
    for row in range(s.touch.first[p], s.touch.last[p]):
        gap, normal = gap_and_normal(s.state, row, x)
        least = ti.min(least, gap - now.h * normal.dot(surface_velocity(s.state, row, x)))
    return least


@ti.func
def meet_obstacles(s: ti.template(), p, now):
    """Let point p meet the obstacles of its body.

    Reads touch.*, obstacle*, rest, inverse_mass, fixed; changes displacement, velocity, half, work.
    """
    x = carried_place(s, p)
    if away(s, p, x, now) < 0.0:
        push_out(s, p, x, now)


@ti.func
def push_out(s: ti.template(), p, x, now):
    """Let point p, which is at x [m], leave the obstacles that it is in."""
    h = now.h
    v = 0.0 * now.gravity
    lightness = 0.0 * h
    for a in range(s.touch.corners):
        i, share = s.touch.corner[p, a], s.touch.share[p, a]
        v += share * driven_velocity(s, i)
        if s.state.fixed[i] != 7:
            lightness += share * share * s.state.inverse_mass[i]
    if lightness > 0.0:
        for row in range(s.touch.first[p], s.touch.last[p]):
            gap, normal = gap_and_normal(s.state, row, x)
            w = surface_velocity(s.state, row, x)
            gap -= h * normal.dot(w)  # where the obstacle is by now
            if gap < 0.0:
                along = normal.dot(v - w)
                before = gap - h * along
                kick = ti.max(-ti.max(before, 0.0 * h) / h - along, 0.0 * h)
                tangential = v - w - along * normal
                speed = tangential.norm()
                change = kick * normal
                if speed > 0.0:
                    change -= (
                        ti.min(s.state.obstacle[row, FRICTION] * kick / speed, 1.0) * tangential
                    )
                slack = s.state.obstacle[row, SLACK]
                push = ti.max(-gap - h * kick - slack, 0.0 * h) * normal
                if 0.0 < slack and gap <= -slack:  # the surface there moves out with the deepest
                    w += s.state.obstacle[row, PUSH] * normal
                for a in range(s.touch.corners):
                    i = s.touch.corner[p, a]
                    part = s.touch.share[p, a] * s.state.inverse_mass[i] / lightness
                    if s.state.fixed[i] != 7:
                        carry(s, i, free(s.state, i, part * change).dot(w))
                        shift(
                            s,
                            i,
                            free(s.state, i, part * change),
                            free(s.state, i, part * push),
                            now,
                        )
                v += change
                x += h * change + push


@ti.func
def carry(s: ti.template(), i, carried):
    """Count work [J per kg] that a moving obstacle did on node i as work from outside."""
    if ti.static(s.ledger):
        given = carried / s.state.inverse_mass[i]
        s.state.work[i][0] = s.state.work[i][0] + given
        s.state.work[i][1] = s.state.work[i][1] + given


@ti.func
def shift(s: ti.template(), i, change, push, now):
    """Change node i's velocity [m/s], and put it as much further and by `push` [m]."""
    old = s.state.velocity[i]
    s.state.velocity[i] = old + change
    if ti.static(s.integrator.closing_passes > 0):
        s.state.half[i] = s.state.half[i] + change
    s.state.displacement[i] = s.state.displacement[i] + now.h * change + push
    if ti.static(s.ledger):
        note(s, i, old, change, push, now)


@ti.func
def note(s: ti.template(), i, old, change, push, now):
    """Add to the energy dissipated at node i, −m Δv·(v + Δv/2 − h a/2), and to the work from
    outside, −m a·push and that of its loads [J].
    """
    mass = 1.0 / s.state.inverse_mass[i]
    pull = s.state.pull[i]
    taken = -mass * change.dot(old + 0.5 * change - 0.5 * now.kick * pull)
    s.state.work[i][0] = s.state.work[i][0] + taken
    s.state.work[i][1] = s.state.work[i][1] - mass * pull.dot(push)
    if now.loaded:
        load = s.state.load[i] + s.state.pressed[i]
        s.state.work[i][1] = s.state.work[i][1] + load.dot(now.h * change + push)
