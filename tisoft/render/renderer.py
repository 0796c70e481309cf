"""The off-screen picture: items and a camera in, an array of sRGB bytes out; needs no display."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import ArrayLike, NDArray

from tisoft.errors import SceneError
from tisoft.render import geometry, light, raster
from tisoft.render import ground as floor
from tisoft.render.batch import Batch, upload
from tisoft.render.camera import Camera
from tisoft.render.items import Item
from tisoft.render.shade import shade

SHADOW_SIZE = 512  # texels along the map of the lamp
DIM_SIZE = 160  # texels along the map of the ground's dimness
TILES = 9.0  # about so many tiles along the distance from the eye to the target

Picture = NDArray[np.uint8]


@dataclass(frozen=True)
class GroundPlane:
    """The plane through a point [m] with a normal that points to its upper side."""

    point: Sequence[float] = (0.0, 0.0, 0.0)
    normal: Sequence[float] = (0.0, 1.0, 0.0)


class Renderer:
    """Draws pictures of one size; `samples` x `samples` of them are averaged in every pixel.

    `ground` is a GroundPlane, a height [m] along `up`, or None. `up` also tells where the sky is.
    Raises SceneError for a size or a number of samples that cannot be drawn. Taichi must have been
    started (`tisoft.runtime`).
    """

    def __init__(
        self,
        size: tuple[int, int] = (1280, 720),
        *,
        samples: int = 2,
        ground: GroundPlane | float | None = None,
        up: ArrayLike = (0.0, 1.0, 0.0),
    ) -> None:
        self.width, self.height = (int(n) for n in size)
        self.samples = int(samples)
        if not (1 <= self.width <= 8192 and 1 <= self.height <= 8192):
            raise SceneError(f"render.size is {list(size)}: give 1 to 8192 pixels each way.")
        if not 1 <= self.samples <= 8:
            raise SceneError(f"render.samples is {samples}: give a whole number from 1 to 8.")
        self.up = np.asarray(up, dtype=np.float64) / np.linalg.norm(up)
        if isinstance(ground, int | float):
            ground = GroundPlane(tuple(ground * self.up), tuple(self.up))
        self.ground = ground
        self._batch = Batch([])
        self._keys = ti.ndarray(ti.i64, self.width * self.height * self.samples**2)
        self._keys.fill(0)
        self._shadow = ti.ndarray(ti.f32, (SHADOW_SIZE, SHADOW_SIZE))
        self._coarse = ti.ndarray(ti.f32, (SHADOW_SIZE // light.CELL, SHADOW_SIZE // light.CELL))
        self._undersides = ti.ndarray(ti.f32, (DIM_SIZE, DIM_SIZE))
        self._dim = ti.ndarray(ti.f32, (DIM_SIZE, DIM_SIZE))
        self._disc = upload(_disc())
        self._curve = ti.ndarray(ti.u8, 4096)
        self._curve.from_numpy(_srgb_curve())
        self._pixels = ti.ndarray(ti.u8, (self.width * self.height, 3))

    def draw(self, items: Sequence[Item], camera: Camera) -> Picture:
        """The picture, shape (height, width, 3), of the items' present positions and colours."""
        if not self._batch.holds(items):
            self._batch = Batch(items)
        batch = self._batch
        batch.place(np.asarray(camera.target, dtype=np.float64), camera.distance)
        view = self._view(camera)
        lamp, plane = self._lamp(camera), self._plane(camera)
        self._map_light(lamp, plane)
        raster.see_triangles(batch.points, batch.triangles, batch.triangle_count, view, self._keys)
        raster.see_capsules(
            batch.points, batch.vertex_count, batch.radii, batch.capsule_count,
            batch.triangle_count, view, self._keys,
        )  # fmt: skip
        shade(
            self._keys, view, batch.points, batch.normals, batch.colors, batch.triangles,
            batch.item_of, batch.materials, batch.triangle_count, batch.vertex_count, batch.radii,
            lamp, self._shadow, self._coarse, self._disc, plane, self._dim, self._curve,
            self._pixels,
        )  # fmt: skip
        return self._pixels.to_numpy().reshape(self.height, self.width, 3)

    def _view(self, camera: Camera) -> Any:
        right, up, forward = camera.axes()
        tan = np.tan(np.radians(camera.fov) / 2.0)
        return geometry.View(
            eye=_vec(-forward),
            right=_vec(right * tan * self.width / self.height),
            up=_vec(up * tan),
            forward=_vec(forward),
            width=self.width * self.samples,
            height=self.height * self.samples,
            per_pixel=self.samples,
        )

    def _lamp(self, camera: Camera) -> Any:
        """A lamp up and to the left of the camera, with its map around all that is drawn."""
        right, _, forward = camera.axes()
        level = np.cross(self.up, right)  # forward, made horizontal
        if level @ forward < 0.0:
            level = -level
        direction = 0.95 * self.up - 0.55 * right - 0.50 * level
        direction /= np.linalg.norm(direction)
        u = np.cross(self.up, direction)
        u /= np.linalg.norm(u)
        frame, texel = self._frame(u, np.cross(direction, u), SHADOW_SIZE, light.REACH + 3.0)
        rows = np.vstack([frame, [*direction, 0.0]])
        return light.Lamp(direction=_vec(direction), frame=_mat(rows), texel=texel)

    def _plane(self, camera: Camera) -> Any:
        shown = self.ground is not None
        plane = self.ground or GroundPlane(normal=tuple(self.up))
        normal = np.asarray(plane.normal, dtype=np.float64)
        normal /= np.linalg.norm(normal)
        away = np.subtract(plane.point, camera.target)
        level = float(normal @ away) / camera.distance
        u = np.cross(np.eye(3)[np.argmin(np.abs(normal))], normal)
        u /= np.linalg.norm(u)
        v = np.cross(normal, u)
        margin = floor.HALO
        frame, texel = self._frame(u, v, DIM_SIZE, 2.0, margin)
        tile = _round_length(camera.distance / TILES)
        phases = [(a @ np.asarray(camera.target)) / tile % 2.0 for a in (u, v)]
        scale = camera.distance / tile
        tiles = np.array([[*(scale * u), phases[0]], [*(scale * v), phases[1]], [0, 0, 0, 0]])
        return floor.Ground(
            shown=int(shown),
            normal=_vec(normal if shown else self.up),
            level=level,
            frame=_mat(np.vstack([frame, [*-normal, level]])),
            texel=texel,
            tiles=_mat(tiles),
        )

    def _frame(
        self, u: NDArray[Any], v: NDArray[Any], size: int, border: float, margin: float = 0.0
    ) -> tuple[NDArray[np.float64], float]:
        """Rows of a square map along u and v, in texels, around all that is drawn.

        Its size and place move in steps, so that shadows do not crawl while a body deforms.
        """
        batch = self._batch
        lo, hi = np.zeros(2), np.zeros(2)
        if batch.starts[-1]:
            points = batch.points.to_numpy() @ np.stack([u, v], axis=1).astype(np.float32)
            points = points[np.isfinite(points).all(axis=1)]
            pad = float(batch.radii.to_numpy().max()) if batch.capsule_count else 0.0
            if len(points):
                lo, hi = points.min(axis=0) - pad, points.max(axis=0) + pad
        side = max(float(np.max(hi - lo)) + 2.0 * margin, 1e-6)
        side = 2.0 ** (np.ceil(np.log2(side) * 8.0) / 8.0)
        texel = side / (size - 2.0 * border - 8.0)
        corner = np.round((lo + hi) / 2.0 / (4.0 * texel)) * 4.0 * texel - size / 2.0 * texel
        rows = np.array([[*u / texel, -corner[0] / texel], [*v / texel, -corner[1] / texel]])
        return rows, float(texel)

    def _map_light(self, lamp: Any, plane: Any) -> None:
        batch = self._batch
        for frame, texel, grid in (
            (lamp.frame, lamp.texel, self._shadow),
            (plane.frame, plane.texel, self._undersides),
        ):
            grid.fill(light.EMPTY)
            light.map_triangles(batch.points, batch.triangles, batch.triangle_count, frame, grid)
            light.map_capsules(
                batch.points, batch.vertex_count, batch.radii, batch.capsule_count, frame, texel,
                grid,
            )  # fmt: skip
        light.coarsen(self._shadow, self._coarse)
        floor.dim_ground(self._undersides, plane, self._dim)


