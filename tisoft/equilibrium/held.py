"""What pins hold of a body in a static problem: components of nodes, and means of cells of a patch.

    u = place + T q,   C T = 0,   c·u = U

T picks the free components; where means are held it also leaves out one component for each of them,
and tells it from the others: u_p = −C_p⁻¹ C_r u_r, with p chosen by pivoting (Golub and Van Loan).
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, sparse

from tisoft.model.part import Part
from tisoft.pins import Pin
from tisoft.step.patches import Patch, patch_of

Floats = NDArray[np.float64]

RANK = 1e-10
"""Share of the largest pivot below which a mean is told by the others."""


class Held:
    """What pins hold at `time` [s]; arrays (nodes, 3), inside order."""

    def __init__(self, part: Part, time: float) -> None:
        self.part, self.time = part, time
        self.dissection: Any = None
        """How matrices on the unknowns are factorised, once one was; see `frontal`."""
        self.pins: list[tuple[Pin, NDArray[np.int64]]] = []
        """Each with its rows of `mesh.points`."""
        self.patches: list[Patch] = []
        self.axes = np.zeros((len(part.order), 3), bool)
        """Whether a pin holds each node along each axis."""
        for pin in part.body.pins:
            if pin.release is not None and time >= pin.release:
                continue
            rows, patch = patch_of(part, pin)
            self.pins.append((pin, rows))
            self.axes[np.ix_(part.rank[rows], pin.components)] = True
            if patch is not None:
                self.patches.append(patch)

    @property
    def free(self) -> NDArray[np.bool_]:
        """Whether each component is free, but for means."""
        return ~self.axes

    @cached_property
    def gripped(self) -> NDArray[np.bool_]:
        """Whether something holds a node along an axis, by itself or in a mean."""
        out = self.axes.copy()
        for patch in self.patches:
            out[np.ix_(np.unique(patch.nodes), patch.pin.components)] = True
        return out

    @cached_property
    def unknowns(self) -> NDArray[np.int64]:
        """The component, 3 node + axis, that each q is of."""
        free = np.flatnonzero(self.free.ravel())
        return np.setdiff1d(free, self._tied[1]) if self.patches else free

    @cached_property
    def basis(self) -> sparse.csc_matrix:
        """T, shape (3 nodes, unknowns)."""
        whole = sparse.identity(self.axes.size, format="csc")
        return sparse.csc_matrix(
            (whole + self._tied[0] if self.patches else whole)[:, self.unknowns]
        )

    @cached_property
    def _tied(self) -> tuple[sparse.csc_matrix, NDArray[np.int64]]:
        """−C_p⁻¹ C_r, shape (3 nodes, 3 nodes), and the components p."""
        count = self.axes.size
        told: list[NDArray[np.int64]] = []
        parts = []
        for axis in range(3):
            C = self._means(axis)
            mine = np.flatnonzero((C != 0.0).any(axis=0) & self.free[:, axis])
            if not len(mine):
                continue
            _, R, order = linalg.qr(C[:, mine], mode="economic", pivoting=True)
            rank = int((np.abs(R.diagonal()) > RANK * np.abs(R[0, 0])).sum())
            shares = -linalg.solve_triangular(R[:rank, :rank], R[:rank, rank:])
            pivots, others = mine[order[:rank]], mine[order[rank:]]
            rows, columns = np.meshgrid(3 * pivots + axis, 3 * others + axis, indexing="ij")
            parts.append((shares.ravel(), rows.ravel(), columns.ravel()))
            told.append(3 * pivots + axis)
        values, rows, columns = (np.concatenate(column) for column in zip(*parts, strict=True))
        tied = sparse.csc_matrix((values, (rows, columns)), (count, count))
        return tied, np.concatenate(told)

    def on_unknowns(self, matrix: Any) -> sparse.csc_matrix:
        """Tᵀ A T of a sparse matrix."""
        if self.patches:
            return sparse.csc_matrix(self.basis.T @ matrix @ self.basis)
        free = np.flatnonzero(self.free.ravel())
        return sparse.csc_matrix(matrix[free][:, free])

    def _means(self, axis: int) -> Floats:
        """C of an axis, shape (means, nodes)."""
        rows = [patch for patch in self.patches if axis in patch.pin.components]
        nodes = np.concatenate([np.empty((0, 8), np.int64), *[patch.nodes for patch in rows]])
        C = np.zeros((len(nodes), len(self.axes)))
        np.add.at(C, (np.arange(len(nodes))[:, None], nodes), _shares(rows))
        return C

    @cached_property
    def _inverses(self) -> list[tuple[Floats, Floats]]:
        """C on free axes and Cᵀ (C Cᵀ)⁻¹, of each axis."""
        found = []
        for axis in range(3):
            C = self._means(axis) * self.free[:, axis]
            found.append((C, C.T @ np.linalg.pinv(C @ C.T, RANK, hermitian=True)))
        return found

    def balanced(self, force: Floats) -> Floats:
        """The forces that nothing holds [N]: without those along C, 0 on held axes."""
        out = np.where(self.free, force, 0.0)
        if self.patches:
            for axis, (C, back) in enumerate(self._inverses):
                out[:, axis] -= back @ (C @ out[:, axis])
        return out

    def place(self, factor: float) -> Floats:
        """Prescribed displacements [m] at a load factor, 0 where free; means have theirs."""
        place = np.zeros(self.axes.shape)
        part = self.part
        for pin, rows in self.pins:
            points = part.body.mesh.points[rows]
            way = pin.share_of_way(points, self.time, factor)
            axes = pin.components
            moved = np.ix_(part.rank[rows], axes)
            # Of two pins that hold a node, one may be still: the moving one tells where it is.
            place[moved] = np.where(way[:, axes] != 0.0, way[:, axes], place[moved])
        if any(patch.pin.moves for patch in self.patches) or place.any():
            for axis, (_, back) in enumerate(self._inverses):
                mine = [patch for patch in self.patches if axis in patch.pin.components]
                wanted = [patch.targets(self.time, factor)[:, axis] for patch in mine]
                now = [patch.means(place)[:, axis] for patch in mine]
                if mine:
                    place[:, axis] += back @ (np.concatenate(wanted) - np.concatenate(now))
        return place


def _shares(patches: list[Patch]) -> Floats:
    return np.concatenate([np.empty((0, 8)), *[patch.shares for patch in patches]])
