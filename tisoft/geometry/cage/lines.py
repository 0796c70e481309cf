"""Scan lines through the pieces of a cut surface: where a line along an axis crosses them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tisoft.geometry.cage.cutting import Pieces

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]

ASIDE = np.array([0.0123457, 0.0234568, 0.0187654])
"""By what share of their distance lines are moved along x, y and z, lest they meet edges of
triangles."""


def others(axis: int) -> list[int]:
    """The two axes across lines along an axis."""
    return [(axis + 1) % 3, (axis + 2) % 3]


def crossings(pieces: Pieces, axis: int, lines: int) -> tuple[Rows, Floats, Rows]:
    """Where lines along an axis cross the pieces, `lines` of them along an edge of a cell: number
    of the line along each of the other two axes, shape (crossings, 2), place in cells, piece.
    """
    across = others(axis)
    flat = pieces.points[:, :, across] * lines - 0.5 - ASIDE[across]
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
    return at, place, piece
