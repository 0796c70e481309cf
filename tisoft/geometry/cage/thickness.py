"""How thick what a cage carries is at its thinnest part, along scan lines.

A line along an axis that enters at one end of a run and leaves at the other is as long as the part
is thick over |n·axis|.  Runs count whose ends face apart (n₁·n₂ < −.7) and that meet the surface
steeply (|n·axis| ≥ .57): exact on plates at any angle.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tisoft.geometry.cage.cutting import Pieces, cut
from tisoft.geometry.cage.lattice import Lattice

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]

LINES = 2
"""Scan lines along an edge of a cell."""
ASIDE = np.array([0.0123457, 0.0234568])
"""By what share of their distance lines are moved, lest they meet edges of triangles."""
APART, STEEP = -0.7, 0.57
SHARE = 0.01
"""Share of all runs that may be shorter than the thickness told: a pointed end is no thin part."""


def thinnest(points: Floats, triangles: Rows, lattice: Lattice) -> float | None:
    """The least thickness [m] of a closed surface; None where no run counts."""
    local = lattice.local(points)
    pieces = cut(local, triangles, lattice.cells)
    corners = points[triangles] @ lattice.axes
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
    found = [np.empty(0)]
    for axis in range(3):
        line, place, piece = crossings(pieces, axis)
        order = np.lexsort((place, line))
        line, place = line[order], place[order]
        n = normals[pieces.parents[piece[order]]]
        a, b = n[:-1], n[1:]
        run = (line[1:] == line[:-1]) & (a[:, axis] < 0.0) & (b[:, axis] > 0.0)
        steep = np.minimum(np.abs(a[:, axis]), np.abs(b[:, axis]))
        run &= (np.einsum("ij,ij->i", a, b) < APART) & (steep >= STEEP)
        found.append((np.diff(place) * lattice.size[axis] * steep)[run])
    lengths = np.concatenate(found)
    return float(np.quantile(lengths, SHARE)) if len(lengths) else None


def crossings(pieces: Pieces, axis: int) -> tuple[Rows, Floats, Rows]:
    """Where lines along an axis cross the pieces: number of the line, place in cells, piece."""
    others = [(axis + 1) % 3, (axis + 2) % 3]
    flat = pieces.points[:, :, others] * LINES - 0.5 - ASIDE
    low = np.ceil(flat.min(axis=1)).astype(np.int64)
    count = np.maximum(np.floor(flat.max(axis=1)).astype(np.int64) - low + 1, 0)
    each = count.prod(axis=1)
    piece = np.repeat(np.arange(len(each)), each)
    step = np.arange(len(piece)) - np.repeat(np.cumsum(each) - each, each)
    at = low[piece] + np.stack([step % count[piece, 0], step // count[piece, 0]], axis=1)
    p = flat[piece] - at[:, None]
    # Twice the areas between the line's foot and the sides: all of one sign where it is inside.
    area = [p[:, i, 0] * p[:, (i + 1) % 3, 1] - p[:, i, 1] * p[:, (i + 1) % 3, 0] for i in range(3)]
    share = np.stack([area[1], area[2], area[0]], axis=1)
    inside = (share > 0.0).all(axis=1) | (share < 0.0).all(axis=1)
    piece, at, share = piece[inside], at[inside], share[inside]
    share /= share.sum(axis=1, keepdims=True)
    place = np.einsum("pc,pc->p", share, pieces.points[piece][:, :, axis])
    width = int(at[:, 0].max(initial=0)) + 2
    return at[:, 0] + width * at[:, 1], place, piece
