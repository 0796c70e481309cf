"""Numbers of a running scene that a viewer changes, and the way back."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.errors import SceneError
from tisoft.gravity import mainly
from tisoft.scene import Scene
from tisoft.viewer.orders import MATERIAL

KEPT = 100
"""Changes that can be undone."""
SAME_DRAG = 1.0
"""Seconds within which changes of one number are one change: a slider on its way."""


@dataclasses.dataclass
class Change:
    """One change, and how it is undone."""

    key: tuple[Any, ...]
    what: str
    """As "young of "beam" to 2e5"."""
    back: Callable[[], None]
    when: float


class Changes:
    """Changes gravity and the bodies' models.

    Raises (each of its methods that change): SceneError for an impossible value.
    """

    def __init__(self, scene: Scene, clock: Callable[[], float]) -> None:
        self.scene, self.clock = scene, clock
        self.made: list[Change] = []
        g = mainly(scene.gravity)
        size = float(np.linalg.norm(g))
        self.down: NDArray[np.float64] = g / size if size > 0.0 else np.array([0.0, -1.0, 0.0])
        """Unit vector along which gravity is changed."""

    @property
    def last(self) -> str:
        """The last change, in words; empty where there is none."""
        return self.made[-1].what if self.made else ""

    def gravity(self, value: float) -> None:
        """The component along the scene's gravity, or along −y where it has none [m/s²]."""
        before, scene = self.scene.gravity, self.scene
        scene.gravity = tuple(float(value) * c for c in self.down)
        self._note(
            ("gravity",), f"gravity to {value:.4g} m/s²", lambda: setattr(scene, "gravity", before)
        )

    def material(self, body: int, name: str, value: float) -> None:
        """A number of a body's model."""
        if body >= len(self.scene.bodies):
            raise SceneError(f"there is no body {body}")
        own = self.scene.bodies[body]
        if not isinstance(getattr(own.model, name, None), int | float):
            raise SceneError(f'the model of "{own.name}" has no {name}')
        before = own.model
        own.model = dataclasses.replace(before, **{name: value})  # type: ignore[arg-type]
        what = f'{name} of "{own.name}" to {value:.4g}'
        self._note((body, name), what, lambda: setattr(own, "model", before))

    def _note(self, key: tuple[Any, ...], what: str, back: Callable[[], None]) -> None:
        now = self.clock()
        if self.made and self.made[-1].key == key and now - self.made[-1].when < SAME_DRAG:
            self.made[-1].what, self.made[-1].when = what, now
            return
        self.made = [*self.made[1 - KEPT :], Change(key, what, back, now)]

    def undo(self) -> str:
        """Take the last change back; returns what it was.  Raises SceneError where none is left."""
        if not self.made:
            raise SceneError("there is no change to undo")
        change = self.made.pop()
        change.back()
        return change.what

    def numbers(self) -> dict[str, Any]:
        """What the sliders show, for JSON."""
        models = []
        for body in self.scene.bodies:
            found = {name: getattr(body.model, name, None) for name in MATERIAL}
            models.append({n: float(v) for n, v in found.items() if isinstance(v, int | float)})
        return {"gravity": float(mainly(self.scene.gravity) @ self.down), "models": models}
