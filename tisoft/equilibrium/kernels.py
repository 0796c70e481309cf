# mypy: ignore-errors
"""Kernels of statics, modes and the sharp step: f(u), K(u) w, C(u) w and element matrices.

    f = −∂V/∂u,   K(u) w = −∂f/∂u · w,   C(u) w = −f_viscous(u, w)

They call the same functions of elements and laws as a running scene, on fields of f64: u stands in
`State.displacement`, w in `State.velocity`.
"""

from typing import Any

import taichi as ti

from tisoft.step import forces, record

A = ti.types.ndarray()
FORCE, PRODUCT, RATE = 0, 1, 2
"""What a kernel computes: f(u), K(u) w or −C(u) w."""


@ti.func
def push(block: ti.template(), state: ti.template(), what: ti.template(), b):
    """Add what batch b comes to, to the copies of its nodes.

    Reads block.*, state.displacement, state.velocity; adds to state.force.
    """
    size = ti.static(3 * block.corners)
    rest = ti.Matrix.zero(block.real, block.element.numbers, block.lanes)
    u = ti.Matrix.zero(block.real, size, block.lanes)
    w = ti.Matrix.zero(block.real, size, block.lanes)
    out = ti.Matrix.zero(block.real, 2 * block.element.rows, block.lanes)
    forces.load_rest(block, b, rest)
    forces.gather(block, state.displacement, b, u)
    if ti.static(what != FORCE):
        forces.gather(block, state.velocity, b, w)
    m = forces.material(block, b)
    for q in range(block.points):
        for lane in range(block.lanes):
            if ti.static(what == PRODUCT):
                block.element.product(block.law, rest, u, w, m, q, lane, out)
            else:
                block.element.forces(block.law, rest, u, w, m, q, lane, out)
    forces.finish(block, rest, out)
    forces.scatter(block, state.force, b, out, size if what == RATE else 0)


def make_operator(state: Any, blocks: tuple[Any, ...], what: int, alone: bool) -> Any:
    """The kernel operate(scene, first, given, out): `given` is u for FORCE and w else, both and
    `out` of shape (nodes, 3); `alone`: on the caller's thread.
    """
    pairs = tuple(enumerate(blocks))

    @ti.kernel
    def operate(scene: int, first: int, given: A, out: A):
        ti.loop_config(serialize=alone)
        for k in range(given.shape[0]):
            for d in ti.static(range(3)):
                if ti.static(what == FORCE):
                    state.displacement[first + k][d] = given[k, d]
                else:
                    state.velocity[first + k][d] = given[k, d]
        for number, block in ti.static(pairs):
            ti.loop_config(serialize=alone, block_dim=1)
            begin = state.ranges[scene, 2 + 2 * number]
            for part in range(begin, state.ranges[scene, 3 + 2 * number]):
                for b in range(block.part_start[part], block.part_start[part + 1]):
                    push(block, state, what, b)
        ti.loop_config(serialize=alone)
        for k in range(out.shape[0]):
            f = forces.total(state, first + k)
            for d in ti.static(range(3)):
                out[k, d] = f[d]

    return operate


def make_energy(state: Any, blocks: tuple[Any, ...], alone: bool) -> Any:
    """The kernel energy(scene, first, u) that tells the elastic energy V(u) [J]."""
    pairs = tuple(enumerate(blocks))

    @ti.kernel
    def energy(scene: int, first: int, u: A) -> ti.f64:
        ti.loop_config(serialize=alone)
        for k in range(u.shape[0]):
            for d in ti.static(range(3)):
                state.displacement[first + k][d] = u[k, d]
        for number, block in ti.static(pairs):
            ti.loop_config(serialize=alone, block_dim=1)
            begin = state.ranges[scene, 2 + 2 * number]
            for part in range(begin, state.ranges[scene, 3 + 2 * number]):
                block.energy[part] = record.part_energy(block, state, part)
        total = ti.cast(0.0, ti.f64)
        for number, block in ti.static(pairs):
            ti.loop_config(serialize=True)
            begin = state.ranges[scene, 2 + 2 * number]
            for part in range(begin, state.ranges[scene, 3 + 2 * number]):
                total += block.energy[part]
        return total

    return energy


def make_matrices(block: Any, state: Any, viscous: bool) -> Any:
    """The kernel matrices(first, out): K_e or C_e of each cell at the present u, by unit columns;
    out has shape (batches, lanes, 3 corners, 3 corners).
    """
    size = 3 * block.corners

    @ti.kernel
    def matrices(first: int, out: A):
        for k in range(out.shape[0]):
            rest = ti.Matrix.zero(block.real, block.element.numbers, block.lanes)
            u = ti.Matrix.zero(block.real, size, block.lanes)
            forces.load_rest(block, first + k, rest)
            forces.gather(block, state.displacement, first + k, u)
            m = forces.material(block, first + k)
            for column in range(size):
                w = ti.Matrix.zero(block.real, size, block.lanes)
                f = ti.Matrix.zero(block.real, 2 * block.element.rows, block.lanes)
                for lane in range(block.lanes):
                    w[column, lane] = 1.0
                for q in range(block.points):
                    for lane in range(block.lanes):
                        if ti.static(viscous):
                            block.element.forces(block.law, rest, u, w, m, q, lane, f)
                        else:
                            block.element.product(block.law, rest, u, w, m, q, lane, f)
                forces.finish(block, rest, f)
                for lane in range(block.lanes):
                    for row in range(size):
                        if ti.static(viscous):
                            out[k, lane, row, column] = -f[size + row, lane]
                        else:
                            out[k, lane, row, column] = f[row, lane]

    return matrices
