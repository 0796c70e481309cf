"""A box: in its own frame, gap = |max(|x − center| − half size, 0)| outside, the distance to its
nearest point; inside, the least distance to a face, below zero.

| symbol    | name                        | unit |
| --------- | --------------------------- | ---- |
| center    | `center`, `a`               | m    |
| half size | `size`/2, `b`               | m    |
| frame     | `rotate`, `numbers[:, FRAME:]` | 1 |
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tisoft import checks
from tisoft.checks import Vector, keep_number, put
from tisoft.geometry.moving import rotation
from tisoft.live import frozen
from tisoft.moving import check_motion, pose
from tisoft.obstacles.base import FRAME, NUMBERS, Corners
from tisoft.turning import Turn, rodrigues

Floats = NDArray[np.float64]

TRIANGLES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
     [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
)  # fmt: skip
"""Between corners numbered by their bits, x first."""


@frozen
@dataclass(frozen=True)
class Box:
    """An obstacle: a box.

    Args:
        center: [m].
        size: [m].
        friction: Coulomb's coefficient.
        velocity: [m/s], from t = 0.
        path: rows (t, dx, dy, dz): displacement [m] at times [s], linear between rows.
        turn: rotation about an axis, from t = 0.
        rotate: how it stands at t = 0: about x, then y, then z [degrees], round its center.

    At most one of velocity, path and turn.

    Raises:
        SceneError: naming the field and its value.
    """

    center: Vector
    size: Vector
    friction: float = 0.0
    velocity: Vector | None = None
    path: checks.Timeline | None = None
    turn: Turn | None = None
    rotate: Vector = (0.0, 0.0, 0.0)
    has_frame: ClassVar = True

    def __post_init__(self) -> None:
        put(self, "center", checks.vector("center", self.center))
        put(self, "size", checks.vector("size", self.size, above=0.0, unit="m"))
        keep_number(self, "friction", least=0.0)
        put(self, "rotate", checks.vector("rotate", self.rotate, unit="degrees"))
        check_motion(self)

    @cached_property
    def frame(self) -> Floats:
        """Its axes at t = 0, shape (3, 3)."""
        return rotation(self.rotate) if any(self.rotate) else np.eye(3)

    def numbers(self, origin: Any, times: Any) -> Floats:
        """a, b and frame at times [s], seen from a body's origin [m], shape (times, 10)."""
        turned, way = pose(self, times)
        out = np.zeros((len(way), NUMBERS))
        out[:, :3] = turned @ np.array(self.center) + way - origin
        out[:, 3:6] = 0.5 * np.array(self.size)
        if self.turn is not None or any(self.rotate):
            out[:, FRAME:] = rodrigues(turned @ self.frame)
        return out

    @staticmethod
    def distance(a, b, r, x):  # type: ignore[no-untyped-def]
        """Signed distance of x [m] and the direction it grows in: a Taichi function (`contact`)."""
        d = x - a
        gap = -1e30 + 0.0 * r
        normal = 0.0 * d
        outside = 0.0 * d
        for c in range(3):
            past = abs(d[c]) - b[c]
            side = 1.0 if d[c] >= 0.0 else -1.0
            if past > gap:
                gap = past
                normal = 0.0 * d
                normal[c] = side
            outside[c] = side * max(past, 0.0)
        length = outside.norm()
        if length > 0.0:
            gap = length
            normal = outside / length
        return gap, normal

    @staticmethod
    def corner(a, b, r, local):  # type: ignore[no-untyped-def]
        """Place [m] of a point of it, by its share of the half sizes: a Taichi function."""
        return a + b * local

    def depth(self, points: Floats) -> Floats:
        """How deep points [m] are inside at t = 0, shape (n,); negative outside."""
        away = np.abs((points - np.array(self.center)) @ self.frame)
        depth: Floats = (0.5 * np.array(self.size) - away).min(axis=1)
        return depth

    def bounds(self) -> tuple[Floats, Floats]:
        """Lowest and highest corner at t = 0 [m], shape (3,) each."""
        middle, half = np.array(self.center), 0.5 * np.abs(self.frame) @ np.array(self.size)
        return middle - half, middle + half

    def core(self) -> None:
        """It has none."""

    def corners(self, edge: float) -> Corners:
        """Its eight."""
        local = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], float)
        rest = np.array(self.center) + (0.5 * np.array(self.size) * local) @ self.frame.T
        return Corners(local, rest, TRIANGLES)
