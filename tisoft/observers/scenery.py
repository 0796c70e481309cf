"""A scene as a picture shows it: items of its bodies and obstacles, ground, camera, colours."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tisoft.body import Body
from tisoft.geometry.mesh import TetMesh
from tisoft.geometry.topology import unique_edges
from tisoft.models.materials import MassSpring
from tisoft.observers.quantities import QUANTITIES, node_values
from tisoft.render.camera import Camera, auto_camera
from tisoft.render.colormap import body_color, colors_of
from tisoft.render.items import Capsules, Item, Spheres, Surface
from tisoft.render.obstacles import box_surface, plane_surface, sphere_surface
from tisoft.render.overlay import ColorBar, draw_color_bar
from tisoft.render.renderer import Renderer
from tisoft.render.stage import GroundPlane
from tisoft.scene import Box, Plane, Scene, Sphere
from tisoft.simulation import Simulation

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]

SPRING_RADIUS = 0.05
"""Of a spring as drawn, as a share of the median spring's length."""
SHOWN = (98.0, 85.0)
"""Per cent of the nodes, and of the frames, whose values the colours tell apart; what is above, as
peaks at single nodes and at the moment of an impact, shows the end's colour."""
COLORMAP = "YlOrRd"
"""Light where nothing happens, so that a body at rest looks like a body in daylight."""


LEAST_HEIGHT = 200
"""Pixels of a picture that has room for a colour bar."""


@dataclass
class Survey:
    """What a film must leave room for: where nodes go, and the values that colours show."""

    lo: Floats = field(default_factory=lambda: np.full(3, np.inf))
    hi: Floats = field(default_factory=lambda: np.full(3, -np.inf))
    tops: list[float] = field(default_factory=list)
    """High value of every frame."""

    @property
    def top(self) -> float:
        """The value at the end of the colour bar."""
        return float(np.percentile(self.tops, SHOWN[1])) if self.tops else 0.0

    @classmethod
    def of_start(cls, sim: Simulation) -> Survey:
        """What the start alone tells: where bodies are, and the ground that they may fall to."""
        survey = cls()
        survey.see(sim, "body")
        up = up_of(sim.scene)
        ground = ground_of(sim.scene, up)
        if ground is not None:
            below = up * (up @ (survey.lo - np.array(ground.point)))
            survey.lo = np.minimum(survey.lo, survey.lo - below)
            survey.hi = np.maximum(survey.hi, survey.lo)
        return survey

    def see(self, sim: Simulation, color: str) -> None:
        """Widen it by the simulation's present state."""
        x = sim.positions()
        self.lo, self.hi = np.minimum(self.lo, x.min(axis=0)), np.maximum(self.hi, x.max(axis=0))
        if color in QUANTITIES:
            values = node_values(sim, color)
            self.tops.append(float(np.percentile(values, SHOWN[0])))


class Scenery:
    """Draws a simulation; `survey` fixes the view and the colours' range for the whole film."""

    def __init__(self, sim: Simulation, survey: Survey) -> None:
        scene = sim.scene
        self.sim = sim
        self.survey = survey
        self.look = scene.render
        self.up = up_of(scene)
        self.camera = camera_of(scene, survey)
        plane = ground_of(scene, self.up) if scene.render.ground else None
        self.renderer = Renderer(
            scene.render.size,
            samples=scene.render.samples,
            ground=GroundPlane(plane.point, plane.normal) if plane else None,
            up=tuple(self.up),
        )
        self.items: list[Item] = []
        start, positions = 0, sim.positions()
        for number, body in enumerate(scene.bodies):
            self.items += body_items(body, start, positions, number, wireframe=self.look.wireframe)
            start += len(body.mesh.points)
        self.moving = list(self.items)
        self.items += obstacle_items(scene, plane, survey)

    def draw(self) -> Picture:
        """The simulation's present state, shape (height, width, 3)."""
        positions = self.sim.positions()
        for item in self.moving:
            item.positions = positions
        quantity = QUANTITIES.get(self.look.color)
        if quantity is None:
            return self.renderer.draw(self.items, self.camera)
        values = node_values(self.sim, self.look.color)
        top = self.survey.top
        colors = colors_of(values, 0.0, top, name=COLORMAP)
        for item in self.moving:
            item.color = colors if not isinstance(item, Spheres) else colors[item.nodes]
        picture = self.renderer.draw(self.items, self.camera)
        return with_bar(picture, ColorBar(quantity.label, quantity.unit, 0.0, top, COLORMAP))


def with_bar(picture: Picture, bar: ColorBar) -> Picture:
    """The picture with a colour bar, where it has room for one and there is something to tell."""
    return (
        draw_color_bar(picture, bar) if len(picture) >= LEAST_HEIGHT and bar.hi > 0.0 else picture
    )


