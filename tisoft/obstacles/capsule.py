"""A rod with round ends: gap = |x − y| − radius, y the nearest point of the line start .. end.

| symbol     | name               | unit |
| ---------- | ------------------ | ---- |
| its middle | `a`                | m    |
| half of it | `b`, (end − start)/2 | m  |
| radius     | `radius`, `r`      | m    |
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import checks
from tisoft.checks import FieldError, Vector, keep_number, put
from tisoft.live import frozen
from tisoft.moving import check_motion, pose
from tisoft.obstacles.base import LINE, Core
from tisoft.turning import Turn

ALONG = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]])
"""The line's ends in the obstacle's own coordinates."""


def check_line(obstacle: Any) -> None:
    """Check start, end and radius; raises FieldError."""
    for key in ("start", "end"):
        put(obstacle, key, checks.vector(key, getattr(obstacle, key), unit="m"))
    if obstacle.start == obstacle.end:
        raise FieldError("end", "is where it starts; give two different points", obstacle.end)
    keep_number(obstacle, "radius", above=0.0, unit="m")
    keep_number(obstacle, "friction", least=0.0)
    check_motion(obstacle)


def line_numbers(obstacle: Any, origin: Any, times: Any) -> NDArray[np.float64]:
    """Middle, half and radius of a line at times [s], seen from `origin` [m], shape (times, 7)."""
    turned, way = pose(obstacle, times)
    start, end = np.array(obstacle.start), np.array(obstacle.end)
    out = np.zeros((len(way), 7))
    out[:, :3] = turned @ (0.5 * (start + end)) + way - origin
    out[:, 3:6] = turned @ (0.5 * (end - start))
    out[:, 6] = obstacle.radius
    return out


@frozen
@dataclass(frozen=True)
class Capsule:
    """An obstacle: a rod with round ends; `from` and `to` in scene files.

    Args:
        start, end: of its line [m].
        radius: [m].
        friction: Coulomb's coefficient.
        velocity: [m/s], from t = 0.
        path: rows (t, dx, dy, dz): displacement [m] at times [s], linear between rows.
        turn: rotation about an axis, from t = 0.

    At most one of velocity, path and turn.

    Raises:
        SceneError: naming the field and its value.
    """

    start: Vector
    end: Vector
    radius: float
    friction: float = 0.0
    velocity: Vector | None = None
    path: checks.Timeline | None = None
    turn: Turn | None = None

    def __post_init__(self) -> None:
        check_line(self)

    def numbers(self, origin: Any, times: Any) -> NDArray[np.float64]:
        """a, b, r of `distance` at times [s], seen from a body's origin [m], shape (times, 7)."""
        return line_numbers(self, origin, times)

    @staticmethod
    def distance(a, b, r, x):  # type: ignore[no-untyped-def]
        """Signed distance of x [m] and the direction it grows in: a Taichi function (`contact`)."""
        d = x - a
        d -= max(min(d.dot(b) / b.dot(b), 1.0), -1.0) * b
        length = d.norm()
        normal = 0.0 * d
        normal[1] = 1.0
        if length > 0.0:
            normal = d / length
        return length - r, normal

    @staticmethod
    def corner(a, b, r, local):  # type: ignore[no-untyped-def]
        """Place [m] of a point of its line: a Taichi function."""
        return a + local[2] * b

    def depth(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """How deep points [m] are inside at t = 0, shape (n,); negative outside."""
        start, along = np.array(self.start), np.subtract(self.end, self.start)
        t = np.clip((points - start) @ along / (along @ along), 0.0, 1.0)
        depth: NDArray[np.float64] = self.radius - np.linalg.norm(
            points - start - t[:, None] * along, axis=1
        )
        return depth

    def bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lowest and highest corner of the box around it at t = 0 [m], shape (3,) each."""
        ends = np.array([self.start, self.end])
        return ends.min(axis=0) - self.radius, ends.max(axis=0) + self.radius

    def core(self) -> Core:
        """Its line."""
        return Core(LINE, ALONG, np.array([self.start, self.end]), self.radius)

    def corners(self, edge: float) -> None:
        """It has none."""
