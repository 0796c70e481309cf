# mypy: ignore-errors
"""One launch a frame on the CPU: every thread walks through all substeps, meeting at barriers.

    substep: forces of the thread's tets (batches of lanes) and spring rows | barrier |
             sum, integrate and hold the thread's nodes                     | barrier

Threads own fixed ranges, an element writes only its own slots, and a node sums its slots in
element order: no atomics, and the same bits for any number of threads.  With one thread the
barriers vanish.  LLVM vectorises the loop over lanes because all that it touches is local:
positions and rest shapes are copied in first, corner forces are copied out after.
"""

import functools
from typing import Any

import taichi as ti

from tisoft.dynamics.nodes import move_node, node_force
from tisoft.dynamics.pressure import pressure_force
from tisoft.dynamics.work import move_and_book
from tisoft.models.consistent_mass import begin_solve, iterate_solve
from tisoft.models.laws import stress
from tisoft.models.rows import row_force

LANES = 8
CHUNK = 512
"""Iterations per thread of the outer loop: Taichi never cuts a chunk of this size in two."""


@ti.func
def meet(arrived: ti.template(), phase, threads):
    """Wait until all threads have come here for the `phase`-th time (counted from 1)."""
    if threads > 1:
        ti.atomic_add(arrived[0], 1)
        while ti.atomic_or(arrived[0], 0) < phase * threads:
            pass


@ti.func
def batch_forces(
    b,
    law: ti.template(),
    viscous: ti.template(),
    real: ti.template(),
    nodes: ti.template(),
    shapes: ti.template(),
    owner: ti.template(),
    material: ti.template(),
    u: ti.template(),
    v: ti.template(),
    slots: ti.template(),
    apart: ti.template(),
    still_slots: ti.template(),
):
    """Corner forces [N] of the LANES tets of batch b into their slots; where they are to be told
    `apart`, those without viscosity into `still_slots`.
    """
    ul = ti.Matrix.zero(real, 12, LANES)
    vl = ti.Matrix.zero(real, 12, LANES)
    rest = ti.Matrix.zero(real, 10, LANES)
    out = ti.Matrix.zero(real, 12, LANES)
    still = ti.Matrix.zero(real, 12, LANES)
    for k in ti.static(range(10)):
        row = shapes[b, k]
        for lane in ti.static(range(LANES)):
            rest[k, lane] = row[lane]
    for lane in range(LANES):
        for c in ti.static(range(4)):
            i = nodes[b, c, lane]
            for d in ti.static(range(3)):
                ul[3 * c + d, lane] = u[i, d]
                if ti.static(viscous):
                    vl[3 * c + d, lane] = v[i, d]
    m = owner[b]
    lam, mu = material[m, 0], material[m, 1]
    phi, eta = material[m, 2], material[m, 3]
    for lane in range(LANES):
        N = ti.Matrix([[rest[3 * c + d, lane] for d in range(3)] for c in range(3)])  # ∇N_1..3
        du = ti.Matrix(
            [[ul[3 * c + 3 + d, lane] - ul[d, lane] for c in range(3)] for d in range(3)]
        )
        H = du @ N
        D = 0.0 * H
        if ti.static(viscous):
            dv = ti.Matrix(
                [[vl[3 * c + 3 + d, lane] - vl[d, lane] for c in range(3)] for d in range(3)]
            )
            D = dv @ N
        f = -rest[9, lane] * (stress(law, viscous, H, D, lam, mu, phi, eta) @ N.transpose())
        for d in ti.static(range(3)):
            out[d, lane] = -(f[d, 0] + f[d, 1] + f[d, 2])
            for c in ti.static(range(3)):
                out[3 * c + 3 + d, lane] = f[d, c]
        if ti.static(apart):
            g = -rest[9, lane] * (stress(law, False, H, D, lam, mu, phi, eta) @ N.transpose())
            for d in ti.static(range(3)):
                still[d, lane] = -(g[d, 0] + g[d, 1] + g[d, 2])
                for c in ti.static(range(3)):
                    still[3 * c + 3 + d, lane] = g[d, c]
    for k in range(12):  # a run-time row keeps `out` in memory, and so the loop above vectorised
        slots[b, k] = ti.Vector([out[k, lane] for lane in ti.static(range(LANES))])
    if ti.static(apart):
        for k in range(12):
            still_slots[b, k] = ti.Vector([still[k, lane] for lane in ti.static(range(LANES))])


