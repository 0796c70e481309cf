# mypy: ignore-errors
"""A pass over the nodes where surfaces may touch: kicks, then impulses of contact, then moves.

    v* = v + h a  |  rows of the pairs that may touch  |  sweeps: v = v* + M⁻¹ Jᵀ λ  |  x += h v

Pairs are listed anew in the substep, after its kicks, in which a point would leave its list's
reach.  Where no pair is listed this is the plain pass over the nodes, which looks ahead by a
substep instead.  What a blow throws on meets others in the same substep: where contact changes
velocities by much, rows are looked for again with what came out, and all are solved anew.
"""

from typing import Any

import taichi as ti

from tisoft import runtime
from tisoft.model.state import TOUCH_SCENE
from tisoft.model.threads import meet, share
from tisoft.obstacles.base import VELOCITY
from tisoft.step import external, forces, ledger
from tisoft.step.contact import corner_place, stop_of, surface_velocity
from tisoft.step.fixed import held
from tisoft.step.substep import move, now_of
from tisoft.touch import fields as f
from tisoft.touch.awake import note_awake
from tisoft.touch.lists import search
from tisoft.touch.rows import ASK, MEASURE, WRITE, find_depths, find_rows
from tisoft.touch.sweeps import sweep
from tisoft.touch.ways import (
    BLOW,
    is_stale,
    left,
    left_standing,
    most_of,
    note_flung,
    note_points,
)

MOST_LOOKS = 8
"""Bodies in a row through which a blow goes within one substep."""


@ti.func
def place(s: ti.template(), i, p, v):
    """Tell contact where node i, its point p, is and how fast, without contact by the substep's end
    v [m/s].  Reads rest, displacement, velocity.
    """
    bits = s.state.fixed[i]
    s.surfaces.place[p] = s.state.rest[i] + s.state.displacement[i]
    s.surfaces.velocity[p], s.surfaces.kicked[p] = s.state.velocity[i], v
    s.surfaces.sent[p] = v.norm()
    s.surfaces.held[p] = bits
    s.surfaces.inverse_mass[p] = 0.0 if bits == 7 else s.state.inverse_mass[i]
    s.surfaces.met[p] = 0


@ti.func
def stand(s: ti.template(), p):
    """Tell contact where an obstacle's point p is and how fast [m/s].  Reads obstacle."""
    body = s.surfaces.body[p]
    row = s.surfaces.trait[body, f.ROW]
    x = corner_place(s.state, row, s.surfaces.local[p])
    v = surface_velocity(s.state, row, x)
    s.surfaces.place[p] = x
    s.surfaces.velocity[p], s.surfaces.kicked[p] = v, v
    s.surfaces.sent[p] = v.norm()
    for d in ti.static(range(3)):
        s.surfaces.spin[body][d] = s.state.obstacle[row, VELOCITY + 3 + d]


@ti.func
def stand_all(s: ti.template(), q, t, threads):
    """The same of thread t's points of all obstacles."""
    low, high = s.surfaces.order[q, f.STANDING], s.surfaces.order[q, f.POINT_END]
    for p in range(share(low, high, t, threads), share(low, high, t + 1, threads)):
        stand(s, p)


@ti.func
def without_contact(s: ti.template(), i, row, now):
    """Node i's acceleration and the elements' force on it; `row` is its row of the mass matrix."""
    a, elements = 0.0 * s.state.velocity[i], 0.0 * s.state.velocity[i]
    if ti.static(s.consistent):
        a = s.mass.solution[row]
        elements = s.mass.force[row]
    else:
        elements = forces.total(s.state, i)
        a = external.acceleration(s.state, i, elements + external.force(s.state, i, now), now)
    return a, elements


@ti.func
def kick(s: ti.template(), i, row, n, now):
    """Acceleration of node i without contact, into row n of touch; its point's place and v*."""
    a, elements = without_contact(s, i, row, now)
    s.surfaces.acceleration[n], s.surfaces.force[n] = a, elements
    p = s.surfaces.point[n]
    if p >= 0:
        place(s, i, p, held(s.state, i, s.integrator.ahead(s.state, i, a, now)))


@ti.func
def lean(s: ti.template(), i, n, now):
    """Tell contact which obstacle stops node i, whose row of touch is n."""
    p = s.surfaces.point[n]
    if p >= 0:
        if s.surfaces.met[p]:
            stop, bound = 0.0 * s.surfaces.kicked[p], -1e30 + 0.0 * now.h
            surface, hold = 0.0 * stop, 0.0 * bound
            if s.state.fixed[i] == 0:
                v = s.surfaces.kicked[p]
                stop, bound, surface, hold = stop_of(s.state, i, now.h, v)
            s.surfaces.stop[p], s.surfaces.bound[p] = stop, bound
            s.surfaces.surface[p], s.surfaces.hold[p] = surface, hold


