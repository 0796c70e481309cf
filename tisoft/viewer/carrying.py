"""Pins and obstacles in a hand: they go where it leads them, as along a path, frame by frame.

A hand may jump; what it carries moves at CARRY times the speed of sound of the softest body at the
most, for a pin that moves at v strains the elements beside it by v/c.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.errors import SceneError
from tisoft.models.materials import MassSpring
from tisoft.moving import pose
from tisoft.scene import Body, Plane, Scene

Floats = NDArray[np.float64]

CARRY = 0.15
"""Of the speed of sound."""
AT_EASE = 0.25
"""Seconds in which what is carried crosses the body at the soonest."""


def speed_of(body: Body) -> float:
    """At which pins of a body, and obstacles near it, may be carried [m/s]."""
    model, points = body.model, body.mesh.points
    size = float(np.ptp(points, axis=0).max())
    if isinstance(model, MassSpring):
        return size / AT_EASE  # springs never stiffen
    return min(CARRY * float(np.sqrt(model.young / model.density)), size / AT_EASE)


class Carried:
    """A thing in a hand, `target` the point [m] that the hand leads to, from `start` on."""

    name = ""
    force = np.zeros(3)
    """What a hand feels; carried things are not pulled, but put."""

    def __init__(self, start: Any, way: Floats, speed: float) -> None:
        self._start = np.array(start, np.float64)
        self.target: Any = self._start.copy()
        self._from, self.way = way, way.copy()
        """Displacement from where the scene has it [m]."""
        self._speed = speed

    def release(self) -> None:
        """Let go: it stays where it is."""

    def advance(self, time: float, seconds: float) -> None:
        """Move on within a frame from `time` [s] that lasts so many seconds."""
        want = self._from + self.free(np.asarray(self.target, np.float64) - self._start)
        step = want - self.way
        far, most = float(np.linalg.norm(step)), self._speed * seconds
        if far > most:
            step *= most / far
        there = self.way + step
        self.put(((time, *self.way), (time + seconds, *there)), bool(step.any()))
        self.way = there

    def free(self, step: Floats) -> Floats:
        """The part of a step that the thing may take."""
        return step

    def put(self, path: Any, moves: bool) -> None:
        """Move along a path through the coming frame."""
        raise NotImplementedError


class CarriedPin(Carried):
    """A pin of a body."""

    def __init__(self, body: Body, number: int, start: Any, time: float) -> None:
        self.body, self.number = body, number
        pin = body.pins[number]
        if pin.turn is not None:
            raise SceneError(f'the pin of "{body.name}" turns; what turns cannot be carried')
        if pin.release is not None and pin.release <= time:
            raise SceneError(f'the pin of "{body.name}" has let go')
        self.name = f'the pin of "{body.name}"'
        self._bits = np.array([float(axis in pin.axes) for axis in "xyz"])
        way = np.array(pin.displacement(np.zeros((1, 3)), time)[0], np.float64)
        super().__init__(start, way, speed_of(body))
        self._still = False

    def free(self, step: Floats) -> Floats:
        return step * self._bits

    def put(self, path: Any, moves: bool) -> None:
        if moves or not self._still:
            pin = self.body.pins[self.number]
            self.body.pins[self.number] = dataclasses.replace(pin, velocity=None, path=path)
        self._still = not moves


class CarriedObstacle(Carried):
    """An obstacle; a plane goes along its normal."""

    def __init__(self, scene: Scene, number: int, start: Any, time: float) -> None:
        self.scene, self.number = scene, number
        obstacle = scene.obstacles[number]
        word = type(obstacle).__name__.lower()
        if obstacle.turn is not None:
            raise SceneError(f"the {word} turns; what turns cannot be carried")
        self.name = f"the {word}"
        self._along = np.array(obstacle.normal) if isinstance(obstacle, Plane) else None
        way = pose(obstacle, time)[1][0]
        super().__init__(start, way, min(map(speed_of, scene.bodies)))
        self._still = False

    def free(self, step: Floats) -> Floats:
        return step if self._along is None else (step @ self._along) * self._along

    def put(self, path: Any, moves: bool) -> None:
        if moves or not self._still:
            obstacle = self.scene.obstacles[self.number]
            self.scene.obstacles[self.number] = dataclasses.replace(
                obstacle, velocity=None, path=path
            )
        self._still = not moves


def pin_near(body: Body, rows: NDArray[np.int64], time: float) -> int | None:
    """Number of the pin that holds one of these rows of `mesh.points`; None where none does."""
    for number, pin in enumerate(body.pins):
        acts = pin.release is None or pin.release > time
        if acts and np.isin(rows, body.nodes(pin.where)).any():
            return number
    return None
