"""Surfaces inside obstacles between their nodes, of bodies whose nodes alone meet obstacles."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.depth import depth_inside
from tisoft.gaps import Sides, radius_of, sides_of
from tisoft.model.part import Part

Floats = NDArray[np.float64]

TOLD = 0.02
"""Depth that is told, as a share of the side's longest edge."""
SUNK = 2.0
"""Radius of an obstacle over that of a side, from which on it sinks in by less than is told."""


class Inside:
    """Remembers how deep the sides of each body have been in each obstacle at the worst."""

    def __init__(self, parts: list[Part]) -> None:
        self._parts = parts
        self._sides: dict[int, Sides | None] = {}
        self.worst: dict[tuple[int, int], tuple[float, float, list[float]]] = {}
        """By body and obstacle: depth [m], time [s] and place [m]."""

    def look(
        self, parts: list[Part], obstacles: tuple[Any, ...], time: float, world: Floats
    ) -> None:
        """Look at some bodies' world positions [m], internal order, at `time` [s]."""
        for number, obstacle in enumerate(obstacles):
            r = radius_of(obstacle)
            for part in parts if r is not None else []:
                sides = self._sides_of(part)
                assert r is not None
                if sides is not None and r < SUNK * sides.radii.max():
                    x = world[part.nodes][part.rank]
                    self._look_at(part, number, obstacle, (time, x, sides))

    def _sides_of(self, part: Part) -> Sides | None:
        if part.index not in self._sides:
            carried = part.body.carried
            points = part.body.mesh.points
            own = points if carried is None else carried.skin.carried(points)
            self._sides[part.index] = sides_of(part.body, own)
        return self._sides[part.index]

    def _look_at(
        self, part: Part, number: int, obstacle: Any, now: tuple[float, Floats, Sides]
    ) -> None:
        time, x, sides = now
        if part.body.carried is not None:
            x = part.body.carried.skin.carried(x)
        corners = x[sides.corners]
        spots = [corners.mean(axis=1)]
        if corners.shape[1] == 3:
            spots += [0.5 * (corners[:, k] + corners[:, k - 1]) for k in range(3)]
        depths = [depth_inside(obstacle, places, time) for places in spots]
        each = np.max(depths, axis=0)
        side = int(np.argmax(each))
        key = (part.index, number)
        if each[side] > max(TOLD * sides.lengths[side], self.worst.get(key, (0.0,))[0]):
            spot = int(np.argmax([own[side] for own in depths]))
            self.worst[key] = (float(each[side]), time, spots[spot][side].tolist())

    def warnings(self) -> list[str]:
        """What happened, a sentence each."""
        told = []
        for (index, number), (depth, time, place) in sorted(self.worst.items()):
            name = self._parts[index].body.name
            where = ", ".join(f"{c:.4g}" for c in place)
            told.append(
                f'the surface of body "{name}" was {depth:.3g} m inside obstacle[{number}] between '
                f"its nodes, at ({where}) at t = {time:.4g} s: nodes alone meet "
                f"obstacles; take shorter edges there"
            )
        return told
