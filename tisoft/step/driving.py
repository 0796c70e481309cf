# mypy: ignore-errors
"""Inputs in time at each substep's own time: loads, pressures, torques and moved pins.

Before a pass its nodes get the forces and velocities that the signals of the pass say
(`model.inputs`): a load the mean of its factor over the substep, so that impulses are exact; a
moved pin the velocity that leads it to where it is at the substep's end.

    torque:  f_i = w_i ω × ρ_i,  ρ_i = x_i − Σ w x,  Σ w (|ρ|² − ρ ρᵀ) ω = M
"""

import taichi as ti

from tisoft.model.inputs import (
    FIRST_MOVED,
    FIRST_TORQUE,
    GRAVITY,
    LAST_MOVED,
    LAST_TORQUE,
    LOAD,
    NODES,
    PATH,
    PRESSURE,
    STRIDE,
    TORQUE,
    VALUES,
)
from tisoft.model.state import INPUTS
from tisoft.obstacles.base import NUMBERS, VELOCITY

FLAT = 1e-12
"""Share of the cube of its size below which the inertia of a face is that of a line."""


@ti.func
def signal(s: ti.template(), row, number, column):
    """Signal `number` in pass `column` of the launch; `row` is the scene's."""
    first = s.inputs.scene[row, VALUES]
    return s.inputs.value[first + number * s.inputs.scene[row, STRIDE] + column]


@ti.func
def act(s: ti.template(), scene, i, column):
    """What acts on node i in a pass.  Reads inputs; writes load, drive, pressure_numbers."""
    row = s.state.ranges[scene, INPUTS]
    node = i + s.inputs.scene[row, NODES]
    load, loaded = 0.0 * s.state.load[i], 0
    for k in range(s.inputs.start[node], s.inputs.start[node + 1]):
        kind, target, along = s.inputs.kind[k], s.inputs.target[k], s.inputs.along[k]
        number = s.inputs.signal[k]
        value = ti.cast(signal(s, row, number, column), s.inputs.real)
        if kind == LOAD:
            loaded = 1
            load += value * along
        elif kind == GRAVITY:
            loaded = 1
            for c in range(3):
                load[c] += along[0] * ti.cast(signal(s, row, number + c, column), s.inputs.real)
        elif kind == TORQUE:
            loaded = 1
            arm = -s.inputs.middle[target]
            for d in ti.static(range(3)):
                arm[d] += s.state.rest[i][d]
                arm[d] += s.state.displacement[i][d]
            load += ti.cast(along[0] * s.inputs.spin[target].cross(arm), s.inputs.real)
        elif kind == PRESSURE:
            s.state.pressure_numbers[target, 6] = value * along[0]
        elif kind == PATH:
            for c in ti.static(range(3)):
                if target & (1 << c):
                    s.state.drive[i][c] = ti.cast(signal(s, row, number + c, column), s.inputs.real)
        else:
            more = ti.cast(signal(s, row, number + 1, column), s.inputs.real)
            way = value * along + more * s.inputs.across[k]
            for c in ti.static(range(3)):
                if target & (1 << c):
                    s.state.drive[i][c] = way[c]
    if loaded:
        s.state.load[i] = load


@ti.func
def turns(s: ti.template(), scene):
    """Whether the scene has torques or moved obstacles."""
    row = s.state.ranges[scene, INPUTS]
    return (
        s.inputs.scene[row, FIRST_TORQUE] < s.inputs.scene[row, LAST_TORQUE]
        or s.inputs.scene[row, FIRST_MOVED] < s.inputs.scene[row, LAST_MOVED]
    )


@ti.func
def move_obstacles(s: ti.template(), scene, column):
    """Put moved obstacles where they are when a pass begins, with the velocity that they have
    through it.  Writes obstacle.
    """
    row = s.state.ranges[scene, INPUTS]
    for m in range(s.inputs.scene[row, FIRST_MOVED], s.inputs.scene[row, LAST_MOVED]):
        first = s.inputs.moved_signal[m]
        for c in range(NUMBERS + 6):
            into = c if c < NUMBERS else c - NUMBERS + VELOCITY
            s.state.obstacle[s.inputs.moved_row[m], into] = ti.cast(
                signal(s, row, first + c, column), s.inputs.real
            )


@ti.func
def turn(s: ti.template(), scene, column):
    """ω of each torque at the present positions.  Writes inputs.middle, inputs.spin."""
    row = s.state.ranges[scene, INPUTS]
    for q in range(s.inputs.scene[row, FIRST_TORQUE], s.inputs.scene[row, LAST_TORQUE]):
        middle = 0.0 * s.inputs.moment[q]
        for k in range(s.inputs.torque_start[q], s.inputs.torque_start[q + 1]):
            middle += s.inputs.turned_share[k] * place(s, s.inputs.turned_node[k])
        J = ti.Matrix.zero(s.inputs.wide, 3, 3)
        for k in range(s.inputs.torque_start[q], s.inputs.torque_start[q + 1]):
            arm = place(s, s.inputs.turned_node[k]) - middle
            for d in ti.static(range(3)):
                J[d, d] += s.inputs.turned_share[k] * arm.dot(arm)
                for e in ti.static(range(3)):
                    J[d, e] -= s.inputs.turned_share[k] * arm[d] * arm[e]
        spin = 0.0 * middle
        size = J.trace()
        if J.determinant() > FLAT * size * size * size:
            moment = signal(s, row, s.inputs.torque_signal[q], column) * s.inputs.moment[q]
            spin = J.inverse() @ moment
        s.inputs.middle[q] = middle
        s.inputs.spin[q] = spin


@ti.func
def place(s: ti.template(), i):
    """Place of node i seen from its body's origin [m], wide."""
    x = ti.Vector.zero(s.inputs.wide, 3)
    for d in ti.static(range(3)):
        x[d] += s.state.rest[i][d]
        x[d] += s.state.displacement[i][d]
    return x
