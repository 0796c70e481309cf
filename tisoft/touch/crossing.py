"""Sheets that have passed through themselves or each other: what has crossed stays so, and is told.

p + s (q − p) = a + u (b − a) + v (c − a),   s, u, v ≥ 0,  s ≤ 1,  u + v ≤ 1
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FLAT = 1e-9
"""Volume of an edge and a triangle, over their lengths, below which they lie in one plane."""


def crossings(x: Floats, triangles: Ints) -> Floats:
    """Where edges of triangles pass through others with which they share no point [m], (n, 3).

    Args:
        x: places of points [m], shape (points, 3).
        triangles: their corners, shape (triangles, 3).
    """
    from scipy.spatial import cKDTree

    sides = np.unique(
        np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0
    )
    ends, corners = x[sides], x[triangles]
    middles, centers = ends.mean(axis=1), corners.mean(axis=1)
    half = 0.5 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    around = np.linalg.norm(corners - centers[:, None], axis=2).max(axis=1)
    far = float(half.max() + around.max())
    near = cKDTree(middles).sparse_distance_matrix(cKDTree(centers), far, output_type="ndarray")
    e, t = near["i"], near["j"]
    keep = near["v"] <= half[e] + around[t]
    keep &= ~(sides[e][:, :, None] == triangles[t][:, None]).any(axis=(1, 2))
    e, t = e[keep], t[keep]
    p, q = ends[e].transpose(1, 0, 2)
    a, b, c = corners[t].transpose(1, 0, 2)
    way, from_a = q - p, p - a
    normal = np.cross(b - a, c - a)
    volume = -np.einsum("ei,ei->e", normal, way)
    size = np.linalg.norm(normal, axis=1) * np.linalg.norm(way, axis=1)
    volume = np.where(np.abs(volume) > FLAT * size, volume, np.nan)
    s = np.einsum("ei,ei->e", normal, from_a) / volume
    turn = np.cross(from_a, way)
    u = np.einsum("ei,ei->e", c - a, turn) / volume
    v = -np.einsum("ei,ei->e", b - a, turn) / volume
    hit = (s >= 0.0) & (s <= 1.0) & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)
    found: Floats = p[hit] + s[hit, None] * way[hit]
    return found


def crossed(touching: Any, world: Floats) -> list[str]:
    """A sentence where sheets of a scene have crossed.

    Args:
        touching: the scene's `Touching`.
        world: positions of all nodes [m], inside order.
    """
    sheets = [t for t in touching.touchers if not t.surface.is_solid and t.meets_others]
    if not sheets:
        return []
    places, rows, begun = [], [], 0
    for sheet in sheets:
        places.append(world[sheet.part.nodes][sheet.surface.points])
        rows.append(sheet.surface.triangles.astype(np.int64) + begun)
        begun += len(places[-1])
    found = crossings(np.concatenate(places), np.concatenate(rows))
    if not len(found):
        return []
    names = " and ".join(f'"{sheet.name}"' for sheet in sheets)
    x, y, z = found[0]
    return [
        f"{len(found)} edges of the triangles of sheets ({names}) pass through others, one at "
        f"({x:.3g}, {y:.3g}, {z:.3g}) m: crumpled to the size of an edge, squeezed hard or started "
        "so, they stay crossed; smaller triangles fold more finely, a smaller step meets earlier"
    ]
