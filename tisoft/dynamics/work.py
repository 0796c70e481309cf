# mypy: ignore-errors
"""What a substep does to the energy of a node: the ledger's entries, in f64 per node.

With v and v' the velocities around a kick of k seconds by the force f = f_c + f_d + f_e
(conservative, dissipating, external), J = m (v' − v) − k f the impulse of contact or of a pin, and
d the displacement, the kinetic energy changes by exactly (k f + J)·(v + v')/2.  Of this

    dissipated     D = −k f_d·(v + v')/2,  contact  −J·(v + v')/2 + (f_c + f_e)·(push out of it)
    external work  W = f_e·d,              moved pins  J·(v + v')/2

Then T + V + D − W differs from its start by −(h/2) v·f alone, f = −∂V/∂x with loads: the swing of
symplectic Euler, O(h), which does not grow (its conserved energy is T + V + (h/2) v·f), and by
O(h²) with velocity Verlet.  A force held for the substep does exactly f_e·d of work.
"""

import taichi as ti

from tisoft.dynamics.nodes import move_node, node_force


@ti.func
def split_force(
    i,
    f,
    mass,
    damping,
    gravity,
    viscous: ti.template(),
    tets: ti.template(),
    rows: ti.template(),
    starts: ti.template(),
    corners: ti.template(),
    slots: ti.template(),
    lanes,
    still: ti.template(),
    v: ti.template(),
):
    """Conservative and dissipating part [N] of the elements' force f, with weight and damping.

    `slots` and `still` hold the elements' forces without viscosity.
    """
    kept = f
    if ti.static(viscous):
        kept = node_force(i, tets, rows, False, starts, corners, slots, lanes, still, still)
    lost = f - kept
    for c in ti.static(range(3)):
        lost[c] -= damping * mass * v[i, c]
    return kept + mass * gravity, lost


@ti.func
def note_work(
    i, mass, kick, before, after, jump, way, shift, held, kept, lost, push, work: ti.template()
):
    """Add node i's dissipated energy and external work [J] of a substep to `work`.

    kick, before, after, jump, way and shift are what `move_node` returns.
    """
    mean = 0.5 * (before + after)
    taken = -kick * lost.dot(mean)
    given = 0.0 * taken
    for c in ti.static(range(3)):
        given += push[c] * way[c]
        if held & (1 << c):
            impulse = mass * (after[c] - before[c]) - kick * (kept[c] + lost[c] + push[c])
            given += impulse * mean[c]
        else:
            taken += (kept[c] + push[c]) * shift[c] - mass * jump[c] * mean[c]
    work[i, 0] = work[i, 0] + taken
    work[i, 1] = work[i, 1] + given


@ti.func
def move_and_book(
    i,
    a,
    f,
    opens,
    closes,
    h,
    integrator: ti.template(),
    contact: ti.template(),
    rest: ti.template(),
    u: ti.template(),
    v: ti.template(),
    half: ti.template(),
    body,
    held: ti.template(),
    drive: ti.template(),
    kind: ti.template(),
    shape: ti.template(),
    viscous: ti.template(),
    tets: ti.template(),
    rows: ti.template(),
    loads: ti.template(),
    pressure: ti.template(),
    lanes: ti.template(),
    gravity,
    inverse_mass: ti.template(),
    material: ti.template(),
    starts: ti.template(),
    corners: ti.template(),
    still_slots: ti.template(),
    still: ti.template(),
    load: ti.template(),
    pressed: ti.template(),
    work: ti.template(),
):
    """`move_node`, and its entries in the ledger; f is the force of elements and loads [N]."""
    mass = 1.0 / inverse_mass[i]
    push = 0.0 * f
    for c in ti.static(range(3)):
        if ti.static(loads):
            push[c] += load[i, c]
        if ti.static(pressure):
            push[c] += pressed[i, c]
    kept, lost = split_force(
        i,
        f - push,
        mass,
        material[body, 4],
        gravity,
        viscous,
        tets,
        rows,
        starts,
        corners,
        still_slots,
        lanes,
        still,
        v,
    )
    kick, before, after, jump, way, shift = move_node(
        i,
        a,
        opens,
        closes,
        h,
        integrator,
        contact,
        rest,
        u,
        v,
        half,
        body,
        held,
        drive,
        kind,
        shape,
    )
    note_work(i, mass, kick, before, after, jump, way, shift, held[i], kept, lost, push, work)