def _vec(v: NDArray[Any]) -> Any:
    return geometry.vec3(*v.tolist())


def _mat(m: NDArray[Any]) -> Any:
    return ti.Matrix(m.tolist(), dt=ti.f32)


def _round_length(x: float) -> float:
    """The nearest of 1, 2 and 5 times a power of ten [m]."""
    choices = [m * 10.0**e for e in (np.floor(np.log10(x)) + np.arange(2)) for m in (1, 2, 5)]
    return float(min(choices, key=lambda c: abs(np.log(c / x))))


def _disc() -> NDArray[np.float32]:
    """Points spread evenly over the unit disc (Vogel's spiral) and their radii, for two tasks."""
    rows = []
    for count in (light.TAPS, light.SEARCH):
        k = np.arange(count)
        r, angle = np.sqrt((k + 0.5) / count), k * np.pi * (3.0 - np.sqrt(5.0))
        rows.append(np.stack([r * np.cos(angle), r * np.sin(angle), r], axis=1))
    return np.concatenate(rows).astype(np.float32)


def _srgb_curve() -> Picture:
    """sRGB bytes of 4096 linear intensities from 0 to 1 (IEC 61966-2-1)."""
    c = np.linspace(0.0, 1.0, 4096)
    curve = np.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1.0 / 2.4) - 0.055)
    return np.round(255.0 * curve).astype(np.uint8)