def up_of(scene: Scene) -> Floats:
    """Unit vector that is up in the picture: the camera's, else against gravity, else y."""
    if scene.camera.up is not None:
        return np.array(scene.camera.up)
    gravity = np.array(scene.gravity)
    strength = float(np.linalg.norm(gravity))
    return -gravity / strength if strength else np.array([0.0, 1.0, 0.0])


def ground_of(scene: Scene, up: Floats) -> Plane | None:
    """The plane that is drawn as an endless floor: the most level one that bears bodies."""
    planes = [p for p in scene.obstacles if isinstance(p, Plane) and up @ np.array(p.normal) > 0.1]
    return max(planes, key=lambda p: float(up @ np.array(p.normal)), default=None)


def camera_of(scene: Scene, survey: Survey) -> Camera:
    """The scene's camera; what it leaves out is chosen so that all motion is in the picture."""
    given = scene.camera
    up = up_of(scene)
    width, height = scene.render.size
    lo, hi = room_of(scene, survey)
    auto = auto_camera(lo, hi, up, aspect=width / height, fov=given.fov)
    if given.eye is None and given.target is None:
        return auto
    target = np.array(auto.target if given.target is None else given.target)
    away = np.subtract(auto.eye, auto.target)
    eye = target + away if given.eye is None else np.array(given.eye)
    return Camera(tuple(eye), tuple(target), tuple(up), given.fov)


def room_of(scene: Scene, survey: Survey) -> tuple[Floats, Floats]:
    """The box to frame: the motion, and spheres and boxes that are no larger than three of it."""
    lo, hi = survey.lo.copy(), survey.hi.copy()
    reach = 3.0 * float(np.linalg.norm(hi - lo))
    for obstacle in scene.obstacles:
        if isinstance(obstacle, Plane):
            continue
        half = np.full(3, obstacle.radius) if isinstance(obstacle, Sphere) else _half(obstacle)
        low, high = np.array(obstacle.center) - half, np.array(obstacle.center) + half
        if np.linalg.norm(high - low) <= reach:
            lo, hi = np.minimum(lo, low), np.maximum(hi, high)
    return lo, hi


def _half(box: Box) -> Floats:
    return 0.5 * np.array(box.size)


def body_items(
    body: Body, start: int, positions: Floats, number: int, *, wireframe: bool, net: bool = False
) -> list[Item]:
    """What shows a body whose nodes begin at row `start` of `positions`.

    Springs are drawn as such, but for cloth, which shows its triangles unless `net` is set.
    """
    color = body_color(number)
    mesh = body.mesh
    if not isinstance(body.model, MassSpring):
        return [Surface(positions, mesh.surface + start, color, wireframe=wireframe)]
    if not net and not isinstance(mesh, TetMesh) and _is_sheet(mesh.surface):
        return [Surface(positions, mesh.surface + start, color, wireframe=wireframe)]
    springs = body.springs().astype(np.int32)
    ends = mesh.points[springs]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    radius = SPRING_RADIUS * float(np.median(lengths)) if len(lengths) else 0.0
    nodes = np.unique(springs).astype(np.int32) + start
    return [
        Capsules(positions, springs + start, radius, color),
        Spheres(positions, 1.6 * radius, color, nodes),
    ]


def _is_sheet(surface: NDArray[np.int32]) -> bool:
    """Whether triangles have a rim: a cloth, not the skin of a solid."""
    if not len(surface):
        return False
    sides = surface[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    return len(sides) != 2 * len(unique_edges(sides))


def _longest_side(body: Body) -> float:
    corners = body.mesh.points[body.mesh.surface]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    return float(sides.max(initial=0.0))


def obstacle_items(scene: Scene, ground: Plane | None, survey: Survey) -> list[Item]:
    """Spheres, boxes, and patches of the planes that are not the ground.

    Nodes lie on a sphere, so the triangles between them cut into it, by edge²/8R and more where
    they stretch: spheres are drawn that much smaller, lest they poke through a cloth.
    """
    items: list[Item] = []
    edge = max((_longest_side(body) for body in scene.bodies), default=0.0)
    lo, hi = room_of(scene, survey)
    for obstacle in scene.obstacles:
        if isinstance(obstacle, Sphere):
            sunk = min(edge**2 / (4.0 * obstacle.radius), 0.05 * obstacle.radius)
            items.append(sphere_surface(obstacle.center, obstacle.radius - sunk))
        elif isinstance(obstacle, Box):
            items.append(box_surface(obstacle.center, obstacle.size))
        elif obstacle is not ground:
            middle, normal = 0.5 * (lo + hi), np.array(obstacle.normal)
            below = normal * (normal @ (middle - np.array(obstacle.point)))
            side = 1.5 * float(np.linalg.norm(hi - lo))
            items.append(plane_surface(middle - below, normal, side))
    return items
