"""The static problem of one body: what its nodes must balance at a load factor.

    f(u) + s L(u) − (1 − s) f(X) = 0 on free axes,   u = place(s) on held axes,   0 ≤ s ≤ 1

with L = gravity and loads, and s the load factor.  f(X), the forces of a net whose springs are not
at their rest lengths, is let go as the load comes on, so that the branch begins at rest.  Pins move
with s as well: along straight lines, or turned by s times their angle.  Pressures and torques turn
with the surface; their part of the tangent is K − s ∂L/∂u, and pressures have the potential s p V
where their faces close or end on held nodes.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from tisoft.equilibrium.held import Held
from tisoft.equilibrium.operators import operators_of
from tisoft.errors import NoEquilibrium
from tisoft.loads import Load
from tisoft.model.part import Part
from tisoft.step.loading import forces_of, pressed_rows, pressure_forces, pressure_tangent

Floats = NDArray[np.float64]

TARGET = 1e-12
"""Out-of-balance forces that end an iteration, as a share of the load."""
ACCEPTED = 1e-8
"""Out-of-balance forces that are still an answer where rounding allows no less."""


class Balance:
    """One body's static problem; all arrays (nodes, 3), inside order.

    Args:
        part: the body.
        time: when loads and pins are looked at [s].
        dead: gravity and other dead forces at factor 1 [N]; the body's own loads come on top.
        target: out-of-balance forces that end an iteration, as a share of the load.
    """

    def __init__(self, part: Part, time: float, dead: Floats, target: float = TARGET) -> None:
        self.part = part
        self.target = target
        self.time = time
        self.elastic = operators_of(part)
        self.held = Held(part, time)
        self.free = self.held.free
        self.rest = part.body.mesh.points[part.order]
        acting = [load for load in part.body.loads if load.factor(time)]
        self.followers = [a for a in acting if a.kind in ("pressure", "torque")]
        self.pressures = [
            (a.factor(time) * (a.pressure or 0.0), *pressed_rows(part, a))
            for a in acting
            if a.kind == "pressure"
        ]
        self.torques = [a for a in acting if a.kind == "torque"]
        self.dead = dead + self._forces([a for a in acting if a not in self.followers], self.rest)
        self.load = self.loads(np.zeros_like(dead))
        """All loads at rest [N]."""
        self.linear = part.elements > 0 and not self.elastic.is_finite
        self.start = self.elastic.force(np.zeros_like(dead))
        self.start = self.held.balanced(self.start)
        self._state, self._factor = np.zeros_like(dead), 0.0
        self._follows: sparse.csr_array | None = None

    def _forces(self, loads: list[Load], x: Floats) -> Floats:
        total = np.zeros_like(x)
        for load in loads:
            total += load.factor(self.time) * forces_of(self.part, load, x)
        return total

    def loads(self, u: Floats) -> Floats:
        """L(u) [N]."""
        if not self.followers:
            return self.dead
        x = self.rest + u
        total = self.dead + self._forces(self.torques, x)
        for pressure, rows, numbers in self.pressures:
            total += pressure_forces(pressure, rows, numbers, x)
        return total

    def place(self, factor: float) -> Floats:
        """Prescribed displacements at a load factor [m]."""
        return self.held.place(factor)

    def external(self, u: Floats, factor: float) -> Floats:
        """All that the elastic forces must balance, apart from reactions [N]."""
        return factor * self.loads(u) - max(1.0 - factor, 0.0) * self.start

    def out_of_balance(self, u: Floats, factor: float) -> tuple[Floats, Floats]:
        """Forces left over that nothing holds, and the pins' forces [N]."""
        total = self.elastic.force(u) + self.external(u, factor)
        left = self.held.balanced(total)
        return left, left - total

    def scale(self, u: Floats, factor: float, reactions: Floats) -> float:
        """What residuals are compared with [N]: the largest nodal load, or the largest reaction
        where motion is prescribed or no load falls on free axes.
        """
        load = largest(np.where(self.free, self.external(u, factor), 0.0))
        return load if load > 0.0 and not self.moves else max(load, largest(reactions))

    @cached_property
    def moves(self) -> bool:
        """Whether pins prescribe motion."""
        return bool(self.place(1.0).any())

    def potential(self, u: Floats, factor: float) -> tuple[float, float]:
        """V(u) − s L·u [J], and the size of its terms, on which its rounding depends."""
        elastic = self.elastic.energy(u)
        work = float(((factor * self.dead - max(1.0 - factor, 0.0) * self.start) * u).sum())
        size = abs(elastic) + abs(work)
        for pressure, rows, numbers in self.pressures:
            here, before = (volume(rows, numbers, x) for x in (self.rest + u, self.rest))
            change = here - before
            work -= factor * pressure * change
            size += abs(factor * pressure * change)
        return elastic - work, size

    def tangent(self, u: Floats, factor: float) -> sparse.csc_matrix:
        """K − s ∂L/∂u [N/m] as a symmetric sparse matrix, without the torques' part."""
        matrix = self.elastic.stiffness(u)
        if self.pressures and factor:
            follows = pressure_tangent(self.part, self.time, self.rest + u)
            matrix = matrix - (0.5 * factor) * sparse.csc_matrix(follows + follows.T)
        return sparse.csc_matrix(matrix)

    def look(self, u: Floats, factor: float) -> None:
        """Choose the state for `tangent_times`."""
        self._state, self._factor = u, factor
        self.elastic.look(u)
        self._follows = None
        if self.pressures and factor:
            self._follows = factor * pressure_tangent(self.part, self.time, self.rest + u)

    def tangent_times(self, w: Floats) -> Floats:
        """(K − s ∂L/∂u) w [N] at the state looked at."""
        product = self.elastic.stiffness_times(w)
        if self._follows is not None:
            product -= (self._follows @ w.ravel()).reshape(-1, 3)
        if self.torques and self._factor:
            h = 1e-5 * self.part.size / (float(np.abs(w).max()) or 1.0)
            x = self.rest + self._state
            ahead, behind = (self._forces(self.torques, x + step * w) for step in (h, -h))
            product -= (0.5 * self._factor / h) * (ahead - behind)
        return product

    def rigid_motions(self, u: Floats) -> Floats:
        """Rigid motions of the pieces that no pin holds anywhere, orthonormal rows, shape
        (6 pieces at the most, nodes · 3)."""
        loose = np.flatnonzero(np.bincount(self.pieces, self.held.gripped.any(axis=1)) == 0)
        x = self.rest if self.linear else self.rest + u
        rows = []
        for piece in loose:
            mine = (self.pieces == piece)[:, None]
            arm = x - x[mine[:, 0]].mean(axis=0)
            for axis in np.eye(3):
                rows += [mine * axis, mine * np.cross(axis, arm)]
        if not rows:
            return np.empty((0, u.size))
        motions = np.array(rows).reshape(len(rows), -1)
        _, sizes, right = np.linalg.svd(motions, full_matrices=False)
        return np.asarray(right[sizes > 1e-9 * sizes[0]], np.float64)

    def is_admissible(self, u: Floats) -> bool:
        """Whether all is finite and no tet inverted (a linear body never says so itself)."""
        if not np.isfinite(u).all():
            return False
        return self.linear or self.elastic.least_volume_change(u) > 0.0

    @cached_property
    def pieces(self) -> NDArray[np.int32]:
        """Number of the connected piece that each node belongs to, shape (nodes,)."""
        part, nodes = self.part, self.elastic.nodes
        pairs: list[NDArray[np.integer]] = [part.springs]
        for cells in part.solids:
            pairs += [cells.nodes[:, [0, k]] for k in range(1, cells.nodes.shape[1])]
        ends = np.concatenate([p.reshape(-1, 2).astype(np.int64) for p in pairs])
        graph = sparse.coo_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), (nodes, nodes))
        labels: NDArray[np.int32] = connected_components(graph, directed=False)[1]
        return labels

    def check_holds(self) -> None:
        """Raises NoEquilibrium where a piece is free to fly along an axis that loads push along."""
        part, piece = self.part, self.pieces
        count = int(piece.max()) + 1
        for k, axis in enumerate("xyz"):
            held = np.bincount(piece, self.held.gripped[:, k], minlength=count) > 0
            push = np.abs(np.bincount(piece, self.load[:, k], minlength=count))
            size = np.bincount(piece, np.abs(self.load).sum(axis=1), minlength=count)
            flying = np.flatnonzero(~held & (push > 1e-9 * size))
            if len(flying):
                node = int(part.order[np.flatnonzero(piece == flying[0])[0]])
                number = int(part.body.mesh.kept_nodes[node])
                raise no_equilibrium(
                    f"no pin holds the piece of {part.body.name!r} with node {number} along "
                    f"{axis}, where {push[flying[0]]:.4g} N push it",
                    0.0,
                )


def volume(rows: NDArray[np.int64], numbers: Floats, x: Floats) -> float:
    """Volume [m³] between faces and the origin; `rows`, `numbers` as of `Boundary.pressed`."""
    i, j, k = rows.T
    normals = numbers[:, None] * np.cross(x[j] - x[i], x[k] - x[i])
    return float(np.einsum("fi,fi->", x[i], normals) / 3.0)


def largest(forces: Floats) -> float:
    """Length of the longest row."""
    return float(np.sqrt(np.einsum("ni,ni->n", forces, forces).max(initial=0.0)))


def no_equilibrium(text: str, factor: float) -> NoEquilibrium:
    """The error, with the last load factor that had an equilibrium as `load_factor`."""
    error = NoEquilibrium(text)
    error.load_factor = factor
    return error
