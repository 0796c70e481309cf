"""The off-screen picture: items and a camera in, an array of sRGB bytes out; needs no display."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tisoft import runtime
from tisoft.errors import SceneError
from tisoft.render import arrays, backdrop, capsules, geometry, ground, light, raster
from tisoft.render import layout as at
from tisoft.render.batch import Batch
from tisoft.render.camera import Camera
from tisoft.render.items import Item
from tisoft.render.shade import draw_kernel, ground_kernel
from tisoft.render.stage import Canvas, GroundPlane, places_of, stage_of

DIM_SIZE = 96  # texels along the map of the ground's dimness
SHARED_LEVELS = 2  # of the shadow's pyramid, which are worth a launch each on a CPU
LEAST_WORK = 512  # iterations that Taichi gives to one thread at the least

Picture = NDArray[np.uint8]
Jobs = tuple[NDArray[np.int32], NDArray[np.int32]]

__all__ = ["GroundPlane", "Renderer"]


class Renderer:
    """Draws pictures of one size (pixels), each pixel the mean of `samples` x `samples` of them.

    `ground` is a GroundPlane, a height [m] along `up`, or None; `up` also tells where the sky is.
    With `alpha` there is no background: pictures have a fourth channel, and the ground shows by its
    shadows alone.  Raises SceneError for a size or a number of samples that cannot be drawn.
    Taichi must have been started (`tisoft.runtime`).
    """

    def __init__(
        self,
        size: tuple[int, int] = (1280, 720),
        *,
        samples: int = 2,
        ground: GroundPlane | float | None = None,
        up: ArrayLike = (0.0, 1.0, 0.0),
        alpha: bool = False,
    ) -> None:
        width, height = (int(n) for n in size)
        if not (1 <= width <= 8192 and 1 <= height <= 8192):
            raise SceneError(f"render.size is {list(size)}: give 1 to 8192 pixels each way.")
        if not 1 <= int(samples) <= 8:
            raise SceneError(f"render.samples is {samples}: give a whole number from 1 to 8.")
        upward = np.asarray(up, dtype=np.float64) / np.linalg.norm(up)
        if isinstance(ground, int | float):
            ground = GroundPlane(tuple(ground * upward), tuple(upward))
        maps = (_map_size(height), DIM_SIZE)
        self.canvas = Canvas((width, height), places_of(int(samples)), maps, upward, ground)
        self.alpha = alpha
        self.lap: Callable[[str], None] = lambda stage: None
        """Called with the name of each stage of a picture when it is done."""
        self._generation = runtime.generation
        self._batch = Batch([])
        self._shown = arrays.Shown(self._batch)
        self._on_cpu = runtime.on_cpu()
        tiles = self.canvas.columns * self.canvas.lines
        self._keys = arrays.device(np.zeros(tiles * len(self.canvas.places) * at.TILE**2, np.int64))
        tables = np.zeros((at.TABLES, 4 * maps[0] ** 2 // 3 + 1), np.float32)
        tables[at.CURVE, : at.CURVE_LENGTH] = backdrop.srgb_curve()
        self._tables = arrays.device(tables)
        self._base = arrays.device(np.zeros((width * height, 3), np.float32), vectors=True)
        self._empty = np.zeros((width * height, 4 if alpha else 3), np.uint8)
        self._painted: Camera | None = None
        self._lists = np.zeros(1, np.int32)
        self._scattered = _scattered(tiles)

    def draw(self, items: Sequence[Item], camera: Camera) -> Picture:
        """The picture, shape (height, width, 3 or 4), of the items' present positions."""
        if self._generation != runtime.generation:
            raise RuntimeError("this renderer belongs to an earlier start of Taichi; make it anew")
        if not self._batch.holds(items):
            self._batch = Batch(items)
            self._shown = arrays.Shown(self._batch)
        batch, shown = self._batch, self._shown
        batch.place(np.asarray(camera.target, dtype=np.float64), camera.distance)
        pad = batch.largest_radius(camera.distance)
        materials = batch.material_rows(camera.distance)
        stage = stage_of(self.canvas, camera, batch.places(), pad, materials)
        shown.update(stage)
        self.lap("places")
        if self._painted != camera and not self.alpha:
            self._paint(shown.stage, camera)
        geometry.look(
            shown.vertices, shown.stage, shown.primitives, shown.corner_starts, shown.corners
        )
        self.lap("projection")
        self._map_lamp(shown, stage)
        self.lap("lamp")
        if self.canvas.ground is not None:
            self._map_ground(shown)
        self.lap("ground")
        busy, bare = (
            self._see_tiles(shown, stage) if self._on_cpu else self._see_samples(shown, stage)
        )
        self.lap("seeing")
        picture = arrays.device(self._empty.copy(), vectors=True)
        kernel = draw_kernel(
            capsules=batch.capsule_count > 0,
            wires=batch.wires,
            alpha=self.alpha,
            together=self._on_cpu,
        )
        if len(busy):
            kernel(
                shown.stage, shown.vertices, shown.primitives, self._keys, self._tables,
                arrays.device(busy), self._base, picture,
            )  # fmt: skip
        if len(bare):
            ground_kernel(alpha=self.alpha)(shown.stage, self._tables, bare, self._base, picture)
        self.lap("shading")
        width, height = self.canvas.size
        return arrays.host(picture).reshape(height, width, -1)

    def _paint(self, stage: Any, camera: Camera) -> None:
        """The empty picture, which a camera sees in every frame."""
        picture = arrays.device(self._empty, vectors=True)
        backdrop.paint_backdrop(stage, self._tables, self._base, picture)
        self._empty = arrays.host(picture)
        self._painted = camera

    def _map(self, shown: arrays.Shown, rows: int, table: int) -> None:
        """The triangles and capsules on the lamp's or the ground's map."""
        batch, args = self._batch, (shown.stage, rows, table, self._tables)
        light.clear_map(self.canvas.map_sizes[table], table, self._tables)
        light.map_triangles(shown.vertices, shown.primitives, batch.triangle_count, *args)
        if batch.capsule_count:
            capsules.map_capsules(shown.vertices, shown.primitives, batch.triangle_count, *args)

    def _map_lamp(self, shown: arrays.Shown, stage: Any) -> None:
        self._map(shown, at.LAMP_X, at.LAMP_MAP)
        light.average_cells(shown.stage, self._tables)
        light.blur_cells(self._tables)

    def _map_ground(self, shown: arrays.Shown) -> None:
        """The soft shadow on the ground, and how dark it is below things."""
        size = self.canvas.map_sizes[0]
        ground.cover(size, shown.stage, self._tables)
        shared = SHARED_LEVELS if self._on_cpu else ground.LEVELS
        for level in range(1, shared):
            ground.halve(size, level, self._tables)
        if shared < ground.LEVELS:
            ground.coarse_levels(size, shared, self._tables)
        for level in reversed(range(shared)):
            ground.soften(size, level, self._tables)
        self._map(shown, at.GROUND_X, at.GROUND_MAP)
        ground.dim_ground(self.canvas.map_sizes[1], shown.stage, self._tables)

    def _see_rare(self, shown: arrays.Shown, stage: Any, marks: Any) -> None:
        """What is not seen triangle by triangle in front of the eye."""
        batch = self._batch
        args = (shown.vertices, shown.primitives, batch.triangle_count, shown.stage, self._keys)
        if batch.capsule_count:
            capsules.see_capsules(*args, marks)
        with np.errstate(invalid="ignore", over="ignore"):
            depths = batch.places() @ stage[at.TO_W, :3] + stage[at.TO_W, 3]
        if batch.triangle_count and (depths <= at.NEAR).any():
            raster.see_cut_triangles(*args, marks)

    def _see_tiles(self, shown: arrays.Shown, stage: Any) -> Jobs:
        """Fill the keys, tile by tile; returns the tiles with primitives and those with ground."""
        batch, tiles = self._batch, len(self._scattered)
        counts = np.zeros(tiles, np.int32)
        args = (shown.vertices, shown.primitives, batch.triangle_count, shown.stage)
        raster.bin_triangles(*args, counts, 0, self._lists)
        first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
        if first[-1] > len(self._lists):
            self._lists = np.zeros(int(1.3 * first[-1]), np.int32)
        raster.bin_triangles(*args, first[:-1].copy(), len(self._lists), self._lists)
        marks = np.zeros(tiles, np.int32)
        self._see_rare(shown, stage, marks)
        raster.see_tiles(
            shown.vertices, shown.primitives, shown.stage, self._keys,
            self._jobs(counts > 0), first, self._lists,
        )  # fmt: skip
        busy = (counts > 0) | (marks > 0)
        return self._jobs(busy), self._jobs(~busy & self._shadowed_tiles(stage))

    def _jobs(self, chosen: NDArray[np.bool_]) -> NDArray[np.int32]:
        return _spread(self._scattered[chosen[self._scattered]])

    def _see_samples(self, shown: arrays.Shown, stage: Any) -> Jobs:
        """Fill the keys, each triangle for itself, as suits a GPU; all tiles are drawn."""
        tiles = len(self._scattered)
        args = (shown.vertices, shown.primitives, self._batch.triangle_count, shown.stage)
        raster.see_triangles(*args, self._keys)
        self._see_rare(shown, stage, arrays.device(np.zeros(tiles, np.int32)))
        return np.arange(tiles, dtype=np.int32), np.zeros(0, np.int32)

    def _shadowed_tiles(self, stage: Any) -> NDArray[np.bool_]:
        """Which tiles shadows on the ground, or its dimness, may reach."""
        if self.canvas.ground is None:
            return np.zeros(len(self._scattered), bool)
        tables = arrays.host(self._tables)
        sizes, columns, lines = self.canvas.map_sizes, self.canvas.columns, self.canvas.lines
        x, y = np.meshgrid(np.arange(columns + 1) * at.TILE, np.arange(lines + 1) * at.TILE)
        rows = stage[[at.FLOOR, at.ON_LAMP_X, at.ON_LAMP_Y, at.ON_GROUND_X, at.ON_GROUND_Y], :3]
        grid = np.stack([x, y, np.ones_like(x)], axis=-1) @ rows.T
        with np.errstate(divide="ignore", invalid="ignore"):
            places = np.nan_to_num(grid[..., 1:] / grid[..., :1])
        shifts = [(slice(v, v + lines), slice(u, u + columns)) for v in (0, 1) for u in (0, 1)]
        lo = np.minimum.reduce([places[shift] for shift in shifts])
        hi = np.maximum.reduce([places[shift] for shift in shifts])
        behind = np.stack([grid[shift][..., 0] <= 0.0 for shift in shifts])
        hit = behind.any(axis=0)  # a tile across the horizon
        hit |= _some_within(tables[at.SHADOW], sizes[0], 1, lo[..., :2], hi[..., :2])
        hit |= _some_within(tables[at.DIM], sizes[1], 0, lo[..., 2:], hi[..., 2:])
        return np.asarray(hit & ~behind.all(axis=0)).ravel()