@ti.func
def finish(s: ti.template(), i, row, n, is_met, is_easing, now):
    """Move node i, with what contact has added to its velocity where `is_met`: `kick` then has its
    acceleration.  (One call of `move` for both: each is compiled anew.)

    Args: is_easing: whether bodies are pushed out of each other.
    """
    a, elements = 0.0 * s.state.velocity[i], 0.0 * s.state.velocity[i]
    pushed, rubbed = 0.0 * a, 0.0 * a
    if is_met:
        a, elements = s.surfaces.acceleration[n], s.surfaces.force[n]
        p = s.surfaces.point[n]
        if p >= 0:
            if s.surfaces.met[p]:
                pushed = s.surfaces.pushed[p] * s.state.inverse_mass[i]
                rubbed = s.surfaces.rubbed[p] * s.state.inverse_mass[i]
                if ti.static(s.ledger):
                    if ti.static(s.contact) or is_easing:
                        ledger.note_carried(s.state, i, s.surfaces.carried[p])
    else:
        a, elements = without_contact(s, i, row, now)
    move(s, i, a, elements, now, pushed, rubbed)


@ti.func
def renew(s: ti.template(), scene, now):
    """List the pairs anew, on one thread, as the state is between substeps."""
    low, high = s.state.ranges[scene, 0], s.state.ranges[scene, 1]
    q = s.state.ranges[scene, TOUCH_SCENE]
    for i in range(low, high):
        p = s.surfaces.point[s.surfaces.order[q, f.NODE] + i - low]
        if p >= 0:
            place(s, i, p, s.state.velocity[i])
    if ti.static(s.contact):
        stand_all(s, q, 0, 1)
    search(s, scene, q, 0, 1, 0, now)


@ti.func
def touch_nodes(s: ti.template(), scene, t, threads, phase, now, stale):
    """Steps 2 to 5 at thread t's nodes; returns the phase that it has come to.

    Args: stale: whether the lists are out of date.
    """
    low, high = s.state.ranges[scene, 0], s.state.ranges[scene, 1]
    first, last = share(low, high, t, threads), share(low, high, t + 1, threads)
    q = s.state.ranges[scene, TOUCH_SCENE]
    thread, base = s.surfaces.order[q, f.THREAD], s.surfaces.order[q, f.NODE] - low
    back = s.state.ranges[scene, 15] - low
    is_met = s.surfaces.order[q, f.COUNT] > 0 or stale
    eases = s.surfaces.length[q, f.LEFT] > 0.0
    moving = s.surfaces.order[q, f.MOVING]
    if ti.static(s.contact):
        if moving or stale:
            stand_all(s, q, t, threads)
    if is_met:
        for i in range(first, last):
            kick(s, i, i + back, i + base, now)
    look, rows = 0, 0
    while is_met and look < MOST_LOOKS:
        note_points(s, scene, q, t, threads, look, now.h)
        phase += 1
        meet(s, scene, phase, threads)
        flung = look == 0 and most_of(s, q, threads, f.FLUNG) > 0.0
        if (stale and look == 0) or is_stale(s, scene, threads):
            phase = search(s, scene, q, t, threads, phase, now)
        found, task = 0, WRITE
        if eases:
            task = MEASURE
        elif look > 0:
            task = ASK
        while task >= 0:
            n = find_rows(s.surfaces, q, t, threads, task, eases, look, now.h)
            s.surfaces.most[thread + t, f.FOUND + task] = n
            phase += 1
            meet(s, scene, phase, threads)
            found = 0
            for k in range(threads):
                found += ti.cast(s.surfaces.most[thread + k, f.FOUND + task], ti.i32)
            task = WRITE if task == MEASURE or (task == ASK and found > 0) else -1
        if t == 0 and look == 0:
            note_awake(s.surfaces, q, threads)
        again = False
        if found > rows:
            rows = found
            if ti.static(s.contact):
                for i in range(first, last):
                    lean(s, i, i + base, now)
            phase = sweep(s, scene, q, t, threads, phase, eases, now)
            thin = ti.cast(s.surfaces.length[q, f.THIN], s.surfaces.real)
            again = now.h * most_of(s, q, threads, f.SWING) > BLOW * thin
        if flung:
            note_flung(s, scene, q, t, threads)
            phase += 1
            meet(s, scene, phase, threads)
            again = again or most_of(s, q, threads, f.FLUNG) > 0.0
        look = look + 1 if again else MOST_LOOKS
    if is_met and eases and now.opens and t == 0:
        falls = now.h * s.surfaces.length[q, f.RATE]
        s.surfaces.length[q, f.LEFT] = ti.max(s.surfaces.length[q, f.LEFT] - falls, 0.0)
    part = 0.0 * now.h
    ahead = s.surfaces.order[q, f.COUNT] == 0
    for i in range(first, last):
        finish(s, i, i + back, i + base, is_met, eases, now)
        p = s.surfaces.point[i + base]
        if p >= 0 and ahead:
            part = ti.max(part, left(s, i, p, now.h))
    if ti.static(s.contact):
        if moving and ahead:
            part = ti.max(part, left_standing(s, q, t, threads, now.h))
    s.surfaces.most[thread + t, f.STALE] = part
    return phase


def make_depths(s: Any) -> Any:
    """The kernel depths(scene), which lists pairs anew, as far as `sunk` allows, and writes there
    how deep bodies are in each other and in obstacles; on the caller's thread.
    """

    @ti.kernel
    def measured(scene: int):
        s.state.arrived[scene] = 0
        ti.loop_config(serialize=True)
        for _ in range(1):
            now = now_of(s, scene, 1, 1)
            renew(s, scene, now)
            find_depths(s.surfaces, s.state.ranges[scene, TOUCH_SCENE], now.h)

    return runtime.compiled_as_written(measured)
