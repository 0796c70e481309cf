"""Pins at work: held axes, what moves them now, exact ends."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tisoft.model.part import Part
from tisoft.model.system import System
from tisoft.pins import Pin
from tisoft.step.patches import Patches, patch_of

Floats = NDArray[np.float64]

SAME_TIME = 1e-9
"""Share of a frame by which a release may seem late through rounding."""


class Holder:
    """Keeps what pins hold and prescribe right in the fields; idle while nothing moves."""

    def __init__(self, system: System, *, by_means: bool = True) -> None:
        self.system = system
        self.by_means = by_means
        """Whether kernels know means of cells; else nodes near a patch are held."""
        self.patches = Patches(system)
        self._key: tuple[object, ...] | None = None
        self.held = np.zeros(system.count, np.int32)
        self.drive = np.zeros((system.count, 3))
        self._moved: list[tuple[Part, Pin, NDArray[np.int64], NDArray[np.int64]]] = []

    @property
    def moved(self) -> list[tuple[Part, Pin, NDArray[np.int64]]]:
        """The pins that move now, with their bodies' parts, and the rows of nodes they hold."""
        return [(part, pin, rows) for part, pin, rows, _ in self._moved]

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
        return changed

    def _hold(self, active: list[tuple[Part, Pin]]) -> None:
        held = np.zeros(self.system.count, np.int32)
        self._moved = []
        patches = []
        for part, pin in active:
            rows, patch = part.body.nodes(pin.where), None
            if self.by_means:
                rows, patch = patch_of(part, pin)
            if patch is not None:
                patches.append(patch)
            inside = part.start + part.rank[rows]
            held[inside] |= pin.bits
            if pin.moves:
                self._moved.append((part, pin, rows, inside))
        # What was let go keeps its velocity; what is held at rest stands still at once.
        self.held = held
        self.drive = np.zeros((self.system.count, 3))
        self.write()
        self.patches.hold(patches, held)

    def write(self) -> None:
        """Write what is held, and how it moves, into the fields."""
        self.system.set_fixed(self.held, self.drive)

    def led(self, here: Floats, time: float) -> Floats:
        """World positions `here` [m], inside order, shape (nodes, 3), what moved pins hold where
        they have it at `time` [s].
        """
        out = here.copy()
        for part, pin, rows, inside in self._moved:
            points = part.body.mesh.points[rows]
            place = points + pin.displacement(points, time)
            for k in pin.components:
                out[inside, k] = place[:, k]
        return out

    def finish(self, end: float) -> None:
        """Put moved pins exactly where they belong at `end` [s]: rounding must not add up."""
        for part, pin, rows, inside in self._moved:
            place = pin.displacement(part.body.mesh.points[rows], end) - part.shift
            self.system.set_places(inside, np.full(len(inside), pin.bits), place)
        if self.is_moving:
            self.patches.finish(end)
