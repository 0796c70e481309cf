# mypy: ignore-errors
"""Impulses of contact: Jacobi sweeps with masses split by weight, from zero in every substep.

    P = Σ_k |w_k| S_k/m_k,   S_i = Σ_rows |w_i|
    λ ← max(λ + (target − n·Jv)/P, 0),   λ_t ← λ_t − (Jv)_t/P, no longer than μ λ
    v_i = v_i* + Σ_rows w_i (λ n + λ_t)/m_i,   then v_i·n_o ≥ bound at an obstacle's surface n_o

P bounds the sums of the rows of A = J M⁻¹ Jᵀ, so that a sweep never gains energy where gaps close,
whatever the step; impulses are equal and opposite by construction. What an obstacle stops gives way
to no row that presses it on, and 1/m_i is as much less there: else a light sheet on the floor would
carry nothing. Splitting the mass of a node between contacts: Tonge, Benevolenski and Voroshilov
(2012), there by count. Light sheets in layers under what is heavy are swept on by Gauss-Seidel, row
after row with whole masses, P = Σ_k w_k²/m_k: its sweeps gain no energy either, and three sheets
under 33 times their weight need 60 where split masses need 2,500. Each island is swept by one
thread until it has converged, and its sums have the order of its rows: no atomics, the same bits
with any number of threads.
"""

import taichi as ti

from tisoft.model.threads import meet, share
from tisoft.touch import fields as f
from tisoft.touch.islands import find_islands
from tisoft.touch.ways import throw_of

LEAST_SWEEPS, MOST_SWEEPS, LAST_SWEEPS = 4, 16, 128
"""Beyond the second, by Gauss-Seidel, only where sheets would sink in by more than SINK."""
SINK = 0.1
"""Share of the least thickness: with half of it, a block on a folded cloth crosses that in .4 s.
"""
LEVER = 0.1
"""Share of a row that its free points must have: with less, where the others are held, they would
be thrown to move it at all.
"""


@ti.func
def weigh(touch: ti.template(), row, last):
    """Add a row to S of its points; those that are new go to row `last` of `candidate` and on.
    Returns the next.
    """
    for k in range(4):
        p = touch.corner[row, k]
        if touch.met[p]:
            if touch.root[p] >= 0:
                touch.root[p] = -1
                touch.weight[p] = 0.0
                touch.pushed[p] = ti.Vector([0.0, 0.0, 0.0])
                touch.rubbed[p] = ti.Vector([0.0, 0.0, 0.0])
                touch.carried[p] = ti.Vector([0.0, 0.0])
                touch.thrust[p] = ti.Vector([0.0, 0.0, 0.0])
                answer(touch, p)
                touch.candidate[last] = p
                last += 1
            touch.weight[p] = touch.weight[p] + ti.abs(touch.share[row, k])
    return last


@ti.func
def yielding(touch: ti.template(), row, k):
    """Shares with which the k-th point of a row gives way along it and across it: where an
    obstacle stops it, to nothing that presses it on.
    """
    p, w = touch.corner[row, k], ti.abs(touch.share[row, k])
    gives, slides = 1.0 + 0.0 * w, 1.0 + 0.0 * w
    if touch.stopped[p]:
        into = touch.share[row, k] * touch.normal[row].dot(touch.stop[p])
        if into < 0.0:
            gives -= (into / w) ** 2
            if touch.stopped[p] == 2:
                gives, slides = 0.0 * w, 0.0 * w
    return gives, slides


@ti.func
def soften(touch: ti.template(), row):
    """1/P of a row, once S is known."""
    inverse, loose, free = 0.0 * touch.target[row], 0.0 * touch.target[row], 0.0 * touch.target[row]
    for k in range(4):
        p, w = touch.corner[row, k], ti.abs(touch.share[row, k])
        gives, slides = yielding(touch, row, k)
        inverse += w * touch.weight[p] * touch.inverse_mass[p] * gives
        loose += w * touch.weight[p] * touch.inverse_mass[p] * slides
        if touch.inverse_mass[p] > 0.0:
            free += w * gives
    touch.mass[row], touch.loose[row] = 0.0, 0.0
    if inverse > 0.0 and free > LEVER:
        touch.mass[row] = 1.0 / inverse
        if loose > 0.0:
            touch.loose[row] = 1.0 / loose


