"""Starts inside obstacles that contact cannot undo: deeper than what its nodes and pairs see.

Nodes are thought to be on the surface of an obstacle that they are in.  What then is still inside
of it, between them, must be seen by pairs as deep; and no core, nor a corner, may be so deep inside
of a body that its faces do not see it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.moving import pose
from tisoft.obstacles import Shell
from tisoft.obstacles.base import FLAT_LINE
from tisoft.touch.overlap import depth_inside

Floats = NDArray[np.float64]

FINE = 6
"""Pieces of a face's edges, at whose corners depth is asked for."""
SAG = 0.02
"""Of the longest edge: how deep a face may lie in what is so large that nodes see enough of it."""
STEEP = 0.2
"""Depth in the middle of a wall over the way through it: less is a ridge that an edge grazes."""
THINNEST = 64
"""Pieces of an edge where it may go through a wall."""
PIECE = 0.25
"""Of an edge: pieces of a core's line."""


def unseen(
    touching: Any, world: Floats, deep: Sequence[tuple[int, int, float]], time: float
) -> Iterator[tuple[str, int, float]]:
    """Bodies that are inside obstacles as nothing can push them out: name, number of the obstacle,
    depth [m].

    Args:
        touching: the scene's `Touching`.
        world: positions of all nodes [m], inside order.
        deep: what pairs see, see `easing.measured`.
        time: [s]
    """
    for k, toucher in enumerate(touching.touchers):
        x = world[toucher.part.nodes][toucher.surface.points]
        by_number: dict[int, list[Any]] = {}
        for standing in touching.standings:
            if not toucher.part.touches or standing.is_met_by_nodes:
                by_number.setdefault(standing.number, []).append(standing)
        for number, standings in by_number.items():
            seen = _seen(touching, k, number, deep)
            depth = _depth(toucher, x, standings, seen, time)
            if depth > 0.0:
                yield toucher.name, number, depth


def _seen(touching: Any, k: int, number: int, deep: Sequence[tuple[int, int, float]]) -> float:
    """How deep toucher k is inside an obstacle by the pairs of both [m]."""
    count = len(touching.touchers)
    owners = touching.owners
    return max(
        (d for b, c, d in deep if b == k and c >= count and owners[c - count].number == number),
        default=0.0,
    )


def _depth(toucher: Any, x: Floats, standings: Sequence[Any], seen: float, time: float) -> float:
    """How deep a body is inside an obstacle [m], where that is deeper than what pushes it out; 0
    where it is not.
    """
    obstacle, surface = standings[0].obstacle, toucher.surface
    turned, way = (moved[0] for moved in pose(obstacle, time))
    x = (x - way) @ turned
    low, high = obstacle.bounds()
    if (x.min(axis=0) > high).any() or (x.max(axis=0) < low).any():
        return 0.0
    worst = _pierced(x, surface, standings) if surface.is_solid else 0.0
    x = x if isinstance(obstacle, Shell) else _put_out(x, obstacle)
    spots = _spots(x, surface, low, high)
    if len(spots):
        inside = float(_inside(obstacle, standings, spots).max())
        if inside > seen + max(toucher.thickness, SAG * surface.longest):
            worst = max(worst, inside)
    through = _through(x, surface, standings)
    return max(worst, through) if through > seen else worst


def _pierced(x: Floats, surface: Any, standings: Sequence[Any]) -> float:
    """How deep a body's surface is pierced by cores and corners, where that is too deep [m]."""
    worst = 0.0
    for standing in standings:
        points, most = standing.rest, surface.depth
        if standing.surface is None:
            count = 1 + int(np.ptp(points, axis=0).max() / (PIECE * surface.edge))
            count, ends = min(count, 1000) + 1, 0.0
            if standing.round == FLAT_LINE:  # its flat ends are for corners
                ends = min(standing.radius / float(np.linalg.norm(points[-1] - points[0])), 0.5)
            shares = np.linspace(ends, 1.0 - ends, count)[:, None]
            points, most = (1.0 - shares) * points[0] + shares * points[-1], 0.0
        near = ((points >= x.min(axis=0)) & (points <= x.max(axis=0))).all(axis=1)
        depth = depth_inside(x, surface, points[near]) if near.any() else 0.0
        if depth > most:
            worst = max(worst, depth + standing.radius)
    return worst


