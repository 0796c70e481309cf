"""The half-space below a plane: gap = n·x − n·point, growing along n.

| symbol   | name         | unit |
| -------- | ------------ | ---- |
| n        | `normal`, `a` | 1    |
| n·point  | `r`          | m    |
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
from tisoft.obstacles.base import NUMBERS
from tisoft.turning import Turn


@frozen
@dataclass(frozen=True)
class Plane:
    """An obstacle: the half-space below a plane; `normal` points to the free side.

    Args:
        point: on the plane [m].
        normal: of any length but 0; kept as a unit vector.
        friction: Coulomb's coefficient.
        velocity: [m/s], from t = 0.
        path: rows (t, dx, dy, dz): displacement [m] at times [s], linear between rows.
        turn: rotation about an axis, from t = 0.

    At most one of velocity, path and turn.

    Raises:
        SceneError: naming the field and its value.
    """

    point: Vector = (0.0, 0.0, 0.0)
    normal: Vector = (0.0, 1.0, 0.0)
    friction: float = 0.0
    velocity: Vector | None = None
    path: checks.Timeline | None = None
    turn: Turn | None = None
    has_frame: ClassVar = False

    def __post_init__(self) -> None:
        put(self, "point", checks.vector("point", self.point))
        put(self, "normal", checks.direction("normal", self.normal))
        keep_number(self, "friction", least=0.0)
        check_motion(self)

    def numbers(self, origin: Any, times: Any) -> NDArray[np.float64]:
        """a, b, r of `distance` at times [s], seen from a body's origin [m], shape (times, 10)."""
        turned, way = pose(self, times)
        out = np.zeros((len(way), NUMBERS))
        out[:, :3] = turned @ np.array(self.normal)
        place = turned @ np.array(self.point) + way - origin
        out[:, 6] = np.einsum("ti,ti->t", out[:, :3], place)
        return out

    @staticmethod
    def distance(a, b, r, x):  # type: ignore[no-untyped-def]
        """Signed distance of x [m] and the direction it grows in: a Taichi function (`contact`)."""
        return a.dot(x) - r, a

    @staticmethod
    def corner(a, b, r, local):  # type: ignore[no-untyped-def]
        """It has none: a Taichi function."""
        return local

    def depth(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """How deep points [m] are inside at t = 0, shape (n,); negative outside."""
        depth: NDArray[np.float64] = (np.array(self.point) - points) @ np.array(self.normal)
        return depth

    def bounds(self) -> None:
        """It has none."""

    def core(self) -> None:
        """None: nodes see all of it."""

    def corners(self, edge: float) -> None:
        """None."""
