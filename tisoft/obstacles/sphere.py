"""A ball: gap = |x − center| − radius, growing away from the center.

| symbol | name         | unit |
| ------ | ------------ | ---- |
| center | `center`, `a` | m    |
| radius | `radius`, `r` | m    |
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tisoft import checks
from tisoft.checks import Vector, keep_number, put
from tisoft.live import frozen
from tisoft.moving import check_motion, pose
from tisoft.obstacles.base import NUMBERS, POINT, Core
from tisoft.turning import Turn


@frozen
@dataclass(frozen=True)
class Sphere:
    """An obstacle: a ball.

    Args:
        center: [m].
        radius: [m].
        friction: Coulomb's coefficient.
        velocity: [m/s], from t = 0.
        path: rows (t, dx, dy, dz): displacement [m] at times [s], linear between rows.
        turn: rotation about an axis, from t = 0.

    At most one of velocity, path and turn.

    Raises:
        SceneError: naming the field and its value.
    """

    center: Vector
    radius: float
    friction: float = 0.0
    velocity: Vector | None = None
    path: checks.Timeline | None = None
    turn: Turn | None = None
    has_frame: ClassVar = False

    def __post_init__(self) -> None:
        put(self, "center", checks.vector("center", self.center))
        keep_number(self, "radius", above=0.0, unit="m")
        keep_number(self, "friction", least=0.0)
        check_motion(self)

    def numbers(self, origin: Any, times: Any) -> NDArray[np.float64]:
        """a, b, r of `distance` at times [s], seen from a body's origin [m], shape (times, 10)."""
        turned, way = pose(self, times)
        out = np.zeros((len(way), NUMBERS))
        out[:, :3] = turned @ np.array(self.center) + way - origin
        out[:, 6] = self.radius
        return out

    @staticmethod
    def distance(a, b, r, x):  # type: ignore[no-untyped-def]
        """Signed distance of x [m] and the direction it grows in: a Taichi function (`contact`)."""
        d = x - a
        length = d.norm()
        normal = 0.0 * d
        normal[1] = 1.0
        if length > 0.0:
            normal = d / length
        return length - r, normal

    @staticmethod
    def corner(a, b, r, local):  # type: ignore[no-untyped-def]
        """The center [m]: a Taichi function."""
        return a + 0.0 * local

    def depth(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """How deep points [m] are inside at t = 0, shape (n,); negative outside."""
        depth: NDArray[np.float64] = self.radius - np.linalg.norm(points - self.center, axis=1)
        return depth

    def bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lowest and highest corner of the box around it at t = 0 [m], shape (3,) each."""
        return np.array(self.center) - self.radius, np.array(self.center) + self.radius

    def core(self) -> Core:
        """Its center."""
        return Core(POINT, np.zeros((1, 3)), np.array([self.center]), self.radius)

    def corners(self, edge: float) -> None:
        """It has none."""
