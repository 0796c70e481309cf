"""Substeps as a few plain launches each: what GPUs run instead of the one launch of `advance`.

The order of things in a substep is that of `advance`, and so are the functions of nodes and laws;
positions and velocities differ from it by rounding alone.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tisoft import runtime
from tisoft.dynamics import plain
from tisoft.dynamics.energy import row_arguments, tet_arguments
from tisoft.dynamics.flags import Flags
from tisoft.dynamics.system import System
from tisoft.models.consistent_mass import ITERATIONS

Launch = Callable[..., None]


def bind_gpu(
    system: System, params: Any, flags: Flags, kind: Any, shape: Any
) -> Callable[[int, int, int, int], None]:
    """A launch(first_pass, last_pass, substeps, threads) as that of `advance`; the device has its
    own number of threads.
    """
    forces = _bind_forces(system, flags)
    bind_move = _bind_solve if system.consistent else _bind_move
    move = bind_move(system, params, flags, kind, shape)

    def launch(first_pass: int, last_pass: int, substeps: int, threads: int) -> None:
        for k in range(first_pass, last_pass):
            for force in forces:
                force()
            move(int(k < substeps), int(k > 0))

    return launch


def _bind_forces(s: System, flags: Flags) -> list[Launch]:
    """Launches that compute what `move` then sums."""
    targets = [(flags.viscous, s.flat_slots, s.force)]
    if flags.viscous and flags.ledger:
        targets.append((False, s.still_flat, s.still))
    launches = []
    for viscous, slots, force in targets:
        if s.laws:
            launches.append(runtime.bind(plain.tet_forces, *tet_arguments(s, viscous, slots)))
        if s.springs or s.tensors:
            launches.append(runtime.bind(plain.row_forces, *row_arguments(s, viscous, force)))
    if flags.pressure:
        pressures = (s.pressure_starts, s.pressure_ends, s.pressure_data)
        launches.append(runtime.bind(plain.pressure_forces, *pressures, s.u, s.pressed))
    return launches


def _sum_arguments(s: System, flags: Flags) -> list[Any]:
    """What the sum of a node's forces takes."""
    return [bool(s.laws), s.springs > 0 or s.tensors, flags.loads, flags.pressure, s.lanes]


def _node_arguments(s: System, params: Any) -> list[Any]:
    return [
        params, s.v, s.inverse_mass, s.body, s.material, s.held, s.force, s.load, s.pressed,
        s.starts, s.corners, s.flat_slots,
    ]  # fmt: skip


def _move_arguments(s: System, kind: Any, shape: Any) -> list[Any]:
    return [
        s.u, s.half, s.rest, s.drive, s.still_flat, s.still, s.work, kind, shape,
    ]  # fmt: skip


def _bind_move(s: System, params: Any, flags: Flags, kind: Any, shape: Any) -> Launch:
    return runtime.bind(
        plain.move_nodes, 1, 1, *_sum_arguments(s, flags), flags.contact, flags.integrator,
        flags.viscous, flags.ledger, *_node_arguments(s, params), *_move_arguments(s, kind, shape),
    )  # fmt: skip


def _bind_solve(s: System, params: Any, flags: Flags, kind: Any, shape: Any) -> Launch:
    solve = (s.diagonal, s.acceleration, s.residual, s.direction)
    sums, node = _sum_arguments(s, flags), _node_arguments(s, params)
    begin = runtime.bind(plain.begin_solves, *sums, *node, *solve)
    iterate = runtime.bind(
        plain.iterate_solves, 0, s.held, s.mass_starts, s.mass_ends, s.mass_entries, *solve
    )
    finish = runtime.bind(
        plain.move_solved, 1, 1, *sums, flags.contact, flags.integrator,
        flags.viscous, flags.ledger, *node, *_move_arguments(s, kind, shape), s.acceleration,
    )  # fmt: skip

    def move(opens: int, closes: int) -> None:
        begin()
        for k in range(ITERATIONS[s.precision]):
            iterate(k)
        finish(opens, closes)

    return move
