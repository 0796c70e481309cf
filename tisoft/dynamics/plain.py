# mypy: ignore-errors
"""Forces and moves by plain loops over tets and nodes: for GPUs, and for forces without a step.

The same formulae as `advance`, one tet per iteration instead of a batch of lanes.  A tet writes its
corner forces to its own slots, a node sums its slots in element order, as there.
"""

import taichi as ti

from tisoft.dynamics.nodes import move_node, node_force
from tisoft.dynamics.pressure import pressure_force
from tisoft.dynamics.work import move_and_book
from tisoft.models.consistent_mass import begin_solve, iterate_solve
from tisoft.models.laws import stress
from tisoft.models.rows import row_force

A = ti.types.ndarray


@ti.func
def corner_forces(
    b,
    lane,
    law: ti.template(),
    viscous: ti.template(),
    lanes: ti.template(),
    nodes: ti.template(),
    shapes: ti.template(),
    owner: ti.template(),
    material: ti.template(),
    u: ti.template(),
    v: ti.template(),
    slots: ti.template(),
):
    """Corner forces [N] of the tet in batch b, lane `lane`, into its slots."""
    N = ti.Matrix([[shapes[b, 3 * c + d, lane] for d in range(3)] for c in range(3)])  # ∇N_1..3
    i = nodes[b, 0, lane]
    du = ti.Matrix([[u[nodes[b, c + 1, lane], d] - u[i, d] for c in range(3)] for d in range(3)])
    H = du @ N
    D = 0.0 * H
    if ti.static(viscous):
        dv = ti.Matrix(
            [[v[nodes[b, c + 1, lane], d] - v[i, d] for c in range(3)] for d in range(3)]
        )
        D = dv @ N
    m = owner[b]
    P = stress(law, viscous, H, D, material[m, 0], material[m, 1], material[m, 2], material[m, 3])
    f = -shapes[b, 9, lane] * (P @ N.transpose())
    first = b * (12 * lanes) + lane
    for d in ti.static(range(3)):
        slots[first + d * lanes] = -(f[d, 0] + f[d, 1] + f[d, 2])
        for c in ti.static(range(3)):
            slots[first + (3 * c + 3 + d) * lanes] = f[d, c]


@ti.kernel
def tet_forces(
    laws: ti.template(),
    viscous: ti.template(),
    lanes: ti.template(),
    law_starts: A(),
    nodes: A(),
    shapes: A(),
    owner: A(),
    material: A(),
    u: A(),
    v: A(),
    slots: A(),
):
    """Corner forces [N] of all tets into `slots`, shape (batches · 12 · lanes,)."""
    for law in ti.static(laws):
        for k in range(law_starts[law] * lanes, law_starts[law + 1] * lanes):
            corner_forces(
                k // lanes,
                k % lanes,
                law,
                viscous,
                lanes,
                nodes,
                shapes,
                owner,
                material,
                u,
                v,
                slots,
            )


@ti.kernel
def row_forces(
    viscous: ti.template(),
    springs: ti.template(),
    tensors: ti.template(),
    u: A(),
    v: A(),
    force: A(),
    spring_starts: A(),
    spring_ends: A(),
    spring_data: A(),
    tensor_starts: A(),
    tensor_ends: A(),
    stiffness: A(),
    viscosity: A(),
):
    """Forces [N] of springs and mass-tensor rows on each node, into `force`, shape (nodes, 3)."""
    for i in range(u.shape[0]):
        f = row_force(
            i,
            viscous,
            springs,
            tensors,
            spring_starts,
            spring_ends,
            spring_data,
            tensor_starts,
            tensor_ends,
            stiffness,
            viscosity,
            u,
            v,
        )
        for c in ti.static(range(3)):
            force[i, c] = f[c]


@ti.kernel
def sum_forces(
    tets: ti.template(),
    rows: ti.template(),
    lanes: ti.template(),
    starts: A(),
    corners: A(),
    slots: A(),
    force: A(),
    total: A(),
):
    """What elements do to each node [N]: its tets' corner forces and its rows, into `total`."""
    for i in range(total.shape[0]):
        f = node_force(i, tets, rows, False, starts, corners, slots, lanes, force, total)
        for c in ti.static(range(3)):
            total[i, c] = f[c]


