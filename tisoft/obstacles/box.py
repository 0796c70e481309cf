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
from tisoft.moving import check_motion, pose
from tisoft.turning import Turn


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
