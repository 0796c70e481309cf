"""Boundary of meshes whose cells have faces of 3, 4 or 6 nodes: which faces belong to one cell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tisoft.geometry.cells import CELLS, TRIANGLES, area_shares, pressed_pairs

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]
CORNERS = {3: 3, 6: 3, 4: 4}
"""Corners of a face of so many nodes."""
HALVES = [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]
"""Triangles that a quad may be halved into."""


@dataclass(frozen=True, eq=False)
class Boundary:
    """Faces of one cell only, a table for each number of nodes, seen from outside."""

    faces: tuple[Rows, ...]
    """Nodes of the faces, shape (faces, nodes) each."""
    halves: int = 0
    """Sides of hexes that two tets meet."""

    @cached_property
    def triangles(self) -> Rows:
        """Triangles that the faces are drawn with, table after table, shape (triangles, 3)."""
        made = [own[:, TRIANGLES[own.shape[1]]].reshape(-1, 3) for own in self.faces]
        return np.concatenate([np.empty((0, 3), np.int64), *made])

    @cached_property
    def rows(self) -> tuple[Rows, ...]:
        """Rows of `triangles` that each face is drawn with, shape (faces, triangles a face)."""
        found, begun = [], 0
        for own in self.faces:
            each = len(TRIANGLES[own.shape[1]])
            found.append(np.arange(begun, begun + each * len(own)).reshape(-1, each))
            begun += each * len(own)
        return tuple(found)

    def within(self, picked: NDArray[np.bool_]) -> Rows:
        """Triangles of the faces all of whose nodes are picked."""
        pairs = zip(self.faces, self.rows, strict=True)
        return np.concatenate(
            [np.empty(0, np.int64), *[rows[picked[own].all(axis=1)].ravel() for own, rows in pairs]]
        )

    def area_shares(self, points: Floats, triangles: NDArray[np.integer]) -> Floats:
        """∫ N_i dA over the faces of the given triangles [m²], shape (nodes,)."""
        total = np.zeros(len(points))
        for own in self.chosen(triangles):
            each = area_shares(points, own).ravel()
            total += np.bincount(own.ravel(), each, minlength=len(points))
        return total

    def pressed(self, triangles: NDArray[np.integer]) -> tuple[Rows, Floats]:
        """How a pressure acts on the faces of the given triangles: rows (i, j, k) of nodes and
        numbers c with ∫ N_i n dA = Σ c (x_j − x_i) × (x_k − x_i), shapes (rows, 3) and (rows,).
        """
        rows, numbers = [np.empty((0, 3), np.int64)], [np.empty(0)]
        for own in self.chosen(triangles):
            if len(own):
                pairs, values = pressed_pairs(own.shape[1])
                rows.append(own[:, pairs].reshape(-1, 3))
                numbers.append(np.tile(values, len(own)))
        return np.concatenate(rows), np.concatenate(numbers)

    @property
    def pressed_rows(self) -> int:
        """How many rows `pressed` has for all faces."""
        return sum(len(own) * len(pressed_pairs(own.shape[1])[1]) for own in self.faces)

    def matching(self, corners: NDArray[np.integer]) -> Rows:
        """Triangles of the faces that have the given corners, three of each, shape (n, 3)."""
        wanted = {tuple(row) for row in np.sort(corners, axis=1).tolist()}
        found = [np.empty(0, np.int64)]
        for own, rows in zip(self.faces, self.rows, strict=True):
            thirds = [[0, 1, 2]] if CORNERS[own.shape[1]] == 3 else HALVES
            sets: list[list[list[int]]] = np.sort(own[:, thirds], axis=2).tolist()
            mine = [any(tuple(third) in wanted for third in face) for face in sets]
            found.append(rows[np.array(mine, bool)].ravel())
        return np.concatenate(found)

    def chosen(self, triangles: NDArray[np.integer]) -> list[Rows]:
        """Faces of each table that some of the given triangles belong to."""
        mine = np.zeros(len(self.triangles), bool)
        mine[triangles] = True
        pairs = zip(self.faces, self.rows, strict=True)
        return [own[mine[rows].any(axis=1)] for own, rows in pairs]


def boundary_of(cells: Mapping[str, NDArray[np.integer]]) -> Boundary:
    """The boundary of cells of several kinds; a side of a hex that two tets meet is inside."""
    tables: dict[int, list[Rows]] = {}
    for word, rows in cells.items():
        kind = CELLS[word]
        faces = rows.astype(np.int64)[:, kind.faces].reshape(-1, kind.faces.shape[1])
        tables.setdefault(kind.faces.shape[1], []).append(faces)
    whole = {size: np.concatenate(own) for size, own in tables.items()}
    left: dict[int, Rows] = {}
    for corners in (3, 4):
        sizes = [size for size in whole if CORNERS[size] == corners]
        if not sizes:
            continue
        keys = np.concatenate([np.sort(whole[size][:, :corners], axis=1) for size in sizes])
        _, index, count = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
        alone, begun = (count == 1)[index.reshape(-1)], 0
        for size in sizes:
            left[size] = whole[size][alone[begun : begun + len(whole[size])]]
            begun += len(whole[size])
    halves = 0
    if 4 in left and 3 in left:
        left[4], left[3], halves = _without_halves(left[4], left[3])
    return Boundary(tuple(left[size] for size in (3, 6, 4) if size in left), halves)


def _without_halves(quads: Rows, triangles: Rows) -> tuple[Rows, Rows, int]:
    """Quads and triangles without those that lie on one another, and how many quads those were."""
    parts = np.sort(quads[:, HALVES], axis=2)
    own = np.sort(triangles, axis=1)
    keys = np.concatenate([own, parts.reshape(-1, 3)])
    index = np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1)
    place = np.full(index.max(initial=0) + 1, -1)
    place[index[: len(own)]] = np.arange(len(own))
    met = place[index[len(own) :]].reshape(-1, 4)
    pairs: Rows = np.stack([met[:, [0, 2]], met[:, [1, 3]]], axis=1)  # the two ways to halve a quad
    both = np.all(pairs >= 0, axis=2)
    covered = np.any(both, axis=1)
    gone = pairs[both]
    keep = np.ones(len(own), bool)
    keep[gone.ravel()] = False
    return quads[~covered], triangles[keep], int(covered.sum())
