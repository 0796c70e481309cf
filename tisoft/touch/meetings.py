"""Who of a scene may touch whom: bodies, themselves, and obstacles that faces meet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.model.part import Part
from tisoft.touch import overlap
from tisoft.touch.standing import SKIN, Standing
from tisoft.touch.toucher import Toucher

Floats = NDArray[np.float64]

INSIDE = 0.01
"""Of the distance that is kept: as deep inside of another one is told."""


def stands(obstacle: Any) -> bool:
    """Whether faces may meet it, not nodes alone."""
    return obstacle.core() is not None or obstacle.corners(1.0) is not None


class Meetings:
    """Pairs that may touch, and what that asks of a state.

    Args:
        touchers: bodies that may touch something.
        apart: pairs of names that do not touch each other.
        standings: obstacles that faces may meet.
    """

    def __init__(
        self,
        touchers: Sequence[Toucher],
        apart: Sequence[tuple[str, str]],
        standings: Sequence[Standing],
    ) -> None:
        self.touchers = list(touchers)
        self.standings = list(standings)
        self.owners = [s for s in self.standings for _ in s.patches]
        """The obstacle of each body beyond the touchers."""
        self.may = self._who_may(apart)
        """Whether two of them may touch, shape (n, n)."""

    def _who_may(self, apart: Sequence[tuple[str, str]]) -> NDArray[np.int32]:
        """Whether two of the bodies and obstacles may touch."""
        names = [toucher.name for toucher in self.touchers]
        meets = [toucher.meets_others for toucher in self.touchers]
        count = len(names) + len(self.owners)
        may = np.zeros((count, count), np.int32)
        may[: len(names), : len(names)] = np.outer(meets, meets)
        np.fill_diagonal(may[: len(names), : len(names)], [t.self_contact for t in self.touchers])
        for pair in apart:
            a, b = (names.index(name) if name in names else None for name in pair)
            if a is not None and b is not None:
                may[a, b] = may[b, a] = 0
        for k, standing in enumerate(self.owners, len(names)):
            for i, toucher in enumerate(self.touchers):
                # A carried surface meets what has a distance by itself.
                may[i, k] = may[k, i] = standing.is_met_by_nodes or not toucher.part.touches
        return may

    def check_apart(self) -> None:
        """Refuse bodies that start deep inside each other or inside of closed triangles."""
        solid = [s for s in self.standings if s.is_met_by_nodes and s.surface is not None]
        names = [repr(toucher.name) for toucher in self.touchers]
        own = [len(names) + self.owners.index(s) for s in solid]
        rows = [*range(len(names)), *own]
        places = [t.part.rest[t.surface.points] + t.part.origin for t in self.touchers]
        overlap.check_apart(
            [*names, *[f"obstacle[{s.number}]" for s in solid]],
            [*[t.surface for t in self.touchers], *[s.surface for s in solid if s.surface]],
            [*places, *[s.rest for s in solid]],
            self.may[np.ix_(rows, rows)],
        )

    def may_meet(self, world: Floats, reach: Floats, times: Sequence[float]) -> bool:
        """Whether bodies, a sheet and itself, or faces and obstacles may touch soon.

        Args:
            world: positions of all nodes [m], inside order.
            reach: how far each body of the scene may come meanwhile [m].
            times: now and then [s].
        """
        if any(toucher.may_fold(world) for toucher in self.touchers):
            return True
        parts = [toucher.part for toucher in self.touchers]
        far = np.array([reach[part.index] for part in parts])[:, None]
        low = np.array([world[part.nodes].min(axis=0) for part in parts]) - far
        high = np.array([world[part.nodes].max(axis=0) for part in parts]) + far
        meet = ((low[:, None] <= high) & (low <= high[:, None])).all(axis=2)
        np.fill_diagonal(meet, False)
        count = len(parts)
        if (meet & (self.may[:count, :count] != 0)).any():
            return True
        for standing in self.standings:
            k = count + self.owners.index(standing)
            lo, hi = standing.boxes(times)
            near = ((low[:, None] <= hi) & (lo <= high[:, None])).all(axis=2).any(axis=1)
            if (near & (self.may[:count, k] != 0)).any():
                return True
        return False

    def may_overlap(self, world: Floats, time: float) -> bool:
        """Whether some of what may touch may be nearer at `time` [s] than it keeps (`may_meet`)."""
        thick = max(toucher.thickness for toucher in self.touchers)
        if self.may_meet(
            world, np.full(1 + max(t.part.index for t in self.touchers), thick), [time]
        ):
            return True
        return any(
            (standing.depths(world[toucher.part.nodes][toucher.surface.points], time) > 0.0).any()
            for standing in self.standings
            for toucher in self.touchers
            if standing.is_met_by_nodes
        )

    def overlaps(self, deep: Sequence[tuple[int, int, float]]) -> list[tuple[str, str, float]]:
        """A body's name, another one's or an obstacle's, and how deep they are in each other [m],
        where that is deeper than the distance that they keep.

        Args: deep: two of the bodies and obstacles, and their depth below that distance [m].
        """
        found = []
        count = len(self.touchers)
        for b, c, depth in deep:
            own = self.touchers[b]
            if c < count:
                kept = 0.5 * (own.thickness + self.touchers[c].thickness)
                other = f'body "{self.touchers[c].name}"'
            else:
                standing = self.owners[c - count]
                kept = 0.0 if standing.surface is None else 0.5 * SKIN * own.thickness
                other = f"obstacle[{standing.number}]"
            if depth > (1.0 + INSIDE) * kept and b != c:
                found.append((own.name, other, depth - kept))
        return found

    def cores_in(self, deep: Sequence[tuple[int, int, float]]) -> list[tuple[Part, int]]:
        """Bodies and the numbers of obstacles whose cores are among those in each other."""
        count = len(self.touchers)
        owners = [(b, self.owners[c - count]) for b, c, _ in deep if c >= count]
        return [(self.touchers[b].part, s.number) for b, s in owners if s.surface is None]

    def partners(self) -> list[tuple[Toucher, list[str], list[int]]]:
        """Each body with the names of others and the numbers of obstacles that its surface may
        touch.
        """
        count, found = len(self.touchers), []
        for k, toucher in enumerate(self.touchers):
            others = [t.name for i, t in enumerate(self.touchers) if i != k and self.may[k, i]]
            met = [s.number for i, s in enumerate(self.owners, count) if self.may[k, i]]
            found.append((toucher, others, sorted(set(met))))
        return found
