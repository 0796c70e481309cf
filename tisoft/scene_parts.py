"""The small things of a scene: probes, camera and picture settings.

All are frozen and checked once; to change one between frames, put a new one in its place.
"""

from __future__ import annotations

from dataclasses import dataclass

from tisoft import checks
from tisoft.checks import FieldError, Vector, keep_number, put
from tisoft.live import frozen


@frozen
@dataclass(frozen=True)
class Probe:
    """A node to follow: of the body named `body`, the one nearest to `point` at rest [m], or number
    `node` of the mesh file.  Exactly one of point and node; `name` is that of its column in tables.
    Raises SceneError where both or neither is given, or a value is of the wrong kind.
    """

    name: str
    body: str
    point: Vector | None = None
    node: int | None = None

    def __post_init__(self) -> None:
        checks.name("name", self.name)
        checks.name("body", self.body)
        checks.exactly_one("", {"point": self.point, "node": self.node})
        if self.point is not None:
            put(self, "point", checks.vector("point", self.point))
        else:
            checks.integer("node", self.node)


@frozen
@dataclass(frozen=True)
class NoContact:
    """The names of two `bodies` that pass through each other.  Raises SceneError where they are not
    two names, each another.
    """

    bodies: tuple[str, str]

    def __post_init__(self) -> None:
        names = checks.sequence("bodies", self.bodies, "names of two bodies")
        if len(names) != 2:
            raise FieldError("bodies", "must be the names of two bodies", self.bodies)
        for i, name in enumerate(names):
            checks.name(f"bodies[{i}]", name)
        if names[0] == names[1]:
            problem = "names one body twice; what passes through itself has self_contact = false"
            raise FieldError("bodies", problem, self.bodies)
        put(self, "bodies", (names[0], names[1]))


@frozen
@dataclass(frozen=True)
class Camera:
    """Where the scene is seen from; what is left out is chosen to frame the scene.

    Args:
        eye: position [m].
        target: the point in the middle of the picture [m].
        up: the direction that is up in the picture; left out, against gravity.
        fov: vertical angle of view [degrees].
        turn: how fast it goes round the target, about up [degrees/s].
        follow: name of the body whose motion, as a whole, it shares.

    Raises:
        SceneError: naming the field and its value.
    """

    eye: Vector | None = None
    target: Vector | None = None
    up: Vector | None = None
    fov: float = 40.0
    turn: float = 0.0
    follow: str | None = None

    def __post_init__(self) -> None:
        keep_number(self, "turn", unit="degrees/s")
        if self.follow is not None:
            checks.name("follow", self.follow)
        for field in ("eye", "target"):
            if getattr(self, field) is not None:
                put(self, field, checks.vector(field, getattr(self, field)))
        if self.up is not None:
            put(self, "up", checks.direction("up", self.up))
        if self.eye is not None and self.eye == self.target:
            raise FieldError("target", "is where the eye is; move one of them", self.target)
        keep_number(self, "fov", least=1.0, most=150.0, unit="degrees")


@frozen
@dataclass(frozen=True)
class Render:
    """How pictures are drawn.

    Args:
        size: width and height [pixels].
        color: the surface's: "stress", "strain", "speed", or a plain one per "body", or
            per "region" of the mesh's file.
        wireframe: draw the edges of the surface too.
        samples: per pixel and direction, for smooth edges.
        ground: draw obstacle planes as a checked floor.
        alpha: a transparent background, where the file can hold one (.png, .webp, .gif).
        scale: tell how wide the floor's tiles are.
        labels: write each body's name below it, a line for each part that a comma ends.

    Raises:
        SceneError: naming the field and its value.
    """

    size: tuple[int, int] = (1280, 720)
    color: str = "body"
    wireframe: bool = False
    samples: int = 2
    ground: bool = True
    alpha: bool = False
    scale: bool = False
    labels: bool = False

    def __post_init__(self) -> None:
        items = checks.sequence("size", self.size, "pixels (width, height)")
        if len(items) != 2:
            raise FieldError("size", "must be two numbers (width, height)", self.size)
        size = [checks.integer(f"size[{i}]", n, least=16, most=8192) for i, n in enumerate(items)]
        put(self, "size", (size[0], size[1]))
        checks.choice("color", self.color, ("stress", "strain", "speed", "body", "region"))
        checks.flag("wireframe", self.wireframe)
        checks.integer("samples", self.samples, least=1, most=8)
        for field in ("ground", "alpha", "scale", "labels"):
            checks.flag(field, getattr(self, field))