@ti.func
def respond(touch: ti.template(), row, rate, mass, loose):
    """Change the impulses of a row at the velocity `rate` of its points [m/s], with 1/P along it
    and across it; returns their change, and how far the row was from its target [m/s].
    """
    n = touch.normal[row]
    along = rate.dot(n)
    short = touch.target[row] - along
    impulse = ti.max(touch.impulse[row] + short * mass, 0.0 * short)
    most = touch.rough[row] * impulse
    grip = touch.grip[row] - (rate - along * n) * loose
    square = grip.norm_sqr()
    if square > most * most:
        grip *= most / ti.sqrt(square)
    change = (impulse - touch.impulse[row]) * n + grip - touch.grip[row]
    touch.impulse[row], touch.grip[row] = impulse, grip
    return change, short


@ti.func
def push(touch: ti.template(), row):
    """One sweep of a row, whose impulses are added to those on its points; returns how far it was
    from its target [m/s].
    """
    rate = touch.drift[row]
    for k in range(4):
        rate += touch.share[row, k] * touch.velocity[touch.corner[row, k]]
    short = 0.0 * rate[0]
    if touch.mass[row] > 0.0:
        _, short = respond(touch, row, rate, touch.mass[row], touch.loose[row])
        if touch.impulse[row] > 0.0:
            total = touch.impulse[row] * touch.normal[row] + touch.grip[row]
            for k in range(4):
                p = touch.corner[row, k]
                if touch.met[p]:
                    touch.thrust[p] = touch.thrust[p] + touch.share[row, k] * total
    return short


@ti.func
def settle(touch: ti.template(), row):
    """One Gauss-Seidel step of a row: its points answer at once, and give way as they do now.
    Returns how far it was from its target [m/s].
    """
    rate = touch.drift[row]
    inverse, loose, free = 0.0 * touch.target[row], 0.0 * touch.target[row], 0.0 * touch.target[row]
    for k in range(4):
        p, w = touch.corner[row, k], ti.abs(touch.share[row, k])
        rate += touch.share[row, k] * touch.velocity[p]
        gives, slides = yielding(touch, row, k)
        inverse += w * w * touch.inverse_mass[p] * gives
        loose += w * w * touch.inverse_mass[p] * slides
        if touch.inverse_mass[p] > 0.0:
            free += w * gives
    change, short = 0.0 * rate, 0.0 * rate[0]
    if inverse > 0.0 and free > LEVER:
        across = 1.0 / loose if loose > 0.0 else 0.0 * loose
        change, short = respond(touch, row, rate, 1.0 / inverse, across)
        for k in range(4):
            p = touch.corner[row, k]
            if touch.met[p]:
                touch.thrust[p] = touch.thrust[p] + touch.share[row, k] * change
                answer(touch, p)
    return short


@ti.func
def answer(touch: ti.template(), p):
    """Velocity of point p with the impulses on it, no deeper into an obstacle than up to it, and
    there with the friction of that, as nodes meet obstacles.
    """
    jump = touch.thrust[p] * touch.inverse_mass[p]
    for d in ti.static(range(3)):
        if touch.held[p] & (1 << d):
            jump[d] = 0.0
    v = touch.kicked[p] + jump
    short = touch.bound[p] - v.dot(touch.stop[p])
    stopped = 0
    if short > 0.0:
        v += short * touch.stop[p]
        slip = v - touch.surface[p]
        slip -= slip.dot(touch.stop[p]) * touch.stop[p]
        speed, most = slip.norm(), touch.hold[p] * short
        stopped = 1
        if speed > most:
            v -= (most / speed) * slip
        else:
            v -= slip
            stopped = 2
    touch.stopped[p] = stopped
    touch.velocity[p] = v


@ti.func
def part(touch: ti.template(), row):
    """Add the impulses of a row to those on its points, along normals and by friction apart."""
    for k in range(4):
        p, w = touch.corner[row, k], touch.share[row, k]
        if touch.met[p]:
            touch.pushed[p] = touch.pushed[p] + w * touch.impulse[row] * touch.normal[row]
            touch.rubbed[p] = touch.rubbed[p] + w * touch.grip[row]


