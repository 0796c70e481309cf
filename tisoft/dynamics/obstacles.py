"""Obstacles as kernels see them: in each body's own coordinates (`nodes.gap_and_normal`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.dynamics.nodes import BOX, PLANE, SPHERE
from tisoft.scene_parts import Box, Obstacle, Plane, Sphere

COLUMNS = 7


def obstacle_kinds(obstacles: Sequence[Obstacle]) -> NDArray[np.int32]:
    """The kind of each obstacle, shape (obstacles,); one entry at least."""
    kinds = {Plane: PLANE, Sphere: SPHERE, Box: BOX}
    return np.array([kinds[type(o)] for o in obstacles] or [PLANE], np.int32)


def obstacle_shapes(obstacles: Sequence[Obstacle], origins: Sequence[Any]) -> NDArray[np.float64]:
    """Their shapes relative to each body's origin [m], shape (bodies, obstacles, 7)."""
    shapes = np.zeros((len(origins), max(1, len(obstacles)), COLUMNS))
    for b, origin in enumerate(origins):
        for row, obstacle in zip(shapes[b], obstacles, strict=False):
            row[6] = obstacle.friction
            if isinstance(obstacle, Plane):
                normal = np.array(obstacle.normal)
                row[:3] = normal
                row[3] = normal @ (np.array(obstacle.point) - origin)
            elif isinstance(obstacle, Sphere):
                row[:3] = np.array(obstacle.center) - origin
                row[3] = obstacle.radius
            else:
                row[:3] = np.array(obstacle.center) - origin
                row[3:6] = 0.5 * np.array(obstacle.size)
    return shapes
