"""The half-space below a plane: gap = n·x − n·point, growing along n.

| symbol   | name         | unit |
| -------- | ------------ | ---- |
| n        | `normal`, `a` | 1    |
| n·point  | `r`          | m    |
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tisoft import checks
from tisoft.checks import Vector, keep_number, put


@dataclass(frozen=True)
class Plane:
    """An obstacle: the half-space below a plane; `normal` points to the free side.

    Args:
        point: on the plane [m].
        normal: of any length but 0; kept as a unit vector.
        friction: Coulomb's coefficient.

    Raises:
        SceneError: naming the field and its value.
    """

    point: Vector = (0.0, 0.0, 0.0)
    normal: Vector = (0.0, 1.0, 0.0)
    friction: float = 0.0

    def __post_init__(self) -> None:
        put(self, "point", checks.vector("point", self.point))
        put(self, "normal", checks.direction("normal", self.normal))
        keep_number(self, "friction", least=0.0)

    def numbers(self, origin: Any) -> list[float]:
        """a, b and r of `distance`, seen from a body's origin [m]."""
        offset = np.array(self.normal) @ (np.array(self.point) - origin)
        return [*self.normal, 0.0, 0.0, 0.0, float(offset)]

    @staticmethod
    def distance(a, b, r, x):  # type: ignore[no-untyped-def]
        """Signed distance of x [m] and the direction it grows in: a Taichi function (`contact`)."""
        return a.dot(x) - r, a
