"""What a scene has of contact in fields: surfaces, who may touch whom (`meetings`), lengths.

Lengths are shares of the bodies' own: nothing is absolute.

| what                     | share                                              |
| ------------------------ | -------------------------------------------------- |
| margin of a search       | MARGIN, least and most, of the shortest edge       |
| residual ending sweeps   | TOLERANCE of the least thickness                   |
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import runtime
from tisoft.checks import FieldError
from tisoft.model.arena import Lease
from tisoft.model.state import TOUCH_SCENE
from tisoft.model.system import System
from tisoft.obstacles import Shell
from tisoft.touch import fields as f
from tisoft.touch.fields import Touch
from tisoft.touch.meetings import Meetings, stands
from tisoft.touch.patches import SIZE, kin_of, patches_of, ranges_of, sorted_surface
from tisoft.touch.standing import SKIN, standings_of
from tisoft.touch.surface import Surface
from tisoft.touch.toucher import any_touch, toucher_of

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]

MARGIN = (0.25, 4.0)
TOLERANCE = 0.02
FINER = 0.5
"""Of that where there are cores: bodies keep no distance to those."""
SELF_REACH = 0.65
"""Of an edge: a flat sheet has no candidate with itself within it."""
PAIRS_A_POINT = 24
"""Room for candidates; where they find none, the margin is halved."""


class Touching:
    """The contact of a scene's bodies with one another and of sheets with themselves.

    Args:
        system: the bodies in fields.
        meetings: who may touch whom.
    """

    def __init__(self, system: System, meetings: Meetings) -> None:
        self.system = system
        self.meetings = meetings
        self.touchers, self.standings = meetings.touchers, meetings.standings
        self.owners = meetings.owners
        self._surfaces, self._old, self._patches = self._sorted()
        self._kin_starts, self._kin = self._find_kin()
        self.lease = self._lend()
        self._write_points()
        self._write_patches()
        self._write_bodies()
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

    def _sorted(self) -> tuple[list[Surface | None], list[Rows], list[Rows]]:
        """Surfaces in the order in which they are written, None for a core; the numbers that the
        points of each had before; and the patches of points, triangles and edges, all counted from
        0.
        """
        given: list[tuple[Surface | None, Floats, list[int]]] = []
        for toucher in self.touchers:
            points = toucher.surface.points
            given.append((toucher.surface, toucher.part.rest[points], [len(points)]))
        for standing in self.standings:
            counts = [b - a for a, b in standing.patches]
            given.append((standing.surface, standing.rest, counts))
        surfaces: list[Surface | None] = []
        owners: list[list[Rows]] = [[], [], []]
        bodies = 0
        olds = []
        for surface, x, counts in given:
            owner = np.repeat(np.arange(bodies, bodies + len(counts)), counts)
            bodies += len(counts)
            owners[0].append(owner)
            old = np.arange(len(owner))
            if surface is not None:
                surface, old = sorted_surface(surface, x, owner)
                owners[1].append(owner[surface.triangles[:, 0]])
                owners[2].append(owner[surface.edges[:, 0]])
            surfaces.append(surface)
            olds.append(old)
        return surfaces, olds, [patches_of(np.concatenate(each)) for each in owners]

    def _find_kin(self) -> tuple[Rows, Rows]:
        """See `patches.kin_of`: of bodies that touch themselves."""
        folds = [toucher.self_contact for toucher in self.touchers]
        folds += [False] * len(self.standings)
        triangles: list[NDArray[np.integer]] = []
        edges: list[NDArray[np.integer]] = []
        points = 0
        for surface, old, may in zip(self._surfaces, self._old, folds, strict=True):
            if surface is not None:
                for found, rows in ((triangles, surface.triangles), (edges, surface.edges)):
                    found.append(rows + points if may else np.full_like(rows, -1))
            points += len(old)
        return kin_of(self._patches, np.concatenate(triangles), np.concatenate(edges), points)

    def _lend(self) -> Lease:
        surfaces = [surface for surface in self._surfaces if surface is not None]
        cores = sum(len(s.local) for s in self.standings if s.surface is None)
        points = sum(len(s.points) for s in surfaces) + cores
        edges = sum(len(s.edges) for s in surfaces)
        bodies = len(self.touchers) + len(self.owners)
        self.room = (PAIRS_A_POINT * points, PAIRS_A_POINT * edges)
        of_points, of_faces, of_edges = (len(each) for each in self._patches)
        self.width = max(points, edges) + SIZE  # and a patch's points that are near one triangle
        needs = {
            "points": points + 1,
            "nodes": self.system.count,
            "triangles": sum(len(s.triangles) for s in surfaces),
            "fans": sum(len(s.fan) for s in surfaces),
            "edges": edges,
            "pairs": sum(self.room),
            "bodies": bodies,
            "couples": bodies * bodies,
            "patches": of_points + of_faces + of_edges,
            "kins": len(self._kin),
            "candidates": self.width * runtime.threads(),
            "threads": runtime.threads(),
            "scenes": 1,
        }
        return self.system.lend(Touch, needs)

    def _write_points(self) -> None:
        starts = self.lease.starts
        self.rows = {name: starts[name] for name in ("points", "fans", "triangles", "edges")}
        nodes = np.full(self.system.count, -1, np.int32)
        self.ranges: list[tuple[int, int]] = []
        fans = []
        for toucher, s in zip(self.touchers, self._surfaces, strict=False):
            assert s is not None
            nodes[toucher.part.start + s.points] = self.rows["points"] + np.arange(len(s.points))
            first = self.rows["points"]
            fans.append(self._write_surface(s))
            self.ranges.append((first, self.rows["points"]))
        self.standing = self.rows["points"]
        for standing, s in zip(self.standings, self._surfaces[len(self.touchers) :], strict=True):
            first = self.rows["points"]
            if s is not None:
                fans.append(self._write_surface(s))
            else:
                self.rows["points"] += len(standing.local)
                fans.append(np.full(len(standing.local), self.rows["fans"]))
            self.ranges += [(first + a, first + b) for a, b in standing.patches]
        bodies = np.repeat(np.arange(len(self.ranges)), [b - a for a, b in self.ranges])
        fans.append(np.array([self.rows["fans"]]))
        self.fields.write_points(
            starts["points"], _ints(bodies + starts["bodies"]), _ints(np.concatenate(fans)),
            starts["nodes"], nodes,
        )  # fmt: skip
        if self.standings:
            olds = self._old[len(self.touchers) :]
            places = np.concatenate(
                [s.local[old] for s, old in zip(self.standings, olds, strict=True)]
            )
            self.fields.write_locals(self.standing, self._reals(places))

    def _write_patches(self) -> None:
        starts, first = self.lease.starts, self.lease.starts["patches"]
        self._own: list[Rows] = []
        """Where each body's patches of a kind begin and end."""
        for kind, patches in zip(("points", "triangles", "edges"), self._patches, strict=True):
            self._own.append(ranges_of(patches, len(self.ranges)) + first)
            rows = patches + np.array([starts[kind], starts[kind], starts["bodies"]])
            kin = self._kin_starts[first - starts["patches"] :][: len(patches) + 1, None]
            rows = np.concatenate([rows, starts["kins"] + kin[:-1], starts["kins"] + kin[1:]], 1)
            self.fields.write_patches(first, _ints(rows))
            first += len(patches)
        self.fields.write_kin(starts["kins"], _ints(self._kin + starts["patches"]))

    def _write_surface(self, s: Surface) -> NDArray[np.integer]:
        """Write a surface into the next rows; returns where its points' fans begin."""
        rows = self.rows
        point, fan, triangle, edge = (rows[k] for k in ("points", "fans", "triangles", "edges"))
        self.fields.write_faces(
            triangle, _ints(s.triangles + point), _ints(s.owned), _raised(s.across, point),
            fan, _ints(s.fan + point),
        )  # fmt: skip
        self.fields.write_edges(edge, _ints(s.edges + point), _raised(s.sides, point))
        rows["points"] += len(s.points)
        rows["fans"] += len(s.fan)
        rows["triangles"] += len(s.triangles)
        rows["edges"] += len(s.edges)
        return s.fan_start[:-1] + fan

    def _write_bodies(self) -> None:
        count = len(self.touchers)
        traits = np.zeros((len(self.ranges), f.TRAITS), np.int32)
        numbers = np.zeros((len(self.ranges), f.NUMBERS))
        traits[:, f.FIRST : f.LAST + 1] = self.ranges
        traits[:, f.OWN_POINTS : f.OWN_POINTS + 2] = self._own[0]
        traits[:, f.OWN_EDGES : f.OWN_EDGES + 2] = self._own[2]
        for k, toucher in enumerate(self.touchers):
            traits[k, f.SOLID] = toucher.surface.is_solid
            traits[k, f.SELF] = toucher.self_contact
            numbers[k, f.HALF] = 0.5 * toucher.thickness
            numbers[k, f.FRICTION] = toucher.friction
            numbers[k, f.DEPTH] = toucher.surface.depth
            numbers[k, f.SHARE] = 1.0
            numbers[k, f.EASE] = toucher.thickness
        for k, standing in enumerate(self.owners, count):
            traits[k, f.OBSTACLE] = 1
            traits[k, f.ROUND] = standing.round
            traits[k, f.BARE] = not standing.is_met_by_nodes
            numbers[k, f.HALF] = standing.radius
            numbers[k, f.FRICTION] = standing.obstacle.friction
            numbers[k, f.EASE] = 1e30
            numbers[k, f.GROW] = standing.grow
            if standing.surface is not None:
                traits[k, f.SOLID] = 1
                numbers[k, f.DEPTH] = standing.surface.depth
                numbers[k, f.SHARE] = SKIN
        starts, may = self.lease.starts, self.meetings.may
        self.fields.write_bodies(
            starts["bodies"],
            traits,
            self._reals(numbers),
            starts["couples"],
            may.ravel(),
        )

    def _write_scene(self) -> None:
        starts, needs = self.lease.starts, self.lease.counts
        order = np.zeros(f.ORDERS, np.int32)
        order[f.POINT], order[f.POINT_END] = starts["points"], self.rows["points"]
        order[f.TRIANGLE], order[f.TRIANGLE_END] = starts["triangles"], self.rows["triangles"]
        order[f.EDGE], order[f.EDGE_END] = starts["edges"], self.rows["edges"]
        order[f.BODY], order[f.BODY_END] = starts["bodies"], starts["bodies"] + needs["bodies"]
        order[f.PAIR], order[f.FACE_ROOM], order[f.EDGE_ROOM] = starts["pairs"], *self.room
        ends = starts["patches"] + np.cumsum([len(patches) for patches in self._patches])
        order[f.POINT_PATCH : f.PATCH_END + 1] = [starts["patches"], *ends]
        order[f.CANDIDATE], order[f.WIDTH] = starts["candidates"], self.width
        order[f.NODE], order[f.COUPLE] = starts["nodes"], starts["couples"]
        order[f.THREAD] = starts["threads"]
        order[f.STANDING] = self.standing
        cores = sum(s.surface is None for s in self.owners)
        order[f.CORES] = starts["bodies"] + needs["bodies"] - cores
        order[f.MOVING] = any(s.moves for s in self.standings)
        self.fields.write_scene(self.scene, order, self._lengths())
        self.system.state.ranges[self.system.scene, TOUCH_SCENE] = self.scene

    def _lengths(self) -> Floats:
        """`Touch.length` [m]."""
        length = np.zeros(f.LENGTHS)
        edge = min(toucher.surface.edge for toucher in self.touchers)
        thick = [toucher.thickness for toucher in self.touchers]
        length[f.THICK], length[f.THIN] = max(thick), min(thick)
        length[f.LONGEST] = max(toucher.surface.longest for toucher in self.touchers)
        has_cores = any(s.surface is None for s in self.standings)
        length[f.TOLERANCE] = TOLERANCE * (FINER if has_cores else 1.0) * min(thick)
        length[f.LEAST], length[f.MOST] = (share * edge for share in MARGIN)
        own = [t.surface.edge for t in self.touchers if t.self_contact]
        if own:
            most = max(SELF_REACH * min(own) - max(thick), 0.1 * edge)
            length[f.LEAST : f.MOST + 1] = np.minimum(length[f.LEAST : f.MOST + 1], most)
        return length

    def end(self) -> None:
        """Give its rows back: another one takes its place."""
        self.lease.end()

    def place_origins(self) -> None:
        """Tell where bodies' origins are, from the middle of them all: after one has moved."""
        origins = np.array([toucher.part.origin for toucher in self.touchers])
        middle, first = origins.mean(axis=0), self.system.parts[0]
        origins = np.concatenate([origins, np.tile(first.origin, (len(self.owners), 1))])
        self.fields.write_origins(self.lease.starts["bodies"], origins - middle)
        if self.standings and self.system.obstacle_lease is not None:
            # Seen from the first body, as their numbers in these rows are.
            rows = [self.system.obstacle_row(first, s.number) for s in self.owners]
            self.fields.write_rows(self.lease.starts["bodies"] + len(self.touchers), _ints(rows))
        self.forget()

    def forget(self) -> None:
        """Say that the state is another than that of the last substep: lists are made anew."""
        self.fields.order[self.scene, f.BUILT] = 0

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