@ti.kernel
def pressure_forces(starts: A(), ends: A(), data: A(), u: A(), pressed: A()):
    """Forces [N] of the pressures on each node, into `pressed`, shape (nodes, 3)."""
    for i in range(u.shape[0]):
        f = pressure_force(i, starts, ends, data, u)
        for c in ti.static(range(3)):
            pressed[i, c] = f[c]


@ti.func
def total_force(
    i,
    tets: ti.template(),
    rows: ti.template(),
    loads: ti.template(),
    pressure: ti.template(),
    lanes: ti.template(),
    force: ti.template(),
    load: ti.template(),
    pressed: ti.template(),
    starts: ti.template(),
    corners: ti.template(),
    slots: ti.template(),
):
    """Force of elements and loads on node i [N]."""
    f = node_force(i, tets, rows, loads, starts, corners, slots, lanes, force, load)
    if ti.static(pressure):
        f += ti.Vector([pressed[i, 0], pressed[i, 1], pressed[i, 2]])
    return f


@ti.func
def node_acceleration(
    i,
    tets: ti.template(),
    rows: ti.template(),
    loads: ti.template(),
    pressure: ti.template(),
    lanes: ti.template(),
    params: ti.template(),
    v: ti.template(),
    inverse_mass: ti.template(),
    body: ti.template(),
    material: ti.template(),
    force: ti.template(),
    load: ti.template(),
    pressed: ti.template(),
    starts: ti.template(),
    corners: ti.template(),
    slots: ti.template(),
):
    """f/m + g − (point damping) v of node i [m/s²], m the lumped mass."""
    f = total_force(
        i, tets, rows, loads, pressure, lanes, force, load, pressed, starts, corners, slots
    )
    a = f * inverse_mass[i] + ti.Vector([params[1], params[2], params[3]])
    for c in ti.static(range(3)):
        a[c] -= material[body[i], 4] * v[i, c]
    return a


@ti.kernel
def move_nodes(
    opens: int,
    closes: int,
    tets: ti.template(),
    rows: ti.template(),
    loads: ti.template(),
    pressure: ti.template(),
    lanes: ti.template(),
    contact: ti.template(),
    integrator: ti.template(),
    viscous: ti.template(),
    ledger: ti.template(),
    params: A(),
    v: A(),
    inverse_mass: A(),
    body: A(),
    material: A(),
    held: A(),
    force: A(),
    load: A(),
    pressed: A(),
    starts: A(),
    corners: A(),
    slots: A(),
    u: A(),
    half: A(),
    rest: A(),
    drive: A(),
    still_slots: A(),
    still: A(),
    work: A(),
    kind: A(),
    shape: A(),
):
    """Sum, integrate and hold all nodes of lumped mass."""
    for i in range(u.shape[0]):
        a = node_acceleration(
            i,
            tets,
            rows,
            loads,
            pressure,
            lanes,
            params,
            v,
            inverse_mass,
            body,
            material,
            force,
            load,
            pressed,
            starts,
            corners,
            slots,
        )
        move(
            i,
            a,
            opens != 0,
            closes != 0,
            tets,
            rows,
            loads,
            pressure,
            lanes,
            contact,
            integrator,
            viscous,
            ledger,
            params,
            v,
            inverse_mass,
            body,
            material,
            held,
            force,
            load,
            pressed,
            starts,
            corners,
            slots,
            u,
            half,
            rest,
            drive,
            still_slots,
            still,
            work,
            kind,
            shape,
        )


