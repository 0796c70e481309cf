"""Cells in which parts of a body lie that do not touch: an element for each part.

What the surface cuts out of a cell falls into *patches*, joined along edges of its pieces.  A cell
with one patch holds one part.  In the others, patches are joined where a scan line leads from one
to the other inside the body, by way of samples on the lines: two patches that no way joins bound
two parts, however thin the gap between them is.

An element has eight corners of its own.  Those of elements in neighbouring cells are joined where
the body goes on across the face between them: where a share of it is filled that is not 0 (cells of
one part), where a line passes inside the body, or where a patch goes on.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tisoft.geometry.cage.cutting import Pieces
from tisoft.geometry.cage.lattice import Lattice
from tisoft.geometry.cage.lines import ASIDE, crossings, others
from tisoft.geometry.cage.moments import POWERS, Filled

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]
Flags = NDArray[np.bool_]

LINES = 8
"""Scan lines, and samples on them, along an edge of a cell."""
GRID = 2.0**20
"""Places in a cell that are told apart."""
NO_FACE = 1e-6
"""Share of a face up to which none of it is filled."""
CORNER = np.array([[c & 1, c >> 1 & 1, c >> 2] for c in range(8)])
"""Corners of a cell in the order of a lattice."""


@dataclass(frozen=True, eq=False)
class Elements:
    """What fills the cells, part by part."""

    cell: Rows
    """Row of `Filled.cells` of each, shape (elements,), ascending."""
    moments: Floats
    """φ and the means of each part, shape (elements, 7)."""
    corners: Rows
    """Node of each corner in the order of a lattice, shape (elements, 8)."""
    places: Floats
    """Of the nodes, in cells from the lattice's origin, shape (nodes, 3)."""
    owner: Rows
    """Element of each piece of the surface, −1 in cells that have no fill, shape (pieces,)."""
    links: Rows
    """Elements whose body goes on from one to the other, shape (links, 2)."""


@dataclass(frozen=True, eq=False)
class Cut:
    """A surface's pieces and the cells that it fills."""

    pieces: Pieces
    fill: Filled
    lattice: Lattice

    @cached_property
    def _sorted(self) -> tuple[Rows, Rows]:
        keys = self._keys(self.fill.cells)
        order = np.argsort(keys)
        return keys[order], order

    def _keys(self, cells: Rows) -> Rows:
        nx, ny, _ = self.lattice.cells + 2
        return np.asarray(cells[:, 0] + 1 + nx * (cells[:, 1] + 1 + ny * (cells[:, 2] + 1)))

    def row(self, cells: Rows) -> Rows:
        """Rows of `fill.cells` of places in the lattice; −1 where there is none."""
        keys, order = self._sorted
        wanted = self._keys(cells)
        found = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        return np.where(keys[found] == wanted, order[found], -1)

    @cached_property
    def rows(self) -> Rows:
        """That of each piece."""
        return self.row(self.pieces.cells)

    @cached_property
    def areas(self) -> Floats:
        """n dA of each piece, in faces of a cell, shape (pieces, 3)."""
        p = self.pieces.points
        return np.asarray(0.5 * np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]))

    @cached_property
    def neighbours(self) -> Rows:
        """Row of the next cell along each axis; −1 where there is none, shape (cells, 3)."""
        unit = np.eye(3, dtype=np.int64)
        return np.stack([self.row(self.fill.cells + unit[axis]) for axis in range(3)], axis=1)

    @cached_property
    def faces(self) -> Floats:
        """Filled share of each cell's face towards the next, shape (cells, 3)."""
        cells, found = self.fill.cells, np.empty(self.fill.cells.shape)
        own = self.rows >= 0
        for axis in range(3):
            sums = -np.bincount(self.rows[own], self.areas[own, axis], len(cells))
            a, b = others(axis)
            order = np.lexsort((cells[:, axis], cells[:, a], cells[:, b]))
            run = np.cumsum(sums[order])
            column = cells[order][:, [a, b]]
            starts = np.append(True, (column[1:] != column[:-1]).any(axis=1))
            first = np.maximum.accumulate(np.where(starts, np.arange(len(cells)), 0))
            found[order, axis] = run - np.append(0.0, run)[first]
        return found

    @cached_property
    def same_edges(self) -> Rows:
        """Pairs of pieces with an edge in common."""
        at = np.round(self.pieces.points * GRID).astype(np.int64).astype(np.uint64)
        key = at @ np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
        key = (key ^ key >> np.uint64(31)) * np.uint64(0xBF58476D1CE4E5B9)
        key ^= key >> np.uint64(29)
        edge = (key + np.roll(key, -1, axis=1)).ravel()
        order = np.argsort(edge, kind="stable")
        piece = order // 3
        same = edge[order[1:]] == edge[order[:-1]]
        return np.stack([piece[:-1][same], piece[1:][same]], axis=1)

    @cached_property
    def patch(self) -> Rows:
        """Number of the patch of each piece."""
        pairs = self.same_edges
        own = self.rows[pairs[:, 0]] == self.rows[pairs[:, 1]]
        return _components(len(self.rows), pairs[own])