def _map_size(height: int) -> int:
    """Texels along the lamp's map: one for about two pixels."""
    return int(np.clip(2 ** round(np.log2(0.7 * height)), 256, 1024))


def _scattered(tiles: int) -> NDArray[np.int32]:
    """All tiles, neighbours far apart: Taichi gives each thread one piece of a range."""
    stride = next(s for s in range(int(0.618 * tiles) + 1, 2 * tiles + 2) if np.gcd(s, tiles) == 1)
    return (np.arange(tiles, dtype=np.int64) * stride % tiles).astype(np.int32)


def _spread(jobs: NDArray[Any]) -> NDArray[np.int32]:
    """Jobs with -1 between them, so many that all threads take part."""
    repeat = max(1, -(-LEAST_WORK * runtime.threads() // max(len(jobs), 1)))
    out = np.full(len(jobs) * repeat, -1, np.int32)
    out[::repeat] = jobs
    return out


def _some_within(
    pyramid: NDArray[np.float32], size: int, level: int, lo: NDArray[Any], hi: NDArray[Any]
) -> NDArray[np.bool_]:
    """Whether anything but zero lies in rectangles of a map, given in texels of the finest level.

    Counted in a table of sums over all rectangles from the corner (Crow 1984).
    """
    n = size >> level
    start = 4 * (size * size - n * n) // 3
    sums = np.zeros((n + 1, n + 1), np.int32)
    sums[1:, 1:] = pyramid[start : start + n * n].reshape(n, n) > 1e-3
    np.cumsum(sums, axis=0, out=sums)
    np.cumsum(sums, axis=1, out=sums)
    (x0, y0), (x1, y1) = (
        np.moveaxis(np.clip(edge / 2**level + shift, 0, n).astype(int), -1, 0)
        for edge, shift in ((lo, -1), (hi, 3))
    )
    return np.asarray(sums[y1, x1] - sums[y0, x1] - sums[y1, x0] + sums[y0, x0] > 0)
