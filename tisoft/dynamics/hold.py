"""Pins at work: held axes, the velocities that carry moved pins through a frame, exact ends."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tisoft import runtime
from tisoft.dynamics.part import Part
from tisoft.dynamics.system import System
from tisoft.pins import Pin

SAME_TIME = 1e-9
"""Share of a frame by which a release may seem late through rounding."""


class Holder:
    """Keeps the system's `held` and `drive` arrays right, and does nothing while nothing moves."""

    def __init__(self, system: System) -> None:
        self.system = system
        self._key: tuple[object, ...] | None = None
        self._moved: list[tuple[Part, Pin, NDArray[np.int64], NDArray[np.int64]]] = []

    @property
    def is_moving(self) -> bool:
        """Whether some pin moves."""
        return bool(self._moved)

    def begin(self, start: float, end: float) -> bool:
        """Prepare the frame from `start` to `end` [s]; returns whether the held axes changed."""
        late = SAME_TIME * (end - start)
        active = [
            (part, pin)
            for part in self.system.parts
            for pin in part.body.pins
            if pin.release is None or start < pin.release - late
        ]
        key = tuple(pin for _, pin in active)
        changed = (
            self._key is None
            or len(key) != len(self._key)
            or any(a is not b for a, b in zip(key, self._key, strict=True))
        )
        if changed:
            self._key = key
            self._hold(active)
        if self._moved and end > start:
            self._drive(start, end)
        return changed

    def _hold(self, active: list[tuple[Part, Pin]]) -> None:
        held = np.zeros(self.system.count, np.int32)
        self._moved = []
        for part, pin in active:
            rows = part.body.nodes(pin.where)
            inside = part.start + part.rank[rows]
            for axis in pin.axes:
                held[inside] |= 1 << "xyz".index(axis)
            if pin.velocity is not None or pin.path is not None or pin.turn is not None:
                self._moved.append((part, pin, rows, inside))
        runtime.write(self.system.held, held)
        runtime.write(self.system.drive, np.zeros((self.system.count, 3), self.system.real))
        # What was let go keeps its velocity; what is held at rest stands still at once.
        self.held = held

    def _drive(self, start: float, end: float) -> None:
        drive = np.array(runtime.read(self.system.drive))
        for part, pin, rows, inside in self._moved:
            points = part.body.mesh.points[rows]
            way = pin.displacement(points, end) - pin.displacement(points, start)
            axes = np.array(["xyz".index(axis) for axis in pin.axes])
            drive[np.ix_(inside, axes)] = way[:, axes] / (end - start)
        runtime.write(self.system.drive, drive)

    def finish(self, end: float) -> None:
        """Put moved pins exactly where they belong at `end` [s]: rounding must not add up."""
        if not self._moved:
            return
        u = np.array(runtime.read(self.system.u))
        for part, pin, rows, inside in self._moved:
            place = pin.displacement(part.body.mesh.points[rows], end) - part.shift
            axes = np.array(["xyz".index(axis) for axis in pin.axes])
            u[np.ix_(inside, axes)] = place[:, axes]
        runtime.write(self.system.u, u)
