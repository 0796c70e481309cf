"""Obstacles, one file each: keys, distance, numbers.  Their place in `OBSTACLES` is their kind in
kernels; the words are those of scene files.
"""

from __future__ import annotations

from tisoft.obstacles.box import Box
from tisoft.obstacles.capsule import Capsule
from tisoft.obstacles.cylinder import Cylinder
from tisoft.obstacles.plane import Plane
from tisoft.obstacles.shell import Shell
from tisoft.obstacles.sphere import Sphere

__all__ = ["OBSTACLES", "Box", "Capsule", "Cylinder", "Obstacle", "Plane", "Shell", "Sphere"]

OBSTACLES = {
    "plane": Plane,
    "sphere": Sphere,
    "box": Box,
    "capsule": Capsule,
    "cylinder": Cylinder,
    "file": Shell,
}

Obstacle = Plane | Sphere | Box | Capsule | Cylinder | Shell
