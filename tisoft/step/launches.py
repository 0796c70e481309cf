# mypy: ignore-errors
"""Substeps on a GPU: every pass is a launch of parallel loops over batches and nodes.

The functions are those of `passes`; there a batch has several lanes and a part several batches,
here a lane is a batch and a batch a part.  Each kernel is compiled when it is first called, which
`runtime.timed` tells apart from stepping.
"""

from typing import Any

import taichi as ti

from tisoft import runtime
from tisoft.model.state import (
    CHUNK,
    DONE,
    FIRST,
    LAST,
    LOADED,
    MOVE,
    PASSES,
    PUSH,
    TASK,
    TRIPPED,
)
from tisoft.step import consistent_mass, driving, external, forces, heat, record, touch
from tisoft.step.substep import begin_solve, move_solved, node, now_of


def make_advance(s: Any) -> Any:
    """advance(scene), as that of `passes`; the device has its own number of threads."""

    @runtime.timed
    @ti.kernel
    def save(scene: int):
        for i in range(s.state.ranges[scene, 0], s.state.ranges[scene, 1]):
            record.save(s.state, i)
        if ti.static(s.ledger):
            for k in ti.static(range(len(s.blocks))):
                first = s.blocks[k].part_start[s.state.ranges[scene, 2 + 2 * k]]
                last = s.blocks[k].part_start[s.state.ranges[scene, 3 + 2 * k]]
                for b in range(first, last):
                    heat.begin(s.blocks[k], b)

    @runtime.timed
    @ti.kernel
    def turn(scene: int, column: int):
        ti.loop_config(serialize=True)
        for _ in range(1):
            driving.turn(s, scene, column)
            driving.move_obstacles(s, scene, column)

    @runtime.timed
    @ti.kernel
    def act(scene: int, column: int):
        for i in range(s.state.ranges[scene, 0], s.state.ranges[scene, 1]):
            driving.act(s, scene, i, column)

    def make_push(loaded: bool, moves: bool) -> Any:
        """push(scene, number, passes): forces on nodes and, where it `moves` them, steps 2 to 5.

        One launch for all: calling a kernel costs more than what most loops take.
        """

        @runtime.timed
        @ti.kernel
        def push(scene: int, number: int, passes: int):
            first, last = s.state.ranges[scene, 0], s.state.ranges[scene, 1]
            for k in ti.static(range(len(s.blocks))):
                begin = s.blocks[k].part_start[s.state.ranges[scene, 2 + 2 * k]]
                end = s.blocks[k].part_start[s.state.ranges[scene, 3 + 2 * k]]
                for b in range(begin, end):
                    forces.batch(s, s.blocks[k], b, now_of(s, scene, number, passes))
            if ti.static(loaded):
                for i in range(first, last):
                    external.press(s.state, i)
                for _ in range(1):
                    external.draw(s.state, scene)
            if ti.static(moves):
                for i in range(first, last):
                    node(s, i, now_of(s, scene, number, passes))

        return push

    kinds = [(loaded, moves) for loaded in (0, 1) for moves in (0, 1)]
    pushes = {kind: make_push(*kind) for kind in kinds}

    @runtime.timed
    @ti.kernel
    def begin(scene: int, number: int, passes: int):
        for i in range(s.state.ranges[scene, 0], s.state.ranges[scene, 1]):
            back = s.state.ranges[scene, 15] - s.state.ranges[scene, 0]
            begin_solve(s, i, i + back, now_of(s, scene, number, passes))

    @runtime.timed
    @ti.kernel
    def iterate(scene: int, k: int):
        for i in range(s.state.ranges[scene, 0], s.state.ranges[scene, 1]):
            back = s.state.ranges[scene, 15] - s.state.ranges[scene, 0]
            if k % 2 == 0:
                consistent_mass.iterate_solve(s.mass, s.state, i, i + back, k, 0)
            else:
                consistent_mass.iterate_solve(s.mass, s.state, i, i + back, k, 1)

    @runtime.timed
    @ti.kernel
    def end(scene: int, number: int, passes: int):
        for i in range(s.state.ranges[scene, 0], s.state.ranges[scene, 1]):
            back = s.state.ranges[scene, 15] - s.state.ranges[scene, 0]
            move_solved(s, i, i + back, now_of(s, scene, number, passes))

    @runtime.timed
    @ti.kernel
    def meet_obstacles(scene: int, number: int, passes: int):
        ti.loop_config(serialize=True)  # one point after the other, as on the CPU
        for _ in range(1):
            touch.meet(s, scene, now_of(s, scene, number, passes))

    @runtime.timed
    @ti.kernel
    def sum_up(scene: int):
        for chunk in range((s.state.ranges[scene, 1] - s.state.ranges[scene, 0] - 1) // CHUNK + 1):
            record.sum_chunk(s, scene, chunk)
        for k in ti.static(range(len(s.blocks))):
            begin, end = s.state.ranges[scene, 2 + 2 * k], s.state.ranges[scene, 3 + 2 * k]
            for part in range(begin, end):
                if record.tells_energy(s, scene):
                    record.weigh_part(s, s.blocks[k], part)

    @runtime.timed
    @ti.kernel
    def write(scene: int, number: int):
        record.write(s, scene, number)

    def solve(scene: int, number: int, passes: int) -> None:
        begin(scene, number, passes)
        for k in range(s.mass.iterations):
            iterate(scene, k)
        end(scene, number, passes)

    def advance(scene: int) -> None:
        orders = s.state.orders
        first, last, passes = (orders[scene, column] for column in (FIRST, LAST, PASSES))
        task = orders[scene, TASK]
        push = pushes[int(bool(orders[scene, LOADED])), int(task == MOVE and s.mass is None)]
        orders[scene, DONE], orders[scene, TRIPPED] = 0, 0
        for number in range(first, last):
            if task == MOVE and number % passes == 0:
                save(scene)
            if task == MOVE and s.driven:
                turn(scene, number - first)
                act(scene, number - first)
            push(scene, number % passes, passes)
            if task == MOVE and s.mass is not None:
                solve(scene, number % passes, passes)
            if task == MOVE and s.touches:
                meet_obstacles(scene, number % passes, passes)
            if task != PUSH and (number + 1) % passes == 0:
                sum_up(scene)
                write(scene, (number + 1) // passes - 1)
                if orders[scene, TRIPPED]:
                    return

    return advance
