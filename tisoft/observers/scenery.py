"""A scene as a picture shows it: items of its bodies and obstacles, ground, camera, colours."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from tisoft.body import Body
from tisoft.geometry.mesh import TetMesh
from tisoft.geometry.skin import Skin
from tisoft.geometry.topology import unique_edges
from tisoft.models.materials import MassSpring
from tisoft.moving import moves, pose
from tisoft.observers.framing import Survey, View, ground_of, room_of, up_of
from tisoft.observers.quantities import QUANTITIES
from tisoft.observers.region_colors import first_colors, node_colors, region_of_triangles
from tisoft.observers.solids import solid_surface
from tisoft.observers.track import Snapshot
from tisoft.render.camera import Camera, pixels_of
from tisoft.render.colormap import body_color, colors_of
from tisoft.render.items import Capsules, Item, Spheres, Surface
from tisoft.render.obstacles import plane_surface
from tisoft.render.overlay import ColorBar, draw_caption, draw_color_bar, draw_labels
from tisoft.render.renderer import Renderer
from tisoft.render.stage import GroundPlane, tile_length
from tisoft.scene import Plane, Scene, Sphere

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]

SPRING_RADIUS = 0.05
"""Of a spring as drawn, as a share of the median spring's length."""
COLORMAP = "YlOrRd"
"""Light where nothing happens, so that a body at rest looks like a body in daylight."""
TRANSLUCENT = 0.8
"""Of soft bodies, which let light through where they are thin."""
LEAST_HEIGHT = 200
"""Pixels of a picture that has room for a colour bar."""


@dataclass
class Actor:
    """Items that show one body."""

    name: str
    nodes: slice
    """Its rows of the scene's nodes."""
    items: list[Item] = field(default_factory=list)
    skin: Skin | None = None

    def place(self, positions: Floats) -> None:
        """Bring the items to where all nodes are [m]."""
        if self.skin is not None:
            positions = self.skin.carried(positions[self.nodes])
        for item in self.items:
            item.positions = positions

    def paint(self, colors: NDArray[np.float32]) -> None:
        """Give the items the colours of all nodes."""
        if self.skin is not None:
            colors = self.skin.carried(colors[self.nodes].astype(np.float64)).astype(np.float32)
        for item in self.items:
            item.color = colors if not isinstance(item, Spheres) else colors[item.nodes]


def actors_of(scene: Scene) -> list[Actor]:
    """What shows the bodies of a scene, at rest."""
    made: list[Actor] = []
    start = 0
    rest = np.concatenate([body.mesh.points for body in scene.bodies])
    by_region = scene.render.color == "region"
    firsts = first_colors(scene) if by_region else range(len(scene.bodies))
    for number, body in zip(firsts, scene.bodies, strict=True):
        nodes = slice(start, start + len(body.mesh.points))
        wires = scene.render.wireframe
        actor = Actor(body.name, nodes, skin=body.skin)
        if body.skin is not None:
            color, places = body_color(number), body.skin.carried(body.mesh.points)
            actor.items = [_soft(places, body.skin.triangles, color, wires)]
        else:
            actor.items = body_items(body, start, rest, number, wireframe=wires)
        if by_region and body.mesh.regions:
            _show_regions(actor, body, number)
        made.append(actor)
        start = nodes.stop
    return made


def _show_regions(actor: Actor, body: Body, number: int) -> None:
    """A colour for each region: of triangles where these are cells' own, else of nodes."""
    if body.skin is not None or isinstance(body.model, MassSpring):
        colors = np.zeros((actor.nodes.stop, 3), np.float32)
        colors[actor.nodes] = node_colors(body, number)
        actor.paint(colors)
        return
    (whole,) = actor.items
    assert isinstance(whole, Surface)
    region = region_of_triangles(body.mesh)
    actor.items = [
        replace(whole, triangles=whole.triangles[region == k], color=body_color(number + int(k)))
        for k in np.unique(region)
    ]


def followed_by(scene: Scene, actors: list[Actor]) -> slice | None:
    """The nodes that the camera follows."""
    return next((actor.nodes for actor in actors if actor.name == scene.camera.follow), None)


