"""A rod with flat ends: the nearest of its side and of its ends.

    along = |d·n| − |b|,   across = |d − (d·n) n| − radius,   d = x − a,   n = b/|b|
    gap = |(max(along, 0), max(across, 0))| outside; inside max(along, across)

| symbol       | name                 | unit |
| ------------ | -------------------- | ---- |
| its middle   | `a`                  | m    |
| half its axis | `b`, (end − start)/2 | m    |
| radius       | `radius`, `r`        | m    |
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tisoft.live import frozen
from tisoft.obstacles.base import ALONG, FLAT_LINE, Core, Corners, Line

SIDES = (24, 128)
"""Least and most corners of a rim."""


@frozen
@dataclass(frozen=True)
class Cylinder(Line):
    """An obstacle: a rod with flat ends; `from` and `to` in scene files.

    Args:
        start, end: of its axis [m].
        radius: [m].
        friction: Coulomb's coefficient.
        velocity: [m/s], from t = 0.
        path: rows (t, dx, dy, dz): displacement [m] at times [s], linear between rows.
        turn: rotation about an axis, from t = 0.

    At most one of velocity, path and turn.

    Raises:
        SceneError: naming the field and its value.
    """

    @staticmethod
    def distance(a, b, r, x):  # type: ignore[no-untyped-def]
        """Signed distance of x [m] and the direction it grows in: a Taichi function (`contact`)."""
        half = b.norm()
        n = b / half
        d = x - a
        height = d.dot(n)
        if height < 0.0:
            n, height = -n, -height
        out = d - height * n
        width = out.norm()
        if width > 0.0:
            out /= width
        along, across = height - half, width - r
        gap, normal = along, n
        if across > along:
            gap, normal = across, out
        if along > 0.0 and across > 0.0:
            gap = (along * along + across * across) ** 0.5
            normal = (along * n + across * out) / gap
        return gap, normal

    @staticmethod
    def corner(a, b, r, local):  # type: ignore[no-untyped-def]
        """Place [m] of a point of it, by its shares of radius and half axis: a Taichi function."""
        n = b.normalized()
        x, y, z = n[0] * n[0], n[1] * n[1], n[2] * n[2]
        u = 0.0 * b
        if x <= y and x <= z:
            u[0] += 1.0
        elif y <= z:
            u[1] += 1.0
        else:
            u[2] += 1.0
        u = (u - n.dot(u) * n).normalized()
        return a + local[2] * b + r * (local[0] * u + local[1] * n.cross(u))

    def depth(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """How deep points [m] are inside at t = 0, shape (n,); negative outside."""
        start, along = np.array(self.start), np.subtract(self.end, self.start)
        length = float(np.linalg.norm(along))
        height = (points - start) @ along / length
        width = np.linalg.norm(points - start - np.outer(height, along / length), axis=1)
        depth: NDArray[np.float64] = np.minimum(
            np.minimum(height, length - height), self.radius - width
        )
        return depth

    def bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lowest and highest corner of the box around it at t = 0 [m], shape (3,) each."""
        ends = self.ends()
        along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
        half = self.radius * np.sqrt(np.maximum(0.0, 1.0 - along**2))
        return ends.min(axis=0) - half, ends.max(axis=0) + half

    def core(self) -> Core:
        """Its axis, for the side."""
        return Core(FLAT_LINE, ALONG, self.ends(), self.radius)

    def corners(self, edge: float) -> Corners:
        """Its rims, in corners half an `edge` [m] apart."""
        count = int(np.clip(4.0 * np.pi * self.radius / edge, *SIDES))
        angle = 2.0 * np.pi * np.arange(count) / count
        circle = np.stack([np.cos(angle), np.sin(angle), np.ones(count)], axis=1)
        ends = np.array([[0.0, 0.0, 1.0]])
        local = np.concatenate([circle * [1, 1, -1], circle, -ends, ends])
        i = np.arange(count)
        j = (i + 1) % count
        low, high = np.full(count, 2 * count), np.full(count, 2 * count + 1)
        triangles = np.concatenate([
            np.stack([low, j, i], 1), np.stack([high, i + count, j + count], 1),
            np.stack([i, j, j + count], 1), np.stack([i, j + count, i + count], 1),
        ])  # fmt: skip
        return Corners(local, self._places(local), triangles)

    def _places(self, local: NDArray[np.float64]) -> NDArray[np.float64]:
        """As `corner` does, at t = 0 [m]."""
        start, end = self.ends()
        half = 0.5 * (end - start)
        n = half / np.linalg.norm(half)
        u = np.eye(3)[np.argmin(np.abs(n))]
        u = u - (n @ u) * n
        u /= np.linalg.norm(u)
        frame = np.stack([self.radius * u, self.radius * np.cross(n, u), half])
        places: NDArray[np.float64] = 0.5 * (start + end) + local @ frame
        return places
