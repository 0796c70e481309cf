"""The off-screen picture: items and a camera in, an array of sRGB bytes out; needs no display."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import ArrayLike, NDArray

from tisoft import runtime
from tisoft.errors import SceneError
from tisoft.render import ground as floor
from tisoft.render import light, raster
from tisoft.render.batch import Batch, upload
from tisoft.render.camera import Camera
from tisoft.render.items import Item
from tisoft.render.shade import shade
from tisoft.render.stage import GroundPlane, ground_of, lamp_of, plane_in_map, view_of

SHADOW_SIZE = 512  # texels along the map of the lamp
DIM_SIZE = 128  # texels along the map of the ground's dimness

Picture = NDArray[np.uint8]


class Renderer:
    """Draws pictures of one size (pixels), each pixel the mean of `samples` x `samples` of them.

    `ground` is a GroundPlane, a height [m] along `up`, or None; `up` also tells where the sky is.
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
        self._generation = runtime.generation
        self._batch = Batch([])
        self._keys = ti.ndarray(ti.i64, self.width * self.height * self.samples**2)
        self._keys.fill(0)
        self._shadow = _map(SHADOW_SIZE)
        self._coarse = _map(SHADOW_SIZE // light.CELL)
        self._radii = _map(SHADOW_SIZE // 4)
        self._floor_shadow = _map(SHADOW_SIZE)
        self._undersides = _map(DIM_SIZE)
        self._dim = _map(DIM_SIZE)
        self._disc = upload(_discs())
        self._curve = ti.ndarray(ti.u8, 4096)
        self._curve.from_numpy(_srgb_curve())
        self._pixels = ti.ndarray(ti.u8, (self.width * self.height, 3))

    def draw(self, items: Sequence[Item], camera: Camera) -> Picture:
        """The picture, shape (height, width, 3), of the items' present positions and colours."""
        if self._generation != runtime.generation:
            raise RuntimeError("this renderer belongs to an earlier start of Taichi; make it anew")
        if not self._batch.holds(items):
            self._batch = Batch(items)
        batch = self._batch
        batch.place(np.asarray(camera.target, dtype=np.float64), camera.distance)
        points, radius = batch.points_and_radius()
        view = view_of(camera, (self.width, self.height), self.samples)
        lamp = lamp_of(camera, self.up, points, radius, SHADOW_SIZE)
        ground = ground_of(self.ground, camera, view, self.up, points, DIM_SIZE)
        self._map_lamp(lamp)
        if self.ground is not None:
            self._map_ground(lamp, ground)
        raster.see_triangles(batch.points, batch.triangles, batch.triangle_count, view, self._keys)
        raster.see_capsules(
            batch.points, batch.vertex_count, batch.radii, batch.capsule_count,
            batch.triangle_count, view, self._keys,
        )  # fmt: skip
        shade(
            self._keys, view, batch.points, batch.normals, batch.colors, batch.triangles,
            batch.item_of, batch.materials, batch.triangle_count, batch.vertex_count, batch.radii,
            lamp, self._shadow, self._coarse, self._disc, ground, self._floor_shadow, self._dim,
            self._curve, self._pixels,
        )  # fmt: skip
        return self._pixels.to_numpy().reshape(self.height, self.width, 3)

    def _map_lamp(self, lamp: Any) -> None:
        self._map(lamp.frame, lamp.texel, self._shadow)
        light.coarsen(self._shadow, self._coarse)

    def _map_ground(self, lamp: Any, ground: Any) -> None:
        plane = plane_in_map(ground, lamp)
        light.soften_plane(plane, lamp, self._shadow, self._coarse, self._disc, self._radii)
        light.light_plane(
            plane, self._shadow, self._coarse, self._disc, self._radii, self._floor_shadow
        )
        self._map(ground.frame, ground.texel, self._undersides)
        floor.dim_ground(self._undersides, ground, self._dim)

    def _map(self, frame: Any, texel: float, grid: Any) -> None:
        batch = self._batch
        grid.fill(light.EMPTY)
        light.map_triangles(batch.points, batch.triangles, batch.triangle_count, frame, grid)
        light.map_capsules(
            batch.points, batch.vertex_count, batch.radii, batch.capsule_count, frame, texel, grid
        )


def _map(size: int) -> Any:
    grid = ti.ndarray(ti.f32, (size, size))
    grid.fill(0.0)
    return grid


def _discs() -> NDArray[np.float32]:
    """Points spread evenly over the unit disc (Vogel's spiral) and their radii, for light.py."""
    rows = []
    for count in (light.SEARCH_ON_BODIES, light.TAPS, light.SEARCH, light.GROUND_TAPS):
        k = np.arange(count)
        r, angle = np.sqrt((k + 0.5) / count), k * np.pi * (3.0 - np.sqrt(5.0))
        rows.append(np.stack([r * np.cos(angle), r * np.sin(angle), r], axis=1))
    return np.concatenate(rows).astype(np.float32)


def _srgb_curve() -> Picture:
    """sRGB bytes of 4096 linear intensities from 0 to 1 (IEC 61966-2-1)."""
    c = np.linspace(0.0, 1.0, 4096)
    curve = np.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1.0 / 2.4) - 0.055)
    return np.round(255.0 * curve).astype(np.uint8)
