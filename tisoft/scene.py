"""Scenes: bodies, what holds and pushes them, what they fall on, and how all of it is watched.

A Scene is plain data, checked where it enters; `Simulation` makes it run and reads it again between
frames: what it follows, and what it refuses to have changed, is told in `followed`.  SI units.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

from numpy.typing import ArrayLike

from tisoft import checks, live
from tisoft.body import Body
from tisoft.checks import FieldError, inside
from tisoft.geometry.mesh import Mesh
from tisoft.gravity import Gravity, check_gravity
from tisoft.live import Items, Live
from tisoft.loads import Load, Torque
from tisoft.models.materials import Model
from tisoft.obstacles import OBSTACLES, Box, Capsule, Cylinder, Obstacle, Plane, Shell, Sphere
from tisoft.pins import Pin, Turn
from tisoft.probed import Probed, probed
from tisoft.scene_parts import Camera, NoContact, Probe, Render

__all__ = [
    "Body",
    "Box",
    "Camera",
    "Capsule",
    "Cylinder",
    "Load",
    "NoContact",
    "Obstacle",
    "Pin",
    "Plane",
    "Probe",
    "Render",
    "Scene",
    "Shell",
    "Sphere",
    "Torque",
    "Turn",
]

INTEGRATORS = ("symplectic-euler", "velocity-verlet", "explicit-euler")
MOST_FRAMES = 1e9


class Bodies(Items[Body]):
    """Of a scene."""

    kinds, words, field = (Body,), "a Body", "body"


class Obstacles(Items[Obstacle]):
    """Of a scene."""

    kinds, field = tuple(OBSTACLES.values()), "obstacle"
    words = f"a {', '.join([k.__name__ for k in kinds[:-1]])} or {kinds[-1].__name__}"


class Probes(Items[Probe]):
    """Of a scene."""

    kinds, words, field = (Probe,), "a Probe", "probe"


class Pairs(Items[NoContact]):
    """Of a scene."""

    kinds, words, field = (NoContact,), "a NoContact", "no_contact"


@dataclass(eq=False, kw_only=True)
class Scene(Live):
    """All there is to simulate.

    Args:
        gravity: [m/s²], or rows (t, gx, gy, gz) with t in s, linear between rows.
        duration: simulated time [s].
        frame_rate: frames per simulated second [1/s].
        step: "auto" or the substep [s].
        integrator: "symplectic-euler", "velocity-verlet" or "explicit-euler".
        start: "plain", or "half-step" (with a step in seconds).
        precision: "f32" or "f64".
        checkpoint_every: frames; 0 for none.
        camera, render: how pictures are taken.
        bodies, obstacles, probes: filled by `add_body`, `add_obstacle` and `add_probe`.
        no_contact: pairs of bodies that pass through each other; append a `NoContact`.

    Raises:
        FieldError: naming the field, its value, the range and what to do.
    """

    gravity: Gravity = (0.0, -9.81, 0.0)
    duration: float = 2.0
    frame_rate: float = 60.0
    step: float | Literal["auto"] = "auto"
    integrator: str = "symplectic-euler"
    start: str = "plain"
    precision: str = "f32"
    checkpoint_every: int = 0
    camera: Camera = field(default_factory=Camera)
    render: Render = field(default_factory=Render)
    bodies: list[Body] = field(default_factory=Bodies)
    obstacles: list[Obstacle] = field(default_factory=Obstacles)
    probes: list[Probe] = field(default_factory=Probes)
    no_contact: list[NoContact] = field(default_factory=Pairs)

    _checks: ClassVar = {
        "gravity": check_gravity,
        "duration": live.number(least=0.0, unit="s"),
        "frame_rate": live.number(above=0.0, unit="frames per second"),
        "step": live.either("auto", live.number(above=0.0, unit="s")),
        "integrator": live.choice(*INTEGRATORS),
        "start": live.choice("plain", "half-step"),
        "precision": live.choice("f32", "f64"),
        "checkpoint_every": checks.integer,
        "camera": live.a(Camera, "a Camera"),
        "render": live.a(Render, "a Render"),
        "bodies": Bodies.of,
        "obstacles": Obstacles.of,
        "probes": Probes.of,
        "no_contact": Pairs.of,
    }

    def __post_init__(self) -> None:
        self.check_together()

    def add_body(
        self,
        mesh: Mesh,
        model: Model,
        name: str | None = None,
        *,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        spin: ArrayLike = (0.0, 0.0, 0.0),
    ) -> Body:
        """Add a body that starts with `velocity` [m/s] and `spin` [rad/s], and return it; without a
        name it is called body0, body1, …  Raises SceneError for a name that another body has, and
        as `Body` does.
        """
        taken = {body.name for body in self.bodies}
        unused = (f"body{i}" for i in range(len(taken), 2 * len(taken) + 1))
        start: dict[str, Any] = {"velocity": velocity, "spin": spin}  # Body makes tuples of them
        new_name = name if name is not None else next(n for n in unused if n not in taken)
        body = Body(new_name, mesh, model, **start)
        if body.name in taken:
            raise FieldError("name", "is another body's name too; choose another", body.name)
        self.bodies.append(body)
        return body

    def add_obstacle(self, obstacle: Obstacle) -> Obstacle:
        """Add something that bodies run into, and return it; raises SceneError for what is none."""
        self.obstacles.append(obstacle)
        return obstacle

    def add_probe(
        self,
        name: str,
        body: Body | str,
        *,
        point: ArrayLike | None = None,
        node: int | None = None,
    ) -> Probe:
        """Follow the node of `body` nearest to `point` at rest [m], or its file's number `node`.

        Raises SceneError for a name that another probe has, and where body or node is not there.
        """
        place: dict[str, Any] = {"point": point, "node": node}  # Probe makes a tuple of the point
        probe = Probe(name, body.name if isinstance(body, Body) else body, **place)
        self.probed(probe)
        if name in {other.name for other in self.probes}:
            raise FieldError("name", "is another probe's name too; choose another", name)
        self.probes.append(probe)
        return probe

    def body(self, name: str) -> Body:
        """The body of this name; raises FieldError where there is none."""
        checks.name("body", name)
        for body in self.bodies:
            if body.name == name:
                return body
        known = [body.name for body in self.bodies]
        hint = checks.suggestion(name, known) if known else "the scene has no bodies yet"
        raise FieldError("body", f"names no body of the scene; {hint}", name)

    def probed(self, probe: Probe) -> Probed:
        """What a probe follows: a node, or a point of the surface that its body carries; raises
        SceneError for a body or a node that is not there.
        """
        live.a(Probe, "a Probe")("probe", probe)
        return probed(self.body(probe.body), probe)

    def validate(self) -> None:
        """Check the whole scene again, as before it runs.

        Raises:
            FieldError: the field with its path, as body[0].pin[1].where.
        """
        self.check_together()
        if not self.bodies:
            raise FieldError("body", "is missing: a scene needs at least one body")
        for i, body in enumerate(self.bodies):
            with inside(f"body[{i}]"):
                body.validate()
        for i, probe in enumerate(self.probes):
            with inside(f"probe[{i}]"):
                self.probed(probe)
        for i, pair in enumerate(self.no_contact):
            with inside(f"no_contact[{i}]"):
                for name in pair.bodies:
                    self._check_named("bodies", name)
        if self.camera.follow is not None:
            with inside("camera"):
                self._check_named("follow", self.camera.follow)
        _check_unique("body", [body.name for body in self.bodies])
        _check_unique("probe", [probe.name for probe in self.probes])

    def check_bodies(self) -> None:
        """Check that all pins and loads find what they hold and push; raises FieldError."""
        for i, body in enumerate(self.bodies):
            with inside(f"body[{i}]"):
                body.check_held_and_pushed()

    def _check_named(self, key: str, name: str) -> None:
        known = [body.name for body in self.bodies]
        if name not in known:
            problem = f"names no body of the scene; {checks.suggestion(name, known)}"
            raise FieldError(key, problem, name)

    def check_together(self) -> None:
        """Check what hangs together of the settings; raises FieldError."""
        if not self.duration * self.frame_rate <= MOST_FRAMES:
            problem = f"at {self.frame_rate:g} frames per second is above {MOST_FRAMES:g} frames"
            raise FieldError("duration", problem, self.duration)
        for key, value in (("integrator", "explicit-euler"), ("start", "half-step")):
            if getattr(self, key) == value and self.step == "auto":
                raise FieldError(key, "needs a step in seconds; give step = 1e-4 or so", value)


def _check_unique(kind: str, names: list[str]) -> None:
    for i, name in enumerate(names):
        first = names.index(name)
        if first < i:
            raise FieldError(f"{kind}[{i}].name", f"is the name of {kind}[{first}] too", name)
