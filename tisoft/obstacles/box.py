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

from tisoft import checks
from tisoft.checks import Vector, keep_number, put


@dataclass(frozen=True)
class Box:
    """An obstacle: a box along the axes about `center` [m], `size` [m]; `friction` is Coulomb's.
    Raises SceneError for numbers that are no box.
    """

    center: Vector
    size: Vector
    friction: float = 0.0

    def __post_init__(self) -> None:
        put(self, "center", checks.vector("center", self.center))
        put(self, "size", checks.vector("size", self.size, above=0.0, unit="m"))
        keep_number(self, "friction", least=0.0)

    def numbers(self, origin: Any) -> list[float]:
        """a, b and r of `distance`, seen from a body's origin [m]."""
        return [*(np.array(self.center) - origin), *(0.5 * np.array(self.size)), 0.0]

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
