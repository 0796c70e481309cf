"""Surfaces of the obstacles, in neutral grey."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tisoft.render.items import Surface

GREY = (0.66, 0.67, 0.69)
CELLS = 16  # cells along a side; large triangles would keep one thread busy for long


def sphere_surface(center: ArrayLike, radius: float, *, color: ArrayLike = GREY) -> Surface:
    """A sphere: a cube's grid, blown up; lengths in metres."""
    points, triangles = cube(12)
    points = np.tan(points * np.pi / 4)
    points *= radius / np.linalg.norm(points, axis=1, keepdims=True)
    return Surface(points + np.asarray(center, float), triangles, color, shine=0.5)


def box_surface(
    center: ArrayLike, size: ArrayLike, frame: ArrayLike | None = None, *, color: ArrayLike = GREY
) -> Surface:
    """A box; centre and size (3 lengths) in metres, along the columns of a frame, or the axes."""
    points, triangles = cube(CELLS)
    points = points * np.asarray(size, float) / 2
    if frame is not None:
        points = points @ np.transpose(frame)
    return Surface(points + np.asarray(center, float), triangles, color, shine=0.5)


def plane_surface(
    point: ArrayLike, normal: ArrayLike, side: float, *, color: ArrayLike = GREY
) -> Surface:
    """A square patch of a plane around a point, with a side [m]."""
    n = np.asarray(normal, float) / np.linalg.norm(normal)
    u = np.cross(np.eye(3)[np.argmin(np.abs(n))], n)
    u /= np.linalg.norm(u)
    grid, triangles = _patch(CELLS, n, u, np.cross(n, u))
    return Surface((grid - n) * side / 2 + np.asarray(point, float), triangles, color, shine=0.3)


def rod_surface(
    start: ArrayLike, end: ArrayLike, radius: float, *, round_ends: bool, color: ArrayLike = GREY
) -> Surface:
    """A rod with round or flat ends; lengths in metres."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    points, triangles = cube(12)
    points = np.tan(points * np.pi / 4)
    length = float(np.linalg.norm(end - start))
    along = (end - start) / length
    if round_ends:
        points /= np.linalg.norm(points, axis=1, keepdims=True)
        across, high = points[:, :2] * radius, points[:, 2] * radius
        high += np.where(points[:, 2] > 0.0, 0.5 * length, -0.5 * length)
    else:  # squares become discs
        widest = np.abs(points[:, :2]).max(axis=1)
        across = points[:, :2] * radius
        across *= (widest / np.maximum(np.linalg.norm(points[:, :2], axis=1), 1e-30))[:, None]
        high = 0.5 * length * points[:, 2]
    u = np.eye(3)[np.argmin(np.abs(along))]
    u = u - (along @ u) * along
    u /= np.linalg.norm(u)
    frame = np.stack([u, np.cross(along, u), along])
    places = 0.5 * (start + end) + np.column_stack([across, high]) @ frame
    return Surface(places, triangles, color, shine=0.5)


def shell_surface(
    points: NDArray[np.float64], triangles: NDArray[np.integer], *, color: ArrayLike = GREY
) -> Surface:
    """A surface of triangles, drawn with flat faces: each has points of its own."""
    flat = np.arange(3 * len(triangles), dtype=np.int32).reshape(-1, 3)
    return Surface(points[triangles].reshape(-1, 3), flat, color, shine=0.3)


def _patch(
    cells: int, n: NDArray[np.float64], u: NDArray[np.float64], v: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """The square [-1, 1]² along u and v at distance 1 along n, facing n = u × v."""
    t = np.linspace(-1.0, 1.0, cells + 1)
    points = (n + t[:, None, None] * u + t[None, :, None] * v).reshape(-1, 3)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(cells), np.arange(cells), indexing="ij"))
    a, b = i * (cells + 1) + j, (i + 1) * (cells + 1) + j
    triangles = np.concatenate([np.stack([a, b, b + 1], 1), np.stack([a, b + 1, a + 1], 1)])
    return points, triangles.astype(np.int32)


def cube(cells: int) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """The surface of [-1, 1]³, nodes shared between its sides, outward."""
    axes = np.eye(3)
    sides = []
    for k in range(3):
        u, v = axes[(k + 1) % 3], axes[(k + 2) % 3]
        sides += [_patch(cells, axes[k], u, v), _patch(cells, -axes[k], v, u)]
    count = len(sides[0][0])
    points = np.concatenate([p for p, _ in sides])
    triangles = np.concatenate([t + k * count for k, (_, t) in enumerate(sides)])
    _, first, index = np.unique(points.round(9), axis=0, return_index=True, return_inverse=True)
    return points[first], index.reshape(-1)[triangles].astype(np.int32)
