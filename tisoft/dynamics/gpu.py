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
from tisoft.dynamics.system import System
from tisoft.models.consistent_mass import ITERATIONS


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
        plain.move_nodes, 1, 1,
        bool(s.laws), s.springs > 0 or s.tensors, loads, contact, integrator, s.lanes,
        params, s.u, s.v, s.half, s.rest, s.inverse_mass, s.body, s.material,
        s.held, s.drive, s.force, s.load, s.starts, s.corners, s.flat_slots, kind, shape,
    )  # fmt: skip


def _bind_solve(
    s: System, params: Any, integrator: int, contact: bool, loads: bool, kind: Any, shape: Any
) -> Callable[[int, int], None]:
    solve = (s.diagonal, s.acceleration, s.residual, s.direction)
    begin = runtime.bind(
        plain.begin_solves, bool(s.laws), s.springs > 0 or s.tensors, loads, s.lanes,
        params, s.v, s.inverse_mass, s.body, s.material, s.held, s.force, s.load,
        s.starts, s.corners, s.flat_slots, *solve,
    )  # fmt: skip
    iterate = runtime.bind(
        plain.iterate_solves, 0, s.held, s.mass_starts, s.mass_ends, s.mass_entries, *solve
    )
    finish = runtime.bind(
        plain.move_solved, 1, 1, contact, integrator, params, s.u, s.v, s.half, s.rest, s.body,
        s.held, s.drive, s.acceleration, kind, shape,
    )  # fmt: skip

    def move(opens: int, closes: int) -> None:
        begin()
        for k in range(ITERATIONS[s.precision]):
            iterate(k)
        finish(opens, closes)

    return move
