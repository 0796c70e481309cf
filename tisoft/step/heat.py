# mypy: ignore-errors
"""What viscosity takes in elements: the ledger's D = −k f_d·(v + v')/2, as Σ over elements.

A batch knows v when it computes f_d, and v' one pass later.  So it keeps k f_d until then, and adds

    −½ (k f_d + k f_d of the pass before)·v

in every pass; the last half of a stretch follows when it has ended.  What is pushed onto an
obstacle's surface has its forces' work on the way counted as given, f_d's too (`ledger`), so here
−f_d·push is taken, as k f_d times `State.shove`.  An element whose stress is
constant keeps −k V P_v instead, whose product with Ḣ is k f_d·v: 9 numbers for 12.  (Summed at the
nodes, D costs a second scatter of forces: 16 % of the stepping of tets against 7.)
"""

import taichi as ti


@ti.func
def begin(block: ti.template(), b):
    """Nothing has been taken in batch b yet, whatever it held: after what broke, nan."""
    block.heat[b] = 0.0
    for c in range(block.flux):
        block.braked[b, c] = ti.Vector.zero(block.real, block.lanes)


@ti.func
def lanes_of(block: ti.template(), columns: ti.template(), row):
    """A row of local columns, a number a lane: LLVM stores no others than vectors at a time."""
    return ti.Vector([columns[row, lane] for lane in ti.static(range(block.lanes))])


@ti.func
def note(block: ti.template(), b, v: ti.template(), out: ti.template(), kick):
    """Add what viscosity takes in batch b to block.heat, and keep its share for the next pass.

    Args: v: velocities of the corners [m/s]; out: forces, viscous share, and rates where the
    element has stresses; kick: seconds for which they act.
    """
    first = ti.static(3 * block.corners)
    rates = ti.static(first + block.element.stresses)
    power = ti.Vector.zero(block.real, block.lanes)
    for c in range(block.flux):
        now = kick * lanes_of(block, out, first + c)
        if ti.static(block.element.stresses > 0):
            power += (block.braked[b, c] + now) * lanes_of(block, out, rates + c)
        else:
            power += (block.braked[b, c] + now) * lanes_of(block, v, c)
        block.braked[b, c] = now
    block.heat[b] = block.heat[b] - 0.5 * ti.cast(power.sum(), block.wide)


@ti.func
def owed(block: ti.template(), b, rest: ti.template(), w: ti.template()):
    """The product of what batch b keeps with velocities w of its corners [m/s], in J."""
    power = ti.Vector.zero(block.real, block.lanes)
    if ti.static(block.element.stresses > 0):
        out = ti.Matrix.zero(block.real, block.element.rows + block.behind, block.lanes)
        rates = ti.static(3 * block.corners + block.element.stresses)
        for lane in range(block.lanes):
            block.element.rate(rest, w, lane, out)
        for c in range(block.flux):
            power += block.braked[b, c] * lanes_of(block, out, rates + c)
    else:
        for c in range(block.flux):
            power += block.braked[b, c] * lanes_of(block, w, c)
    return ti.cast(power.sum(), block.wide)
