# mypy: ignore-errors
"""Substeps on the CPU: one launch for many, every thread walking through all of them.

    forces of the thread's parts | barrier | the thread's nodes | barrier | …

Threads own fixed ranges of parts and nodes and meet at barriers (an atomic on a counter, none on
data), so the bits are the same for any number of threads.  After each stretch (a frame, or a piece
of a long one) the launch records what it came to, and ends where the state is no longer finite or
moves more than it may.
"""

from typing import Any

import taichi as ti

from tisoft import runtime
from tisoft.model.state import (
    DONE,
    FIRST,
    LAST,
    MOVE,
    PASSES,
    PUSH,
    TASK,
    THREADS,
    TOUCH_SCENE,
    TRIPPED,
)
from tisoft.model.threads import SLICE, meet, share
from tisoft.step import consistent_mass, driving, external, forces, heat, means, record, touch
from tisoft.step.meeting import touch_nodes
from tisoft.step.substep import begin_solve, move_solved, node, now_of
from tisoft.touch.fields import BUILT
from tisoft.touch.ways import is_stale


@ti.func
def batches(s: ti.template(), k: ti.template(), scene, t, threads):
    """First and last batch of block k that are thread t's.  Reads ranges, part_start."""
    low, high = s.state.ranges[scene, 2 + 2 * k], s.state.ranges[scene, 3 + 2 * k]
    first = s.blocks[k].part_start[share(low, high, t, threads)]
    return first, s.blocks[k].part_start[share(low, high, t + 1, threads)]


@ti.func
def solve(s: ti.template(), scene, t, threads, phase, now):
    """The thread's nodes with consistent mass; returns the phase that it has come to."""
    low, high = s.state.ranges[scene, 0], s.state.ranges[scene, 1]
    first, last = share(low, high, t, threads), share(low, high, t + 1, threads)
    back = s.state.ranges[scene, 15] - low  # from a node to its row of the matrix
    for i in range(first, last):
        begin_solve(s, i, i + back, now)
    for k in range(s.mass.iterations // 2):
        for half in ti.static(range(2)):
            phase += 1
            meet(s, scene, phase, threads)
            for i in range(first, last):
                consistent_mass.iterate_solve(s.mass, s.state, i, i + back, 2 * k + half, half)
    if ti.static(not s.meets):  # a node's acceleration is its own by now
        for i in range(first, last):
            move_solved(s, i, i + back, now)
    return phase


@ti.func
def drive(s: ti.template(), scene, t, threads, phase, number):
    """What acts on the thread's nodes in pass `number`; returns the phase that it has come to."""
    low, high = s.state.ranges[scene, 0], s.state.ranges[scene, 1]
    column = number - s.state.orders[scene, FIRST]
    if driving.turns(s, scene):
        if t == 0:
            driving.turn(s, scene, column)
            driving.move_obstacles(s, scene, column)
        phase += 1
        meet(s, scene, phase, threads)
    for i in range(share(low, high, t, threads), share(low, high, t + 1, threads)):
        driving.act(s, scene, i, column)
    return phase


@ti.func
def walk(s: ti.template(), scene, t, threads):
    """All passes of the launch, as thread t of `threads` sees them."""
    low, high = s.state.ranges[scene, 0], s.state.ranges[scene, 1]
    first, last = share(low, high, t, threads), share(low, high, t + 1, threads)
    passes, task = s.state.orders[scene, PASSES], s.state.orders[scene, TASK]
    number, end = s.state.orders[scene, FIRST], s.state.orders[scene, LAST]
    phase = 0
    stale = False
    if ti.static(s.meets):
        stale = s.surfaces.order[s.state.ranges[scene, TOUCH_SCENE], BUILT] != threads
    while number < end:
        now = now_of(s, scene, number % passes, passes)
        if task == MOVE and number % passes == 0:
            for i in range(first, last):
                record.save(s.state, i)
            if ti.static(s.ledger):
                for k in ti.static(range(len(s.blocks))):
                    begin, stop = batches(s, k, scene, t, threads)
                    for b in range(begin, stop):
                        heat.begin(s.blocks[k], b)
        if ti.static(s.driven):
            if task == MOVE:
                phase = drive(s, scene, t, threads, phase, number)
        for k in ti.static(range(len(s.blocks))):
            begin, stop = batches(s, k, scene, t, threads)
            for b in range(begin, stop):
                forces.batch(s, s.blocks[k], b, now)
        if now.loaded:
            for i in range(first, last):
                external.press(s.state, i)
            if t == 0:
                external.draw(s.state, scene)
        phase += 1
        meet(s, scene, phase, threads)
        if task == MOVE:
            if ti.static(s.consistent):
                phase = solve(s, scene, t, threads, phase, now)
            if ti.static(s.meets):
                phase = touch_nodes(s, scene, t, threads, phase, now, stale)
            elif ti.static(not s.consistent):
                for i in range(first, last):
                    node(s, i, now)
        phase += 1
        meet(s, scene, phase, threads)
        if ti.static(s.touches):
            if task == MOVE:
                if t == 0:
                    touch.meet(s, scene, now)
                phase += 1
                meet(s, scene, phase, threads)
        if ti.static(s.holds_means):
            if task == MOVE:
                if t == 0:
                    means.hold(s, scene, number - s.state.orders[scene, FIRST], now)
                phase += 1
                meet(s, scene, phase, threads)
        if ti.static(s.meets):
            if task == MOVE:
                stale = is_stale(s, scene, threads)
        number += 1
        if task != PUSH and number % passes == 0:
            record.sum_up(s, scene, t, threads)
            phase += 1
            meet(s, scene, phase, threads)
            if t == 0:
                record.write(s, scene, number // passes - 1)
            phase += 1
            meet(s, scene, phase, threads)
            if s.state.orders[scene, TRIPPED]:
                number = end
    if ti.static(s.meets):
        if task == MOVE and t == 0 and stale:
            s.surfaces.order[s.state.ranges[scene, TOUCH_SCENE], BUILT] = 0


def make_advance(s: Any, alone: bool) -> Any:
    """The kernel advance(scene); `alone` runs on the caller's thread, to which handing a small
    frame over would cost as much as the frame.
    """

    @ti.kernel
    def advance(scene: int):
        s.state.arrived[scene] = 0
        s.state.orders[scene, DONE] = 0
        s.state.orders[scene, TRIPPED] = 0
        if ti.static(alone):
            ti.loop_config(serialize=True)
            for _ in range(1):
                walk(s, scene, 0, 1)
        else:
            for item in range(s.state.orders[scene, THREADS] * SLICE):
                if item % SLICE == 0:
                    walk(s, scene, item // SLICE, s.state.orders[scene, THREADS])

    return runtime.compiled_as_written(advance) if s.meets else advance
