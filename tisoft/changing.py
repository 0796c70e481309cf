"""What the caller changes between frames, taken over before the next: all that was changed, or
nothing.
"""

from __future__ import annotations

from copy import copy
from typing import Any

import numpy as np

from tisoft.checks import inside
from tisoft.equilibrium.damping import damped_body
from tisoft.errors import SceneError
from tisoft.gravity import gravity_at
from tisoft.model.number_range import check_parts, check_scene
from tisoft.present import AGAIN, Present
from tisoft.touch.meetings import stands
from tisoft.touch.touching import touching_of


class Changing(Present):
    """A scene that may be changed while it runs; the arguments are those of `Present`."""

    def take_changes(self) -> bool:
        """Take over what the caller changed since the last frame; returns whether materials,
        gravity or obstacles did.

        Raises:
            FieldError: what cannot change while it runs, or is impossible; nothing is taken then.
        """
        self._check_changes()
        if self.scene.frame_rate != self._rate:
            self._rate, self.origin = self.scene.frame_rate, (self.frame, self.time)
        made_of = [body.made_of for body in self.scene.bodies]
        changed, shaken = made_of != self._made_of, self.scene.gravity != self._given_gravity
        others = changed or shaken
        if others:
            with self._as_external_work():
                if changed:
                    self._reread()
                    self._made_of = made_of
                    self.remade = True
                self._given_gravity = self.scene.gravity
                self.gravity_now = gravity_at(self.scene.gravity, self.time)
        if self._has_other_obstacles():
            known, asked = self._obstacles, tuple(self.scene.obstacles)
            self._obstacles = asked
            self._meet_anew([*known, *asked])
            if not _go_on(known, asked, self.time):
                self.pushing.begin()
                others = self.pushing.is_due = True
            self.place_obstacles()
            shaken = True
        if shaken:
            self.loading.forget()
        if self.loading.refresh() or shaken or (changed and self.shakes):
            self._set_inputs()
        if self._rules() != self.stepper.rules:
            self.stepper = self._make_stepper()
            self.stepper.compile()
        self.stepper.loaded = self._is_loaded()
        if self.pushing.is_due:
            self.pushing.ease()
        return others

    def rehearse(self) -> None:
        """Compile what taking over a change needs, and the guard's second look at its energy;
        changes nothing.
        """
        self._reread()
        self.stepper.save()
        self.stepper.restore()
        self.system.set_motion(*self.system.motion())

    def _check_changes(self) -> None:
        """Refuse what cannot be followed before anything is taken."""
        scene = self.scene
        scene.check_together()
        self._kept.check(scene)
        if scene.gravity != self._given_gravity or self._has_other_obstacles():
            check_scene(scene, self.precision)
        if self._kept.settled(scene):
            self.next_look = min(self.next_look, AGAIN)
        for part, body in zip(self.system.parts, scene.bodies, strict=True):
            if part.body is not body:  # with its damping ratio turned; else the same
                part.body.pins, part.body.loads = body.pins, body.loads

    def put_anew(self) -> None:
        """Say that bodies have been put elsewhere: what is inside of something comes out slowly."""
        self.pushing.begin()
        self.place_obstacles()
        self.pushing.is_due = True

    def _meet_anew(self, obstacles: list[Any]) -> None:
        """Take other obstacles: what faces may meet of them, or of those before."""
        if not any(stands(obstacle) for obstacle in obstacles):
            return
        self.pushing.easing = None
        old, self.touching = self.touching, touching_of(self.scene, self.system, fresh=False)
        if old is not None:
            old.end()
        if self.touching is None:
            self.meets = False
        self.look_for_contact()

    def _has_other_obstacles(self) -> bool:
        now, known = self.scene.obstacles, self._obstacles
        return len(now) != len(known) or any(a is not b for a, b in zip(now, known, strict=True))

    def _reread(self) -> None:
        """Take the bodies' materials; all of them, or none."""
        parts = self.system.parts
        before = []
        for part, body, made_of in zip(parts, self.scene.bodies, self._made_of, strict=True):
            old = part.body
            if old is body:  # whose model is the new one already
                old = copy(body)
                old.model, old.regions = made_of[0], list(made_of[1:])
            before.append(old)
        bodies = []
        for k, body in enumerate(self.scene.bodies):
            with inside(f"body[{k}]"):
                body.validate()
                bodies.append(damped_body(body))
        for part, body in zip(parts, bodies, strict=True):
            part.body = body
        try:
            with np.errstate(all="ignore"):
                self.system.reread_models()
                check_parts(self.system)
        except SceneError:
            for part, body in zip(parts, before, strict=True):
                part.body = body
            self.system.reread_models()
            raise
        self.limit.refresh()


def _go_on(known: tuple[Any, ...], asked: tuple[Any, ...], time: float) -> bool:
    """Whether obstacles are where others were at `time` [s], and differ in how they move on."""
    if [type(o) for o in known] != [type(o) for o in asked]:
        return False
    zero, now = np.zeros(3), np.array([time])
    pairs = [
        (a.numbers(zero, now), b.numbers(zero, now)) for a, b in zip(known, asked, strict=True)
    ]
    return all(np.allclose(a, b, rtol=1e-9, atol=1e-12 * np.abs(a).max()) for a, b in pairs)
