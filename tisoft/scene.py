"""Scenes: bodies, what holds and pushes them, what they fall on, and how all of it is watched.

A Scene is plain data; `Simulation` makes it run and reads it again between frames, so `gravity`, a
body's `model`, pins and loads may be replaced while it runs.  SI units throughout.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

from numpy.typing import ArrayLike

from tisoft import checks
from tisoft.body import Body
from tisoft.checks import FieldError, Vector, inside, keep_number
from tisoft.geometry.mesh import Mesh
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


@dataclass(eq=False, kw_only=True)
class Scene:
    """All there is to simulate.

    Args:
        gravity: [m/s²].
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

    gravity: Vector = (0.0, -9.81, 0.0)
    duration: float = 2.0
    frame_rate: float = 60.0
    step: float | Literal["auto"] = "auto"
    integrator: str = "symplectic-euler"
    start: str = "plain"
    precision: str = "f32"
    checkpoint_every: int = 0
    camera: Camera = field(default_factory=Camera)
    render: Render = field(default_factory=Render)
    bodies: list[Body] = field(default_factory=list)
    obstacles: list[Obstacle] = field(default_factory=list)
    probes: list[Probe] = field(default_factory=list)
    no_contact: list[NoContact] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._check_settings()

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
        """Add something that bodies run into, and return it."""
        _check_obstacle(obstacle)
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
        return probed(self.body(probe.body), probe)

    def validate(self) -> None:
        """Check the whole scene again, as before it runs.

        Raises:
            FieldError: the field with its path, as body[0].pin[1].where.
        """
        self._check_settings()
        if not self.bodies:
            raise FieldError("body", "is missing: a scene needs at least one body")
        for i, body in enumerate(self.bodies):
            with inside(f"body[{i}]"):
                body.validate()
        for i, obstacle in enumerate(self.obstacles):
            with inside(f"obstacle[{i}]"):
                _check_obstacle(obstacle)
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

    def _check_named(self, key: str, name: str) -> None:
        known = [body.name for body in self.bodies]
        if name not in known:
            problem = f"names no body of the scene; {checks.suggestion(name, known)}"
            raise FieldError(key, problem, name)

    def _check_settings(self) -> None:
        self.gravity = checks.vector("gravity", self.gravity, unit="m/s²")
        keep_number(self, "duration", least=0.0, unit="s")
        keep_number(self, "frame_rate", above=0.0, unit="frames per second")
        if not self.duration * self.frame_rate <= MOST_FRAMES:
            problem = f"at {self.frame_rate:g} frames per second is above {MOST_FRAMES:g} frames"
            raise FieldError("duration", problem, self.duration)
        if isinstance(self.step, str):
            checks.choice("step", self.step, ("auto",))
        else:
            keep_number(self, "step", above=0.0, unit="s")
        checks.choice("integrator", self.integrator, INTEGRATORS)
        checks.choice("start", self.start, ("plain", "half-step"))
        checks.choice("precision", self.precision, ("f32", "f64"))
        checks.integer("checkpoint_every", self.checkpoint_every)
        for key, value in (("integrator", "explicit-euler"), ("start", "half-step")):
            if getattr(self, key) == value and self.step == "auto":
                raise FieldError(key, "needs a step in seconds; give step = 1e-4 or so", value)
        if not isinstance(self.camera, Camera):
            raise FieldError("camera", "must be a Camera", self.camera)
        if not isinstance(self.render, Render):
            raise FieldError("render", "must be a Render", self.render)


def _check_obstacle(obstacle: Any) -> None:
    if not isinstance(obstacle, tuple(OBSTACLES.values())):
        known = [kind.__name__ for kind in OBSTACLES.values()]
        problem = f"must be a {', '.join(known[:-1])} or {known[-1]}"
        raise FieldError("obstacle", problem, obstacle)


def _check_unique(kind: str, names: list[str]) -> None:
    for i, name in enumerate(names):
        first = names.index(name)
        if first < i:
            raise FieldError(f"{kind}[{i}].name", f"is the name of {kind}[{first}] too", name)
