"""How deep points are inside an obstacle."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.moving import pose

Floats = NDArray[np.float64]


def depth_inside(obstacle: Any, points: Floats, time: float = 0.0) -> Floats:
    """How deep points are inside an obstacle at `time` [s], in m, shape (n,); negative outside.

    Touching is not inside: rounding is left out.
    """
    turned, way = (moved[0] for moved in pose(obstacle, time))
    seen = (points - way) @ turned
    depth = obstacle.depth(seen)
    size = float(np.ptp(points, axis=0).max()) + float(np.abs(points).max())
    rounded: Floats = depth - 1e-9 * size
    return rounded
