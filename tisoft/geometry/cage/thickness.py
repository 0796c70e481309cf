"""How thick what a cage carries is at its thinnest part, along scan lines.

A line along an axis that enters at one end of a run and leaves at the other is as long as the part
is thick over |n·axis|.  Runs count whose ends face apart (n₁·n₂ < −.7) and that meet the surface
steeply (|n·axis| ≥ .57): exact on plates at any angle.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tisoft.geometry.cage.cutting import cut
from tisoft.geometry.cage.lattice import Lattice
from tisoft.geometry.cage.lines import crossings

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]

LINES = 2
"""Scan lines along an edge of a cell."""
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
        at, place, piece = crossings(pieces, axis, LINES)
        line = at[:, 0] + (int(at[:, 0].max(initial=0)) + 2) * at[:, 1]
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
