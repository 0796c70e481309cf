"""Bodies that start inside each other: how deep, by the nearest faces.

depth = −min (x − y)·n   over the points x of one body inside of the other, y nearest on it
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tisoft.checks import FieldError
from tisoft.touch.surface import DEPTH, Surface

Floats = NDArray[np.float64]

MOST = "half an edge or half the thickness"
NEAREST = 12
"""Triangles, by the distance of their centres, among which a point looks for its nearest."""


def check_apart(
    names: Sequence[str],
    surfaces: Sequence[Surface],
    places: Sequence[Floats],
    may: NDArray[np.int32],
) -> None:
    """Refuse solids that start deeper inside each other than contact can push out.

    Args:
        names: of the bodies, quoted, and of obstacles, obstacle[0].
        surfaces: theirs.
        places: world positions of their points [m], shape (points, 3) each.
        may: whether two of them may touch, shape (bodies, bodies).

    Raises:
        FieldError: with both names and the depth.
    """
    lows = [x.min(axis=0) for x in places]
    highs = [x.max(axis=0) for x in places]
    for a in range(len(names)):
        for b in range(len(names)):
            apart = a == b or not may[a, b] or not surfaces[a].is_solid
            if apart or (lows[b] > highs[a]).any() or (highs[b] < lows[a]).any():
                continue
            inside = ((places[b] >= lows[a]) & (places[b] <= highs[a])).all(axis=1)
            if not inside.any():
                continue
            depth = depth_inside(places[a], surfaces[a], places[b][inside])
            most = min(surfaces[a].depth, DEPTH * surfaces[b].edge)  # faces may be of any size
            if depth > most:
                raise _refusal(names[a], names[b], depth, most)


def stuck(name: str, number: int, depth: float) -> FieldError:
    """Of a body so deep inside an obstacle that nothing pushes it out."""
    problem = (
        f"starts {depth:.3g} m inside obstacle[{number}], or goes through it, where contact cannot "
        "push it out; move one of them"
    )
    return FieldError("body", problem, name)


def _refusal(a: str, b: str, depth: float, most: float) -> FieldError:
    named = [name.strip("'\"") for name in (a, b)]
    if any(name.startswith("obstacle[") for name in (a, b)):
        body, obstacle = reversed(named) if a.startswith("obstacle[") else named
        problem = (
            f"starts {depth:.3g} m inside {obstacle}, deeper than contact can push out "
            f"({most:.3g} m, {MOST}); move one of them"
        )
        return FieldError("body", problem, body)
    problem = (
        f"and {b} start {depth:.3g} m inside each other, deeper than contact "
        f"can push apart ({most:.3g} m, {MOST}); move one of "
        "them, or let them pass by [[no_contact]]"
    )
    return FieldError("body", problem, named[0])


def depth_inside(x: Floats, surface: Surface, points: Floats) -> float:
    """How deep [m] the deepest of some points [m] lies inside the surface with points x [m]; 0
    where none does.
    """
    return float(depths_inside(x, surface, points).max(initial=0.0))


def depths_inside(x: Floats, surface: Surface, points: Floats) -> Floats:
    """How deep [m] each point lies inside the surface; 0 where it does not, shape (points,)."""
    from scipy.spatial import cKDTree

    corners = x[surface.triangles]
    count = min(NEAREST, len(corners))
    near = cKDTree(corners.mean(axis=1)).query(points, k=count)[1].reshape(len(points), count)
    a, b, c = (corners[near, k] for k in range(3))
    nearest = _nearest(points[:, None], a, b, c)
    way = points[:, None] - nearest
    distance = np.linalg.norm(way, axis=2)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    least = distance.min(axis=1, keepdims=True)
    # Faces that share the nearest edge or corner vote together.
    votes = np.where(distance <= least * (1 + 1e-9), (way * normal).sum(axis=2), 0.0).sum(axis=1)
    depths: Floats = np.where(votes < 0.0, least[:, 0], 0.0)
    return depths


def _nearest(p: Floats, a: Floats, b: Floats, c: Floats) -> Floats:
    """Nearest points of triangles abc: on the plane where that lies inside, else on an edge."""
    u, v, w = b - a, c - a, p - a
    normal = np.cross(u, v)
    size = (normal**2).sum(axis=-1)
    wb = (np.cross(w, v) * normal).sum(axis=-1) / size
    wc = (np.cross(u, w) * normal).sum(axis=-1) / size
    inside = (wb >= 0) & (wc >= 0) & (wb + wc <= 1)
    best = a + wb[..., None] * u + wc[..., None] * v
    least = np.where(inside, 0.0, np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        way = end - start
        t = np.clip(((p - start) * way).sum(axis=-1) / (way**2).sum(axis=-1), 0.0, 1.0)
        there = start + t[..., None] * way
        far = ((p - there) ** 2).sum(axis=-1)
        nearer = ~inside & (far < least)
        best, least = np.where(nearer[..., None], there, best), np.where(nearer, far, least)
    return best
