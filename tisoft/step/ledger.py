# mypy: ignore-errors
"""What a substep does to the energy of a node: the ledger's entries, in f64 per node.

With v and v' the velocities around a kick of k seconds by the force f = f_c + f_d + f_e
(conservative, dissipating, external), J = m (v' − v) − k f the impulse of contact or of a pin, and
d the displacement, the kinetic energy changes by exactly (k f + J)·(v + v')/2.  Of this

    dissipated     D = −k f_d·(v + v')/2,  contact  −J·((v + v')/2 − w)
    external work  W = f_e·d,              moved pins  J·(v + v')/2,  moved obstacles  J·w,
                                           pushes out of obstacles  −(f_c + f_e)·push

Then T + V + D − W differs from its start by −(h/2) v·f alone, f = −∂V/∂x with loads: the swing of
symplectic Euler, O(h), which does not grow (its conserved energy is T + V + (h/2) v·f), and by
O(h²) with velocity Verlet.  A force held for the substep does exactly f_e·d of work; a hand, whose
force follows the node, k f_e·(v + v')/2.
"""

import taichi as ti

from tisoft.step import external


@ti.func
def note(s: ti.template(), i, elements, moved, old, now):
    """Add node i's dissipated energy and external work [J] of a pass to state.work, but for what
    viscosity takes (`heat`).

    Args: elements: their force [N]; moved: what the integrator returned; old: velocity before the
    pass [m/s].
    """
    acts = s.state.drag[s.state.body[i]] != 0.0 or now.loaded or s.state.fixed[i] != 0
    if ti.static(s.contact):
        acts = True
    if acts:
        note_acting(s, i, elements, moved, old, now)


@ti.func
def note_acting(s: ti.template(), i, elements, moved, old, now):
    """The same where something acts on node i."""
    state, kick = s.state, s.integrator.kick(now)
    mass = 1.0 / state.inverse_mass[i]
    load = external.force(state, i, now)
    drag = -state.drag[state.body[i]] * mass * old
    mean = 0.5 * (moved.before + moved.after)
    taken, given = -kick * drag.dot(mean), load.dot(moved.way)
    if now.loaded:  # a hand's force changes as the node moves: what it gives is its kick's work
        given += state.drawn[i].dot(kick * mean - moved.way)
    kept = elements + mass * now.gravity + load
    bits = state.fixed[i]
    if bits:
        for c in ti.static(range(3)):
            if bits & (1 << c):
                impulse = mass * (moved.after[c] - moved.before[c])
                given += (impulse - kick * (kept[c] + drag[c])) * mean[c]
    if ti.static(s.contact):
        for c in ti.static(range(3)):
            if not bits & (1 << c):
                given -= kept[c] * moved.push[c]
        if bits != 7 and (moved.jump != 0.0).any():
            met = mass * state.carried[i]
            given += met[0]
            for c in ti.static(range(3)):
                if not bits & (1 << c):
                    met -= mass * mean[c] * ti.Vector([moved.jump[c], state.rubbed[i][c]])
            taken += met[0]
            state.touched[i][0] = state.touched[i][0] + met[0] - met[1]
            state.touched[i][1] = state.touched[i][1] + met[1]
    state.work[i][0] = state.work[i][0] + taken
    state.work[i][1] = state.work[i][1] + given


@ti.func
def note_carried(state: ti.template(), i, work):
    """Count work [J] of moving obstacles' surfaces on node i, along normals and by friction, as
    external: J·w of J·(v + v')/2, which `note_touch` takes for lost.
    """
    state.work[i][0] = state.work[i][0] + work[0] + work[1]
    state.work[i][1] = state.work[i][1] + work[0] + work[1]
    state.touched[i][0] = state.touched[i][0] + work[0]
    state.touched[i][1] = state.touched[i][1] + work[1]


@ti.func
def note_touch(state: ti.template(), i, moved, pushed, rubbed):
    """Add what other surfaces did to node i, pushed and rubbed [m/s]: −m J·(v + v')/2 each to
    state.touched; what a held component takes up is its pin's work.
    """
    mass = 1.0 / state.inverse_mass[i]
    mean = 0.5 * (moved.before + moved.after)
    contact, friction = -mass * pushed.dot(mean), -mass * rubbed.dot(mean)
    bits = state.fixed[i]
    for c in ti.static(range(3)):
        if bits & (1 << c):
            state.work[i][1] = state.work[i][1] - mass * (pushed[c] + rubbed[c]) * mean[c]
    state.work[i][0] = state.work[i][0] + contact + friction
    state.touched[i][0] = state.touched[i][0] + contact
    state.touched[i][1] = state.touched[i][1] + friction