class Scenery:
    """Draws snapshots of actors; `survey` fixes the view and the colours' range for all of them."""

    def __init__(self, scene: Scene, actors: list[Actor], survey: Survey) -> None:
        self.actors = actors
        self.survey = survey
        self.look = scene.render
        self.view = View(scene, survey)
        up = up_of(scene)
        plane = ground_of(scene, up) if scene.render.ground else None
        self.renderer = Renderer(
            scene.render.size,
            samples=scene.render.samples,
            ground=GroundPlane(plane.point, plane.normal) if plane else None,
            up=tuple(up),
            alpha=scene.render.alpha,
        )
        self.items = [item for actor in actors for item in actor.items]
        shown = [obstacle for obstacle in scene.obstacles if obstacle is not plane]
        count = len(shown)
        self.items += obstacle_items(scene, plane, survey)
        own = self.items[len(self.items) - count :]
        self.moving = [
            (item, obstacle, np.asarray(item.positions, np.float64))
            for item, obstacle in zip(own, shown, strict=True)
            if moves(obstacle)
        ]

    def draw(self, snapshot: Snapshot) -> Picture:
        """The picture of a snapshot, shape (height, width, 3 or 4)."""
        for actor in self.actors:
            actor.place(snapshot.positions)
        for item, obstacle, points in self.moving:
            turned, way = pose(obstacle, snapshot.time)
            item.positions = points @ turned[0].T + way[0]
        camera = self.view.at(snapshot)
        quantity, top = QUANTITIES.get(self.look.color), self.survey.top
        if quantity is not None and snapshot.values is not None:
            colors = colors_of(snapshot.values, 0.0, top, name=COLORMAP)
            for actor in self.actors:
                actor.paint(colors)
        picture = self.renderer.draw(self.items, camera)
        if self.look.scale and len(picture) >= LEAST_HEIGHT:
            picture = draw_caption(picture, f"a tile is {tile_length(camera):g} m wide")
        if self.look.labels and len(picture) >= LEAST_HEIGHT:
            names = [actor.name for actor in self.actors]
            spots = [_spot(snapshot.positions[actor.nodes], camera) for actor in self.actors]
            picture = draw_labels(picture, names, pixels_of(np.array(spots), camera, picture.shape))
        if quantity is None:
            return picture
        return with_bar(picture, ColorBar(quantity.label, quantity.unit, 0.0, top, COLORMAP))


def _spot(positions: Floats, camera: Camera) -> Floats:
    """The lowest point of a body in the picture [m]."""
    up = camera.axes()[1]
    return np.asarray(positions[int(np.argmin(positions @ up))], np.float64)


def with_bar(picture: Picture, bar: ColorBar) -> Picture:
    """The picture with a colour bar, where it has room for one and there is something to tell."""
    return (
        draw_color_bar(picture, bar) if len(picture) >= LEAST_HEIGHT and bar.hi > 0.0 else picture
    )


def _soft(
    positions: Floats, triangles: NDArray[np.int32], color: tuple[float, ...], wireframe: bool
) -> Surface:
    return Surface(positions, triangles, color, wireframe=wireframe, translucent=TRANSLUCENT)


def body_items(
    body: Body, start: int, positions: Floats, number: int, *, wireframe: bool, net: bool = False
) -> list[Item]:
    """What shows a body whose nodes begin at row `start` of `positions`.

    Springs are drawn as such, but for cloth, which shows its triangles unless `net` is set.
    """
    color = body_color(number)
    mesh = body.mesh
    if not isinstance(body.model, MassSpring):
        return [_soft(positions, mesh.surface + start, color, wireframe)]
    if not net and not isinstance(mesh, TetMesh) and _is_sheet(mesh.surface):
        return [Surface(positions, mesh.surface + start, color, wireframe=wireframe)]
    return spring_items(positions, body.springs().astype(np.int32) + start, color)


def spring_items(
    positions: Floats, springs: NDArray[np.int32], color: tuple[float, ...]
) -> list[Item]:
    """Springs between rows of `positions`, and the mass points at their ends."""
    ends = positions[springs]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    radius = SPRING_RADIUS * float(np.median(lengths)) if len(lengths) else 0.0
    nodes = np.unique(springs).astype(np.int32)
    return [
        Capsules(positions, springs, radius, color),
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
    """The obstacles but the ground; of planes a patch.

    Nodes lie on a sphere, so the triangles between them cut into it, by edge²/8R and more where
    they stretch: spheres are drawn that much smaller, lest they poke through a cloth.
    """
    items: list[Item] = []
    edge = max((_longest_side(body) for body in scene.bodies), default=0.0)
    lo, hi = room_of(scene, survey)
    for obstacle in scene.obstacles:
        if isinstance(obstacle, Sphere):
            sunk = min(edge**2 / (4.0 * obstacle.radius), 0.05 * obstacle.radius)
            items.append(solid_surface(obstacle, sunk=sunk))
        elif not isinstance(obstacle, Plane):
            items.append(solid_surface(obstacle))
        elif obstacle is not ground:
            middle, normal = 0.5 * (lo + hi), np.array(obstacle.normal)
            below = normal * (normal @ (middle - np.array(obstacle.point)))
            side = 1.5 * float(np.linalg.norm(hi - lo))
            items.append(plane_surface(middle - below, normal, side))
    return items
