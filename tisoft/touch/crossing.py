"""Sheets that have passed through something: what has crossed stays so, and is told.

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
    sides = _sides(triangles)
    e, t, found = _hits(x[sides], x[triangles])
    joined = (sides[e][:, :, None] == triangles[t][:, None]).any(axis=(1, 2))
    return found[~joined]


def crossed(touching: Any, world: Floats) -> list[str]:
    """A sentence where sheets of a scene have passed through themselves, each other or solids.

    Args:
        touching: the scene's `Touching`.
        world: positions of all nodes [m], inside order.
    """
    touchers, may = touching.touchers, touching.meetings.may
    places = [world[each.part.nodes][each.surface.points] for each in touchers]
    triangles = [each.surface.triangles.astype(np.int64) for each in touchers]
    named: set[int] = set()
    every = []
    for a, sheet in enumerate(touchers):
        if sheet.surface.is_solid:
            continue
        for b, other in enumerate(touchers):
            if not may[a, b] or (b < a and not other.surface.is_solid):
                continue
            if a == b:
                found = crossings(places[a], triangles[a])
            else:
                found = _between(places[a], triangles[a], places[b], triangles[b])
            if len(found):
                named |= {a, b}
                every.append(found)
    if not every:
        return []
    names = " and ".join(f'"{touchers[k].name}"' for k in sorted(named))
    x, y, z = every[0][0]
    return [
        f"{sum(map(len, every))} edges of triangles of {names} pass through others, one at "
        f"({x:.3g}, {y:.3g}, {z:.3g}) m: a sheet crumpled to the size of an edge, squeezed hard or "
        "started so stays crossed; smaller triangles fold more finely, a smaller step meets earlier"
    ]


def _sides(triangles: Ints) -> Ints:
    """Edges of triangles, each once, shape (edges, 2)."""
    every = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    sides: Ints = np.unique(every, axis=0)
    return sides


def _between(x: Floats, of_x: Ints, y: Floats, of_y: Ints) -> Floats:
    """Where edges of one body pass through triangles of another one [m], shape (n, 3)."""
    found = np.zeros((0, 3))
    low = np.maximum(x.min(axis=0), y.min(axis=0))
    high = np.minimum(x.max(axis=0), y.max(axis=0))
    for p, rows, q, others in ((x, of_x, y, of_y), (y, of_y, x, of_x)):
        ends, corners = p[_sides(rows)], q[others]
        ends, corners = (
            each[((each.min(axis=1) <= high) & (each.max(axis=1) >= low)).all(axis=1)]
            for each in (ends, corners)
        )
        if len(ends) and len(corners):
            found = np.concatenate([found, _hits(ends, corners)[2]])
    return found


def _hits(ends: Floats, corners: Floats) -> tuple[Ints, Ints, Floats]:
    """Which lines (lines, 2, 3) pass through which triangles (triangles, 3, 3), and where [m]."""
    from scipy.spatial import cKDTree

    middles, centers = ends.mean(axis=1), corners.mean(axis=1)
    half = 0.5 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    around = np.linalg.norm(corners - centers[:, None], axis=2).max(axis=1)
    far = float(half.max() + around.max())
    near = cKDTree(middles).sparse_distance_matrix(cKDTree(centers), far, output_type="ndarray")
    e, t = near["i"], near["j"]
    keep = near["v"] <= half[e] + around[t]
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
    return e[hit], t[hit], p[hit] + s[hit, None] * way[hit]
