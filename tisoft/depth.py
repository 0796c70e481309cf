"""How deep points are inside an obstacle."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.moving import pose
from tisoft.obstacles.box import Box
from tisoft.obstacles.plane import Plane
from tisoft.obstacles.sphere import Sphere

Floats = NDArray[np.float64]


def depth_inside(obstacle: Any, points: Floats, time: float = 0.0) -> Floats:
    """How deep points are inside an obstacle at `time` [s], in m, shape (n,); negative outside.

    Touching is not inside: rounding is left out.
    """
    turned, way = (moved[0] for moved in pose(obstacle, time))
    seen = (points - way) @ turned
    if isinstance(obstacle, Plane):
        depth = (np.array(obstacle.point) - seen) @ np.array(obstacle.normal)
    elif isinstance(obstacle, Sphere):
        depth = obstacle.radius - np.linalg.norm(seen - np.array(obstacle.center), axis=1)
    else:
        assert isinstance(obstacle, Box)
        away = np.abs(seen - np.array(obstacle.center))
        depth = (0.5 * np.array(obstacle.size) - away).min(axis=1)
    size = float(np.ptp(points, axis=0).max()) + float(np.abs(points).max())
    rounded: Floats = depth - 1e-9 * size
    return rounded