@ti.func
def carry(touch: ti.template(), row):
    """Add work [J] from outside to that on a row's points, along normals and by friction: an
    impulse times the velocity of an obstacle's surface, −|w| P·(Σ w_k v_k) over its points; and
    times that with which what is inside another one is pushed out.
    """
    v = touch.drift[row]
    for k in range(4):
        p = touch.corner[row, k]
        if touch.trait[touch.body[p], f.OBSTACLE]:
            v += touch.share[row, k] * touch.velocity[p]
    pressed = touch.impulse[row] * (touch.outside[row] - v.dot(touch.normal[row]))
    work = ti.Vector([pressed, -v.dot(touch.grip[row])])
    for k in range(4):
        p = touch.corner[row, k]
        if touch.met[p]:
            touch.carried[p] = touch.carried[p] + ti.abs(touch.share[row, k]) * work


@ti.func
def solve(s: ti.template(), q, rows, first, eases, now):
    """Sweep an island; returns how often, and how fast it throws a point at the most [m/s].

    Args:
        rows: of `queue`, first and last.
        first: row of `candidate` from which on its points go.
        eases: whether bodies are pushed out of each other.
    """
    touch = s.surfaces
    last = first
    for z in range(rows[0], rows[1]):
        last = weigh(touch, touch.queue[z], last)
    tolerance = ti.cast(touch.length[q, f.TOLERANCE], touch.real) / now.h
    enough, deep = tolerance, 1e30 + 0.0 * tolerance
    stops = False
    for z in range(first, last):
        if touch.bound[touch.candidate[z]] > -1e29:
            stops = True
        if touch.trait[touch.body[touch.candidate[z]], f.SOLID] == 0:
            deep = SINK * ti.cast(touch.length[q, f.THIN], touch.real) / now.h
    number, done, swing = 0, 0, 0.0 * tolerance
    while done == 0:
        worst = 0.0 * tolerance
        if number < MOST_SWEEPS:
            for z in range(first, last):
                p = touch.candidate[z]
                touch.thrust[p] = ti.Vector([0.0, 0.0, 0.0])
            if number == 0 or stops:
                for z in range(rows[0], rows[1]):
                    soften(touch, touch.queue[z])
            for z in range(rows[0], rows[1]):
                worst = ti.max(worst, push(touch, touch.queue[z]))
            for z in range(first, last):
                answer(touch, touch.candidate[z])
        else:
            for z in range(rows[0], rows[1]):
                worst = ti.max(worst, settle(touch, touch.queue[z]))
        number += 1
        if number == MOST_SWEEPS:
            enough = deep
        if number == LAST_SWEEPS or (number >= LEAST_SWEEPS and worst < enough):
            done = 1
    for z in range(rows[0], rows[1]):
        part(touch, touch.queue[z])
    if ti.static(s.ledger):
        if ti.static(s.contact) or eases:
            for z in range(rows[0], rows[1]):
                carry(touch, touch.queue[z])
    for z in range(first, last):
        swing = ti.max(swing, throw_of(touch, touch.candidate[z]))
    return ti.Vector([number, swing])


@ti.func
def sweep(s: ti.template(), scene, q, t, threads, phase, eases, now):
    """Solve for the impulses of all rows; returns the phase that it has come to.

    Args: eases: whether bodies are pushed out of each other.
    """
    touch = s.surfaces
    if t == 0:
        find_islands(touch, q, threads)
    phase += 1
    meet(s, scene, phase, threads)
    base, count = touch.order[q, f.PAIR], touch.order[q, f.ISLANDS]
    rows = touch.island_end[base + count - 1] - base
    begin, end = base + share(0, rows, t, threads), base + share(0, rows, t + 1, threads)
    first = touch.order[q, f.CANDIDATE] + t * touch.order[q, f.WIDTH]
    start, most = base, 0.0 * touch.target[base] + ti.Vector([0.0, 0.0])
    for island in range(base, base + count):
        stop = touch.island_end[island]
        if begin <= start and start < end:
            most = ti.max(most, solve(s, q, ti.Vector([start, stop]), first, eases, now))
        start = stop
    touch.most[touch.order[q, f.THREAD] + t, f.WORST] = most[0]
    touch.most[touch.order[q, f.THREAD] + t, f.SWING] = most[1]
    phase += 1
    meet(s, scene, phase, threads)
    if t == 0:
        sweeps = ti.cast(most[0], ti.i32)
        for k in range(1, threads):
            other = touch.most[touch.order[q, f.THREAD] + k, f.WORST]
            sweeps = ti.max(sweeps, ti.cast(other, ti.i32))
        touch.order[q, f.ROWS] = touch.order[q, f.ROWS] + rows
        touch.order[q, f.SWEEPS] = touch.order[q, f.SWEEPS] + sweeps
    return phase
