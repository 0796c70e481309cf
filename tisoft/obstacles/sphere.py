"""A ball: gap = |x − center| − radius, growing away from the center.

| symbol | name         | unit |
| ------ | ------------ | ---- |
| center | `center`, `a` | m    |
| radius | `radius`, `r` | m    |
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tisoft import checks
from tisoft.checks import Vector, keep_number, put


@dataclass(frozen=True)
class Sphere:
    """An obstacle: a ball about `center` [m] of `radius` [m]; `friction` is Coulomb's.
    Raises SceneError for numbers that are no ball.
    """

    center: Vector
    radius: float
    friction: float = 0.0

    def __post_init__(self) -> None:
        put(self, "center", checks.vector("center", self.center))
        keep_number(self, "radius", above=0.0, unit="m")
        keep_number(self, "friction", least=0.0)

    def numbers(self, origin: Any) -> list[float]:
        """a, b and r of `distance`, seen from a body's origin [m]."""
        return [*(np.array(self.center) - origin), 0.0, 0.0, 0.0, self.radius]

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