@functools.cache
def advance_kernel(real: Any) -> Any:
    """The kernel `advance` for ti.f32 or ti.f64 (a batch row's type holds its number)."""
    A = ti.types.ndarray
    Rows = ti.types.ndarray(dtype=ti.types.vector(LANES, real), ndim=2)

    @ti.kernel
    def advance(
        first_pass: int,
        last_pass: int,
        substeps: int,
        threads: int,
        alone: ti.template(),
        laws: ti.template(),
        viscous: ti.template(),
        springs: ti.template(),
        tensors: ti.template(),
        iterations: ti.template(),
        loads: ti.template(),
        pressure: ti.template(),
        contact: ti.template(),
        integrator: ti.template(),
        ledger: ti.template(),
        params: A(),
        u: A(),
        v: A(),
        half: A(),
        rest: A(),
        inverse_mass: A(),
        body: A(),
        material: A(),
        held: A(),
        drive: A(),
        load: A(),
        force: A(),
        pressure_starts: A(),
        pressure_ends: A(),
        pressure_data: A(),
        pressed: A(),
        law_starts: A(),
        nodes: A(),
        shapes: Rows,
        owner: A(),
        slots: Rows,
        flat: A(),
        still_slots: Rows,
        still_flat: A(),
        still: A(),
        work: A(),
        starts: A(),
        corners: A(),
        spring_starts: A(),
        spring_ends: A(),
        spring_data: A(),
        tensor_starts: A(),
        tensor_ends: A(),
        stiffness: A(),
        viscosity: A(),
        mass_starts: A(),
        mass_ends: A(),
        mass_entries: A(),
        diagonal: A(),
        acceleration: A(),
        residual: A(),
        direction: A(),
        kind: A(),
        shape: A(),
        arrived: A(),
    ):
        if ti.static(alone):  # on the caller's thread: a hand-over costs as much as a small frame
            ti.loop_config(serialize=True)
        for item in range(threads * CHUNK):
            if item % CHUNK == 0:
                t = item // CHUNK
                phase = 0
                count = u.shape[0]
                first, last = count * t // threads, count * (t + 1) // threads
                h = params[0]
                gravity = ti.Vector([params[1], params[2], params[3]])
                for s in range(first_pass, last_pass):
                    for law in ti.static(laws):
                        size = law_starts[law + 1] - law_starts[law]
                        low = law_starts[law] + size * t // threads
                        high = law_starts[law] + size * (t + 1) // threads
                        for b in range(low, high):
                            batch_forces(
                                b,
                                law,
                                viscous,
                                real,
                                nodes,
                                shapes,
                                owner,
                                material,
                                u,
                                v,
                                slots,
                                ti.static(ledger and viscous),
                                still_slots,
                            )
                    if ti.static(springs or tensors):
                        for i in range(first, last):
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
                    if ti.static((springs or tensors) and ledger and viscous):
                        # A loop of its own: Taichi 1.7.4 merges it with the one above within one.
                        for i in range(first, last):
                            f = row_force(
                                i,
                                False,
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
                                still[i, c] = f[c]
                    if ti.static(pressure):
                        for i in range(first, last):
                            f = pressure_force(i, pressure_starts, pressure_ends, pressure_data, u)
                            for c in ti.static(range(3)):
                                pressed[i, c] = f[c]
                    phase += 1
                    meet(arrived, phase, threads)
                    for i in range(first, last):
                        f = node_force(
                            i,
                            ti.static(len(laws) > 0),
                            ti.static(springs or tensors),
                            loads,
                            starts,
                            corners,
                            flat,
                            LANES,
                            force,
                            load,
                        )
                        if ti.static(pressure):
                            f += ti.Vector([pressed[i, 0], pressed[i, 1], pressed[i, 2]])
                        a = f * inverse_mass[i] + gravity
                        for c in ti.static(range(3)):
                            a[c] -= material[body[i], 4] * v[i, c]
                        if ti.static(iterations > 0):
                            begin_solve(
                                i,
                                a / inverse_mass[i],
                                held[i],
                                diagonal,
                                acceleration,
                                residual,
                                direction,
                            )
                        elif ti.static(ledger):
                            move_and_book(
                                i,
                                a,
                                f,
                                s < substeps,
                                s > 0,
                                h,
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
                                ti.static(len(laws) > 0),
                                ti.static(springs or tensors),
                                loads,
                                pressure,
                                LANES,
                                gravity,
                                inverse_mass,
                                material,
                                starts,
                                corners,
                                still_flat,
                                still,
                                load,
                                pressed,
                                work,
                            )
                        else:
                            move_node(
                                i,
                                a,
                                s < substeps,
                                s > 0,
                                h,
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
                    if ti.static(iterations > 0):
                        for k in range(iterations):
                            phase += 1
                            meet(arrived, phase, threads)
                            for i in range(first, last):
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
                        for i in range(first, last):  # a node's acceleration is its own by now
                            a = ti.Vector(
                                [acceleration[i, 0], acceleration[i, 1], acceleration[i, 2]]
                            )
                            if ti.static(ledger):
                                f = node_force(
                                    i,
                                    ti.static(len(laws) > 0),
                                    ti.static(springs or tensors),
                                    loads,
                                    starts,
                                    corners,
                                    flat,
                                    LANES,
                                    force,
                                    load,
                                )
                                if ti.static(pressure):
                                    f += ti.Vector([pressed[i, 0], pressed[i, 1], pressed[i, 2]])
                                move_and_book(
                                    i,
                                    a,
                                    f,
                                    s < substeps,
                                    s > 0,
                                    h,
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
                                    ti.static(len(laws) > 0),
                                    ti.static(springs or tensors),
                                    loads,
                                    pressure,
                                    LANES,
                                    gravity,
                                    inverse_mass,
                                    material,
                                    starts,
                                    corners,
                                    still_flat,
                                    still,
                                    load,
                                    pressed,
                                    work,
                                )
                            else:
                                move_node(
                                    i,
                                    a,
                                    s < substeps,
                                    s > 0,
                                    h,
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
                    phase += 1
                    meet(arrived, phase, threads)

    return advance
