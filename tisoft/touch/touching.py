"""What a scene has of contact: which bodies may touch, their surfaces in fields, when to search.

Lengths are shares of the bodies' own: nothing is absolute.

| what                     | share                                              |
| ------------------------ | -------------------------------------------------- |
| thickness of a body      | THICKNESS of its median edge: solids, sheets       |
| margin of a search       | MARGIN, least and most, of the shortest edge       |
| residual ending sweeps   | TOLERANCE of the least thickness                   |
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import runtime
from tisoft.model.arena import Lease
from tisoft.model.part import Part
from tisoft.model.state import TOUCH_SCENE
from tisoft.model.system import System
from tisoft.touch import fields as f
from tisoft.touch.fields import Touch
from tisoft.touch.overlap import check_apart
from tisoft.touch.surface import Surface, surface_of

Floats = NDArray[np.float64]

THICKNESS = {True: 0.05, False: 0.1}
MARGIN = (0.25, 1.0)
THINNEST = 0.02
"""Of the median edge: less than what the sweeps leave over would let surfaces through."""
TOLERANCE = 0.02
SELF_REACH = 0.65
"""Of an edge: a flat sheet has no candidate with itself within it."""
PAIRS_A_POINT = 24
"""Room for candidates; where they find none, the margin is halved."""
BOXES_A_BODY = 16


@dataclass(frozen=True, eq=False)
class Toucher:
    """A body as contact sees it."""

    part: Part
    surface: Surface
    thickness: float
    """[m]"""
    friction: float
    self_contact: bool

    @property
    def name(self) -> str:
        """The body's."""
        return self.part.body.name


def toucher_of(part: Part) -> Toucher | None:
    """The body, or None where it has no surface or shall not touch."""
    body = part.body
    triangles = part.rank[np.asarray(body.mesh.surface)]
    if not body.contact or not len(triangles):
        return None
    surface = surface_of(triangles, part.rest, float(part.volume.sum()))
    thickness = body.thickness or THICKNESS[surface.is_solid] * surface.edge
    thickness = max(thickness, THINNEST * surface.edge)
    return Toucher(part, surface, thickness, body.friction, bool(body.self_contact))


