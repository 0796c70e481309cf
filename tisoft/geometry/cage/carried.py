"""Forces on a surface that a cage carries, and which of its nodes hold a patch of it.

    f_a = ∫ N_a t dA,   −p ∫ N_a n dA   over pieces of the triangles, each in one cell

A pressure takes a piece (a, b, c) of the deformed surface for flat between its corners
x_a = Σ N_m(a) x_m: a sum of cross products of edges between nodes of its cell, and the gradient of
the enclosed volume, so that a closed surface is neither pushed away nor turned,

    f_i = −p N̄_i (x_b − x_a) × (x_c − x_a)/2 = −p Σ_{m<n} c_imn (x_m − x_i) × (x_n − x_i)

with N̄_i the mean over the three corners.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tisoft.geometry.cage.connected import CORNER
from tisoft.geometry.cage.cutting import Pieces, cut
from tisoft.geometry.cage.moments import POINTS, WEIGHTS
from tisoft.geometry.cells import LATTICE

if TYPE_CHECKING:
    from tisoft.geometry.solid import SolidMesh

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]

NEAR = 0.5
"""Distance, in cells, within which a node holds a patch that lies on no plane of the lattice."""
LEAST_AREA = 0.02
"""Of the largest part of a patch in a cell: what is smaller has no mean of its own."""
FULL = 1e-9
"""How much a full cell may lack."""
MOST_MEANS = 500
"""Cells of a patch whose means are held; of more, nodes near it are."""
FLAT = 1e-6
"""Distance, in cells, up to which a patch lies on a plane of the lattice."""
PARTS = 4
"""Pieces of a cell's edge in which one point of the surface meets obstacles."""
AT_ONCE = 20000
"""Pieces whose pressures are summed at a time."""
PAIRS = np.array([[m, n] for m in range(8) for n in range(m + 1, 8)])


class Means(NamedTuple):
    """Cells of a patch: c·u is the mean displacement of what lies in one."""

    nodes: Rows
    """Shape (cells, 8)."""
    shares: Floats
    """c_a, shape (cells, 8)."""
    around: Rows
    """Nodes of all cells that the patch is in, and of all that are filled in part."""


def shares(inside: Floats) -> Floats:
    """N_a of places in a cell, 0 .. 1 along each axis, shape (…, 8)."""
    each = np.where(CORNER, inside[..., None, :], 1.0 - inside[..., None, :])
    return np.asarray(each.prod(axis=-1))


