"""Exact moments of what a closed surface fills of each cell, by the divergence theorem.

In a cell's own coordinates ξ, η, ζ of −1 .. 1, with G = ∫ f dξ from −1 and outward areas,

    ∫ f dV = Σ_pieces ∫ G n_ξ dS + [∫ f dξ] A_qr,   f = ξ^p η^q ζ^r

A_qr, the moment of the filled part of the cell's right face, is minus the sum of ∫ η^q ζ^r n_ξ dS
over the pieces of this cell and of all cells left of it in its column.  There is no inside test.
Only cells that the surface meets need this: the others of a column are full or empty.

| column of `Filled.moments` | 0 | 1..3        | 4..6                          |
| -------------------------- | - | ----------- | ----------------------------- |
| means over the filled part | φ | ξ̄ η̄ ζ̄    | ⟨ηζ⟩ ⟨ξζ⟩ ⟨ξη⟩               |
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tisoft.errors import MeshError
from tisoft.geometry.cage.cutting import Pieces
from tisoft.geometry.cage.lattice import Lattice
from tisoft.geometry.surface import told

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]

POWERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 1], [1, 0, 1], [1, 1, 0]])
"""p, q, r of the moments."""
OUTSIDE = 0.01
"""How far a fill may lie outside of 0 .. 1."""

_R = np.sqrt(15.0)
_A, _B = (6.0 - _R) / 21.0, (6.0 + _R) / 21.0
POINTS = np.full((7, 3), 1.0 / 3.0)
POINTS[1:4] = _A + (1.0 - 3.0 * _A) * np.eye(3)
POINTS[4:] = _B + (1.0 - 3.0 * _B) * np.eye(3)
"""Points of a triangle, exact for degree 5 (Radon 1948)."""
WEIGHTS = np.array([9 / 40] + [(155 - _R) / 1200] * 3 + [(155 + _R) / 1200] * 3)


@dataclass(frozen=True, eq=False)
class Filled:
    """Cells that a surface fills, whole or in part."""

    cells: Rows
    """Places in the lattice, shape (cells, 3)."""
    moments: Floats
    """φ and the means over the filled part, shape (cells, 7)."""
    right: Floats
    """Share of the face towards higher x that is filled, shape (cells,)."""


def filled(pieces: Pieces, lattice: Lattice) -> Filled:
    """The cells with a positive fill.

    Raises:
        MeshError: a surface that crosses itself, or fills a place twice, with the place.
    """
    nx, ny, _ = lattice.cells
    column = pieces.cells[:, 1] + ny * pieces.cells[:, 2]
    keys, index = np.unique(column * nx + pieces.cells[:, 0], return_inverse=True)
    xi = 2.0 * np.einsum("qc,tcd->tqd", POINTS, pieces.points - pieces.cells[:, None]) - 1.0
    edges = pieces.points[:, 1:] - pieces.points[:, :1]
    area = 2.0 * (edges[:, 0, 1] * edges[:, 1, 2] - edges[:, 0, 2] * edges[:, 1, 1])
    weight = WEIGHTS * area[:, None]  # n_ξ dS in a face of area 4
    total = np.zeros((len(keys), len(POWERS)))
    faces: dict[tuple[int, int], Floats] = {}
    first = np.searchsorted(keys, keys // nx * nx)  # first cell that is met in the column
    for k, (p, q, r) in enumerate(POWERS.tolist()):
        flat = weight * xi[..., 1] ** q * xi[..., 2] ** r
        if (q, r) not in faces:
            sums = -np.bincount(index, flat.sum(axis=1), len(keys))
            run = np.concatenate([[0.0], np.cumsum(sums)])
            faces[q, r] = run[1:] - run[first]
        whole = (1.0 - (-1.0) ** (p + 1)) / (p + 1)
        G = (xi[..., 0] ** (p + 1) - (-1.0) ** (p + 1)) / (p + 1)
        own = np.bincount(index, (flat * G).sum(axis=1), len(keys))
        total[:, k] = (own + whole * faces[q, r]) / 8.0
    right = faces[0, 0] / 4.0
    place = np.stack([keys % nx, keys // nx % ny, keys // nx // ny], axis=1)
    _check(lattice, place, total[:, 0], right)
    return _with_full(place, total, right, keys // nx)


def _check(lattice: Lattice, place: Rows, fill: Floats, right: Floats) -> None:
    outside = np.maximum(-np.minimum(fill, right), np.maximum(fill, right) - 1.0)
    worst = int(outside.argmax())
    if outside[worst] <= OUTSIDE:
        return
    spot = told(lattice.world(place[worst] + 0.5))
    raise MeshError(
        f"the surface crosses itself or encloses a place twice near {spot}; make one outer surface "
        "of it (a union of its parts)"
    )


def _with_full(place: Rows, total: Floats, right: Floats, column: Rows) -> Filled:
    """Cells that are met, with their means, and the full ones between them."""
    keep = total[:, 0] > 0.0
    moments = total[keep]
    moments[:, 1:] /= moments[:, :1]
    # After a cell whose right face is filled come full cells, up to the next that is met.
    after = np.flatnonzero((column[1:] == column[:-1]) & (right[:-1] > 0.5))
    runs = place[after + 1, 0] - place[after, 0] - 1
    row = np.repeat(after, runs)
    step = np.arange(len(row)) - np.repeat(np.cumsum(runs) - runs, runs)
    full = place[row].copy()
    full[:, 0] += 1 + step
    unit = np.zeros((len(full), len(POWERS)))
    unit[:, 0] = 1.0
    return Filled(
        np.concatenate([place[keep], full]),
        np.concatenate([moments, unit]),
        np.concatenate([right[keep], np.ones(len(full))]),
    )
