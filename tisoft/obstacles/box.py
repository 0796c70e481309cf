"""A box along the axes: gap = |max(|x − center| − half size, 0)| outside, the distance to its
nearest point; inside, the least distance to a face, below zero.

| symbol    | name          | unit |
| --------- | ------------- | ---- |
| center    | `center`, `a` | m    |
| half size | `size`/2, `b` | m    |
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
from tisoft.obstacles.base import Corners
from tisoft.turning import Turn

TRIANGLES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
     [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
)  # fmt: skip
"""Between corners numbered by their bits, x first."""


@frozen
@dataclass(frozen=True)
class Box:
    """An obstacle: a box along the axes.

    Args:
        center: [m].
        size: [m].
        friction: Coulomb's coefficient.
        velocity: [m/s], from t = 0.
        path: rows (t, dx, dy, dz): displacement [m] at times [s], linear between rows.
        turn: none: a box stays along the axes.

    At most one of velocity and path.

    Raises:
        SceneError: naming the field and its value.
    """

    center: Vector
    size: Vector
    friction: float = 0.0
    velocity: Vector | None = None
    path: checks.Timeline | None = None
    turn: Turn | None = None

    def __post_init__(self) -> None:
        put(self, "center", checks.vector("center", self.center))
        put(self, "size", checks.vector("size", self.size, above=0.0, unit="m"))
        keep_number(self, "friction", least=0.0)
        check_motion(self)
        if self.turn is not None:
            problem = "cannot turn a box, which stays along the axes; give a velocity or a path"
            raise FieldError("turn", problem)

    def numbers(self, origin: Any, times: Any) -> NDArray[np.float64]:
        """a, b, r of `distance` at times [s], seen from a body's origin [m], shape (times, 7)."""
        way = pose(self, times)[1]
        out = np.zeros((len(way), 7))
        out[:, :3] = np.array(self.center) + way - origin
        out[:, 3:6] = 0.5 * np.array(self.size)
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

    def depth(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """How deep points [m] are inside at t = 0, shape (n,); negative outside."""
        away = np.abs(points - np.array(self.center))
        depth: NDArray[np.float64] = (0.5 * np.array(self.size) - away).min(axis=1)
        return depth

    def bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lowest and highest corner at t = 0 [m], shape (3,) each."""
        middle, half = np.array(self.center), 0.5 * np.array(self.size)
        return middle - half, middle + half

    def core(self) -> None:
        """It has none."""

    def corners(self, edge: float) -> Corners:
        """Its eight."""
        local = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], float)
        rest = np.array(self.center) + 0.5 * np.array(self.size) * local
        return Corners(local, rest, TRIANGLES)
