"""A rod with round ends: gap = |x − y| − radius, y the nearest point of the line start .. end.

| symbol     | name               | unit |
| ---------- | ------------------ | ---- |
| its middle | `a`                | m    |
| half of it | `b`, (end − start)/2 | m  |
| radius     | `radius`, `r`      | m    |
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tisoft.live import frozen
from tisoft.obstacles.base import ALONG, LINE, Core, Line


@frozen
@dataclass(frozen=True)
class Capsule(Line):
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
        ends = self.ends()
        return ends.min(axis=0) - self.radius, ends.max(axis=0) + self.radius

    def core(self) -> Core:
        """Its line."""
        return Core(LINE, ALONG, self.ends(), self.radius)

    def corners(self, edge: float) -> None:
        """It has none."""
