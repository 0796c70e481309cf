"""Where a film is seen from: all motion in the picture, as large as it can be."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tisoft.gravity import mainly
from tisoft.moving import moves
from tisoft.observers.quantities import QUANTITIES
from tisoft.observers.track import Snapshot, snapshot_of
from tisoft.render.camera import Camera, auto_camera, turned
from tisoft.scene import Plane, Scene
from tisoft.simulation import Simulation

Floats = NDArray[np.float64]

SHOWN = (98.0, 85.0)
"""Per cent of the nodes, and of the frames, whose values the colours tell apart; what is above, as
peaks at single nodes and at the moment of an impact, shows the end's colour."""
DIRECTIONS = 96
"""In which the outermost nodes of a frame are looked for."""
LARGEST = 3.0
"""Sizes of the motion that a sphere or box may have and still be framed with it."""
VIEWS = 25
"""From which a camera that turns looks in search of a distance that suits all of them."""


@dataclass
class Survey:
    """What a film must leave room for: where nodes go, and the values that colours show."""

    lo: Floats = field(default_factory=lambda: np.full(3, np.inf))
    hi: Floats = field(default_factory=lambda: np.full(3, -np.inf))
    tops: list[float] = field(default_factory=list)
    """High value of every frame."""
    outermost: list[Floats] = field(default_factory=list)
    """Positions [m] of every frame that no others lie beyond."""
    followed: slice | None = None
    """Rows of the nodes whose motion as a whole the camera shares."""
    _home: Floats | None = None

    @property
    def top(self) -> float:
        """The value at the end of the colour bar: a round one."""
        return round_up(float(np.percentile(self.tops, SHOWN[1]))) if self.tops else 0.0

    @classmethod
    def of(cls, snapshots: Iterable[Snapshot], followed: slice | None = None) -> Survey:
        """What all of a film shows."""
        survey = cls(followed=followed)
        for snapshot in snapshots:
            survey.add(snapshot)
        return survey

    @classmethod
    def of_start(cls, sim: Simulation, followed: slice | None = None) -> Survey:
        """What the start alone tells: where bodies are, and the ground that they may fall to."""
        survey = cls(followed=followed)
        survey.see(sim, "body")
        up = up_of(sim.scene)
        ground = ground_of(sim.scene, up)
        if ground is not None:
            below = up * (up @ (survey.lo - np.array(ground.point)))
            survey.lo = np.minimum(survey.lo, survey.lo - below)
            survey.hi = np.maximum(survey.hi, survey.lo)
            survey.outermost = []  # the box tells
        return survey

    def see(self, sim: Simulation, color: str) -> None:
        """Widen it by the simulation's present state."""
        self.add(snapshot_of(sim, color if color in QUANTITIES else "body"))

    def add(self, snapshot: Snapshot) -> None:
        """Widen it by a snapshot."""
        x = snapshot.positions - self.way(snapshot)
        self.lo, self.hi = np.minimum(self.lo, x.min(axis=0)), np.maximum(self.hi, x.max(axis=0))
        self.outermost.append(x[np.unique(np.argmax(x @ _directions().T, axis=0))])
        if snapshot.values is not None:
            self.tops.append(float(np.percentile(snapshot.values, SHOWN[0])))

    def way(self, snapshot: Snapshot) -> Floats:
        """How far what the camera follows has moved since the first snapshot [m]."""
        if self.followed is None:
            return np.zeros(3)
        middle: Floats = snapshot.positions[self.followed].mean(axis=0)
        if self._home is None:
            self._home = middle
        return middle - self._home


def _directions() -> Floats:
    """Unit vectors spread evenly over the sphere."""
    k = np.arange(DIRECTIONS) + 0.5
    z, angle = 1.0 - 2.0 * k / DIRECTIONS, k * np.pi * (3.0 - np.sqrt(5.0))
    r = np.sqrt(1.0 - z * z)
    return np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1)


