"""Substeps as a few plain launches each: what GPUs run instead of the one launch of `advance`.

The order of things in a substep is that of `advance`, and so are the functions of nodes and laws;
positions, velocities and bits differ from it by rounding alone.
"""

from collections.abc import Callable
from typing import Any

import taichi as ti

from tisoft import runtime
from tisoft.dynamics import plain
from tisoft.dynamics.energy import row_arguments, tet_arguments
from tisoft.dynamics.nodes import move_node, node_force
from tisoft.dynamics.system import System
from tisoft.models.consistent_mass import ITERATIONS, begin_solve, iterate_solve

A = ti.types.ndarray


@ti.func
def node_acceleration(i, tets: ti.template(), rows: ti.template(), loads: ti.template(),
                      lanes: ti.template(), params: ti.template(), v: ti.template(),
                      inverse_mass: ti.template(), body: ti.template(), material: ti.template(),
                      force: ti.template(), load: ti.template(), starts: ti.template(),
                      corners: ti.template(), slots: ti.template()):
    """f/m + g − (point damping) v of node i [m/s²], m the lumped mass."""
    f = node_force(i, tets, rows, loads, starts, corners, slots, lanes, force, load)
    a = f * inverse_mass[i] + ti.Vector([params[1], params[2], params[3]])
    for c in ti.static(range(3)):
        a[c] -= material[body[i], 4] * v[i, c]
    return a


@ti.kernel
def move_nodes(
    opens: int, closes: int,
    tets: ti.template(), rows: ti.template(), loads: ti.template(), contact: ti.template(),
    integrator: ti.template(), lanes: ti.template(),
    params: A(), u: A(), v: A(), half: A(), rest: A(), inverse_mass: A(), body: A(), material: A(),
    held: A(), drive: A(), force: A(), load: A(), starts: A(), corners: A(), slots: A(),
    kind: A(), shape: A(),
):
    """Sum, integrate and hold all nodes of lumped mass."""
    for i in range(u.shape[0]):
        a = node_acceleration(
            i, tets, rows, loads, lanes, params, v, inverse_mass, body, material, force, load,
            starts, corners, slots,
        )
        move_node(
            i, a, opens != 0, closes != 0, params[0], integrator, contact, rest, u, v, half,
            body[i], held, drive, kind, shape,
        )


@ti.kernel
def begin_solves(
    tets: ti.template(), rows: ti.template(), loads: ti.template(), lanes: ti.template(),
    params: A(), v: A(), inverse_mass: A(), body: A(), material: A(), held: A(), force: A(),
    load: A(), starts: A(), corners: A(), slots: A(),
    diagonal: A(), acceleration: A(), residual: A(), direction: A(),
):
    """Sum the nodes' forces and begin the solve with the consistent mass."""
    for i in range(v.shape[0]):
        a = node_acceleration(
            i, tets, rows, loads, lanes, params, v, inverse_mass, body, material, force, load,
            starts, corners, slots,
        )
        begin_solve(
            i, a / inverse_mass[i], held[i], diagonal, acceleration, residual, direction
        )


@ti.kernel
def iterate_solves(
    k: int, held: A(), mass_starts: A(), mass_ends: A(), mass_entries: A(), diagonal: A(),
    acceleration: A(), residual: A(), direction: A(),
):
    """Iteration k (from 0) of the solve with the consistent mass."""
    for i in range(held.shape[0]):
        iterate_solve(
            i, k, held[i], mass_starts, mass_ends, mass_entries, diagonal, acceleration, residual,
            direction,
        )


@ti.kernel
def move_solved(
    opens: int, closes: int, contact: ti.template(), integrator: ti.template(),
    params: A(), u: A(), v: A(), half: A(), rest: A(), body: A(), held: A(), drive: A(),
    acceleration: A(), kind: A(), shape: A(),
):
    """Integrate and hold all nodes with the accelerations of the solve."""
    for i in range(u.shape[0]):
        a = ti.Vector([acceleration[i, 0], acceleration[i, 1], acceleration[i, 2]])
        move_node(
            i, a, opens != 0, closes != 0, params[0], integrator, contact, rest, u, v, half,
            body[i], held, drive, kind, shape,
        )


def bind_gpu(
    system: System, params: Any, integrator: int, contact: bool, loads: bool, viscous: bool,
    kind: Any, shape: Any,
) -> Callable[[int, int, int, int], None]:  # fmt: skip
    """A launch(first_pass, last_pass, substeps, threads) as that of `advance`; the device has its
    own number of threads.
    """
    s = system
    forces = []
    if s.laws:
        forces.append(runtime.bind(plain.tet_forces, *tet_arguments(s, viscous)))
    if s.springs or s.tensors:
        forces.append(runtime.bind(plain.row_forces, *row_arguments(s, viscous)))
    bind_move = _bind_solve if s.consistent else _bind_move
    move = bind_move(s, params, integrator, contact, loads, kind, shape)

    def launch(first_pass: int, last_pass: int, substeps: int, threads: int) -> None:
        for k in range(first_pass, last_pass):
            for force in forces:
                force()
            move(int(k < substeps), int(k > 0))

    return launch


def _bind_move(
    s: System, params: Any, integrator: int, contact: bool, loads: bool, kind: Any, shape: Any
) -> Callable[[int, int], None]:
    return runtime.bind(
        move_nodes, 1, 1,
        bool(s.laws), s.springs > 0 or s.tensors, loads, contact, integrator, s.lanes,
        params, s.u, s.v, s.half, s.rest, s.inverse_mass, s.body, s.material,
        s.held, s.drive, s.force, s.load, s.starts, s.corners, s.flat_slots, kind, shape,
    )  # fmt: skip


def _bind_solve(
    s: System, params: Any, integrator: int, contact: bool, loads: bool, kind: Any, shape: Any
) -> Callable[[int, int], None]:
    solve = (s.diagonal, s.acceleration, s.residual, s.direction)
    begin = runtime.bind(
        begin_solves, bool(s.laws), s.springs > 0 or s.tensors, loads, s.lanes,
        params, s.v, s.inverse_mass, s.body, s.material, s.held, s.force, s.load,
        s.starts, s.corners, s.flat_slots, *solve,
    )  # fmt: skip
    iterate = runtime.bind(
        iterate_solves, 0, s.held, s.mass_starts, s.mass_ends, s.mass_entries, *solve
    )
    finish = runtime.bind(
        move_solved, 1, 1, contact, integrator, params, s.u, s.v, s.half, s.rest, s.body, s.held,
        s.drive, s.acceleration, kind, shape,
    )  # fmt: skip

    def move(opens: int, closes: int) -> None:
        begin()
        for k in range(ITERATIONS[s.precision]):
            iterate(k)
        finish(opens, closes)

    return move
