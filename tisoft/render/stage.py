"""The frames of a picture: the camera's frustum, the lamp's map and the ground's, as kernels take
them; lengths in distances from the eye to the target, about the target."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from tisoft.render import geometry, ground, light
from tisoft.render.camera import Camera

Array = NDArray[np.float64]

TILES = 9.0  # about so many tiles along the distance from the eye to the target


@dataclass(frozen=True)
class GroundPlane:
    """The plane through a point [m] with a normal that points to its upper side."""

    point: Sequence[float] = (0.0, 0.0, 0.0)
    normal: Sequence[float] = (0.0, 1.0, 0.0)


def view_of(camera: Camera, size: tuple[int, int], samples: int) -> Any:
    """The frustum of a camera for a picture of so many pixels."""
    right, up, forward = camera.axes()
    tan = np.tan(np.radians(camera.fov) / 2.0)
    width, height = size[0] * samples, size[1] * samples
    right, up = right * tan * size[0] / size[1], up * tan
    return geometry.View(
        eye=_vec(-forward),
        right=_vec(right),
        up=_vec(up),
        forward=_vec(forward),
        corner=_vec(forward - right + up),
        across=_vec(2.0 / width * right),
        down=_vec(-2.0 / height * up),
        width=width,
        height=height,
        per_pixel=samples,
    )


def lamp_of(camera: Camera, sky: Array, points: Array, pad: float, size: int) -> Any:
    """A lamp above and to the left of the camera, with a map of size² texels around the points."""
    right, _, forward = camera.axes()
    level = np.cross(sky, right)  # forward, made horizontal
    level *= 1.0 if level @ forward >= 0.0 else -1.0
    direction = _unit(0.95 * sky - 0.55 * right - 0.50 * level)
    u = _unit(np.cross(sky, direction))
    v = np.cross(direction, u)
    rows, texel = _square_map(points, u, v, size, pad, light.REACH + 1.0)
    return light.Lamp(
        direction=_vec(direction), frame=_mat([*rows, [*direction, 0.0]]), texel=texel
    )


def ground_of(
    plane: GroundPlane | None, camera: Camera, view: Any, sky: Array, points: Array, size: int
) -> Any:
    """The ground with a map of size² texels around the points; unseen from below or without one."""
    normal = _unit(np.asarray(plane.normal, dtype=np.float64)) if plane else sky
    point = plane.point if plane else camera.target
    above = float(normal @ np.subtract(camera.eye, point)) / camera.distance
    rays = np.array([view.across, view.down, view.corner], dtype=np.float64)
    inverse = -rays @ normal / above if plane and above > 0.0 else np.zeros(3)
    u = _unit(np.cross(np.eye(3)[np.argmin(np.abs(normal))], normal))
    v = np.cross(normal, u)
    rows, texel = _square_map(points, u, v, size, ground.HALO, 2.0)
    tile = _round_length(camera.distance / TILES)
    scale = camera.distance / tile
    level = float(normal @ np.subtract(point, camera.target)) / camera.distance
    phases = [float(a @ np.asarray(camera.target)) / tile % 2.0 for a in (u, v)]
    return ground.Ground(
        normal=_vec(normal),
        level=level,
        inverse=_vec(inverse),
        frame=_mat([*rows, [*-normal, level]]),
        texel=texel,
        tiles=_mat([[*(scale * u), phases[0]], [*(scale * v), phases[1]], [0.0] * 4]),
    )


def plane_in_map(plane: Any, lamp: Any) -> Any:
    """The ground's height in the lamp's map: coefficients of x, y and 1."""
    frame = np.array(lamp.frame.to_list(), dtype=np.float64)
    g = np.array(plane.normal, dtype=np.float64) @ np.linalg.inv(frame[:, :3])
    g[2] = max(g[2], 1e-3)  # a lamp below the ground's horizon does not light it anyway
    constant = (plane.level + g @ frame[:, 3]) / g[2]
    return geometry.vec3(-g[0] / g[2], -g[1] / g[2], constant)


def _square_map(
    points: Array, u: Array, v: Array, size: int, margin: float, border: float
) -> tuple[Array, float]:
    """Rows of a square map along u and v, in texels, around the points and a margin; its texel.

    Its side and place move in steps, so that shadows do not crawl while a body deforms.
    """
    lo, hi = np.zeros(2), np.zeros(2)
    if len(points):
        flat = points @ np.stack([u, v], axis=1)
        lo, hi = flat.min(axis=0), flat.max(axis=0)
    side = max(float(np.max(hi - lo)) + 2.0 * margin, 1e-6)
    side = 2.0 ** (np.ceil(np.log2(side) * 8.0) / 8.0)
    texel = side / (size - 2.0 * border - 8.0)
    corner = np.round((lo + hi) / 2.0 / (4.0 * texel)) * 4.0 - size / 2.0  # in texels
    rows = np.array([[*u / texel, -corner[0]], [*v / texel, -corner[1]]])
    return rows, float(texel)


def _round_length(x: float) -> float:
    """The nearest of 1, 2 and 5 times a power of ten [m]."""
    choices = [m * 10.0**e for e in (np.floor(np.log10(x)) + np.arange(2)) for m in (1, 2, 5)]
    return float(min(choices, key=lambda c: abs(np.log(c / x))))


def _unit(v: Array) -> Array:
    return np.asarray(v / np.linalg.norm(v))


def _vec(v: Array) -> Any:
    return geometry.vec3(*np.asarray(v).tolist())


def _mat(rows: Sequence[Any]) -> Any:
    return ti.Matrix(np.array(rows, dtype=np.float64).tolist(), dt=ti.f32)
