"""The data of one picture: where rows, obstacles, probes and the culprit are, and colours.

What is drawn beside the rows travels as `extra`: 7 numbers an obstacle (d, and the quaternion of R,
x y z w: X is at R X + d), 3 a probe, and the ends of CULPRIT segments around the element that sets
the step (NaN where there are fewer).
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tisoft.errors import SceneError
from tisoft.geometry.cells import CELLS
from tisoft.moving import pose
from tisoft.observers.quantities import QUANTITIES, node_values
from tisoft.observers.scenery import COLORMAP
from tisoft.observers.solids import solid_surface
from tisoft.render.colormap import table
from tisoft.render.items import SmoothVertices
from tisoft.scene import Plane, Scene, Sphere
from tisoft.simulation import Simulation
from tisoft.stable.limiting import Limit
from tisoft.viewer.drawn import Drawn

Floats = NDArray[np.float64]

CULPRIT = 12
"""Segments that show the element that sets the step: those of a hexahedron at the most."""
PERCENTILE = 98.0
"""Per cent of the rows whose values the colours tell apart."""


@dataclasses.dataclass(frozen=True)
class Snapshot:
    """Data of one picture."""

    number: int
    drag: int
    """Number of the last drag that this state has felt."""
    time: float
    positions: NDArray[np.float32]
    """Of the drawn rows [m], shape (rows, 3)."""
    values: NDArray[np.uint8]
    """0 to 255 from 0 to `top`, shape (rows,)."""
    extra: NDArray[np.float32]
    top: float
    color: str


class Painter:
    """Makes snapshots of a simulation's present state."""

    def __init__(self, scene: Scene, color: str) -> None:
        self.scene, self.color = scene, color
        self.drawn = Drawn(scene)
        self.hold = False
        self.top = 0.0
        self.number = 0
        self.error = ""
        self._topology: dict[str, Any] = {}
        self.corners: NDArray[np.int64] = np.zeros((0, 2), np.int64)
        """Rows of the scene's nodes: the segments around the culprit, shape (segments, 2)."""

    def snapshot(self, sim: Simulation, drag: int) -> Snapshot:
        """The present state."""
        self.number += 1
        everywhere = sim.positions()
        positions = self.drawn.carried(everywhere).astype(np.float32)
        values = np.zeros(self.drawn.count, np.uint8)
        if self.color in QUANTITIES:
            try:
                values = self._values(sim)
            except SceneError as error:
                self.color, self.error = "body", str(error)
        extra = self._extra(sim, everywhere)
        return Snapshot(self.number, drag, sim.time, positions, values, extra, self.top, self.color)

    def _values(self, sim: Simulation) -> NDArray[np.uint8]:
        raw = self.drawn.carried(node_values(sim, self.color)[:, None])[:, 0]
        if not self.hold or self.top == 0.0:
            high = float(np.percentile(raw, PERCENTILE)) if len(raw) else 0.0
            self.top = max(0.99 * self.top, high, 1e-30)
        return np.clip(255.0 / self.top * raw, 0.0, 255.0).astype(np.uint8)

    def _extra(self, sim: Simulation, positions: Floats) -> NDArray[np.float32]:
        count = len(self.scene.obstacles)
        marks = np.full((2 * CULPRIT, 3), np.nan)
        ends = self.corners.ravel()[: 2 * CULPRIT]
        marks[: len(ends)] = positions[ends]
        poses = np.zeros((count, 7))
        for row, obstacle in zip(poses, self.scene.obstacles, strict=True):
            turned, way = pose(obstacle, sim.time)
            row[:3], row[3:] = way[0], Rotation.from_matrix(turned[0]).as_quat()
        parts = [poses.ravel(), sim.probe_positions().ravel(), marks.ravel()]
        return np.concatenate(parts).astype(np.float32)

    def blame(self, found: Limit) -> None:
        """Show the element that sets the step."""
        self.corners = np.zeros((0, 2), np.int64)
        if found.part is None or found.element < 0:
            return
        number = found.part.index
        shown = self.drawn.bodies[number]
        self.corners = shown.nodes.start + _segments(shown.body, found.kind, found.element)

    def hello(self, sim: Simulation) -> dict[str, Any]:
        """What a page needs before the first picture, for JSON."""
        positions = sim.positions()
        rows = self.drawn.carried(positions)
        if not self._topology:  # creases are those of the start
            self._topology = self.drawn.topology(positions)
            colors = (255.0 * table(COLORMAP)).round().astype(int)
            self._topology["map"] = colors.ravel().tolist()
        return {
            "elements": sum(body.mesh.elements for body in self.scene.bodies),
            "lo": rows.min(axis=0).tolist(),
            "hi": rows.max(axis=0).tolist(),
            "obstacles": [_plain(obstacle) for obstacle in self.scene.obstacles],
            "probes": [probe.name for probe in self.scene.probes],
            "extra": len(self._extra(sim, positions)),
            **self._topology,
        }


def _segments(body: Any, kind: str, element: int) -> NDArray[np.int64]:
    """Segments that show one of the body's elements, rows of `mesh.points`, shape (n, 2)."""
    if kind == "spring":
        return np.asarray(body.springs()[element : element + 1], np.int64)
    begun = 0
    for word, cells in body.mesh.cells.items():
        if element < begun + len(cells):
            corners = np.asarray(cells[element - begun], np.int64)
            return corners[CELLS[word].edges]
        begun += len(cells)
    return np.zeros((0, 2), np.int64)


def _plain(obstacle: Any) -> dict[str, Any]:
    """An obstacle at t = 0, for JSON: planes and balls by their numbers, others by triangles."""
    if isinstance(obstacle, Plane):
        return {"kind": "plane", "point": obstacle.point, "normal": obstacle.normal}
    if isinstance(obstacle, Sphere):
        return {"kind": "sphere", "center": obstacle.center, "radius": obstacle.radius}
    surface = solid_surface(obstacle)
    positions = np.asarray(surface.positions, np.float64)
    smooth = SmoothVertices.of(positions, np.asarray(surface.triangles))
    return {
        "kind": "solid",
        "points": positions[smooth.nodes].ravel().tolist(),
        "triangles": smooth.triangles.ravel().tolist(),
    }
