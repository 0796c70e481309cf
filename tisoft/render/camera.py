"""Where a picture is taken from, and the view that frames a scene by itself.

Nothing here is absolute: a scene scaled by 1000 gets a camera scaled by 1000, and so the same
picture.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tisoft.errors import SceneError

Vector = NDArray[np.float64]

AZIMUTH = 30.0  # degrees off the broad side: the three-quarter view of product photographs
ELEVATION = 16.0  # degrees above the horizon
MARGIN = 0.86  # share of the half picture that what is framed may fill
S = (-1.0, 1.0)


@dataclass(frozen=True)
class Camera:
    """A pinhole camera; eye and target in metres, fov the vertical opening angle in degrees.

    The target should lie at the depth of the scene: lengths of the picture that have no other
    measure (the fading of the ground, the near limit) are taken from the distance |target - eye|.
    Raises SceneError for a view that is undefined.
    """

    eye: Sequence[float]
    target: Sequence[float]
    up: Sequence[float] = (0.0, 1.0, 0.0)
    fov: float = 32.0

    def __post_init__(self) -> None:
        for name in ("eye", "target", "up"):
            value = np.asarray(getattr(self, name), dtype=np.float64)
            if value.shape != (3,) or not np.isfinite(value).all():
                raise SceneError(f"camera.{name} must be three finite numbers, not {value}.")
            object.__setattr__(self, name, tuple(value.tolist()))
        if not 1.0 <= self.fov <= 150.0:
            raise SceneError(f"camera.fov is {self.fov}: give degrees between 1 and 150.")
        if self.distance == 0.0:
            raise SceneError("camera.eye and camera.target are the same point: move one of them.")

    @property
    def distance(self) -> float:
        """From the eye to the target [m]."""
        return float(np.linalg.norm(np.subtract(self.target, self.eye)))

    def axes(self) -> tuple[Vector, Vector, Vector]:
        """Unit vectors to the right, upward in the picture, and forward."""
        forward = np.subtract(self.target, self.eye) / self.distance
        right = np.cross(forward, np.asarray(self.up) / (np.linalg.norm(self.up) or 1.0))
        if np.linalg.norm(right) < 1e-6:  # looking straight up or down: any right will do
            right = np.cross(forward, np.eye(3)[np.argmin(np.abs(forward))])
        right /= np.linalg.norm(right)
        return right, np.cross(right, forward), forward


def pixels_of(points: Vector, camera: Camera, shape: Sequence[int]) -> Vector:
    """Where points [m] fall in a picture of a shape (height, width, …): columns and rows from its
    upper left, shape (points, 2).
    """
    right, up, forward = camera.axes()
    away = np.asarray(points, np.float64) - camera.eye
    scale = 0.5 * shape[0] / np.tan(np.radians(0.5 * camera.fov))
    depth = np.maximum(away @ forward, 1e-9 * camera.distance)
    x, y = scale * (away @ right) / depth, scale * (away @ up) / depth
    return np.stack([0.5 * shape[1] + x, 0.5 * shape[0] - y], axis=1)


def auto_camera(
    lo: ArrayLike,
    hi: ArrayLike,
    up: ArrayLike = (0.0, 1.0, 0.0),
    *,
    aspect: float = 16.0 / 9.0,
    fov: float = 32.0,
    points: Vector | None = None,
    angles: Sequence[float] = (0.0,),
) -> Camera:
    """Three-quarter view from slightly above that holds the box [lo, hi] (m) of what moves.

    `aspect` is the picture's width over its height. With `points` (m) in the box, shape (n, 3), the
    view holds these and no more; with several `angles` (degrees) it holds them, turned so far about
    its target. Raises SceneError for bounds that are not finite.
    """
    lo, hi = np.asarray(lo, dtype=np.float64), np.asarray(hi, dtype=np.float64)
    if not (np.isfinite(lo).all() and np.isfinite(hi).all() and (lo <= hi).all()):
        raise SceneError(f"The camera cannot frame a box from {lo} to {hi}: give finite bounds.")
    extent = float(np.linalg.norm(hi - lo)) or 1.0
    half = np.maximum(hi - lo, 1e-3 * extent) / 2.0
    upward = _unit(np.asarray(up, dtype=np.float64))
    view = Camera((lo + hi) / 2 + _direction(half, upward), (lo + hi) / 2, tuple(upward), fov)
    if points is None:
        points = (lo + hi) / 2 + half * np.array([[x, y, z] for x in S for y in S for z in S])
    # What one camera sees in turn, another sees at once where the points turn the other way.
    seen = (points - (lo + hi) / 2) @ np.concatenate([_turn(upward, a) for a in angles], axis=1)
    x, y, z = np.stack(view.axes()) @ seen.reshape(-1, 3).T  # z grows away from the eye
    tan_y = np.tan(np.radians(fov) / 2) * MARGIN
    cx, cy, distance = _fit(x, y, z, tan_y * aspect, tan_y)
    right, up_there, forward = view.axes()
    away = cx * right + cy * up_there
    if len(angles) > 1:  # a target off the axis would swing about it
        away = cy / max(float(up_there @ upward), 0.1) * upward
        x, y, z = (a - away @ axis for a, axis in zip((x, y, z), view.axes(), strict=True))
        distance = float(np.max(np.maximum(np.abs(x) / (tan_y * aspect), np.abs(y) / tan_y) - z))
    distance, target = max(distance, 0.5 * extent), (lo + hi) / 2 + away
    return Camera(target - distance * forward, target, tuple(np.asarray(up, float)), fov)


def turned(camera: Camera, angle: float) -> Camera:
    """The camera carried round its target, about its up, by an angle [degrees]."""
    turn = _turn(_unit(np.asarray(camera.up, dtype=np.float64)), angle)
    eye = camera.target + turn @ np.subtract(camera.eye, camera.target)
    return Camera(tuple(eye), camera.target, camera.up, camera.fov)


def _turn(axis: Vector, angle: float) -> Vector:
    """The rotation about a unit vector, after Rodrigues."""
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    cross = np.cross(np.eye(3), axis)
    return np.asarray(c * np.eye(3) + s * cross + (1.0 - c) * np.outer(axis, axis))


def _unit(v: Vector) -> Vector:
    length = float(np.linalg.norm(v))
    if not np.isfinite(length) or length == 0.0:
        raise SceneError(f"camera.up is {v}: give a direction that is not zero.")
    return v / length


def _direction(half: Vector, up: Vector) -> Vector:
    """Unit vector from the scene to the eye: off the broad side, a little above."""
    vertical = int(np.argmax(np.abs(up)))
    first, second = np.eye(3)[(vertical + 1) % 3], np.eye(3)[(vertical + 2) % 3]
    if vertical == 1:  # y up: x runs along the picture, z comes out of it
        first, second = second, first
    if half @ first < half @ second:
        first, second = second, first
    along = _unit(first - (first @ up) * up)
    facing = np.cross(along, up)
    facing *= 1.0 if facing @ second >= 0.0 else -1.0
    azimuth, elevation = np.radians(AZIMUTH), np.radians(ELEVATION)
    level = np.cos(azimuth) * facing + np.sin(azimuth) * along
    return np.cos(elevation) * level + np.sin(elevation) * up


def _fit(x: Vector, y: Vector, z: Vector, tan_x: float, tan_y: float) -> tuple[float, float, float]:
    """Centre and distance of the closest view for which |x - cx| <= tan_x (d + z), y alike."""

    # Each bound reads ±(x - cx)/tan <= d + z; two opposite ones added give the least d of an axis.
    def least(a: Vector, tan: float) -> tuple[float, float, float]:
        high, low = float(np.max(a / tan - z)), float(np.max(-a / tan - z))
        return (high + low) / 2.0, high, low

    dx, high_x, low_x = least(x, tan_x)
    dy, high_y, low_y = least(y, tan_y)
    centre = (tan_x * (high_x - low_x) / 2.0, tan_y * (high_y - low_y) / 2.0)
    return *centre, max(dx, dy)
