# mypy: ignore-errors
"""Mass-tensor: linear elasticity with its stiffness stored on the edges of a tet mesh.

    f_i = −Σ_j K_ij u_j,   K_ab = V [λ ∇N_a ∇N_bᵀ + μ ∇N_b ∇N_aᵀ + μ (∇N_a·∇N_b) I]

summed over the tets that hold both nodes: the gradient of the strain energy, so the same force as
linear finite elements to rounding (Cotin, Delingette and Ayache 2000; Picinbono, Delingette and
Ayache 2003 carried the name to large displacements).  Rows add up to nothing, K_ii = −Σ_j≠i K_ij,
and K_ji = K_ijᵀ, so that the edges alone do it, in differences that keep their digits in f32
however far a body has moved:

    edge (i, j), d = u_j − u_i:   f_i −= K_ij d + C_ij ḋ,   f_j += K_ijᵀ d + C_ijᵀ ḋ,
                                  energy −dᵀK_ij d/2 + u_iᵀ (K_ij − K_ijᵀ) d/2

A tet mesh has about 7 edges and 5 to 6 tets a node: where elements are linear and the material does
not change, edges replace the loop over tets.

| symbol | name          | unit   |
| ------ | ------------- | ------ |
| K_ij   | `rest[0..8]`  | N/m    |
| C_ij   | `rest[9..17]` | N·s/m  |
"""

from collections.abc import Sequence

import numpy as np
import taichi as ti
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Rows = NDArray[np.integer]


class Tensor:
    """An edge of a mass-tensor body."""

    corners = 2
    points = 1
    rows = 6
    stresses = 0
    known = 4
    constants = 0
    numbers = 18
    is_relative = True
    """Whether its energy wants displacements as seen from one of its body\'s nodes."""

    @staticmethod
    @ti.func
    def difference(a: ti.template(), lane):
        """a_j − a_i of the two corner columns."""
        return ti.Vector([a[3 + d, lane] - a[d, lane] for d in range(3)])

    @staticmethod
    @ti.func
    def pull(
        rest: ti.template(), first: ti.template(), d, lane, row: ti.template(), out: ti.template()
    ):
        """−A d on end i and Aᵀd on end j, into rows of `out` from `row` on; A = rest[first..]."""
        for r in ti.static(range(3)):
            here, there = 0.0 * d[0], 0.0 * d[0]
            for c in ti.static(range(3)):
                here -= rest[first + 3 * r + c, lane] * d[c]
                there += rest[first + 3 * c + r, lane] * d[c]
            out[row + r, lane] = here
            out[row + 3 + r, lane] = there

    @staticmethod
    @ti.func
    def forces(
        law: ti.template(),
        rest: ti.template(),
        u: ti.template(),
        v: ti.template(),
        m,
        q,
        lane,
        out: ti.template(),
    ):
        """Forces on the ends [N]; rows 6..11 of `out`, where it has them, get the viscous share."""
        Tensor.pull(rest, 0, Tensor.difference(u, lane), lane, 0, out)
        dv = Tensor.difference(v, lane)
        if ti.static(out.n > 6):
            Tensor.pull(rest, 9, dv, lane, 6, out)
        for r in ti.static(range(3)):
            for c in ti.static(range(3)):
                out[r, lane] -= rest[9 + 3 * r + c, lane] * dv[c]
                out[3 + r, lane] += rest[9 + 3 * c + r, lane] * dv[c]

    @staticmethod
    def of_material(lam: float, mu: float) -> tuple[float, ...]:
        """It needs no constants of its own."""
        return ()

    @staticmethod
    @ti.func
    def energy(law: ti.template(), rest: ti.template(), u: ti.template(), m, q, lane):
        """The edge's share of uᵀK u/2 [J], which may be negative; u as seen from one node."""
        d = Tensor.difference(u, lane)
        total = 0.0 * d[0]
        for r in range(3):
            for c in range(3):
                along, back = rest[3 * r + c, lane], rest[3 * c + r, lane]
                total += 0.5 * (u[r, lane] * (along - back) - d[r] * along) * d[c]
        return total

    @staticmethod
    @ti.func
    def product(
        law: ti.template(),
        rest: ti.template(),
        u: ti.template(),
        w: ti.template(),
        m,
        q,
        lane,
        out: ti.template(),
    ):
        """K w [N]."""
        Tensor.pull(rest, 0, -Tensor.difference(w, lane), lane, 0, out)


def edge_sums(solids: Sequence[tuple[Rows, Floats]]) -> tuple[NDArray[np.int64], Floats]:
    """Edges (i < j), shape (edges, 2), and the sum of their cells' K_ij, shape (edges, 9).

    `solids`: nodes of cells, shape (cells, corners), and their K_e [N/m], each.
    """
    pairs, values = [], []
    for cells, matrices in solids:
        corners = cells.shape[1]
        blocks = matrices.reshape(-1, corners, 3, corners, 3)
        a, b = np.nonzero(~np.eye(corners, dtype=bool))
        ends = np.stack([cells[:, a], cells[:, b]], axis=-1).reshape(-1, 2).astype(np.int64)
        up = ends[:, 0] < ends[:, 1]
        pairs.append(ends[up])
        values.append(blocks[:, a, :, b, :].swapaxes(0, 1).reshape(-1, 9)[up])
    rows, columns = np.concatenate(pairs), np.concatenate(values).T
    span = int(rows.max(initial=0)) + 1
    keys, index = np.unique(rows[:, 0] * span + rows[:, 1], return_inverse=True)
    total = np.stack([np.bincount(index, column, minlength=len(keys)) for column in columns], 1)
    return np.stack([keys // span, keys % span], axis=1), total
