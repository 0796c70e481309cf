"""Which points lie in which boxes: a grid for every size of box, for graded meshes.

A box is entered once, in the cell of its low corner; cells are at least as large as the boxes of
their size, so that a point finds all that may hold it in its own cell and the 7 below it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

CHUNK = 4_000_000
"""Pairs that are looked at together."""
_BELOW = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])


def points_in_boxes(points: Floats, low: Floats, high: Floats) -> Iterator[tuple[Ints, Ints]]:
    """Pairs (box, point) with low <= point <= high, in chunks; `low` and `high` by box."""
    if not len(points) or not len(low):
        return
    origin = np.minimum(points.min(axis=0), low.min(axis=0))
    sizes = (high - low).max(axis=1)
    least = float(sizes.max()) * 1e-6
    levels = np.ceil(np.log2(np.maximum(sizes, least or 1.0))).astype(np.int64)
    for level in np.unique(levels):
        boxes = np.flatnonzero(levels == level)
        side = 2.0 ** float(level)
        span = int(max(np.ptp(points, axis=0).max(), np.ptp(low, axis=0).max()) / side) + 4
        keys = _keys(np.floor((low[boxes] - origin) / side).astype(np.int64), span)
        order = np.argsort(keys, kind="stable")
        keys, boxes = keys[order], boxes[order]
        cells = np.floor((points - origin) / side).astype(np.int64)
        for below in _BELOW:
            wanted = _keys(cells - below, span)
            first = np.searchsorted(keys, wanted, side="left")
            count = np.searchsorted(keys, wanted, side="right") - first
            for pairs in _expanded(first, count):
                box, point = boxes[pairs[0]], pairs[1]
                x = points[point]
                inside = ((x >= low[box]) & (x <= high[box])).all(axis=1)
                if inside.any():
                    yield box[inside], point[inside]


def _keys(cells: Ints, span: int) -> Ints:
    """One number for every cell of the grid; cells just outside get numbers of their own."""
    wide = span + 4
    i, j, k = (np.clip(cells[:, axis], -2, span) + 2 for axis in range(3))
    return (i * wide + j) * wide + k


def _expanded(first: Ints, count: Ints) -> Iterator[tuple[Ints, Ints]]:
    """(place, row) for every place of the ranges first … first + count of each row, in chunks."""
    rows = np.flatnonzero(count)
    ends = np.cumsum(count[rows])
    start = 0
    while start < len(rows):
        done = int(ends[start - 1]) if start else 0
        stop = max(start + 1, int(np.searchsorted(ends, done + CHUNK)))
        mine = rows[start:stop]
        owner = np.repeat(mine, count[mine])
        within = np.arange(len(owner)) - np.repeat(
            np.cumsum(count[mine]) - count[mine], count[mine]
        )
        yield first[owner] + within, owner
        start = stop
