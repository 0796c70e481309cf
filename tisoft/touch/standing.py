"""Obstacles as contact of surfaces sees them: bodies that no impulse moves.

What is round is a core with a radius, what has corners its surface, with sharp edges cut to a share
of the bodies' own, so that a face finds points and edges wherever it lies on them.  Spheres and
capsules that are large against all faces have no core here: nodes see enough of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.geometry.surface import solid_moments
from tisoft.geometry.topology import morton_order
from tisoft.moving import moves, pose
from tisoft.obstacles import Shell
from tisoft.touch.overlap import depths_inside
from tisoft.touch.surface import Surface, cut_edges, surface_of

Floats = NDArray[np.float64]

SPACING = 0.25
"""Of the least edge of all bodies: pieces of an obstacle's sharp edges."""
FINE = 16.0
"""Times the longest edge: a radius from which on nodes see enough (a face between nodes on a ball
is edge²/6R deep in it)."""
PATCH = 160
"""Points of a closed surface that nodes meet which make one body."""
SKIN = 0.4
"""Share of their distance to others that bodies keep from corners: a direction needs some."""


@dataclass(frozen=True, eq=False)
class Standing:
    """An obstacle, or a part of it."""

    obstacle: Any
    number: int
    """In the scene."""
    local: Floats
    """Its points in its own coordinates, shape (points, 3)."""
    rest: Floats
    """Their places at t = 0 [m]."""
    surface: Surface | None
    """None for a core."""
    round: int = 0
    """Kind of its core."""
    radius: float = 0.0
    grow: float = 0.0
    """How far it reaches beyond its points [m]."""

    @property
    def patches(self) -> list[tuple[int, int]]:
        """Ranges of its points that make a body each: boxes around a whole bowl would tell nothing
        of where it is.
        """
        count = len(self.local)
        size = PATCH if self.is_met_by_nodes else count
        return [(k, min(k + size, count)) for k in range(0, count, size)]

    @property
    def moves(self) -> bool:
        """Whether it does."""
        return moves(self.obstacle)

    @property
    def is_met_by_nodes(self) -> bool:
        """Whether bodies' points meet its triangles; else its distance."""
        return isinstance(self.obstacle, Shell)

    def depths(self, points: Floats, time: float) -> Floats:
        """How deep points [m] are inside its triangles at `time` [s]; 0 where they are not."""
        assert self.surface is not None
        R, d = (moved[0] for moved in pose(self.obstacle, time))
        x = (points - d) @ R
        near = ((x > self.rest.min(axis=0)) & (x < self.rest.max(axis=0))).all(axis=1)
        found = np.zeros(len(x))
        if near.any():
            found[near] = depths_inside(self.rest, self.surface, x[near])
        return found

    def boxes(self, times: Sequence[float]) -> tuple[Floats, Floats]:
        """Lowest and highest corners [m] of what faces may meet between some times [s]: of its
        edges, of its triangles where nodes meet those, or of its core.
        """
        R, d = pose(self.obstacle, times)
        x = self.rest @ R.transpose(0, 2, 1) + d[:, None]
        if self.surface is None:
            low, high = x.min(axis=(0, 1)), x.max(axis=(0, 1))
            return low[None] - self.radius, high[None] + self.radius
        rows = self.surface.triangles if self.is_met_by_nodes else self.surface.edges
        return x[:, rows].min(axis=(0, 2)), x[:, rows].max(axis=(0, 2))


def standings_of(obstacles: Sequence[Any], edge: float, longest: float) -> list[Standing]:
    """What faces of bodies may meet, those with corners first.

    Args:
        obstacles: the scene's.
        edge: least of the bodies' median edges [m].
        longest: of their edges [m].
    """
    cornered, cores = [], []
    for number, obstacle in enumerate(obstacles):
        corners, core = obstacle.corners(edge), obstacle.core()
        if corners is not None:
            cornered.append(_cornered(obstacle, number, corners, SPACING * edge))
        if core is not None and core.radius < FINE * longest:
            own = (core.local, core.rest, None, core.kind, core.radius)
            cores.append(Standing(obstacle, number, *own, grow=core.radius))
    return cornered + cores


def _cornered(obstacle: Any, number: int, corners: Any, most: float) -> Standing:
    order = morton_order(corners.rest)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    x, triangles = corners.rest[order], rank[corners.triangles]
    surface = surface_of(triangles, x, solid_moments(x, triangles)[0])
    x, local = x[surface.points], corners.local[order][surface.points]
    grow = surface.longest
    surface, rows = cut_edges(surface, x, most)
    i, j, share = rows[:, 0].astype(int), rows[:, 1].astype(int), rows[:, 2:]
    local, x = ((1.0 - share) * values[i] + share * values[j] for values in (local, x))
    return Standing(obstacle, number, local, x, surface, grow=grow)