class Carried:
    """The surface of a cage as what loads act on and pins hold; the counterpart of `Boundary`."""

    def __init__(self, mesh: SolidMesh) -> None:
        assert mesh.cage is not None
        self.mesh, self.cage, self.skin = mesh, mesh.cage, mesh.cage.skin
        self._known: dict[bytes, Means | None] = {}
        """Means of patches that were asked for, by their points."""

    @cached_property
    def places(self) -> Floats:
        """Nodes in cells from the lattice's origin, shape (nodes, 3)."""
        places = np.zeros((len(self.mesh.points), 3))
        places[self.mesh.hexes[:, LATTICE]] = self.cage.cells[:, None] + CORNER
        return places

    @cached_property
    def _points(self) -> Floats:
        """Points of the surface, likewise."""
        return self.skin.carried(self.places)

    @cached_property
    def _edges(self) -> Floats:
        """Edges of a cell as they are [m], in the rows."""
        corners = self.mesh.points[self.mesh.hexes[0, LATTICE]]
        return corners[[1, 2, 4]] - corners[0]

    def within(self, picked: NDArray[np.bool_]) -> Rows:
        """Triangles all of whose points are picked."""
        return np.flatnonzero(picked[self.skin.triangles].all(axis=1))

    def area_shares(self, triangles: Rows) -> Floats:
        """∫ N_a dA over triangles at rest [m²], shape (nodes,)."""
        pieces, _, nodes = self._pieces(triangles)
        sides = (pieces.points[:, 1:] - pieces.points[:, :1]) @ self._edges
        areas = 0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
        each = areas[:, None] * self._means(pieces)
        return np.bincount(nodes.ravel(), each.ravel(), len(self.mesh.points)).astype(np.float64)

    def pressed(self, triangles: Rows) -> tuple[Rows, Floats]:
        """How a pressure acts on triangles: rows (i, j, k) of nodes and numbers c with ∫ N_i n dA =
        Σ c (x_j − x_i) × (x_k − x_i), shapes (rows, 3) and (rows,).
        """
        pieces, _, nodes = self._pieces(triangles)
        own, index = np.unique(nodes, axis=0, return_inverse=True)
        index = index.reshape(-1)
        total = np.zeros((len(own), 8, len(PAIRS)))
        for some in np.array_split(np.arange(len(index)), 1 + len(index) // AT_ONCE):
            part = Pieces(pieces.points[some], pieces.parents[some], pieces.cells[some])
            at = shares(part.points - part.cells[:, None])
            b, c = at[:, 1] - at[:, 0], at[:, 2] - at[:, 0]
            m, n = PAIRS.T
            area = 0.5 * (b[:, m] * c[:, n] - b[:, n] * c[:, m])
            np.add.at(total, index[some], at.mean(axis=1)[:, :, None] * area[:, None])
        i = np.repeat(np.arange(8), len(PAIRS))
        pairs = np.tile(PAIRS, (8, 1))
        keep = (pairs != i[:, None]).all(axis=1)  # x_i − x_i is none
        three = np.column_stack([i, pairs])[keep]
        numbers = total.reshape(len(own), -1)[:, keep].ravel()
        return own[:, three].reshape(-1, 3), numbers

    def _pieces(self, triangles: Rows) -> tuple[Pieces, Rows, Rows]:
        """Pieces of triangles in the cells of the hexahedra that carry them, these hexahedra, and
        their nodes.
        """
        rows = self.skin.triangles[triangles].astype(np.int64)
        pieces = cut(self._points, rows, self.cage.lattice.cells)
        own = self._carriers(triangles[pieces.parents], pieces.cells)
        nodes = self.mesh.hexes[:, LATTICE][own].astype(np.int64)
        return Pieces(pieces.points, pieces.parents, self.cage.cells[own]), own, nodes

    def _carriers(self, triangles: Rows, cells: Rows) -> Rows:
        """The hexahedra that carry what of triangles lies in cells."""
        nx, ny, nz = self.cage.lattice.cells
        keys = [c @ np.array([1, nx, nx * ny]) for c in (self.cage.cells, cells)]
        order = np.argsort(keys[0])
        found = order[np.minimum(np.searchsorted(keys[0][order], keys[1]), len(order) - 1)]
        stray = self.cage.strays
        if len(stray):
            whole = nx * ny * nz
            known = stray[:, 0] * whole + stray[:, 1:4] @ np.array([1, nx, nx * ny])
            wanted = triangles * whole + keys[1]
            order = np.argsort(known)
            at = order[np.minimum(np.searchsorted(known[order], wanted), len(order) - 1)]
            found = np.where(known[at] == wanted, stray[at, 4], found)
        return np.asarray(found)

    @staticmethod
    def _means(pieces: Pieces) -> Floats:
        """Mean of N_a over each piece, shape (pieces, 8)."""
        at = np.einsum("qc,tcd->tqd", POINTS, pieces.points - pieces.cells[:, None])
        return np.einsum("q,tqa->ta", WEIGHTS, shares(at))

    def is_on_plane(self, points: Rows) -> bool:
        """Whether points of the surface lie on one plane of the lattice."""
        there = self._points[points]
        flat = np.ptp(there, axis=0) < FLAT
        on = np.abs(there[0] - np.round(there[0])) < FLAT
        return bool((flat & on).any())

    def means(self, points: Rows) -> Means | None:
        """What holds a patch between points of the surface by the mean displacement of each cell;
        None where there are no triangles between them, or more than MOST_MEANS cells.
        """
        key = points.tobytes()
        if key not in self._known:
            self._known[key] = self._make_means(points)
        return self._known[key]

    def _make_means(self, points: Rows) -> Means | None:
        picked = np.zeros(len(self._points), bool)
        picked[points] = True
        pieces, own, around = self._pieces(self.within(picked))
        if not len(own):
            return None
        sides = (pieces.points[:, 1:] - pieces.points[:, :1]) @ self._edges
        areas = 0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
        cells, index = np.unique(own, return_inverse=True)
        total = np.zeros((len(cells), 8))
        np.add.at(total, index.reshape(-1), areas[:, None] * self._means(pieces))
        area = total.sum(axis=1)
        kept = area >= LEAST_AREA * area.max()
        if kept.sum() > MOST_MEANS:
            return None
        nodes = self.mesh.hexes[:, LATTICE][cells[kept]].astype(np.int64)
        cut_cells = self.cage.moments[:, 0] < 1.0 - FULL
        around = np.union1d(around, self.mesh.hexes[cut_cells])
        return Means(nodes, total[kept] / area[kept, None], around)

    def holders(self, points: Rows) -> Rows:
        """Nodes within half a cell of a patch between points of the surface."""
        from scipy.spatial import cKDTree

        picked = np.zeros(len(self._points), bool)
        picked[points] = True
        pieces, _, nodes = self._pieces(self.within(picked))
        samples = np.concatenate([self._points[points], pieces.points.reshape(-1, 3)])
        away = cKDTree(samples).query(self.places, p=np.inf)[0]
        # Not what lies beyond a gap: nodes of the cells that carry the patch and of those beside.
        near = np.zeros(len(self.places), bool)
        near[nodes] = near[self.skin.corners[points]] = True
        near[self.mesh.hexes[near[self.mesh.hexes].any(axis=1)]] = True
        return np.flatnonzero((away <= NEAR * (1.0 + 1e-6)) & near)

    def outermost(self) -> Rows:
        """Points of the surface that stand for it where it is met: of each part of a cell the one
        that lies farthest out, those of the same nodes together.
        """
        points, triangles = self._points, self.skin.triangles.astype(np.int64)
        corners = points[triangles]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        spot = np.floor(PARTS * points).astype(np.int64)
        _, own = np.unique(spot, axis=0, return_inverse=True)
        own = own.reshape(-1)
        out = np.zeros((own.max() + 1, 3))
        for corner in range(3):
            np.add.at(out, own[triangles[:, corner]], normals)
        height = np.einsum("pi,pi->p", points, out[own])
        order = np.lexsort((height, own))
        last = np.append(own[order][1:] != own[order][:-1], True)
        return order[last][np.lexsort(self.skin.corners[order[last]].T[::-1])]
