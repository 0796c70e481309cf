"""What a picture knows of the camera's frustum and of the maps of lamp and ground: rows of numbers
for the kernels, see layout.py.  Lengths in distances from the eye to the target, about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tisoft.render import ground, light
from tisoft.render import layout as at
from tisoft.render.camera import Camera

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

TILES = 9.0  # about so many tiles along the distance from the eye to the target
LAMP_BORDER = 25.0  # texels around what is mapped, for penumbrae
GROUND_BORDER = 2.0


@dataclass(frozen=True)
class GroundPlane:
    """The plane through a point [m] with a normal that points to its upper side."""

    point: Sequence[float] = (0.0, 0.0, 0.0)
    normal: Sequence[float] = (0.0, 1.0, 0.0)


@dataclass(frozen=True)
class Canvas:
    """What all pictures of one renderer share: size (pixels), samples a pixel (places from 0 to 1,
    shape (n, 2)), texels along the maps, which way is up, and the ground."""

    size: tuple[int, int]
    places: Floats
    map_sizes: tuple[int, int]
    up: Array
    ground: GroundPlane | None

    @property
    def columns(self) -> int:
        """Tiles side by side."""
        return -(-self.size[0] // at.TILE)

    @property
    def lines(self) -> int:
        """Tiles one above another."""
        return -(-self.size[1] // at.TILE)


def places_of(samples: int) -> Floats:
    """Places of samples² samples in a pixel: a lattice turned so that no two share a row or a
    column, which smooths edges near the axes better than a square one."""
    n = samples * samples
    if n == 1:
        return np.array([[0.5, 0.5]], dtype=np.float32)
    k = np.arange(1, n + 1)
    turn = next(g for g in range(max(2, samples), n + 2) if np.gcd(g, n + 1) == 1)
    return (np.stack([k, k * turn % (n + 1)], axis=1) / (n + 1)).astype(np.float32)


def disc_rows(size: int) -> Floats:
    """Points spread evenly over the unit disc (Vogel's spiral) and their radii; those of the search
    in whole texels of its reach, and how far that is along a map of size²."""
    rows = []
    for count in (at.SEARCH, at.TAPS):
        k = np.arange(count)
        r, angle = np.sqrt((k + 0.5) / count), k * np.pi * (3.0 - np.sqrt(5.0))
        rows.append(np.stack([r * np.cos(angle), r * np.sin(angle), r, 0.0 * r], axis=1))
    rows[0][:, :2] = np.floor(0.5 + light.REACH * rows[0][:, :2])
    rows[0][:, 2] *= light.REACH
    rows[0][:, 3] = rows[0][:, 1] * size + rows[0][:, 0]
    return np.concatenate(rows).astype(np.float32)


def stage_of(canvas: Canvas, camera: Camera, places: Floats, pad: float, items: Floats) -> Floats:
    """All rows, for what is at `places` and reaches `pad` around them."""
    stage = np.zeros((at.ITEMS + max(len(items), 1), 4), np.float32)
    width, height = canvas.size
    stage[at.SIZES] = width, height, len(canvas.places), canvas.columns
    stage[at.PLACES : at.PLACES + len(canvas.places), :2] = canvas.places
    stage[at.DISC : at.ITEMS] = disc_rows(canvas.map_sizes[0])
    stage[at.ITEMS : at.ITEMS + len(items)] = items
    _view(stage, canvas, camera)
    direction, normal = _lamp_direction(canvas, camera), _normal(canvas)
    u = _unit(np.cross(canvas.up, direction))
    gu = _unit(np.cross(np.eye(3)[np.argmin(np.abs(normal))], normal))
    axes = np.stack([u, np.cross(direction, u), gu, np.cross(normal, gu)])
    lo, hi = _extent(places, axes)
    size, margin = canvas.map_sizes[0], pad
    rows, texel = _square_map(lo[:2], hi[:2], axes[:2], size, margin, LAMP_BORDER)
    stage[at.LAMP, :3] = direction
    stage[at.LAMP_X], stage[at.LAMP_Y] = rows
    stage[at.LAMP_Z, :3] = direction
    size, margin = canvas.map_sizes[1], ground.HALO
    rows, ground_texel = _square_map(lo[2:], hi[2:], axes[2:], size, margin, GROUND_BORDER)
    stage[at.GROUND_X], stage[at.GROUND_Y] = rows
    stage[at.LAMP_SIZE, :2] = canvas.map_sizes[0], texel
    stage[at.GROUND_SIZE, :2] = canvas.map_sizes[1], ground_texel
    _ground(stage, canvas, camera, normal, axes[2:])
    return stage


def _view(stage: Floats, canvas: Canvas, camera: Camera) -> None:
    width, height = canvas.size
    right, up, forward = camera.axes()
    tan = np.tan(np.radians(camera.fov) / 2.0)
    right, up = right * tan * width / height, up * tan
    eye = -forward
    stage[at.EYE, :3] = eye
    stage[at.CORNER, :3] = forward - right + up
    stage[at.ACROSS, :3] = 2.0 / width * right
    stage[at.DOWN, :3] = -2.0 / height * up
    depth = np.array([*forward, -forward @ eye])
    x, y = right / (right @ right), up / (up @ up)
    stage[at.TO_X] = (np.array([*x, -x @ eye]) + depth) * 0.5 * width
    stage[at.TO_Y] = (depth - np.array([*y, -y @ eye])) * 0.5 * height
    stage[at.TO_W] = depth


def _lamp_direction(canvas: Canvas, camera: Camera) -> Array:
    """To a lamp above and to the left of the camera."""
    right, _, forward = camera.axes()
    level = np.cross(canvas.up, right)  # forward, made horizontal
    level *= 1.0 if level @ forward >= 0.0 else -1.0
    return _unit(0.95 * canvas.up - 0.55 * right - 0.50 * level)


def _normal(canvas: Canvas) -> Array:
    if canvas.ground is None:
        return canvas.up
    return _unit(np.asarray(canvas.ground.normal, dtype=np.float64))


def _ground(stage: Floats, canvas: Canvas, camera: Camera, normal: Array, axes: Array) -> None:
    """The ground; unseen from below or without one."""
    point = canvas.ground.point if canvas.ground else camera.target
    level = float(normal @ np.subtract(point, camera.target)) / camera.distance
    above = float(normal @ np.subtract(camera.eye, point)) / camera.distance
    stage[at.GROUND] = [*normal, level]
    stage[at.GROUND_Z] = [*-normal, level]
    rays = stage[[at.ACROSS, at.DOWN, at.CORNER], :3].astype(np.float64)
    if canvas.ground and above > 0.0:
        stage[at.FLOOR, :3] = -rays @ normal / above
        frame = stage[[at.LAMP_X, at.LAMP_Y, at.LAMP_Z]].astype(np.float64)
        g = normal @ np.linalg.inv(frame[:, :3])
        g[2] = max(g[2], 1e-3)  # a lamp below the ground's horizon does not light it anyway
        stage[at.PLANE, :3] = [-g[0] / g[2], -g[1] / g[2], (level + g @ frame[:, 3]) / g[2]]
    eye = stage[at.EYE, :3].astype(np.float64)
    for target, source in (
        (at.ON_LAMP_X, at.LAMP_X),
        (at.ON_LAMP_Y, at.LAMP_Y),
        (at.ON_GROUND_X, at.GROUND_X),
        (at.ON_GROUND_Y, at.GROUND_Y),
    ):
        row = stage[source].astype(np.float64)
        stage[target, :3] = rays @ row[:3] + stage[at.FLOOR, :3] * (row[:3] @ eye + row[3])
    tile = tile_length(camera)
    scale = camera.distance / tile
    for target, axis in zip((at.TILES_X, at.TILES_Y), axes, strict=True):
        stage[target] = [*(scale * axis), float(axis @ np.asarray(camera.target)) / tile % 2.0]


def _extent(places: Floats, axes: Array) -> tuple[Array, Array]:
    """Least and greatest of the finite places along axes."""
    if len(places) == 0:
        return np.zeros(len(axes)), np.zeros(len(axes))
    with np.errstate(invalid="ignore", over="ignore"):
        flat = axes.astype(np.float32) @ places.T
    lo, hi = flat.min(axis=1).astype(np.float64), flat.max(axis=1).astype(np.float64)
    if not (np.isfinite(lo).all() and np.isfinite(hi).all()):
        return _extent(places[np.isfinite(places).all(axis=1)], axes)
    return lo, hi


def _square_map(
    lo: Array, hi: Array, axes: Array, size: int, margin: float, border: float
) -> tuple[Array, float]:
    """Rows of a square map along two axes, in texels, around an extent and a margin; its texel.

    Its side and place move in steps, so that shadows do not crawl while a body deforms.
    """
    side = max(float(np.max(hi - lo)) + 2.0 * margin, 1e-6)
    side = 2.0 ** (np.ceil(np.log2(side) * 8.0) / 8.0)
    texel = side / (size - 2.0 * border - 8.0)
    corner = np.round((lo + hi) / 2.0 / (4.0 * texel)) * 4.0 - size / 2.0  # in texels
    rows = np.concatenate([axes / texel, -corner[:, None]], axis=1)
    return rows, float(texel)


def tile_length(camera: Camera) -> float:
    """Side of the ground's tiles [m]."""
    return _round_length(camera.distance / TILES)


def _round_length(x: float) -> float:
    """The nearest of 1, 2 and 5 times a power of ten [m]."""
    choices = [m * 10.0**e for e in (np.floor(np.log10(x)) + np.arange(2)) for m in (1, 2, 5)]
    return float(min(choices, key=lambda c: abs(np.log(c / x))))


def _unit(v: Array) -> Array:
    return np.asarray(v / np.linalg.norm(v))
