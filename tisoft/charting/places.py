"""Where variants are compared: points of bodies, which probes follow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tisoft.charting.carriers import carrier
from tisoft.scene import Scene

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Place:
    """A point of a body, which probes follow: its name in the scene, rest position [m]."""

    name: str
    body: int
    point: tuple[float, float, float]


def places_of(scene: Scene) -> list[Place]:
    """Where the scene's probes are: the nodes that they follow."""
    found = []
    for probe in scene.probes:
        seen = scene.probed(probe)
        x, y, z = (float(c) for c in seen.at(seen.body.mesh.points))
        found.append(Place(probe.name, scene.bodies.index(seen.body), (x, y, z)))
    return found


def corners_of(scene: Scene) -> list[Place]:
    """Where bodies are watched that no probe follows: the nodes nearest to their boxes' corners."""
    found = []
    for k, body in enumerate(scene.bodies):
        points = body.mesh.points
        low, high = points.min(axis=0), points.max(axis=0)
        for pick in np.ndindex(2, 2, 2):
            corner = np.where(pick, high, low)
            x, y, z = points[np.linalg.norm(points - corner, axis=1).argmin()].tolist()
            found.append(Place("", k, (x, y, z)))
    return found


def at_places(scene: Scene, places: list[Place], moved: list[Floats]) -> list[list[float]]:
    """Displacements [m] at the places from those of the nodes of each body."""
    found = []
    for place in places:
        mesh, u = scene.bodies[place.body].mesh, moved[place.body]
        nodes, weights = carrier(mesh, np.array(place.point))
        found.append((weights @ u[nodes]).tolist())
    return found
