"""What a page draws of a scene: rows (points that move), triangles and segments between them.

A row is a node of a body's mesh, or a point of its skin.  What is grabbed is told in rows.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.body import Body
from tisoft.models.materials import MassSpring
from tisoft.observers.region_colors import first_colors, node_colors
from tisoft.observers.scenery import body_items
from tisoft.render.colormap import body_color
from tisoft.render.items import Capsules, SmoothVertices, Surface
from tisoft.scene import Scene

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Shown:
    """One body as it is drawn: its rows, and how they follow from its nodes."""

    body: Body
    nodes: slice
    """Its rows of the scene's nodes."""
    rows: slice
    """Its rows of what is drawn."""
    triangles: NDArray[np.int64]
    segments: NDArray[np.int64]
    picked: NDArray[np.int64] | None
    """Nodes that are drawn; None where a skin is."""

    def carried(self, values: Floats) -> Floats:
        """Values at the drawn rows of values at all nodes of the scene."""
        own = values[self.nodes]
        if self.picked is not None:
            return own[self.picked]
        assert self.body.skin is not None
        return self.body.skin.carried(own)

    def rest_point(self, rows: NDArray[np.int64], weights: Floats) -> Floats:
        """Where Σ w x of drawn rows is in the mesh at rest [m], shape (3,)."""
        points = np.zeros((self.nodes.stop, 3))
        points[self.nodes] = self.body.mesh.points
        point: Floats = weights @ self.carried(points)[rows - self.rows.start]
        return point


class Drawn:
    """All bodies of a scene as they are drawn."""

    def __init__(self, scene: Scene) -> None:
        self.bodies: list[Shown] = []
        nodes = rows = 0
        for body in scene.bodies:
            shown = _shown(body, nodes, rows)
            self.bodies.append(shown)
            nodes, rows = shown.nodes.stop, shown.rows.stop
        self.count = rows
        """Rows."""

    def carried(self, values: Floats) -> Floats:
        """Values at all rows of values at all nodes, in the scene's order."""
        return np.concatenate([shown.carried(values) for shown in self.bodies])

    def owner(self, rows: NDArray[np.int64]) -> Shown | None:
        """The one body that all these rows belong to."""
        for shown in self.bodies:
            if (rows >= shown.rows.start).all() and (rows < shown.rows.stop).all():
                return shown
        return None

    def topology(self, positions: Floats) -> dict[str, Any]:
        """Vertices split along creases, their triangles, springs and plain colours, for JSON."""
        triangles = np.concatenate([shown.triangles for shown in self.bodies])
        segments = np.concatenate([shown.segments for shown in self.bodies])
        smooth = SmoothVertices.of(self.carried(positions), triangles)
        counts = [shown.rows.stop - shown.rows.start for shown in self.bodies]
        plain = np.repeat([body_color(i) for i in range(len(counts))], counts, axis=0)
        return {
            "rows": self.count,
            "vertices": smooth.nodes.tolist(),
            "triangles": smooth.triangles.ravel().tolist(),
            "segments": segments.ravel().tolist(),
            "plain": _bytes(plain),
            "regions": _bytes(self._region_colors()),
        }

    def _region_colors(self) -> Floats:
        """A colour of each row by the region it is in, shape (rows, 3)."""
        firsts = first_colors(Scene(bodies=[shown.body for shown in self.bodies]))
        found = []
        for shown, first in zip(self.bodies, firsts, strict=True):
            colors = np.zeros((shown.nodes.stop, 3))
            colors[shown.nodes] = node_colors(shown.body, first)
            found.append(shown.carried(colors))
        return np.concatenate(found)


def _bytes(colors: Floats) -> list[int]:
    found: list[int] = np.round(255 * colors).astype(int).ravel().tolist()
    return found


def _shown(body: Body, node: int, row: int) -> Shown:
    nodes = slice(node, node + len(body.mesh.points))
    none = np.zeros((0, 2), np.int64)
    if body.skin is not None:
        rows = slice(row, row + len(body.skin.carried(body.mesh.points)))
        return Shown(body, nodes, rows, np.asarray(body.skin.triangles, np.int64) + row, none, None)
    triangles, segments = np.zeros((0, 3), np.int64), none
    if not isinstance(body.model, MassSpring):
        triangles = np.asarray(body.mesh.surface, np.int64)
    else:
        for item in body_items(body, 0, body.mesh.points, 0, wireframe=False):
            if isinstance(item, Surface):
                triangles = np.asarray(item.triangles, np.int64)
            elif isinstance(item, Capsules):
                segments = np.asarray(item.edges, np.int64)
    picked = np.unique(np.concatenate([triangles.ravel(), segments.ravel()]))
    rank = np.zeros(len(body.mesh.points), np.int64)
    rank[picked] = np.arange(len(picked)) + row
    rows = slice(row, row + len(picked))
    return Shown(body, nodes, rows, rank[triangles], rank[segments], picked)