class Touching:
    """The contact of a scene's bodies with one another and of sheets with themselves.

    Args:
        system: the bodies in fields.
        touchers: those that may touch something.
        apart: pairs of names that do not touch each other.
    """

    def __init__(
        self, system: System, touchers: Sequence[Toucher], apart: Sequence[tuple[str, str]]
    ) -> None:
        self.system = system
        self.touchers = list(touchers)
        self.lease = self._lend()
        self._write_points()
        self._write_bodies(apart)
        self._write_scene()
        self.place_origins()

    @property
    def fields(self) -> Any:
        """Those of contact."""
        return self.lease.fields

    @property
    def scene(self) -> int:
        """The scene's row."""
        return self.lease.starts["scenes"]

    def _lend(self) -> Lease:
        surfaces = [toucher.surface for toucher in self.touchers]
        points = sum(len(s.points) for s in surfaces)
        edges = sum(len(s.edges) for s in surfaces)
        bodies = len(self.touchers)
        self.buckets = 1 << max(4, int(np.ceil(np.log2(2 * max(points, edges)))))
        self.room = (PAIRS_A_POINT * points, PAIRS_A_POINT * edges)
        needs = {
            "points": points + 1,
            "nodes": self.system.count,
            "triangles": sum(len(s.triangles) for s in surfaces),
            "fans": sum(len(s.fan) for s in surfaces),
            "edges": edges,
            "pairs": sum(self.room),
            "buckets": self.buckets + 1,
            "bodies": bodies,
            "couples": bodies * bodies,
            "boxes": BOXES_A_BODY * bodies,
            "threads": runtime.threads(),
            "scenes": 1,
        }
        return self.system.lend(Touch, needs)

    def _write_points(self) -> None:
        starts = self.lease.starts
        rows = np.full(self.system.count, -1, np.int32)
        first, fan, triangle, edge = (starts[k] for k in ("points", "fans", "triangles", "edges"))
        bodies, fans, self.ranges = [], [], []
        for number, toucher in enumerate(self.touchers):
            s = toucher.surface
            rows[toucher.part.start + s.points] = first + np.arange(len(s.points))
            bodies.append(np.full(len(s.points), starts["bodies"] + number))
            fans.append(s.fan_start[:-1] + fan)
            self.fields.write_faces(
                triangle, _ints(s.triangles + first), _ints(s.owned), _raised(s.across, first),
                fan, _ints(s.fan + first),
            )  # fmt: skip
            self.fields.write_edges(edge, _ints(s.edges + first), _raised(s.sides, first))
            self.ranges.append((first, first + len(s.points)))
            first += len(s.points)
            fan += len(s.fan)
            triangle += len(s.triangles)
            edge += len(s.edges)
        self.ends = (first, triangle, edge)
        fans.append(np.array([fan]))
        self.fields.write_points(
            starts["points"], _ints(np.concatenate(bodies)), _ints(np.concatenate(fans)),
            starts["nodes"], rows,
        )  # fmt: skip

    def _write_bodies(self, apart: Sequence[tuple[str, str]]) -> None:
        traits = np.zeros((len(self.touchers), 7), np.int32)
        numbers = np.zeros((len(self.touchers), 4))
        for k, toucher in enumerate(self.touchers):
            traits[k, f.SOLID] = toucher.surface.is_solid
            traits[k, f.SELF] = toucher.self_contact
            traits[k, f.FIRST : f.LAST + 1] = self.ranges[k]
            numbers[k, f.HALF] = 0.5 * toucher.thickness
            numbers[k, f.FRICTION] = toucher.friction
            numbers[k, f.DEPTH] = toucher.surface.depth
        names = [toucher.name for toucher in self.touchers]
        may = np.ones((len(names), len(names)), np.int32)
        np.fill_diagonal(may, [toucher.self_contact for toucher in self.touchers])
        for pair in apart:
            a, b = (names.index(name) if name in names else None for name in pair)
            if a is not None and b is not None:
                may[a, b] = may[b, a] = 0
        self._may = may
        check_apart(
            names,
            [toucher.surface for toucher in self.touchers],
            [t.part.rest[t.surface.points] + t.part.origin for t in self.touchers],
            may,
        )
        starts = self.lease.starts
        self.fields.write_bodies(
            starts["bodies"], traits, self._reals(numbers), starts["couples"], may.ravel()
        )

    def _write_scene(self) -> None:
        starts, needs = self.lease.starts, self.lease.counts
        order = np.zeros(25, np.int32)
        order[f.POINT], order[f.POINT_END] = starts["points"], self.ends[0]
        order[f.TRIANGLE], order[f.TRIANGLE_END] = starts["triangles"], self.ends[1]
        order[f.EDGE], order[f.EDGE_END] = starts["edges"], self.ends[2]
        order[f.BODY], order[f.BODY_END] = starts["bodies"], starts["bodies"] + needs["bodies"]
        order[f.PAIR], order[f.FACE_ROOM], order[f.EDGE_ROOM] = starts["pairs"], *self.room
        order[f.BUCKET], order[f.MASK] = starts["buckets"], self.buckets - 1
        order[f.NODE], order[f.COUPLE] = starts["nodes"], starts["couples"]
        order[f.BOX], order[f.BOX_END] = starts["boxes"], starts["boxes"] + needs["boxes"]
        order[f.THREAD] = starts["threads"]
        length = np.zeros(8)
        edge = min(toucher.surface.edge for toucher in self.touchers)
        thick = [toucher.thickness for toucher in self.touchers]
        length[f.THICK] = max(thick)
        length[f.LONGEST] = max(toucher.surface.longest for toucher in self.touchers)
        length[f.TOLERANCE] = TOLERANCE * min(thick)
        length[f.LEAST], length[f.MOST] = (share * edge for share in MARGIN)
        own = [t.surface.edge for t in self.touchers if t.self_contact]
        if own:
            most = max(SELF_REACH * min(own) - max(thick), 0.1 * edge)
            length[f.LEAST : f.MOST + 1] = np.minimum(length[f.LEAST : f.MOST + 1], most)
        self.fields.write_scene(self.scene, order, length)
        self.system.state.ranges[self.system.scene, TOUCH_SCENE] = self.scene

    def may_meet(self, world: Floats, reach: Floats) -> bool:
        """Whether bodies, or a sheet and itself, may touch soon.

        Args:
            world: positions of all nodes [m], inside order.
            reach: how far each body of the scene may come meanwhile [m].
        """
        if self._may.diagonal().any():
            return True
        parts = [toucher.part for toucher in self.touchers]
        far = np.array([reach[part.index] for part in parts])[:, None]
        low = np.array([world[part.nodes].min(axis=0) for part in parts]) - far
        high = np.array([world[part.nodes].max(axis=0) for part in parts]) + far
        meet = ((low[:, None] <= high) & (low <= high[:, None])).all(axis=2)
        return bool((meet & (self._may != 0)).any())

    def place_origins(self) -> None:
        """Tell where bodies' origins are, from the middle of them all: after one has moved."""
        origins = np.array([toucher.part.origin for toucher in self.touchers])
        self.fields.write_origins(self.lease.starts["bodies"], origins - origins.mean(axis=0))
        self.forget()

    def forget(self) -> None:
        """Say that the state is another than that of the last substep: lists are made anew."""
        self.fields.order[self.scene, f.BUILT] = 0

    def is_stale(self, threads: int) -> bool:
        """Whether lists are out of date, or other threads' than so many."""
        return bool(self.fields.order[self.scene, f.BUILT] != threads)

    def counts(self) -> dict[str, int]:
        """Candidates now; searches, sweeps and rows so far."""
        order, columns = self.fields.order, {"pairs": f.COUNT, "searches": f.BUILDS,
                                             "sweeps": f.SWEEPS, "rows": f.ROWS}  # fmt: skip
        return {name: int(order[self.scene, column]) for name, column in columns.items()}

    def _reals(self, values: Any) -> NDArray[Any]:
        return np.ascontiguousarray(values, dtype=self.system.real)


def _ints(values: Any) -> NDArray[np.int32]:
    return np.ascontiguousarray(values, dtype=np.int32)


def _raised(values: NDArray[np.int32], by: int) -> NDArray[np.int32]:
    """Points from row `by` on; −1 stays."""
    return _ints(np.where(values >= 0, values + by, -1))


def touching_of(scene: Any, system: System) -> Touching | None:
    """What of a scene's bodies may touch; None where nothing can."""
    if scene.integrator == "explicit-euler" or not runtime.on_cpu():
        return None
    bodies = [part.body for part in system.parts if part.body.contact]
    if len(bodies) < 2 and not any(body.self_contact for body in bodies):
        return None
    found = [toucher for toucher in map(toucher_of, system.parts) if toucher is not None]
    if len(found) < 2 and not any(toucher.self_contact for toucher in found):
        return None
    return Touching(system, found, [pair.bodies for pair in scene.no_contact])
