# mypy: ignore-errors
"""The stable step: a bound from elements and springs that is never above the true limit.

The lectures' scheme v += h a(x, v), x += h v is stable exactly while 4M − 2hC − h²K is positive
definite.  With ω² and d = 2ζω those of a tet's stiffest mode (with its own lumped masses m_e),
uᵀK_e u ≤ m_e ω² Σ_a |u_a|² and likewise for C, so that node by node it is sufficient to have

    h²ω² + 2h (d + g) ≤ 4   ⟺   h ≤ 4 / (d + g + √((d + g)² + 4ω²))

with ω² and d averaged over the tets at the node, by mass, and point damping g [1/s].  The average
is never worse than the worst tet alone, and much better around slivers, whose nodes are heavier
than the sliver is.  As a tet deforms, its law's `stiffening` (a, b, c) says by how much:

    ω² ≤ a ω₀² + b 4γ/ρ,   d ≤ c d₀,   γ = λ_max(∇N_a·∇N_b)

Velocity Verlet sees damping twice as much: h²ω² + 4h (d + g) ≤ 4 (its `damping_factor`).
Springs have a bound that holds in every state (`elements.spring`), and mass-tensors never stiffen.
"""

from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from tisoft.elements.spring import frequencies
from tisoft.model.part import Part
from tisoft.step import forces

Floats = NDArray[np.float64]

NO_LIMIT = 1e30
"""Step [s] of nodes without tets."""


def longest_step(omega2: Floats, rate: Floats) -> Floats:
    """h [s] of ω² [1/s²] and damping rate d + g [1/s]; inf where neither acts."""
    with np.errstate(divide="ignore"):
        out: Floats = 4.0 / (rate + np.sqrt(rate * rate + 4.0 * omega2))
    return out


def averages(part: Part, weight: Floats, values: list[Floats]) -> Floats:
    """Averages at a body's nodes, by weight, of columns of values of its cells, a list for each
    element; 0 at nodes without cells, shape (nodes, columns).
    """
    nodes = len(part.order)
    total, sums, begun = np.zeros(nodes), np.zeros((nodes, values[0].shape[1])), 0
    for cells, rows in zip(part.solids, values, strict=True):
        w = weight[begun : begun + len(rows)]
        begun += len(rows)
        corners, width = cells.nodes.ravel(), cells.nodes.shape[1]
        total += np.bincount(corners, np.repeat(w, width), minlength=nodes)
        for k, column in enumerate(rows.T):
            sums[:, k] += np.bincount(corners, np.repeat(w * column, width), minlength=nodes)
    return np.divide(sums, total[:, None], out=np.zeros_like(sums), where=total[:, None] > 0.0)


def limits_at_rest(part: Part, factor: int) -> Floats:
    """Longest steps [s] at rest: by node for tets (inf where a node has none), by spring for
    springs; empty without elements.
    """
    drag = part.body.model.point_damping
    if part.is_springs:
        omega2, rate = frequencies(part.springs, part.spring_numbers, 1.0 / part.mass)
        return longest_step(omega2, factor * (rate + drag))
    mean = averages(part, part.volume, [known[:, :2] for known in part.known()])
    return longest_step(mean[:, 0], factor * (mean[:, 1] + drag * (mean[:, 0] > 0.0)))


@ti.func
def batch_limits(block: ti.template(), state: ti.template(), scene, b):
    """Add volume times (1, ω², d) of batch b's tets to the copies of their nodes, and count the
    inverted.  Reads block.*, state.displacement; writes block.stiffest, state.force, inverted.
    """
    rest = ti.Matrix.zero(block.real, block.element.numbers, block.lanes)
    u = ti.Matrix.zero(block.real, 3 * block.corners, block.lanes)
    forces.load_rest(block, b, rest)
    forces.gather(block, state.displacement, b, u)
    m = forces.material(block, b)
    for lane in range(block.lanes):
        known = ti.Vector([block.modes[b, k, lane] for k in range(block.known)])
        now = block.element.stiffened(block.law, rest, u, m, known, lane)
        block.stiffest[b, lane] = now[0]
        weight = known[3]
        row = weight * ti.Vector([1.0, now[0], now[1], 0.0])
        for c in range(block.corners):
            k = block.places[b, c, lane]
            state.force[k] = state.force[k] + row
        if weight > 0.0 and not (now[2] > 0.0):
            ti.atomic_add(state.inverted[scene], 1)


@ti.func
def node_limit(state: ti.template(), factor: ti.template(), i):
    """Longest stable step of node i [s], from what its tets have added.  Writes state.limit."""
    row = forces.total(state, i)
    limit = 0.0 * row[0] + NO_LIMIT
    if not (row[0] <= 0.0):
        rate = factor * (row[2] / row[0] + state.drag[state.body[i]])
        limit = 4.0 / (rate + ti.sqrt(rate * rate + 4.0 * row[1] / row[0]))
    if not (limit >= 0.0):  # of a state that is no longer finite
        limit = 0.0
    state.limit[i] = limit
    return limit


def make_look(
    state: Any, blocks: tuple[Any, ...], numbers: tuple[int, ...], factor: int, alone: bool
) -> Any:
    """The kernel look(scene): limits of all nodes, the least of them, and inverted tets.

    Args: blocks: those with tets; numbers: their places among the scene's blocks; alone: on the
    caller's thread.
    """
    pairs = tuple(zip(numbers, blocks, strict=True))

    @ti.kernel
    def look(scene: int):
        state.least_limit[scene] = NO_LIMIT
        state.inverted[scene] = 0
        for number, block in ti.static(pairs):
            ti.loop_config(serialize=alone, block_dim=1)
            begin = state.ranges[scene, 2 + 2 * number]
            for part in range(begin, state.ranges[scene, 3 + 2 * number]):
                for b in range(block.part_start[part], block.part_start[part + 1]):
                    batch_limits(block, state, scene, b)
        ti.loop_config(serialize=alone)
        for i in range(state.ranges[scene, 0], state.ranges[scene, 1]):
            ti.atomic_min(state.least_limit[scene], node_limit(state, factor, i))

    return look
