# mypy: ignore-errors
"""What a stretch came to: sums over nodes and elements, in f64, in an order that no thread changes.

    T = Σ m |v|²/2   (consistent mass: vᵀM v/2),   Σ m u,   W = Σ V Ψ + Σ k e²/2,   Σ v·f

Nodes are summed in chunks and elements in parts, each by one thread; then one thread adds chunks
and parts up in order.  W is computed where a ledger is kept, where frames are told from their
records (TELLS), and where it is the launch's task, with the power v·f of the elements' forces and
gravity.
"""

import taichi as ti

from tisoft.model.state import (
    CHUNK,
    CHUNKS,
    DONE,
    GRAVITY,
    MOST_KINETIC,
    POWER,
    PROBE,
    PROBES,
    RECORD,
    RECORDS,
    SUM,
    TASK,
    TELLS,
    TOUCHED,
    TRIPPED,
)
from tisoft.step import forces


@ti.func
def save(state: ti.template(), i):
    """Keep node i's state, and begin its ledger, whatever it held: after what broke, nan.

    Writes saved_*, work, touched.
    """
    state.saved_displacement[i] = state.displacement[i]
    state.saved_velocity[i] = state.velocity[i]
    for c in ti.static(range(2)):
        state.work[i][c] = 0.0
        state.touched[i][c] = 0.0


@ti.func
def momentum(s: ti.template(), i, row):
    """(M v)_i [kg m/s]; `row` is the node's row of the mass matrix.  Reads velocity, mass."""
    p = s.state.velocity[i] / s.state.inverse_mass[i]
    if ti.static(s.consistent):
        p = 0.0 * p
        for q in range(s.mass.start[row], s.mass.start[row + 1]):
            p += s.mass.entry[q] * s.state.velocity[i + s.mass.column[q] - row]
    return p


@ti.func
def add(s: ti.template(), row, column: ti.template(), value):
    """Add to a sum (`+=` on a field would be an atomic)."""
    s.state.sums[row, column] = s.state.sums[row, column] + value


@ti.func
def sum_chunk(s: ti.template(), scene, chunk):
    """Sums over a chunk of nodes into its row of state.sums.  Reads u, v, masses, work, copies."""
    low = s.state.ranges[scene, 0] + chunk * CHUNK
    back = s.state.ranges[scene, 15] - s.state.ranges[scene, 0]
    row = s.state.orders[scene, CHUNKS] + chunk
    gravity = ti.Vector([s.state.settings[scene, GRAVITY + d] for d in range(3)])
    for c in range(RECORD):
        s.state.sums[row, c] = 0.0
    for i in range(low, ti.min(low + CHUNK, s.state.ranges[scene, 1])):
        u, v = s.state.displacement[i], s.state.velocity[i]
        wide = ti.cast(1.0, s.state.wide)
        p = momentum(s, i, i + back)
        mass = wide / s.state.inverse_mass[i]
        add(s, row, 0, 0.5 * wide * (v[0] * wide * p[0] + v[1] * wide * p[1] + v[2] * wide * p[2]))
        for d in ti.static(range(3)):
            add(s, row, 1 + d, mass * u[d])
        add(s, row, 7, u.dot(u) + v.dot(v))
        if ti.static(s.ledger):
            add(s, row, 5, s.state.work[i][0])
            add(s, row, 6, s.state.work[i][1])
            add(s, row, TOUCHED, s.state.touched[i][0])
            add(s, row, TOUCHED + 1, s.state.touched[i][1])
        if s.state.orders[scene, TASK] == SUM:
            f = forces.total(s.state, i)
            for d in ti.static(range(3)):
                add(s, row, POWER, v[d] * (f[d] + mass * gravity[d]))


@ti.func
def tells_energy(s: ti.template(), scene):
    """Whether W is asked for."""
    asked = s.state.orders[scene, TASK] == SUM or s.state.orders[scene, TELLS] == 1
    return s.ledger or asked


@ti.func
def part_energy(block: ti.template(), state: ti.template(), part):
    """Elastic energy of a part [J]."""
    total = ti.cast(0.0, state.wide)
    for b in range(block.part_start[part], block.part_start[part + 1]):
        total += forces.batch_energy(block, state, b)
    return total


@ti.func
def weigh_part(s: ti.template(), block: ti.template(), part):
    """Write a part's elastic energy, and what viscosity has taken in it [J]."""
    block.energy[part] = part_energy(block, s.state, part)
    if ti.static(s.ledger):
        lost = ti.cast(0.0, s.state.wide)
        for b in range(block.part_start[part], block.part_start[part + 1]):
            lost += forces.batch_heat(s, block, b)
        block.lost[part] = lost


@ti.func
def sum_up(s: ti.template(), scene, t, threads):
    """Thread t's share of all sums."""
    low, high = s.state.ranges[scene, 0], s.state.ranges[scene, 1]
    chunks = (high - low + CHUNK - 1) // CHUNK
    for chunk in range(chunks * t // threads, chunks * (t + 1) // threads):
        sum_chunk(s, scene, chunk)
    if tells_energy(s, scene):
        for k in ti.static(range(len(s.blocks))):
            begin, end = s.state.ranges[scene, 2 + 2 * k], s.state.ranges[scene, 3 + 2 * k]
            size = end - begin
            for part in range(begin + size * t // threads, begin + size * (t + 1) // threads):
                weigh_part(s, s.blocks[k], part)


@ti.func
def write(s: ti.template(), scene, number):
    """Add chunks and parts up into the record of stretch `number`, and trip where it must end.

    Reads sums, energy, settings; writes record, orders.
    """
    low, high = s.state.ranges[scene, 0], s.state.ranges[scene, 1]
    probes = s.state.orders[scene, PROBES]
    row = s.state.orders[scene, RECORDS] + number * (1 + probes)
    first = s.state.orders[scene, CHUNKS]
    for c in range(RECORD):
        total = ti.cast(0.0, s.state.wide)
        for chunk in range(first, first + (high - low + CHUNK - 1) // CHUNK):
            total += s.state.sums[chunk, c]
        s.state.record[row, c] = total
    if tells_energy(s, scene):
        total = ti.cast(0.0, s.state.wide)
        for k in ti.static(range(len(s.blocks))):
            for part in range(s.state.ranges[scene, 2 + 2 * k], s.state.ranges[scene, 3 + 2 * k]):
                total += s.blocks[k].energy[part]
        s.state.record[row, 4] = total
    if ti.static(s.ledger):
        total = s.state.record[row, 5]
        for k in ti.static(range(len(s.blocks))):
            for part in range(s.state.ranges[scene, 2 + 2 * k], s.state.ranges[scene, 3 + 2 * k]):
                total += s.blocks[k].lost[part]
        s.state.record[row, 5] = total
    for k in range(probes):
        i = s.state.probe[s.state.orders[scene, PROBE] + k]
        for d in ti.static(range(3)):
            s.state.record[row + 1 + k, d] = s.state.displacement[i][d]
            s.state.record[row + 1 + k, 3 + d] = s.state.velocity[i][d]
    kinetic, size = s.state.record[row, 0], s.state.record[row, 7]
    s.state.orders[scene, DONE] = number + 1
    if not (kinetic <= s.state.settings[scene, MOST_KINETIC]) or not (size - size == 0.0):
        s.state.orders[scene, TRIPPED] = 1