@ti.func
def move(
    i,
    a,
    opens,
    closes,
    tets: ti.template(),
    rows: ti.template(),
    loads: ti.template(),
    pressure: ti.template(),
    lanes: ti.template(),
    contact: ti.template(),
    integrator: ti.template(),
    viscous: ti.template(),
    ledger: ti.template(),
    params: ti.template(),
    v: ti.template(),
    inverse_mass: ti.template(),
    body: ti.template(),
    material: ti.template(),
    held: ti.template(),
    force: ti.template(),
    load: ti.template(),
    pressed: ti.template(),
    starts: ti.template(),
    corners: ti.template(),
    slots: ti.template(),
    u: ti.template(),
    half: ti.template(),
    rest: ti.template(),
    drive: ti.template(),
    still_slots: ti.template(),
    still: ti.template(),
    work: ti.template(),
    kind: ti.template(),
    shape: ti.template(),
):
    """Integrate and hold node i, with its entries in the ledger where there is one."""
    if ti.static(ledger):
        f = total_force(
            i, tets, rows, loads, pressure, lanes, force, load, pressed, starts, corners, slots
        )
        move_and_book(
            i,
            a,
            f,
            opens,
            closes,
            params[0],
            integrator,
            contact,
            rest,
            u,
            v,
            half,
            body[i],
            held,
            drive,
            kind,
            shape,
            viscous,
            tets,
            rows,
            loads,
            pressure,
            lanes,
            ti.Vector([params[1], params[2], params[3]]),
            inverse_mass,
            material,
            starts,
            corners,
            still_slots,
            still,
            load,
            pressed,
            work,
        )
    else:
        move_node(
            i,
            a,
            opens,
            closes,
            params[0],
            integrator,
            contact,
            rest,
            u,
            v,
            half,
            body[i],
            held,
            drive,
            kind,
            shape,
        )


@ti.kernel
def begin_solves(
    tets: ti.template(),
    rows: ti.template(),
    loads: ti.template(),
    pressure: ti.template(),
    lanes: ti.template(),
    params: A(),
    v: A(),
    inverse_mass: A(),
    body: A(),
    material: A(),
    held: A(),
    force: A(),
    load: A(),
    pressed: A(),
    starts: A(),
    corners: A(),
    slots: A(),
    diagonal: A(),
    acceleration: A(),
    residual: A(),
    direction: A(),
):
    """Sum the nodes' forces and begin the solve with the consistent mass."""
    for i in range(v.shape[0]):
        a = node_acceleration(
            i,
            tets,
            rows,
            loads,
            pressure,
            lanes,
            params,
            v,
            inverse_mass,
            body,
            material,
            force,
            load,
            pressed,
            starts,
            corners,
            slots,
        )
        begin_solve(i, a / inverse_mass[i], held[i], diagonal, acceleration, residual, direction)


@ti.kernel
def iterate_solves(
    k: int,
    held: A(),
    mass_starts: A(),
    mass_ends: A(),
    mass_entries: A(),
    diagonal: A(),
    acceleration: A(),
    residual: A(),
    direction: A(),
):
    """Iteration k (from 0) of the solve with the consistent mass."""
    for i in range(held.shape[0]):
        iterate_solve(
            i,
            k,
            held[i],
            mass_starts,
            mass_ends,
            mass_entries,
            diagonal,
            acceleration,
            residual,
            direction,
        )


@ti.kernel
def move_solved(
    opens: int,
    closes: int,
    tets: ti.template(),
    rows: ti.template(),
    loads: ti.template(),
    pressure: ti.template(),
    lanes: ti.template(),
    contact: ti.template(),
    integrator: ti.template(),
    viscous: ti.template(),
    ledger: ti.template(),
    params: A(),
    v: A(),
    inverse_mass: A(),
    body: A(),
    material: A(),
    held: A(),
    force: A(),
    load: A(),
    pressed: A(),
    starts: A(),
    corners: A(),
    slots: A(),
    u: A(),
    half: A(),
    rest: A(),
    drive: A(),
    still_slots: A(),
    still: A(),
    work: A(),
    kind: A(),
    shape: A(),
    acceleration: A(),
):
    """Integrate and hold all nodes with the accelerations of the solve."""
    for i in range(u.shape[0]):
        a = ti.Vector([acceleration[i, 0], acceleration[i, 1], acceleration[i, 2]])
        move(
            i,
            a,
            opens != 0,
            closes != 0,
            tets,
            rows,
            loads,
            pressure,
            lanes,
            contact,
            integrator,
            viscous,
            ledger,
            params,
            v,
            inverse_mass,
            body,
            material,
            held,
            force,
            load,
            pressed,
            starts,
            corners,
            slots,
            u,
            half,
            rest,
            drive,
            still_slots,
            still,
            work,
            kind,
            shape,
        )
