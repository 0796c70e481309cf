"""Obstacles, one file each: keys, distance, numbers.  Their place in `OBSTACLES` is their kind in
kernels; the words are those of scene files.
"""

from __future__ import annotations

from tisoft.obstacles.box import Box
from tisoft.obstacles.plane import Plane
from tisoft.obstacles.sphere import Sphere

__all__ = ["OBSTACLES", "Box", "Obstacle", "Plane", "Sphere"]

OBSTACLES = {
    "plane": Plane,
    "sphere": Sphere,
    "box": Box,
}

Obstacle = Plane | Sphere | Box
