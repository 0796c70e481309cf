# mypy: ignore-errors
"""Pins that hold a cage's surface where it lies on no plane of nodes: of each cell of the patch the
mean displacement does what the pin says, c·u = U, c_a = ∫ N_a dA / ∫ dA.

After the nodes have moved, impulses along c take away what the means' velocities have too much,

    λ = (C M⁻¹ Cᵀ)⁻¹ (C v − V),   v −= M⁻¹ Cᵀ λ,   x −= h M⁻¹ Cᵀ λ

which keeps the stable step, and lets the cells bend as the mesh can.  The inverse is made when the
pins change.  What rounding leaves of c·u − U of a still pin goes back slowly.

| symbol | name                  | unit |
| ------ | --------------------- | ---- |
| C      | `means.node`, `.share` | 1   |
| V      | `wanted`              | m/s  |
| λ      | `means.push`          | N·s  |
"""

import taichi as ti

from tisoft.model.means import CORNERS, PATH, STILL
from tisoft.model.state import HELD_MEANS, INPUTS
from tisoft.step.driving import signal
from tisoft.step.fixed import free

BACK = 0.05
"""Share of a mean's distance from where it is held that a substep takes away."""


@ti.func
def hold(s: ti.template(), scene, column, now):
    """Let all means do what pins say, in pass `column` of the launch.

    Reads means, inputs, inverse_mass, fixed; changes velocity, half, displacement, work.
    """
    if ti.static(s.integrator.closing_passes > 0):
        if now.opens:
            take_away(s, s.state.half, scene, column, now, True, True)
        take_away(s, s.state.velocity, scene, column, now, not now.opens, False)
    else:
        take_away(s, s.state.velocity, scene, column, now, True, True)


@ti.func
def take_away(s: ti.template(), velocity: ti.template(), scene, column, now, counts, moves):
    """Take away what the means of a field of velocities have too much; `moves`: by these the nodes
    have moved; `counts`: by these, or they end a stretch.
    """
    first, last = s.state.ranges[scene, HELD_MEANS], s.state.ranges[scene, HELD_MEANS + 1]
    for k in range(first, last):
        v, u = 0.0 * s.means.target[k], -s.means.target[k]
        for a in range(CORNERS):
            i, share = s.means.node[k, a], s.means.share[k, a]
            v += share * velocity[i]
            u += share * s.state.displacement[i]
        if s.means.motion[k, 0] != STILL:
            v -= wanted(s, scene, k, column)
        elif moves:
            v += BACK * (u / now.h - v)  # where it was before it moved
        s.means.excess[k] = ti.cast(v, s.means.wide)
    for k in range(first, last):
        low, place = s.means.group[k, 0], s.means.group[k, 2]
        push = 0.0 * s.means.excess[k]
        for j in range(low, s.means.group[k, 1]):
            push += s.means.inverse[place + j - low] * s.means.excess[j]
        s.means.push[k] = push
    for k in range(first, last):
        push = ti.cast(s.means.push[k], s.state.real)
        for a in range(CORNERS):
            i, share = s.means.node[k, a], s.means.share[k, a]
            change = free(s.state, i, -share * s.state.inverse_mass[i] * push)
            old = velocity[i]
            velocity[i] = old + change
            way = 0.0 * change
            if moves:
                way = now.h * change
                s.state.displacement[i] = s.state.displacement[i] + way
            if ti.static(s.ledger):
                if counts:
                    note(s, i, old, change, way, now)


@ti.func
def wanted(s: ti.template(), scene, k, column):
    """V [m/s] of mean k, which moves."""
    v = 0.0 * s.means.target[k]
    if ti.static(s.driven):
        row, number = s.state.ranges[scene, INPUTS], s.means.motion[k, 1]
        if s.means.motion[k, 0] == PATH:
            for c in ti.static(range(3)):
                v[c] = ti.cast(signal(s, row, number + c, column), s.means.real)
        else:
            one = ti.cast(signal(s, row, number, column), s.means.real)
            two = ti.cast(signal(s, row, number + 1, column), s.means.real)
            v = one * s.means.along[k] + two * s.means.across[k]
    return v


@ti.func
def note(s: ti.template(), i, old, change, way, now):
    """Add the pin's work at node i, m Δv·(v + Δv/2 − a/2 · kick), and its loads' [J] (`ledger`)."""
    kick, pull = s.integrator.kick(now), s.state.pull[i]
    given = change.dot(old + 0.5 * change - 0.5 * kick * pull) / s.state.inverse_mass[i]
    if now.loaded:
        given += (s.state.load[i] + s.state.pressed[i]).dot(way)
    s.state.work[i][1] = s.state.work[i][1] + given
