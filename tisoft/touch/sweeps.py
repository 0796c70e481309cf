# mypy: ignore-errors
"""Impulses of contact: Jacobi sweeps with masses split by weight, from zero in every substep.

    P = Σ_k |w_k| S_k/m_k,   S_i = Σ_rows |w_i|
    λ ← max(λ + (target − n·Jv)/P, 0),   λ_t ← λ_t − (Jv)_t/P, no longer than μ λ
    v_i = v_i* + Σ_rows w_i (λ n + λ_t)/m_i

P bounds the sums of the rows of A = J M⁻¹ Jᵀ, so that a sweep never gains energy where gaps close,
whatever the step; impulses are equal and opposite by construction.  Splitting the mass of a node
between contacts: Tonge, Benevolenski and Voroshilov (2012), there by count.  Each thread has its
own pairs and points, and sums have one order: no atomics on data, the same bits.
"""

import taichi as ti

from tisoft.model.threads import meet, share
from tisoft.touch import fields as f

LEAST_SWEEPS, MOST_SWEEPS = 4, 16
ALONE = 400
"""Rows below which one thread solves for them sooner than several that meet twice a sweep."""
LEVER = 0.1
"""Share of a row that its free points must have: with less, where the others are held, they would
be thrown to move it at all.
"""


@ti.func
def weigh(touch: ti.template(), q, t, threads):
    """S and rows of thread t's points, which it lists; returns how many."""
    low, high = touch.order[q, f.POINT], touch.order[q, f.POINT_END]
    begin = share(low, high, t, threads)
    n = 0
    for p in range(begin, share(low, high, t + 1, threads)):
        touch.weight[p] = 0.0
        if touch.met[p]:
            total, end = 0.0 * touch.weight[p], touch.slot_start[p]
            for k in range(touch.slot_start[p], touch.slot_start[p + 1]):
                c = touch.slot[k >> 2, k & 3]
                row = touch.near[c >> 2] - 1
                if row >= 0:
                    total += ti.abs(touch.share[row, c & 3])
                    touch.live[end >> 2, end & 3] = 4 * row + (c & 3)
                    end += 1
            touch.weight[p], touch.live_end[p] = total, end
            touch.touched[begin + n] = p
            n += 1
    return n


@ti.func
def soften(touch: ti.template(), row):
    """1/P of a row, once S is known."""
    inverse, free = 0.0 * touch.target[row], 0.0 * touch.target[row]
    for k in range(4):
        p, w = touch.corner[row, k], ti.abs(touch.share[row, k])
        inverse += w * touch.weight[p] * touch.inverse_mass[p]
        if touch.inverse_mass[p] > 0.0:
            free += w
    touch.mass[row] = 0.0
    if inverse > 0.0 and free > LEVER:
        touch.mass[row] = 1.0 / inverse


@ti.func
def push(touch: ti.template(), row):
    """One sweep of a row; returns how far it was from its target [m/s]."""
    n, mass = touch.normal[row], touch.mass[row]
    rate = touch.drift[row]
    for k in range(4):
        rate += touch.share[row, k] * touch.velocity[touch.corner[row, k]]
    along = rate.dot(n)
    short = 0.0 * along
    if mass > 0.0:
        short = touch.target[row] - along
        impulse = ti.max(touch.impulse[row] + short * mass, 0.0 * short)
        touch.impulse[row] = impulse
        most = touch.rough[row] * impulse
        grip = touch.grip[row] - (rate - along * n) * mass
        size = grip.norm()
        if size > most:
            grip *= most / size
        touch.grip[row] = grip
    return short


@ti.func
def gather(touch: ti.template(), p):
    """Impulses of all rows on point p, and its velocity."""
    pushed, rubbed = 0.0 * touch.velocity[p], 0.0 * touch.velocity[p]
    for k in range(touch.slot_start[p], touch.live_end[p]):
        c = touch.live[k >> 2, k & 3]
        w = touch.share[c >> 2, c & 3]
        pushed += w * touch.impulse[c >> 2] * touch.normal[c >> 2]
        rubbed += w * touch.grip[c >> 2]
    touch.pushed[p], touch.rubbed[p] = pushed, rubbed
    jump = (pushed + rubbed) * touch.inverse_mass[p]
    for d in ti.static(range(3)):
        if touch.held[p] & (1 << d):
            jump[d] = 0.0
    touch.velocity[p] = touch.kicked[p] + jump


@ti.func
def sweep(s: ti.template(), scene, q, t, threads, rows, phase, now):
    """Solve for the impulses of all `rows` rows; returns the phase that it has come to.  The first
    thread sees to few of them alone: it would wait for others longer than they help.
    """
    begun, crew, own = phase, threads, t
    if rows < ALONE:
        crew, own = 1, 0
    if t == own:
        phase = solve(s, scene, q, ti.Vector([own, crew, threads]), phase, now)
    if crew < threads:
        phase = begun + 1
        meet(s, scene, phase, threads)
    return phase


@ti.func
def solve(s: ti.template(), scene, q, hands, phase, now):
    """The same by some threads.

    Args: hands: number of this one, how many there are, and how many have rows.
    """
    touch = s.surfaces
    own, crew = hands[0], hands[1]
    low, high = own, own + 1
    if crew == 1:
        high = hands[2]
    count = weigh(touch, q, own, crew)
    thread = touch.order[q, f.THREAD]
    begin = share(touch.order[q, f.POINT], touch.order[q, f.POINT_END], own, crew)
    phase += 1
    meet(s, scene, phase, crew)
    tolerance = ti.cast(touch.length[q, f.TOLERANCE], touch.real) / now.h
    for k in range(thread + low, thread + high):
        for kind in range(2):
            first = touch.segment[k, 2 * kind]
            for row in range(first, first + touch.segment[k, f.FACES_NEAR + kind]):
                soften(touch, row)
    number = 0
    while number < MOST_SWEEPS:
        worst = 0.0 * tolerance
        for k in range(thread + low, thread + high):
            for kind in range(2):
                first = touch.segment[k, 2 * kind]
                for row in range(first, first + touch.segment[k, f.FACES_NEAR + kind]):
                    worst = ti.max(worst, push(touch, row))
        touch.most[thread + own, f.WORST] = worst
        phase += 1
        meet(s, scene, phase, crew)
        for k in range(crew):
            worst = ti.max(worst, touch.most[thread + k, f.WORST])
        for k in range(begin, begin + count):
            gather(touch, touch.touched[k])
        phase += 1
        meet(s, scene, phase, crew)
        number += 1
        if own == 0:
            touch.order[q, f.SWEEPS] = touch.order[q, f.SWEEPS] + 1
        if number >= LEAST_SWEEPS and worst < tolerance:
            number = MOST_SWEEPS
    return phase
