"""What shows an obstacle, where it is at t = 0."""

from __future__ import annotations

from tisoft.obstacles import Box, Capsule, Cylinder, Obstacle, Plane, Sphere
from tisoft.render.items import Surface
from tisoft.render.obstacles import box_surface, rod_surface, shell_surface, sphere_surface


def solid_surface(obstacle: Obstacle, *, sunk: float = 0.0) -> Surface:
    """The surface of an obstacle that is no plane; a sphere is drawn smaller by `sunk` [m]."""
    assert not isinstance(obstacle, Plane)
    if isinstance(obstacle, Sphere):
        return sphere_surface(obstacle.center, obstacle.radius - sunk)
    if isinstance(obstacle, Box):
        return box_surface(obstacle.center, obstacle.size, obstacle.frame)
    if isinstance(obstacle, Capsule | Cylinder):
        ends = (obstacle.start, obstacle.end, obstacle.radius)
        return rod_surface(*ends, round_ends=isinstance(obstacle, Capsule))
    return shell_surface(obstacle.points, obstacle.triangles)