def _components(count: int, pairs: Rows) -> Rows:
    """The number of each of `count` things' group."""
    from scipy.sparse import coo_array  # SciPy is slow to import
    from scipy.sparse.csgraph import connected_components

    i, j = pairs.T
    graph = coo_array((np.ones(len(pairs), bool), (i, j)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], np.int64)


def elements(pieces: Pieces, fill: Filled, lattice: Lattice) -> Elements:
    """The elements of the cells that a surface fills, the barely filled ones too."""
    made = Cut(pieces, fill, lattice)
    rows, count = made.rows, len(fill.cells)
    own = rows >= 0
    patch_row = np.full(made.patch.max(initial=-1) + 1, -1)
    patch_row[made.patch] = rows
    doubtful = np.bincount(patch_row[patch_row >= 0], minlength=count) > 1
    # Things to join: cells, patches, samples.
    sure = (patch_row >= 0) & ~doubtful[patch_row]
    inside = [np.stack([patch_row[sure], count + np.flatnonzero(sure)], axis=1)]
    across: list[Rows] = []
    runs: list[Runs] = []
    samples = np.empty((0, 3), np.int64)
    if doubtful.any():
        samples = _samples(fill.cells[doubtful])
        runs = [_runs(made, axis, doubtful, samples, len(patch_row)) for axis in range(3)]
        for run in runs:
            own_cell = run.row[0] == run.row[1]
            ends = run.ends.T[own_cell]
            inside.append(ends[(ends >= 0).all(axis=1)])
            across.append(run.across(made, doubtful))
    group = _components(count + len(patch_row) + len(samples), np.concatenate(inside))
    # Groups are elements where they have a cell of one part, or a patch.
    bears = np.concatenate([np.flatnonzero(~doubtful), count + np.flatnonzero(patch_row >= 0)])
    cell_of = np.full(group.max() + 1, -1)
    cell_of[group[bears]] = np.concatenate([np.arange(count), patch_row])[bears]
    is_element = cell_of >= 0
    order = np.flatnonzero(is_element)[np.argsort(cell_of[is_element], kind="stable")]
    number = np.full(len(cell_of), -1)
    number[order] = np.arange(len(order))
    cell = cell_of[order]
    element = number[group]
    owner = np.where(own, element[count + made.patch], -1)
    links = _links(made, cell, owner, [element[pairs] for pairs in across])
    moments = fill.moments[cell]
    if len(cell) > count:
        _share_out(moments, cell, made, owner, [(run, element) for run in runs])
    corners, places = _nodes(fill.cells[cell], links)
    return Elements(cell, moments, corners, places, owner, links)


