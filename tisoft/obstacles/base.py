"""What obstacles have in common.

Faces of bodies meet an obstacle's core, a point or a line with a radius, and its corners, the
points and edges of its surface.  Nodes meet its `distance` besides.

Points are kept in the obstacle's own coordinates, from which `corner` of its file makes places:
those are the same however it moves.  What `has_frame` knows no directions but the axes: it is met
in a frame that turns with it (`step.contact`).
"""

# Annotations are kept as types, not as text: text would be looked up where a subclass stands.

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tisoft import checks
from tisoft.checks import FieldError, Vector, keep_number, put
from tisoft.live import frozen
from tisoft.moving import check_motion, pose
from tisoft.turning import Turn

Floats = NDArray[np.float64]

NUMBERS = 10
"""An obstacle's numbers: a, b [m], r of `distance`, and its frame c = axis · tan(θ/4)."""
FRAME, FRICTION, PUSH, VELOCITY = 7, 10, 11, 12
"""Columns of a row of `State.obstacle`: those numbers, friction, speed of pushing out [m/s], and
its surface's velocity w₀ + ω × x: w₀ [m/s] and ω [1/s]."""

POINT, LINE, FLAT_LINE = 1, 2, 3
"""Kinds of cores: balls, capsules, and the side of a cylinder, which has no round ends."""


class Core(NamedTuple):
    """A point, or the two ends of a line."""

    kind: int
    local: Floats
    rest: Floats
    """Places at t = 0 [m]."""
    radius: float
    """[m]"""


class Corners(NamedTuple):
    """Points and triangles of a closed surface, counter-clockwise from outside."""

    local: Floats
    rest: Floats
    """Places at t = 0 [m]."""
    triangles: NDArray[np.int64]


ALONG = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]])
"""The line's ends in the obstacle's own coordinates."""


@frozen
@dataclass(frozen=True)
class Line:
    """An obstacle round a line; `from` and `to` in scene files.

    Args:
        start, end: of the line [m].
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
    has_frame: ClassVar = False

    def __post_init__(self) -> None:
        for key in ("start", "end"):
            put(self, key, checks.vector(key, getattr(self, key), unit="m"))
        if self.start == self.end:
            raise FieldError("end", "is where it starts; give two different points", self.end)
        keep_number(self, "radius", above=0.0, unit="m")
        keep_number(self, "friction", least=0.0)
        check_motion(self)

    def numbers(self, origin: Any, times: Any) -> Floats:
        """a, b, r of `distance`: middle and half of the line, and radius, at times [s], seen from a
        body's origin [m], shape (times, 10).
        """
        turned, way = pose(self, times)
        start, end = self.ends()
        out = np.zeros((len(way), NUMBERS))
        out[:, :3] = turned @ (0.5 * (start + end)) + way - origin
        out[:, 3:6] = turned @ (0.5 * (end - start))
        out[:, 6] = self.radius
        return out

    def ends(self) -> Floats:
        """Both ends at t = 0 [m], shape (2, 3)."""
        return np.array([self.start, self.end])
