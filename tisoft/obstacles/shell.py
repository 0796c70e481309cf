"""A closed surface of triangles: a bowl, a funnel, a tool.  Bodies' nodes meet its triangles, and
their faces its points and edges, as they meet another body's (`tisoft.touch`).

    x = a + R X

| symbol                | name               | unit |
| --------------------- | ------------------ | ---- |
| R                     | `numbers[:, FRAME:]` | 1  |
| where its middle is   | `a`                | m    |
| X from its middle     | `local`            | m    |
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tisoft import checks
from tisoft.checks import FieldError, keep_number, put
from tisoft.errors import MeshError
from tisoft.geometry.checks import check_range, index_rows, positions
from tisoft.geometry.moving import moved
from tisoft.geometry.surface import closed, read_surface
from tisoft.live import frozen
from tisoft.moving import check_motion, pose
from tisoft.obstacles.base import FRAME, NUMBERS, Corners
from tisoft.turning import Turn, rodrigues

Floats = NDArray[np.float64]
FAR = 1e30
"""Distance [m] that its `distance` tells: nodes meet triangles instead."""


@frozen
@dataclass(frozen=True, eq=False)
class Shell:
    """An obstacle: closed triangles, `file` in scene files; `read_shell` reads one.

    Args:
        points: [m], shape (points, 3).
        triangles: rows of points, counter-clockwise from outside, shape (triangles, 3).
        friction: Coulomb's coefficient.
        velocity: [m/s], from t = 0.
        path: rows (t, dx, dy, dz): displacement [m] at times [s], linear between rows.
        turn: rotation about an axis, from t = 0.

    At most one of velocity, path and turn.

    Raises:
        SceneError: naming the field and its value.
    """

    points: Floats
    triangles: NDArray[np.int64]
    friction: float = 0.0
    velocity: checks.Vector | None = None
    path: checks.Timeline | None = None
    turn: Turn | None = None
    has_frame: ClassVar = True

    def __post_init__(self) -> None:
        try:
            put(self, "points", positions(self.points).copy())
            rows = index_rows(self.triangles, 3, "triangle")
            put(self, "triangles", check_range(rows, "triangle", len(self.points)).astype(np.int64))
            put(self, "triangles", closed(self.points, self.triangles)[0])
        except MeshError as error:
            raise FieldError("triangles", f"are no closed surface: {error}") from None
        keep_number(self, "friction", least=0.0)
        check_motion(self)

    @cached_property
    def middle(self) -> Floats:
        """Of its box at t = 0 [m]."""
        return 0.5 * (self.points.min(axis=0) + self.points.max(axis=0))

    def numbers(self, origin: Any, times: Any) -> Floats:
        """a and frame at times [s], seen from a body's origin [m], shape (times, 10)."""
        turned, way = pose(self, times)
        out = np.zeros((len(way), NUMBERS))
        out[:, :3] = turned @ self.middle + way - origin
        if self.turn is not None:
            out[:, FRAME:] = rodrigues(turned)
        return out

    @staticmethod
    def distance(a, b, r, x):  # type: ignore[no-untyped-def]
        """Far from everything: a Taichi function (`contact`)."""
        return FAR + 0.0 * r, 0.0 * x

    @staticmethod
    def corner(a, b, r, local):  # type: ignore[no-untyped-def]
        """Place [m] of a point of it: a Taichi function."""
        return a + local

    def depth(self, points: Floats) -> Floats:
        """Below 0 for all points, shape (n,): see `touch.overlap` for what starts inside."""
        return np.full(len(points), -FAR)

    def bounds(self) -> tuple[Floats, Floats]:
        """Lowest and highest corner of the box around it at t = 0 [m], shape (3,) each."""
        return self.points.min(axis=0), self.points.max(axis=0)

    def core(self) -> None:
        """It has none."""

    def corners(self, edge: float) -> Corners:
        """All of its points."""
        return Corners(self.points - self.middle, self.points, self.triangles)


def read_shell(
    path: str | os.PathLike[str],
    /,
    *,
    scale: float = 1.0,
    rotate: Sequence[float] = (0.0, 0.0, 0.0),
    translate: Sequence[float] = (0.0, 0.0, 0.0),
    **keys: Any,
) -> Shell:
    """The closed surface of a file (.obj, .off, .ply, .stl, .vtp), scaled, turned about x, y and z
    [degrees] and moved [m]; `keys` are those of `Shell`.

    Raises:
        MeshError: a file that is no surface, or cannot be read.
        SceneError: a surface that is not closed.
    """
    points, triangles = read_surface(checks.path("path", path, "a surface file"))
    return Shell(moved(points, scale, rotate, translate), triangles, **keys)
