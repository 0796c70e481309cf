"""Pins: nodes held where they are at rest, or moved in a way that is known beforehand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import checks
from tisoft.checks import FieldError, Vector, keep_number, put
from tisoft.live import frozen
from tisoft.turning import Turn
from tisoft.where import Selection, check_selection

Points = NDArray[np.float64]


@frozen
@dataclass(frozen=True)
class Pin:
    """Nodes held where they are at rest, or moved.

    Args:
        where: the nodes.
        axes: the components that are held, as "xyz" or "xy".
        velocity: [m/s], from t = 0.
        path: rows (t, dx, dy, dz): displacement from rest [m] at times [s], linear between rows;
            the first row holds before it, the last after it.
        turn: rotation of the nodes about an axis.
        release: when the nodes are let go [s]; left out, never.

    At most one of velocity, path and turn.

    Raises:
        SceneError: naming the field and its value.
    """

    where: Selection
    axes: str = "xyz"
    velocity: Vector | None = None
    path: checks.Timeline | None = None
    turn: Turn | None = None
    release: float | None = None

    def __post_init__(self) -> None:
        check_selection(self.where)
        if not isinstance(self.axes, str) or not self.axes or not set(self.axes) <= set("xyz"):
            raise FieldError("axes", 'must be letters of "xyz", as "xy" for a roller', self.axes)
        put(self, "axes", "".join(axis for axis in "xyz" if axis in self.axes))
        motions = {key: getattr(self, key) for key in ("velocity", "path", "turn")}
        if sum(motion is not None for motion in motions.values()) > 1:
            checks.exactly_one("", motions)
        if self.velocity is not None:
            put(self, "velocity", checks.vector("velocity", self.velocity))
            self._check_held("velocity", self.velocity)
        if self.path is not None:
            put(self, "path", checks.timeline("path", self.path, 4, "(t, dx, dy, dz)"))
            for i, row in enumerate(self.path):
                self._check_held(f"path[{i}]", row[1:])
        if self.turn is not None and not isinstance(self.turn, Turn):
            raise FieldError("turn", "must be a Turn(point, axis, rate)", self.turn)
        if self.release is not None:
            keep_number(self, "release", least=0.0, unit="s")

    @property
    def moves(self) -> bool:
        """Whether it moves what it holds."""
        return self.velocity is not None or self.path is not None or self.turn is not None

    @property
    def components(self) -> NDArray[np.int64]:
        """Numbers of the axes that are held, as [0, 1, 2]; shape (held axes,)."""
        return np.array(["xyz".index(axis) for axis in self.axes])

    @property
    def bits(self) -> int:
        """The same as bits: 1 for x, 2 for y, 4 for z."""
        return sum(1 << "xyz".index(axis) for axis in self.axes)

    def _check_held(self, field: str, motion: tuple[float, ...]) -> None:
        for axis, component in zip("xyz", motion, strict=True):
            if component and axis not in self.axes:
                problem = f"moves along {axis}, which axes = {self.axes!r} leaves free"
                raise FieldError(field, problem, motion)

    def share_of_way(self, points: Points, time: float, factor: float) -> Points:
        """Displacement [m] at a share of the way, of a turn's angle; shape (n, 3)."""
        if self.turn is not None:
            return self.turn.slower(factor).displacement(points, time)
        return factor * self.displacement(points, time)

    def displacement(self, points: Points, time: float) -> Points:
        """Displacement from rest [m] at `time` [s] of held nodes at rest positions `points`.

        Shape (n, 3); only the components in `axes` are prescribed.
        """
        if self.velocity is not None:
            return np.broadcast_to(np.array(self.velocity) * time, points.shape)
        if self.path is not None:
            rows = np.array(self.path)
            now = [np.interp(time, rows[:, 0], rows[:, k]) for k in (1, 2, 3)]
            return np.broadcast_to(np.array(now), points.shape)
        if self.turn is not None:
            return self.turn.displacement(points, time)
        return np.zeros(points.shape)

    def motion_along(self, axis: str) -> Any:
        """What tells motions along one axis apart: equal values move nodes in the same way."""
        k = "xyz".index(axis)
        if self.velocity is not None and self.velocity[k]:
            return self.velocity[k]
        if self.path is not None and any(row[k + 1] for row in self.path):
            return tuple((row[0], row[k + 1]) for row in self.path)
        if self.turn is not None and self.turn.rate and abs(self.turn.axis[k]) != 1.0:
            return self.turn
        return "still"
