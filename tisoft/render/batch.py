"""Items gathered into one set of arrays, so that a picture costs the same few launches whatever it
shows, and what does not change is uploaded once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from tisoft.render import geometry
from tisoft.render.items import Capsules, Item, Spheres, Surface, host


def upload(array: NDArray[Any]) -> Any:
    """A Taichi ndarray with the same content; an empty one gets a row of zeros."""
    if not len(array):
        array = np.zeros((1, *array.shape[1:]), dtype=array.dtype)
    floats = array.dtype.kind == "f"
    device = ti.ndarray(ti.f32 if floats else ti.i32, array.shape)
    device.from_numpy(np.ascontiguousarray(array, dtype=np.float32 if floats else np.int32))
    return device


class Batch:
    """Arrays of all items: points (vertices of surfaces, then ends of capsules) and triangles."""

    def __init__(self, items: Sequence[Item]) -> None:
        self.items = list(items)
        self.surfaces = [item for item in items if isinstance(item, Surface)]
        self.capsules = [item for item in items if isinstance(item, Capsules | Spheres)]
        smooth = [item.smooth for item in self.surfaces]
        ends = [item.end_nodes() for item in self.capsules]
        counts = [len(s.nodes) for s in smooth] + [len(e) for e in ends]
        self.starts = np.concatenate([[0], np.cumsum(counts)]).astype(int).tolist()
        self.nodes = [upload(nodes) for nodes in [*(s.nodes for s in smooth), *ends]]
        self.vertex_count = self.starts[len(smooth)]
        self.capsule_count = (self.starts[-1] - self.vertex_count) // 2
        self.triangle_count = sum(len(s.triangles) for s in smooth)
        self._upload_topology(smooth)
        self._upload_materials([len(s.triangles) for s in smooth], [len(e) // 2 for e in ends])
        self.points = upload(np.zeros((self.starts[-1], 3), dtype=np.float32))
        self.normals = upload(np.zeros((self.vertex_count, 3), dtype=np.float32))
        self.colors = upload(np.zeros((self.starts[-1], 3), dtype=np.float32))
        self.radii = upload(np.zeros(self.capsule_count, dtype=np.float32))
        self._radius = 0.0

    def _upload_topology(self, smooth: list[Any]) -> None:
        nothing = np.zeros((0, 3), dtype=np.int32)
        triangles, starts, corners, first = [nothing], [np.zeros(1, np.int32)], [nothing[:, 0]], 0
        for s, start in zip(smooth, self.starts, strict=False):
            triangles.append(s.triangles + start)
            starts.append(s.starts[1:] + first)
            corners.append(s.corners + first)
            first += len(s.corners)
        self.triangles = upload(np.concatenate(triangles))
        self.corner_starts = upload(np.concatenate(starts))
        self.corners = upload(np.concatenate(corners))

    def _upload_materials(self, triangles: list[int], capsules: list[int]) -> None:
        everything = [*self.surfaces, *self.capsules]
        of = np.repeat(np.arange(len(everything)), [*triangles, *capsules])
        wires = [float(getattr(item, "wireframe", False)) for item in everything]
        shines = [float(item.shine) for item in everything]
        self.item_of = upload(of.astype(np.int32))
        self.materials = upload(np.array([wires, shines], dtype=np.float32).T.reshape(-1, 2))

    def holds(self, items: Sequence[Item]) -> bool:
        """Whether it was made of just these items."""
        if len(items) != len(self.items):
            return False
        return all(new is old for new, old in zip(items, self.items, strict=True))

    def place(self, target: NDArray[np.float64], distance: float) -> None:
        """Bring positions, normals, colours and radii up to date, about the target."""
        everything = [*self.surfaces, *self.capsules]
        for item, nodes, start in zip(everything, self.nodes, self.starts, strict=False):
            positions = item.positions
            if len(positions.shape) == 1:  # Taichi's, of vectors
                positions = host(positions)
            if isinstance(positions, np.ndarray):
                positions = np.ascontiguousarray(positions)
            geometry.place(positions, nodes, start, target, distance, self.points)
        if self.triangle_count:
            geometry.vertex_normals(
                self.points, self.triangles, self.corner_starts, self.corners, self.normals
            )
        if self.capsule_count:
            counts = np.diff(self.starts)[len(self.surfaces) :] // 2
            radii = np.repeat([item.radius / distance for item in self.capsules], counts)
            self._radius = float(radii.max())
            self.radii.from_numpy(radii.astype(np.float32))
        self._place_colors()

    def _place_colors(self) -> None:
        linear = [s.vertex_colors() for s in self.surfaces]
        linear += [c.end_colors() for c in self.capsules]
        counts = np.diff(self.starts)
        if linear:
            rows = [np.broadcast_to(c, (n, 3)) for c, n in zip(linear, counts, strict=True)]
            colors = np.concatenate(rows)
            if len(colors):
                self.colors.from_numpy(np.ascontiguousarray(colors))

    def points_and_radius(self) -> tuple[NDArray[np.float64], float]:
        """All finite points, in NumPy, and the largest radius around them."""
        if self.starts[-1] == 0:
            return np.zeros((0, 3)), 0.0
        points = self.points.to_numpy().astype(np.float64)
        return points[np.isfinite(points).all(axis=1)], self._radius