def _through(x: Floats, surface: Any, standings: Sequence[Any]) -> float:
    """How deep edges go into an obstacle and out of it again, as through a wall [m]."""
    obstacle = standings[0].obstacle
    ends = x[_sides(surface.triangles)]
    low, high = ends.min(axis=1), ends.max(axis=1)
    lows, highs = standings[0].rest.min(axis=0)[None], standings[0].rest.max(axis=0)[None]
    if isinstance(obstacle, Shell):
        corners = standings[0].rest[standings[0].surface.triangles]
        lows, highs = corners.min(axis=1), corners.max(axis=1)
    else:
        lows, highs = (bound[None] for bound in obstacle.bounds())
    near = np.zeros(len(ends), bool)
    for k in range(0, len(lows), 256):
        lo, hi = lows[k : k + 256], highs[k : k + 256]
        meet = (low[:, None] <= hi) & (high[:, None] >= lo)
        near |= meet.all(axis=2).any(axis=1)
    if not near.any():
        return 0.0
    shares = np.linspace(0.0, 1.0, THINNEST + 1)[None, :, None]
    a, b = ends[near, :1], ends[near, 1:]
    spots = (1.0 - shares) * a + shares * b
    depth = _inside(obstacle, standings, spots.reshape(-1, 3)).reshape(len(spots), -1)
    long = np.linalg.norm(b - a, axis=2)[:, 0] * (depth > 0.0).mean(axis=1)
    most = depth.max(axis=1)
    steep = (most > STEEP * long) & (depth[:, 0] <= 0.0) & (depth[:, -1] <= 0.0)
    return float(np.where(steep, most, 0.0).max())


def _sides(triangles: Any) -> Any:
    """Edges of triangles, each once."""
    halves = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    return np.unique(halves, axis=0)


def _put_out(x: Floats, obstacle: Any) -> Floats:
    """Nodes [m], those in an obstacle on its surface."""
    depth = obstacle.depth(x)
    inside = depth > 0.0
    if not inside.any():
        return x
    size = float(np.ptp(x, axis=0).max())
    step, way = 1e-6 * (size + float(depth.max())), np.zeros((int(inside.sum()), 3))
    here = x[inside] + 1e-3 * (x.mean(axis=0) - x[inside])  # in the middle of a plate: to its own
    for d in range(3):
        ahead, back = here.copy(), here.copy()
        ahead[:, d] += step
        back[:, d] -= step
        way[:, d] = obstacle.depth(back) - obstacle.depth(ahead)
    long = np.linalg.norm(way, axis=1, keepdims=True)
    out = x.copy()
    out[inside] += depth[inside, None] * way / np.where(long > 0.0, long, 1.0)
    return out


def _spots(x: Floats, surface: Any, low: Floats, high: Floats) -> Floats:
    """Points [m] all over the faces that are near a box."""
    corners = x[surface.triangles]
    near = (corners.min(axis=1) <= high).all(axis=1) & (corners.max(axis=1) >= low).all(axis=1)
    a, b, c = corners[near].transpose(1, 0, 2)
    shares = [(i / FINE, j / FINE) for i in range(FINE + 1) for j in range(FINE + 1 - i)]
    spots = np.concatenate([(1.0 - u - v) * a + u * b + v * c for u, v in shares])
    return spots[((spots >= low) & (spots <= high)).all(axis=1)]


def _inside(obstacle: Any, standings: Sequence[Any], spots: Floats) -> Floats:
    """How deep points are inside an obstacle at t = 0 [m]; 0 or less where they are not."""
    if isinstance(obstacle, Shell):
        return standings[0].depths(spots, 0.0)
    depth: Floats = obstacle.depth(spots)
    return depth
