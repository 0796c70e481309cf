# mypy: ignore-errors
"""What happens to one node in a substep: integration, held axes, contact with obstacles.

Symplectic Euler in the lectures' form, Δv = h a(x, v), Δx = h (v + Δv); explicit Euler moves with
the old velocity; velocity Verlet kicks by halves around each force (`substep` is its number in the
frame: the first only opens and the last only closes).

Contact corrects velocities (no penalty stiffness, so no smaller step).  A node that would end the
substep inside an obstacle loses what leads it past the surface; the impulse J of that lets Coulomb
friction take at most μ J from the tangential velocity.
"""

import taichi as ti

SYMPLECTIC_EULER, VELOCITY_VERLET, EXPLICIT_EULER = 0, 1, 2
PLANE, SPHERE, BOX = 0, 1, 2

A = ti.types.ndarray


@ti.func
def gap_and_normal(kind: ti.template(), shape: ti.template(), body, o, x):
    """Signed distance [m] from an obstacle's surface to x, and the direction it grows in.

    shape[body, o] holds, in the body's own coordinates: plane (normal, offset), sphere (center,
    radius), box (center, half size).
    """
    a = ti.Vector([shape[body, o, 0], shape[body, o, 1], shape[body, o, 2]])
    normal = a
    gap = normal.dot(x) - shape[body, o, 3]
    if kind[o] == SPHERE:
        d = x - a
        length = d.norm()
        gap = length - shape[body, o, 3]
        normal = ti.Vector([0.0 * length, 0.0 * length + 1.0, 0.0 * length])
        if length > 0.0:
            normal = d / length
    if kind[o] == BOX:
        d = x - a
        gap = -1e30 + 0.0 * gap
        outside = 0.0 * d
        for c in ti.static(range(3)):  # inside: the nearest face; outside: the nearest point
            past = ti.abs(d[c]) - shape[body, o, 3 + c]
            side = 1.0 if d[c] >= 0.0 else -1.0
            if past > gap:
                gap = past
                normal = 0.0 * d
                normal[c] = side
            outside[c] = side * ti.max(past, 0.0)
        if outside.norm() > 0.0:
            gap = outside.norm()
            normal = outside / gap
    return gap, normal


@ti.func
def collide(kind: ti.template(), shape: ti.template(), body, h, x, v):
    """Velocity after contact, and the push that puts a node from inside onto the surface [m]."""
    push = 0.0 * v
    for o in range(kind.shape[0]):
        gap, normal = gap_and_normal(kind, shape, body, o, x)
        along = normal.dot(v)
        allowed = -ti.max(gap, 0.0 * gap) / h  # the velocity that just reaches the surface
        if along < allowed:
            impulse = allowed - along
            tangential = v - along * normal
            speed = tangential.norm()
            keep = 0.0 * speed
            if speed > 0.0:
                keep = ti.max(1.0 - shape[body, o, 6] * impulse / speed, 0.0 * speed)
            v = keep * tangential + allowed * normal
        if gap < 0.0:
            push -= gap * normal
    return v, push


@ti.func
def node_force(
    i,
    tets: ti.template(),
    rows: ti.template(),
    loads: ti.template(),
    starts: ti.template(),
    corners: ti.template(),
    slots: ti.template(),
    lanes,
    force: ti.template(),
    load: ti.template(),
):
    """Force on node i [N]: its tets' corner forces in element order, springs, loads."""
    f = 0.0 * ti.Vector([load[0, 0], load[0, 0], load[0, 0]])
    if ti.static(rows):
        f += ti.Vector([force[i, 0], force[i, 1], force[i, 2]])
    if ti.static(tets):
        for q in range(starts[i], starts[i + 1]):
            k = corners[q]
            f[0] += slots[k]
            f[1] += slots[k + lanes]
            f[2] += slots[k + 2 * lanes]
    if ti.static(loads):
        f += ti.Vector([load[i, 0], load[i, 1], load[i, 2]])
    return f


@ti.func
def move_node(
    i,
    a,
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
):
    """Integrate node i with acceleration a [m/s²] over the substep h [s].

    Velocity Verlet keeps v(t + h/2) in `half` and leaves in `v` the prediction v(t + h) that the
    next viscous forces see; `opens` and `closes` say which of its two kicks are due.

    Returns what the ledger needs (see `work`): seconds of the kick, velocity before and after it,
    the jump of the velocity in contact, displacement, and push onto the surface [m].
    """
    old = ti.Vector([v[i, 0], v[i, 1], v[i, 2]])
    before = old
    new = old + h * a
    kick = h
    way = 0.0 * a
    if ti.static(integrator == VELOCITY_VERLET):
        new = old
        kick = 0.0 * h
        if closes:
            before = ti.Vector([half[i, 0], half[i, 1], half[i, 2]])
            new = before + 0.5 * h * a
            kick += 0.5 * h
            way += 0.5 * h * before
        if opens:
            kick += 0.5 * h
    ahead = new  # the velocity that moves the node
    if ti.static(integrator == VELOCITY_VERLET):
        ahead = new + 0.5 * h * a
    if ti.static(integrator == EXPLICIT_EULER):
        ahead = old
    shift = 0.0 * a
    jump = 0.0 * a
    if ti.static(contact):
        if held[i] != 7:
            x = ti.Vector([rest[i, 0] + u[i, 0], rest[i, 1] + u[i, 1], rest[i, 2] + u[i, 2]])
            free = ahead
            ahead, shift = collide(kind, shape, body, h, x, ahead)
            if ti.static(integrator == SYMPLECTIC_EULER):
                new = ahead
            if ti.static(integrator != EXPLICIT_EULER):
                jump = ahead - free
            if ti.static(integrator == VELOCITY_VERLET):
                if not opens:  # the velocity that a frame ends with does not lead inside either
                    free = new
                    new, shift = collide(kind, shape, body, h, x, new)
                    jump, shift = new - free, 0.0 * a
    for c in ti.static(range(3)):
        if held[i] & (1 << c):
            new[c] = drive[i, c]
            ahead[c] = drive[i, c]
            shift[c] = 0.0 * h
    after = new
    if ti.static(integrator == VELOCITY_VERLET):
        if opens:
            after = ahead
            way += 0.5 * h * ahead + shift
    else:
        way = h * ahead + shift
    for c in ti.static(range(3)):
        if ti.static(integrator == VELOCITY_VERLET):
            if opens:
                half[i, c] = ahead[c]
                u[i, c] = u[i, c] + (h * ahead[c] + shift[c])
                if not held[i] & (1 << c):
                    new[c] = ahead[c] + 0.5 * h * a[c]
            v[i, c] = new[c]
        else:
            v[i, c] = new[c]
            u[i, c] = u[i, c] + (h * ahead[c] + shift[c])
    return kick, before, after, jump, way, shift
