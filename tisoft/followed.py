"""What of a scene may change while a simulation of it runs, and what is refused by its name.

Followed from the next frame on: gravity, duration, frame_rate, step, checkpoint_every, obstacles; a
body's model and regions (their numbers), pins and loads.  Camera and render are read when a picture
is made.  All else needs arrays, times or kernels that a simulation has already chosen.
"""

from __future__ import annotations

from typing import Any

from tisoft.body import Body
from tisoft.checks import FieldError, shown
from tisoft.scene import Scene

OF_SCENE = ("integrator", "start", "precision")
OF_BODY = ("name", "velocity", "spin", "contact", "self_contact", "thickness", "friction")
PARTS = {"body": "bodies", "probe": "probes", "no_contact": "no_contact"}
"""Lists of which nothing is added or taken away, by what a member is called."""
MESHES = ("mesh", "skin")
REMEDY = "make a new Simulation, and set_state"


class Kept:
    """What a scene held when a simulation of it began, and must go on to hold."""

    def __init__(self, scene: Scene) -> None:
        self._settings = [getattr(scene, key) for key in OF_SCENE]
        self._parts = [tuple(getattr(scene, key)) for key in PARTS.values()]
        self._bodies = [[getattr(body, key) for key in OF_BODY] for body in scene.bodies]
        self._meshes = [[getattr(body, key) for key in MESHES] for body in scene.bodies]
        self._known: tuple[Any, ...] = ()

    def check(self, scene: Scene) -> None:
        """Raise FieldError at the first thing that was changed and is not followed."""
        for key, before in zip(OF_SCENE, self._settings, strict=True):
            _refuse(key, before, getattr(scene, key), is_same=before == getattr(scene, key))
        for word, before in zip(PARTS, self._parts, strict=True):
            _check_parts(word, before, getattr(scene, PARTS[word]))
        for k, body in enumerate(scene.bodies):
            self._check_body(k, body)

    def _check_body(self, k: int, body: Body) -> None:
        for key, before in zip(OF_BODY, self._bodies[k], strict=True):
            now = getattr(body, key)
            _refuse(f"body[{k}].{key}", before, now, is_same=before == now)
        for key, before in zip(MESHES, self._meshes[k], strict=True):
            if before is not getattr(body, key):
                problem = f"cannot become another while a simulation of it runs; {REMEDY}"
                raise FieldError(f"body[{k}].{key}", problem)

    def settled(self, scene: Scene) -> bool:
        """Check pins and loads where they are others than at the last call; returns whether."""
        now = tuple(item for body in scene.bodies for item in (*body.pins, None, *body.loads, None))
        known = self._known
        if len(now) == len(known) and all(a is b for a, b in zip(now, known, strict=True)):
            return False
        scene.check_bodies()
        self._known = now
        return True


def _refuse(field: str, before: Any, now: Any, *, is_same: bool) -> None:
    if not is_same:
        problem = f"was {_told(before)} and cannot change while a simulation of it runs; {REMEDY}"
        raise FieldError(field, problem, now)


def _told(value: Any) -> str:
    return "left out" if value is None else shown(value)


def _check_parts(word: str, before: tuple[Any, ...], now: list[Any]) -> None:
    for k in range(max(len(before), len(now))):
        if k >= len(before):
            raise FieldError(f"{word}[{k}]", f"was added while a simulation of it runs; {REMEDY}")
        if k >= len(now) or before[k] is not now[k]:
            problem = f"was taken away or replaced while a simulation of it runs; {REMEDY}"
            raise FieldError(f"{word}[{k}]", problem)