def round_up(value: float) -> float:
    """The least of 1, 1.5, 2, 2.5, 3, 4, 5, 6, 8 times a power of ten that is not below."""
    if not value > 0.0 or not np.isfinite(value):
        return value
    power = 10.0 ** np.floor(np.log10(value))
    steps = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
    return float(power * next(s for s in steps if s * power >= value * (1.0 - 1e-9)))


class View:
    """The camera of a film from moment to moment."""

    def __init__(self, scene: Scene, survey: Survey) -> None:
        self._survey = survey
        self._turn = scene.camera.turn
        self._first = camera_of(scene, survey)

    def at(self, snapshot: Snapshot) -> Camera:
        """Where the snapshot is seen from."""
        way = self._survey.way(snapshot)
        camera = turned(self._first, self._turn * snapshot.time) if self._turn else self._first
        if not way.any():
            return camera
        eye, target = np.add(camera.eye, way), np.add(camera.target, way)
        return Camera(tuple(eye), tuple(target), camera.up, camera.fov)


def up_of(scene: Scene) -> Floats:
    """Unit vector that is up in the picture: the camera's, else against gravity, else y."""
    if scene.camera.up is not None:
        return np.array(scene.camera.up)
    gravity = mainly(scene.gravity)
    strength = float(np.linalg.norm(gravity))
    return -gravity / strength if strength else np.array([0.0, 1.0, 0.0])


def ground_of(scene: Scene, up: Floats) -> Plane | None:
    """The plane that is drawn as an endless floor: the most level one that bears bodies."""
    planes = [
        p
        for p in scene.obstacles
        if isinstance(p, Plane) and not moves(p) and up @ np.array(p.normal) > 0.1
    ]
    return max(planes, key=lambda p: float(up @ np.array(p.normal)), default=None)


def camera_of(scene: Scene, survey: Survey) -> Camera:
    """The scene's camera at the start; what it leaves out is chosen so that all motion is seen."""
    given, up = scene.camera, up_of(scene)
    if given.eye is not None and given.target is not None:
        return Camera(given.eye, given.target, tuple(up), given.fov)
    width, height = scene.render.size
    lo, hi = room_of(scene, survey)
    views = [
        given.turn * scene.duration * k / (VIEWS - 1) for k in range(VIEWS if given.turn else 1)
    ]
    auto = auto_camera(
        lo,
        hi,
        up,
        aspect=width / height,
        fov=given.fov,
        points=_outermost(scene, survey),
        angles=[angle for angle in views if abs(angle) < 360.0],
    )
    target = np.array(auto.target if given.target is None else given.target)
    away = np.subtract(auto.eye, auto.target)
    eye = target + away if given.eye is None else np.array(given.eye)
    return Camera(tuple(eye), tuple(target), tuple(up), given.fov)


def room_of(scene: Scene, survey: Survey) -> tuple[Floats, Floats]:
    """The box to frame: the motion, and spheres and boxes that are not much larger."""
    lo, hi = survey.lo, survey.hi
    for low, high in _framed_obstacles(scene, survey):
        lo, hi = np.minimum(lo, low), np.maximum(hi, high)
    return lo, hi


def _outermost(scene: Scene, survey: Survey) -> Floats | None:
    """Points whose hull is all that is to be framed; None where only their box is known."""
    if not survey.outermost:
        return None
    boxes = [np.stack(corners) for corners in _framed_obstacles(scene, survey)]
    pick = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    corners = [box[pick, [0, 1, 2]] for box in boxes]
    return np.concatenate([*survey.outermost, *corners])


def _framed_obstacles(scene: Scene, survey: Survey) -> list[tuple[Floats, Floats]]:
    """Corners of the boxes around obstacles that are shown whole."""
    found = []
    reach = LARGEST * float(np.linalg.norm(survey.hi - survey.lo))
    for obstacle in scene.obstacles:
        box = obstacle.bounds()
        if box is not None and np.linalg.norm(box[1] - box[0]) <= reach:
            found.append(box)
    return found
