"""What a caller hands to a Simulation, checked where it enters."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import checks, runtime
from tisoft.checks import FieldError
from tisoft.motion import Motion
from tisoft.running import HOOKS
from tisoft.scene import MOST_FRAMES, Scene
from tisoft.scene_file import load_scene

Floats = NDArray[np.float64]

OFF = 1e-5
"""Share of a body's size by which a held node may seem moved through rounding."""
OURS = ("scene", "arch", "precision", "certify", "measures", "parts")
"""Attributes of a simulation that are settled when it is made."""
SCENE_FIELDS = {field.name for field in dataclasses.fields(Scene)} - {"precision"}


def scene_of(scene: Any) -> Scene:
    """The scene, or that of a scene file; it is whole."""
    if isinstance(scene, (str, os.PathLike)):
        return load_scene(checks.path("scene", scene, "a scene file"))
    if not isinstance(scene, Scene):
        raise FieldError("scene", "must be a Scene, or the name of a scene file", scene)
    scene.validate()
    return scene


def check_options(arch: Any, precision: Any, threads: Any, **flags: Any) -> None:
    """Raise FieldError at the first option of a simulation that is none."""
    checks.choice("arch", arch, runtime.ARCHS)
    if precision is not None:
        checks.choice("precision", precision, ("f32", "f64"))
    if threads is not None:
        checks.integer("threads", threads, least=1)
    for name, value in flags.items():
        checks.flag(name, value)


def check_half_step(scene: Scene) -> None:
    """Raise FieldError where the scene's bodies or integrator cannot start half a step earlier."""
    if scene.start != "half-step":
        return
    if scene.integrator != "symplectic-euler":
        problem = f"shifts the velocities of symplectic-euler, not of {scene.integrator}"
        raise FieldError("start", f'{problem}; use start = "plain"', scene.start)
    for i, body in enumerate(scene.bodies):
        if getattr(body.model, "mass", "lumped") != "lumped":
            problem = f"needs lumped masses, and body[{i}] has consistent ones"
            raise FieldError("start", problem, scene.start)


def check_attribute(simulation: Any, name: str, value: Any) -> None:
    """Raise FieldError where somebody sets what is settled, or what is the scene's."""
    if name in OURS and name in vars(simulation):
        problem = "is settled when a simulation is made; make a new Simulation"
        raise FieldError(name, problem)
    if name in SCENE_FIELDS and not callable(value):  # a method may be wrapped
        raise FieldError(name, f"is the scene's: set simulation.scene.{name}", value)


def frames_in(seconds: Any, scene: Scene) -> int:
    """Frames in so many seconds; left out, in the scene's duration."""
    if seconds is None:
        return round(scene.duration * scene.frame_rate)
    most = MOST_FRAMES / scene.frame_rate
    return round(checks.number("seconds", seconds, least=0.0, most=most, unit="s")
                 * scene.frame_rate)  # fmt: skip


def observers_of(observers: Any) -> list[Any]:
    """The observers, each of which has a hook."""
    if isinstance(observers, str) or not isinstance(observers, Iterable):
        problem = "must be a list of observers: functions, or objects with on_frame(frame)"
        raise FieldError("observers", problem, observers)
    found = list(observers)
    for k, observer in enumerate(found):
        hooks = [getattr(observer, name) for name in HOOKS if hasattr(observer, name)]
        if isinstance(observer, type):
            raise FieldError(f"observers[{k}]", "is a class; give an object of it", observer)
        if (not callable(observer) and not hooks) or not all(map(callable, hooks)):
            problem = f"is no function and has none of the methods {', '.join(HOOKS)}"
            raise FieldError(f"observers[{k}]", problem, observer)
    return found


def state_of(sim: Motion, positions: Any, velocities: Any) -> tuple[Floats, Floats]:
    """Positions [m] and velocities [m/s] of all nodes in the scene's order, shape (nodes, 3).

    Raises:
        FieldError: another shape, what is not finite, or a held node that is moved.
    """
    shape = (sim.system.count, 3)
    room = checks.LARGEST if sim.precision == "f64" else float(np.finfo(np.float32).max)
    x, v = (
        checks.floats(name, value, shape, "a row (x, y, z) for each node")
        for name, value in (("positions", positions), ("velocities", velocities))
    )
    for name, values in (("positions", x), ("velocities", v)):
        if np.abs(values).max(initial=0.0) > room:
            row = int(np.abs(values).max(axis=1).argmax())
            problem = 'is beyond what f32 computes with; use precision = "f64"'
            raise FieldError(f"{name}[{row}]", problem, values[row])
    here, now = sim.system.world(), sim.whole_velocities()
    led = sim.holder.led(here, sim.time)
    for part in sim.parts:
        bits = sim.holder.held[part.nodes][:, None] & np.array([1, 2, 4])
        v[part.nodes][part.order] = np.where(bits, now[part.nodes], v[part.nodes][part.order])
        new = x[part.nodes][part.order]
        away = np.minimum(np.abs(new - here[part.nodes]), np.abs(new - led[part.nodes]))
        away *= bits != 0
        if away.max(initial=0.0) > OFF * part.size:
            row = int(away.max(axis=1).argmax())
            node = int(part.body.mesh.kept_nodes[part.order[row]])
            number = part.start + int(part.order[row])
            place = ", ".join(f"{c:.6g}" for c in here[part.start + row])
            problem = (
                f'moves node {node} of "{part.body.name}", which a pin holds at ({place}); leave '
                "held nodes where they are, or take the pin away before"
            )
            raise FieldError(f"positions[{number}]", problem, x[number])
    for patch in sim.holder.patches.held:
        part = patch.part
        u = x[part.nodes][part.order] - part.body.mesh.points[part.order]
        away = np.abs(patch.means(u) - patch.targets(sim.time))[:, patch.pin.components]
        if away.max(initial=0.0) > OFF * part.size:
            problem = (
                f'moves what pin[{part.body.pins.index(patch.pin)}] of "{part.body.name}" holds; '
                "leave its surface there, or take the pin away before"
            )
            raise FieldError("positions", problem)
    return x, v
