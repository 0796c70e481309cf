"""Rotation about a fixed axis, of pins and of obstacles."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tisoft import checks
from tisoft.checks import Vector, keep_number, put
from tisoft.live import frozen

Points = NDArray[np.float64]


@frozen
@dataclass(frozen=True)
class Turn:
    """Rotation about a fixed axis: through `point` [m], along `axis`, at `rate` [rad/s].  Raises
    SceneError for an axis of no length, or a value that is no number.
    """

    point: Vector
    axis: Vector
    rate: float

    def __post_init__(self) -> None:
        put(self, "point", checks.vector("point", self.point))
        put(self, "axis", checks.direction("axis", self.axis))
        keep_number(self, "rate", unit="rad/s")

    def slower(self, factor: float) -> Turn:
        """The same axis, at a multiple of the rate."""
        return replace(self, rate=factor * self.rate)

    def displacement(self, points: Points, time: float) -> Points:
        """How far rest positions [m], shape (n, 3), have been turned at `time` [s] (Rodrigues)."""
        axis, angle = np.array(self.axis), self.rate * time
        arm = points - np.array(self.point)
        # 1 - cos by the half angle, so that small turns keep their digits.
        bend = 2.0 * math.sin(0.5 * angle) ** 2
        return math.sin(angle) * np.cross(axis, arm) + bend * np.cross(axis, np.cross(axis, arm))


def rodrigues(frames: Points) -> Points:
    """Modified Rodrigues parameters of rotations, shape (n, 3, 3): shape (n, 3)."""
    # SciPy takes a quarter of a second to import it, and few scenes turn boxes.
    from scipy.spatial.transform import Rotation

    made: Points = Rotation.from_matrix(frames).as_mrp()
    return made