def _links(made: Cut, cell: Rows, owner: Rows, across: list[Rows]) -> Rows:
    """Pairs of elements in neighbouring cells between which the body goes on."""
    alone = np.bincount(cell, minlength=len(made.fill.cells)) == 1
    only = np.searchsorted(cell, np.arange(len(alone)))
    found = list(across)
    for axis in range(3):
        after = made.neighbours[:, axis]
        joined = alone & (after >= 0) & (made.faces[:, axis] > NO_FACE)
        joined &= alone[after]
        found.append(np.stack([only[joined], only[after[joined]]], axis=1))
    pairs = owner[made.same_edges]
    pairs = pairs[(pairs >= 0).all(axis=1)]
    apart = np.abs(made.fill.cells[cell[pairs[:, 0]]] - made.fill.cells[cell[pairs[:, 1]]])
    found.append(pairs[apart.sum(axis=1) == 1])
    links = np.concatenate(found)
    links = np.sort(links[(links >= 0).all(axis=1)], axis=1)
    key = np.unique(links[:, 0] * len(cell) + links[:, 1])
    return np.stack([key // len(cell), key % len(cell)], axis=1)


def _nodes(cells: Rows, links: Rows) -> tuple[Rows, Floats]:
    """Node of each corner of elements in cells, and the nodes' places."""
    pairs = [np.empty((0, 2), np.int64)]
    way = cells[links[:, 1]] - cells[links[:, 0]]
    for axis in range(3):
        for c in np.flatnonzero(CORNER[:, axis] == 1):
            for step in (1, -1):
                own = links[way[:, axis] == step][:, ::step]
                pairs.append(8 * own + np.array([c, c ^ 1 << axis]))
    group = _components(8 * len(cells), np.concatenate(pairs))
    place = (cells[:, None] + CORNER).reshape(-1, 3)
    first = np.unique(group, return_index=True)[1]
    order = np.lexsort(place[first].T)
    number = np.empty(len(first), np.int64)
    number[order] = np.arange(len(first))
    return number[group].reshape(-1, 8), place[first[order]].astype(np.float64)


@dataclass(frozen=True, eq=False)
class Runs:
    """Ways inside the body along lines of one axis, each from one crossing or sample to the next.

    `ends` are patches and samples by their numbers among the things to join, −1 in cells of one
    part.
    """

    axis: int
    line: Rows
    """Along each of the other two axes, shape (runs, 2)."""
    ends: Rows
    """Shape (2, runs)."""
    row: Rows
    """Rows of their cells, shape (2, runs)."""
    place: Floats
    """Where they lie on the line [cells], shape (2, runs)."""

    def across(self, made: Cut, doubtful: Flags) -> Rows:
        """Pairs of things in neighbouring cells that a run joins."""
        cells = made.fill.cells
        unit = np.eye(3, dtype=np.int64)[self.axis]
        found = []
        for here, step in ((0, 1), (1, -1)):
            own = (self.ends[here] >= 0) & (self.row[0] != self.row[1])
            next_row = made.row(cells[self.row[here, own]] + step * unit)
            # In a cell with samples the run ends there; any other stands for its one element.
            sampled = (next_row >= 0) & doubtful[next_row]
            there = np.where(sampled, self.ends[1 - here, own], next_row)
            found.append(np.stack([self.ends[here, own], there], axis=1))
        pairs = np.concatenate(found)
        return pairs[(pairs >= 0).all(axis=1)]


def _samples(cells: Rows) -> Rows:
    """Samples of cells, counted along the axes, shape (LINES³ cells, 3)."""
    k = np.arange(LINES)
    inside = np.stack(np.meshgrid(k, k, k, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.asarray((LINES * cells[:, None] + inside).reshape(-1, 3))


def _runs(made: Cut, axis: int, doubtful: Flags, samples: Rows, patches: int) -> Runs:
    """The ways inside the body along lines that pass through doubtful cells."""
    count = len(made.fill.cells)
    across = others(axis)
    wide = int(LINES * (made.lattice.cells[across[0]] + 1))
    columns = np.unique(made.fill.cells[doubtful][:, across] @ [1, wide])
    in_column = np.isin(made.pieces.cells[:, across] @ [1, wide], columns)
    some = np.flatnonzero(in_column)
    part = Pieces(made.pieces.points[some], made.pieces.parents[some], made.pieces.cells[some])
    at, place, piece = crossings(part, axis, LINES)
    piece = some[piece]
    crossed_row = made.rows[piece]
    node = np.where(doubtful[crossed_row], count + made.patch[piece], -1)
    node[crossed_row < 0] = -1
    line = np.concatenate([at, samples[:, across]])
    spot = np.concatenate([place, (samples[:, axis] + 0.5 + ASIDE[axis]) / LINES])
    node = np.concatenate([node, count + patches + np.arange(len(samples))])
    row = np.concatenate([crossed_row, np.repeat(np.flatnonzero(doubtful), LINES**3)])
    enters = np.where(made.areas[piece, axis] < 0.0, 1, -1)
    change = np.concatenate([enters, np.zeros(len(samples), np.int64)])
    order = np.lexsort((spot, line[:, 0], line[:, 1]))
    line, spot, node, row, change = (x[order] for x in (line, spot, node, row, change))
    starts = np.append(True, (line[1:] != line[:-1]).any(axis=1))
    number = np.cumsum(starts) - 1
    depth = np.cumsum(change)
    depth -= (depth - change)[starts][number]
    # A line that met an edge after all is not believed.
    wrong = np.zeros(number[-1] + 1, bool)
    wrong[number[(depth < 0) | (depth > 1)]] = True
    last = np.append(starts[1:], True)
    wrong[number[last & (depth != 0)]] = True
    keep = np.flatnonzero((depth == 1) & ~last & ~wrong[number])
    both = np.stack([keep, keep + 1])
    return Runs(axis, line[keep], node[both], row[both], spot[both])


def _share_out(
    moments: Floats, cell: Rows, made: Cut, owner: Rows, runs: list[tuple[Runs, Rows]]
) -> None:
    """Give the parts of cells that have several the moments that lines find, scaled so that they
    add up to the cell's.
    """
    cells, whole = made.fill.cells, made.fill.moments
    several = np.bincount(cell, minlength=len(cells)) > 1
    mine = owner >= 0
    steep = np.stack(
        [np.bincount(owner[mine], np.abs(made.areas[mine, d]), len(cell)) for d in range(3)], axis=1
    )
    best = steep.argmax(axis=1)  # lines that meet its surface steeply measure it best
    raw = np.zeros((len(cell), len(POWERS)))
    for run, element in runs:
        for here in (0, 1):
            ends, row = run.ends[here], run.row[here]
            own = (ends >= 0) & (row >= 0) & ((run.row[0] != run.row[1]) | (here == 0))
            target = np.where(own, element[ends], -1)
            own = own & (target >= 0)
            own &= several[row] & (best[target] == run.axis)
            base = cells[row[own]]
            span = 2.0 * (run.place[:, own] - base[:, run.axis]) - 1.0
            a, b = np.clip(span, -1.0, 1.0)
            middle = np.empty((len(base), 3))
            for k, d in enumerate(others(run.axis)):
                place = (run.line[own, k] + 0.5 + ASIDE[d]) / LINES
                middle[:, d] = 2.0 * (place - base[:, d]) - 1.0
            for k, powers in enumerate(POWERS.tolist()):
                p = powers[run.axis]
                each = (b ** (p + 1) - a ** (p + 1)) / (p + 1)
                for d in others(run.axis):
                    each = each * middle[:, d] ** powers[d]
                raw[:, k] += np.bincount(target[own], each, len(cell)) / (2.0 * LINES**2)
    total = whole * np.where(np.arange(len(POWERS)) == 0, 1.0, whole[:, :1])
    for k in range(len(POWERS)):
        sums = np.bincount(cell, raw[:, k], len(cells))
        if k == 0:
            scale = total[:, 0] / np.maximum(sums, 1e-300)
            raw *= scale[cell][:, None]
        else:
            raw[:, k] += (total[:, k] - sums)[cell] * (raw[:, 0] / total[cell, 0])
    split = several[cell] & (raw[:, 0] > 0.0)
    moments[split] = raw[split]
    moments[split, 1:] /= raw[split, :1]
    moments[several[cell] & (raw[:, 0] <= 0.0)] = 0.0