def touching_of(scene: Any, system: System, *, fresh: bool = True) -> Touching | None:
    """What of a scene's bodies may touch, each other, themselves or obstacles; None where nothing
    can but nodes and obstacles.

    Args:
        scene, system: its bodies.
        fresh: whether they are where they start, and must not be inside each other there.

    Raises:
        FieldError: what cannot be met here, or starts too deep inside another one.
    """
    if not runtime.on_cpu():
        for number, obstacle in enumerate(scene.obstacles):
            if isinstance(obstacle, Shell):
                problem = "is met on the processor only; take --arch cpu, or another shape"
                raise FieldError(f"obstacle[{number}].file", problem)
        return None
    if scene.integrator == "explicit-euler":
        return None
    solid = any(stands(obstacle) for obstacle in scene.obstacles)
    if not solid and not any_touch([part.body for part in system.parts]):
        return None
    found = [toucher for toucher in map(toucher_of, system.parts) if toucher is not None]
    standings = []
    if found and solid:
        edge = min(toucher.surface.edge for toucher in found)
        longest = max(toucher.surface.longest for toucher in found)
        standings = standings_of(scene.obstacles, edge, longest)
    if not standings:
        found = [toucher for toucher in found if toucher.meets_others]
        if len(found) < 2 and not any(toucher.self_contact for toucher in found):
            return None
    meetings = Meetings(found, [pair.bodies for pair in scene.no_contact], standings)
    touching = Touching(system, meetings)
    if fresh:
        meetings.check_apart()
    return touching
