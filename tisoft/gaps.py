"""Obstacles that fit between the nodes of a body whose faces meet no obstacles: one of springs
without faces, or any with explicit Euler.

What is round with radius r fits into a face whose nodes lie ρ from its middle where r < ρ, and
sinks in by d = r − √(r² − ρ²) where it does not.  Of a box the second smallest half side stands for
r.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.body import Body
from tisoft.obstacles.box import Box
from tisoft.scene import Scene

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]


def faces_meet(body: Body, integrator: str) -> bool:
    """Whether the body's faces meet obstacles, and not its nodes alone."""
    return integrator != "explicit-euler" and len(body.mesh.surface) > 0


@dataclass(frozen=True)
class Sides:
    """The surface of a body between what meets obstacles, as triangles or springs."""

    corners: Rows
    """Points of each, shape (n, 3) or (n, 2)."""
    lengths: Floats
    """The longest edge of each [m], shape (n,)."""
    radii: Floats
    """Distance of each one's middle from its points [m], shape (n,)."""


def sides_of(body: Body, points: Floats) -> Sides | None:
    """Of a body whose surface has these points [m]; None where it has no sides."""
    if body.carried is not None:
        corners = body.carried.skin.triangles.astype(np.int64)
    elif len(body.mesh.surface):
        corners = body.mesh.surface.astype(np.int64)
    else:
        corners = body.springs()
    if not len(corners):
        return None
    x = points[corners]
    edges = np.stack([np.linalg.norm(x[:, k] - x[:, k - 1], axis=1) for k in range(x.shape[1])])
    longest = edges.max(axis=0)
    return Sides(corners, longest, _radii(edges, longest))


def _radii(edges: Floats, longest: Floats) -> Floats:
    """Radii of the smallest circles round triangles (half the edge of springs, and of obtuse)."""
    if len(edges) == 2:
        return 0.5 * longest
    a, b, c = edges
    s = 0.5 * (a + b + c)
    area = np.sqrt(np.maximum(s * (s - a) * (s - b) * (s - c), 0.0))
    around = np.divide(a * b * c, 4.0 * area, out=np.full_like(a, np.inf), where=area > 0.0)
    blunt = 2.0 * longest**2 >= a * a + b * b + c * c
    return np.where(blunt, 0.5 * longest, np.minimum(around, longest))


def radius_of(obstacle: Any) -> float | None:
    """r [m]; None for what fits nowhere, as a plane, or what nodes never meet."""
    core = obstacle.core()
    if core is not None:
        return float(core.radius)
    return 0.5 * sorted(obstacle.size)[1] if isinstance(obstacle, Box) else None


def gap_warnings(scene: Scene) -> Iterator[str]:
    """Sentences about obstacles that slip through a body's surface unseen."""
    radii = [radius_of(obstacle) for obstacle in scene.obstacles]
    if not any(radii):
        return
    for body in scene.bodies:
        if faces_meet(body, scene.integrator):
            continue
        points = body.mesh.points
        sides = sides_of(
            body, points if body.carried is None else body.carried.skin.carried(points)
        )
        for number, r in enumerate(radii):
            if sides is None or r is None or r >= sides.radii.max():
                continue
            wide = sides.lengths[sides.radii > r]
            kind = "half width" if isinstance(scene.obstacles[number], Box) else "radius"
            yield (
                f"obstacle[{number}] ({kind} {r:.3g} m) is smaller than the mesh of body "
                f'"{body.name}" (edges up to {wide.max():.3g} m): its nodes alone meet obstacles, '
                f"so it can slip through unseen; take edges of {r:.2g} m or less"
            )
