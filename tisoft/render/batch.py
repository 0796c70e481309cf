"""Items gathered into one set of arrays, so that a picture costs the same few launches whatever it
shows, and what does not change is prepared once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.render.items import Item, Surface, host
from tisoft.render.layout import COLOR, PLACE

Floats = NDArray[np.float32]
Integers = NDArray[np.int32]


class Batch:
    """Arrays of all items, in NumPy: vertices of surfaces, then ends of capsules; triangles, then
    capsules.  An array that would be empty has a row of zeros that nothing reads.
    """

    def __init__(self, items: Sequence[Item]) -> None:
        self.items = list(items)
        surfaces = [item for item in items if isinstance(item, Surface)]
        capsules = [item for item in items if not isinstance(item, Surface)]
        self.order: list[Item] = [*surfaces, *capsules]
        smooth = [item.smooth for item in surfaces]
        self.nodes = [*(s.nodes for s in smooth), *(c.end_nodes() for c in capsules)]
        self.starts = np.concatenate([[0], np.cumsum([len(n) for n in self.nodes])]).astype(int)
        self.triangle_count = sum(len(s.triangles) for s in smooth)
        self.primitives = self._primitives(smooth)
        self.capsule_count = len(self.primitives) - self.triangle_count
        if not len(self.primitives):
            self.primitives = np.zeros((1, 4), np.int32)
        firsts = np.concatenate([[0], np.cumsum([len(s.corners) for s in smooth])]).astype(int)
        corner_starts = [s.starts[1:] + n for s, n in zip(smooth, firsts, strict=False)]
        self.corner_starts = _joined([np.zeros(1, np.int32), *corner_starts])
        three = zip(smooth, firsts, strict=False)  # corner 3t + k of all triangles
        self.corners = _joined([*(s.corners + n for s, n in three), np.zeros(1, np.int32)])
        self.vertices = np.zeros((4, max(int(self.starts[-1]), 1), 3), np.float32)
        self.wires = False
        self._shown: list[Any] = [None] * len(self.order)

    def _primitives(self, smooth: list[Any]) -> Integers:
        rows = [np.zeros((0, 4), np.int32)]
        for k, start in enumerate(self.starts[:-1]):
            if k < len(smooth):
                corners = smooth[k].triangles + start
            else:
                ends = start + np.arange(len(self.nodes[k])).reshape(-1, 2)
                corners = np.concatenate([ends, np.full((len(ends), 1), -1)], axis=1)
            rows.append(np.concatenate([corners, np.full((len(corners), 1), k)], axis=1))
        return np.ascontiguousarray(np.concatenate(rows), np.int32)

    def holds(self, items: Sequence[Item]) -> bool:
        """Whether it was made of just these items."""
        if len(items) != len(self.items):
            return False
        return all(new is old for new, old in zip(items, self.items, strict=True))

    def place(self, target: NDArray[np.float64], distance: float) -> None:
        """Bring places, (p - target)/distance, and colours up to date.

        The difference is formed in the positions' own precision, so that with f64 a scene far from
        the origin, or of any size, loses no digits.
        """
        self.wires = any(getattr(item, "wireframe", False) for item in self.order)
        for k, item in enumerate(self.order):
            rows = slice(self.starts[k], self.starts[k + 1])
            if rows.start == rows.stop:
                continue
            with np.errstate(invalid="ignore", over="ignore"):
                here = np.take(host(item.positions), self.nodes[k], axis=0)
                self.vertices[PLACE, rows] = (here - target) / distance
            color = np.asarray(item.color, dtype=np.float32)
            if self._shown[k] is None or not np.array_equal(self._shown[k], color):
                self._shown[k] = color.copy()
                self.vertices[COLOR, rows] = item.vertex_colors()

    def places(self) -> Floats:
        """Places of all vertices, shape (n, 3)."""
        return self.vertices[PLACE, : self.starts[-1]]

    def material_rows(self, distance: float) -> Floats:
        """Rows of the stage for all items."""
        rows = [
            (
                float(getattr(item, "wireframe", False)),
                item.shine,
                getattr(item, "radius", 0.0) / distance,
                getattr(item, "translucent", 0.0),
            )
            for item in self.order
        ]
        return np.array(rows, np.float32).reshape(-1, 4)

    def largest_radius(self, distance: float) -> float:
        """Of the capsules, in distances from the eye to the target."""
        radii = [item.radius for item in self.order if not isinstance(item, Surface)]
        return max(radii, default=0.0) / distance


def _joined(arrays: list[Any]) -> Integers:
    return np.ascontiguousarray(np.concatenate(arrays), dtype=np.int32)
