"""Bodies that begin, or are put, inside obstacles or each other: pushed out slowly, since at once
would be a blow, and told.

    speed = depth / T

T is told in `pushing`; surfaces that overlap come out by `touch.easing`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.gravity import strongest
from tisoft.model.part import Part
from tisoft.moving import STILL
from tisoft.pushing import depths_of, push_time
from tisoft.touch import easing
from tisoft.touch.overlap import stuck
from tisoft.touch.starts import unseen

Floats = NDArray[np.float64]

OUT = 1e-6
"""Depth, as a share of a body's size, that contact puts out at once."""


class PushingOut:
    """What of a scene is being pushed out of what.

    Args:
        present: the `Present` of the scene.
    """

    def __init__(self, present: Any) -> None:
        self.present = present
        self.speeds = [STILL] * len(present.scene.bodies)
        """At which obstacles push each body's nodes out [m/s]; STILL where none is inside."""
        self.easing: easing.Easing | None = None
        """What of surfaces is pushed out of what."""
        self.is_due = False
        """Whether bodies or obstacles have been put elsewhere since `ease` looked."""

    @property
    def goes_on(self) -> bool:
        """Whether a body is being pushed out of an obstacle or another body."""
        return self.easing is not None or any(speed < STILL for speed in self.speeds)

    def begin(self, freed: NDArray[np.bool_] | None = None) -> None:
        """Let bodies whose nodes are inside obstacles be pushed out: where `freed` are given, those
        alone, inside order, which a pin has let go of.
        """
        present = self.present
        world = present.system.world()
        for k, part in enumerate(present.parts):
            if freed is not None and not freed[part.nodes].any():
                continue
            for number, depths in enumerate(self._depths(part, world)):
                if freed is not None and part.body.carried is None:
                    depths = np.where(freed[part.nodes], depths, 0.0)
                deepest = float(depths.max())
                if deepest > (0.0 if freed is None else OUT * part.size):
                    seconds = self._time(part, deepest)
                    known, speed = self.speeds[k], deepest / seconds
                    self.speeds[k] = speed if known == STILL else max(known, speed)
                    count = int((depths > 0.0).sum())
                    name, push = part.body.name, (deepest, present.time, seconds)
                    present.watch.note_push(name, f"obstacle[{number}]", count, push)

    def ease(self) -> None:
        """Let surfaces that are inside obstacles or each other come out slowly.

        Raises:
            SceneError: a body that starts in an obstacle which cannot push it out.
        """
        present, touching = self.present, self.present.touching
        self.easing, self.is_due = None, False
        world = present.system.world()
        if touching is None:
            return
        deep = []
        if present.meets and touching.meetings.may_overlap(world, present.time):
            deep = easing.measured(touching, present.stepper.find_depths)
        if deep:
            seconds = [
                self._time(touching.touchers[k].part, depth)
                for *bodies, depth in deep
                for k in bodies
                if k < len(touching.touchers)
            ]
            self.easing = easing.Easing(present.time, max(seconds), deep)
            present.place_obstacles()
            easing.set_easing(touching, self.easing, present.time)
        for name, number, depth in unseen(touching, world, deep, present.time):
            if not present.frame:
                raise stuck(name, number, depth)
            present.watch.note_stuck(name, f"obstacle[{number}]", (depth, present.time))
        for name, other, depth in touching.meetings.overlaps(deep):
            assert self.easing is not None
            present.watch.note_push(name, other, 0, (depth, present.time, self.easing.seconds))

    def tell_left(self) -> None:
        """Let the kernels know how much of the depths is left."""
        if self.easing is not None and self.present.touching is not None:
            easing.set_left(self.present.touching, self.easing, self.present.time)

    def stop(self) -> None:
        """Let contact act at once again on bodies that are out."""
        if not self.goes_on:
            return
        if self.easing is not None and self.easing.left(self.present.time) <= 0.0:
            self._go_on(None)
        world = self.present.system.world()
        for k, part in enumerate(self.present.parts):
            deepest = max((d.max() for d in self._depths(part, world)), default=0.0)
            if deepest <= OUT * part.size:
                self.speeds[k] = STILL
        self.present.place_obstacles()

    def table(self, obstacles: int) -> Floats:
        """Speeds [m/s] at which nodes are put out of obstacles, shape (bodies, obstacles): those
        that faces come out of take them along.
        """
        speeds = np.repeat(np.array(self.speeds)[:, None], obstacles, axis=1)
        if self.easing is not None and self.present.touching is not None:
            for part, number in self.present.touching.meetings.cores_in(self.easing.deep):
                speeds[part.index, number] = 0.0
        return speeds

    def state(self) -> list[Any]:
        """What a checkpoint keeps."""
        found = self.easing
        eased = None if found is None else [found.began, found.seconds, found.deep]
        return [self.speeds, self.is_due, eased]

    def set_state(self, state: list[Any]) -> None:
        """Go on from what `state` told."""
        self.speeds, self.is_due, eased = state
        self.present.place_obstacles()
        self._go_on(None if eased is None else easing.Easing(*eased))

    def _go_on(self, known: easing.Easing | None) -> None:
        self.easing = known
        if self.present.touching is not None and self.present.meets:
            easing.set_easing(self.present.touching, known, self.present.time)

    def _depths(self, part: Part, world: Floats) -> list[Floats]:
        """How deep what meets obstacles of a body is inside of each [m]."""
        here, obstacles = world[part.nodes], self.present.scene.obstacles
        return [depths_of(part, obstacle, here, self.present.time) for obstacle in obstacles]

    def _time(self, part: Part, depth: float) -> float:
        gravity = strongest(self.present.scene.gravity)
        return push_time(part, depth, self.present.limit.rest_bound(), gravity)
