# mypy: ignore-errors
"""Forces of elements: f_int of the lectures' M a = f_int + f_ext.

A batch gathers its corners' u and v into local columns, lets the element compute, and adds the
corner forces to its part's copies of the nodes.  What touches fields loops over corners outside
and lanes inside; between gather and scatter all is local, so LLVM vectorises over lanes.  Loops
are loops at run time wherever they may be: Taichi reads unrolled code ten times as slowly, and LLVM
unrolls it all the same.
"""

import taichi as ti

from tisoft.model.state import SHOVED
from tisoft.step import heat


@ti.func
def gather(block: ti.template(), field: ti.template(), b, columns: ti.template()):
    """Rows 3c + d of `columns` become component d of `field` at corner c.

    Reads block.cells, field.
    """
    for c in range(block.corners):
        for lane in range(block.lanes):
            i = block.cells[b, c, lane]
            for d in range(3):
                columns[3 * c + d, lane] = field[i][d]


@ti.func
def row_of(block: ti.template(), columns: ti.template(), first, lane):
    """Three rows of `columns` from `first` on, as a copy holds them: the fourth number is 0."""
    row = ti.Vector.zero(block.real, 4)
    for d in ti.static(range(3)):
        row[d] = columns[first + d, lane]
    return row


@ti.func
def scatter(
    block: ti.template(), copies: ti.template(), b, columns: ti.template(), first: ti.template()
):
    """Add rows `first` + 3c + d of `columns` to the part's copy of corner c.

    Reads block.places; adds to copies.  Within a part one lane follows the other.
    """
    for lane in range(block.lanes):
        for c in range(block.corners):
            k = block.places[b, c, lane]
            copies[k] = copies[k] + row_of(block, columns, first + 3 * c, lane)


@ti.func
def load_rest(block: ti.template(), b, rest: ti.template()):
    """The batch's rest numbers, copied before the loop over lanes.  Reads block.rest."""
    for k in range(block.element.numbers):
        for lane in range(block.lanes):
            rest[k, lane] = block.rest[b, k, lane]


@ti.func
def material(block: ti.template(), b):
    """The batch's material row m.  Reads block.owner, block.material."""
    row = block.owner[b]
    return ti.Vector([block.material[row, k] for k in range(block.columns)])


@ti.func
def batch(s: ti.template(), block: ti.template(), b, now):
    """Add the forces of batch b to the copies of its nodes, and note what viscosity takes.

    Reads block.*, displacement, velocity, half; adds to force; with a ledger, see `heat.note`.
    """
    lanes, size = ti.static(block.lanes, 3 * block.corners)
    rest = ti.Matrix.zero(block.real, block.element.numbers, lanes)
    u = ti.Matrix.zero(block.real, size, lanes)
    load_rest(block, b, rest)
    gather(block, s.state.displacement, b, u)
    m = material(block, b)
    v = ti.Matrix.zero(block.real, size, lanes)
    is_viscous = block.is_viscous[block.owner[b]]
    if is_viscous:
        gather(block, s.state.velocity, b, v)
    out = ti.Matrix.zero(block.real, block.element.rows + s.ledger * block.behind, lanes)
    for q in range(block.points):
        for lane in range(lanes):
            block.element.forces(block.law, rest, u, v, m, q, lane, out)
            if ti.static(s.ledger and block.element.stresses > 0):
                block.element.rate(rest, v, lane, out)
    finish(block, rest, out)
    scatter(block, s.state.force, b, out, 0)
    if ti.static(s.ledger):
        if is_viscous and now.counts:
            if ti.static(s.integrator.closing_passes > 0):
                if now.closes:  # the last kick ended with these
                    gather(block, s.state.half, b, v)
                    if ti.static(block.element.stresses > 0):
                        for lane in range(lanes):
                            block.element.rate(rest, v, lane, out)
            if ti.static(s.contact):
                if s.state.orders[now.scene, SHOVED] == now.number:
                    w = ti.Matrix.zero(block.real, size, lanes)
                    gather(block, s.state.shove, b, w)
                    block.heat[b] = block.heat[b] - heat.owed(block, b, rest, w)
            heat.note(block, b, v, out, s.integrator.kick(now))


@ti.func
def finish(block: ti.template(), rest: ti.template(), out: ti.template()):
    """Make corner forces of what the points of elements with several have left in `out`."""
    if ti.static(block.points > 1):
        for lane in range(block.lanes):
            block.element.finish(rest, lane, out)


@ti.func
def total(state: ti.template(), i):
    """Sum of the copies of node i's force [N], which are 0 again afterwards.

    Reads state.copy_start; takes from state.force.
    """
    f = ti.Vector.zero(state.real, 3)  # not 0 times a force: of a body that explodes, nan
    for k in range(state.copy_start[i], state.copy_start[i + 1]):
        for d in ti.static(range(3)):
            f[d] += state.force[k][d]
        state.force[k] = ti.Vector.zero(state.real, 4)
    return f


@ti.func
def batch_energy(block: ti.template(), state: ti.template(), b):
    """Elastic energy of batch b [J], in f64.  Reads block.*, state.displacement."""
    rest = ti.Matrix.zero(block.real, block.element.numbers, block.lanes)
    u = ti.Matrix.zero(block.real, 3 * block.corners, block.lanes)
    load_rest(block, b, rest)
    gather(block, state.displacement, b, u)
    if ti.static(block.element.is_relative):
        origin = state.displacement[block.origin[block.owner[b]]]
        for c in range(block.corners):
            for lane in range(block.lanes):
                for d in range(3):
                    u[3 * c + d, lane] -= origin[d]
    m = material(block, b)
    each = ti.Vector.zero(block.real, block.lanes)
    for q in range(block.points):
        for lane in range(block.lanes):
            each[lane] += block.element.energy(block.law, rest, u, m, q, lane)
    total = ti.cast(0.0, state.wide)
    for lane in range(block.lanes):
        total += each[lane]
    return total


@ti.func
def batch_heat(s: ti.template(), block: ti.template(), b):
    """What viscosity has taken in batch b since the stretch began [J].

    Reads block.*, velocity, shove.
    """
    taken = block.heat[b]
    if block.is_viscous[block.owner[b]]:
        rest = ti.Matrix.zero(block.real, block.element.numbers, block.lanes)
        v = ti.Matrix.zero(block.real, 3 * block.corners, block.lanes)
        load_rest(block, b, rest)
        gather(block, s.state.velocity, b, v)
        taken -= 0.5 * heat.owed(block, b, rest, v)
        if ti.static(s.contact):
            gather(block, s.state.shove, b, v)
            taken -= heat.owed(block, b, rest, v)
    return taken
