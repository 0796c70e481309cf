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
from tisoft.checks import FieldError
from tisoft.model.arena import Lease
from tisoft.model.part import Part
from tisoft.model.state import TOUCH_SCENE
from tisoft.model.system import System
from tisoft.models.materials import MassSpring
from tisoft.obstacles import Shell
from tisoft.touch import fields as f
from tisoft.touch import overlap
from tisoft.touch.fields import Touch
from tisoft.touch.patches import patches_of, ranges_of, sorted_surface
from tisoft.touch.standing import SKIN, Standing, standings_of
from tisoft.touch.surface import Surface, surface_of

Floats = NDArray[np.float64]

THICKNESS = {True: 0.05, False: 0.1}
MARGIN = (0.25, 1.5)
THINNEST = 0.02
"""Of the median edge: less than what the sweeps leave over would let surfaces through."""
TOLERANCE = 0.02
FINER = 0.5
"""Of that where there are cores: bodies keep no distance to those."""
SELF_REACH = 0.65
"""Of an edge: a flat sheet has no candidate with itself within it."""
INSIDE = 0.01
"""Of the distance that is kept: as deep inside of another one is told."""
FOLDED = 0.5
"""Cosine of the angle to its mean normal up to which a sheet has not begun to fold."""
PAIRS_A_POINT = 24
"""Room for candidates; where they find none, the margin is halved."""


@dataclass(frozen=True, eq=False)
class Toucher:
    """A body as contact sees it."""

    part: Part
    surface: Surface
    thickness: float
    """[m]"""
    friction: float
    self_contact: bool
    meets_others: bool
    """Whether it touches other bodies; else obstacles alone."""

    @property
    def name(self) -> str:
        """The body's."""
        return self.part.body.name

    def may_fold(self, world: Floats) -> bool:
        """Whether it may touch itself soon.  A sheet that nobody has said to touch itself has not
        begun to fold while all its normals look to one side.

        Args:
            world: positions of all nodes [m], inside order.
        """
        if self.part.body.self_contact or not self.self_contact:
            return self.self_contact
        a, b, c = world[self.part.nodes][self.surface.points][self.surface.triangles.T]
        normal = np.cross(b - a, c - a)
        along = normal @ normal.sum(axis=0)
        size = np.linalg.norm(normal, axis=1) * np.linalg.norm(normal.sum(axis=0))
        return bool((along < FOLDED * size).any())


def touches_itself(body: Any) -> bool:
    """Whether a body's surface does: as its key says, else sheets of springs, which have a rim."""
    if body.self_contact is not None:
        return bool(body.self_contact)
    surface = np.asarray(body.mesh.surface)
    if not isinstance(body.model, MassSpring) or not len(surface):
        return False
    sides = np.sort(surface[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    return bool((np.unique(sides, axis=0, return_counts=True)[1] == 1).any())


def toucher_of(part: Part) -> Toucher | None:
    """The body, or None where it has no surface."""
    body = part.body
    triangles = part.rank[np.asarray(body.mesh.surface)]
    if not len(triangles):
        return None
    surface = surface_of(triangles, part.rest, float(part.volume.sum()))
    thickness = body.thickness or THICKNESS[surface.is_solid] * surface.edge
    thickness = max(thickness, THINNEST * surface.edge)
    own = body.contact and touches_itself(body)
    return Toucher(part, surface, thickness, body.friction, own, body.contact)


class Touching:
    """The contact of a scene's bodies with one another and of sheets with themselves.

    Args:
        system: the bodies in fields.
        touchers: those that may touch something.
        apart: pairs of names that do not touch each other.
        standings: obstacles that faces may meet.
    """

    def __init__(
        self,
        system: System,
        touchers: Sequence[Toucher],
        apart: Sequence[tuple[str, str]],
        standings: Sequence[Standing],
    ) -> None:
        self.system = system
        self.touchers = list(touchers)
        self.standings = list(standings)
        self.owners = [s for s in self.standings for _ in s.patches]
        """The obstacle of each body beyond the touchers."""
        self._surfaces, self._patches = self._sorted()
        self.lease = self._lend()
        self._write_points()
        self._write_patches()
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

    def _sorted(self) -> tuple[list[Surface | None], list[NDArray[np.int64]]]:
        """Surfaces in the order in which they are written, None for a core, and the patches of
        points, triangles and edges, all counted from 0.
        """
        given: list[tuple[Surface | None, Floats, list[int]]] = []
        for toucher in self.touchers:
            points = toucher.surface.points
            given.append((toucher.surface, toucher.part.rest[points], [len(points)]))
        for standing in self.standings:
            counts = [b - a for a, b in standing.patches]
            given.append((standing.surface, standing.rest, counts))
        surfaces: list[Surface | None] = []
        owners: list[list[NDArray[np.int64]]] = [[], [], []]
        bodies = 0
        for surface, x, counts in given:
            owner = np.repeat(np.arange(bodies, bodies + len(counts)), counts)
            bodies += len(counts)
            owners[0].append(owner)
            if surface is not None:
                surface = sorted_surface(surface, x, owner)
                owners[1].append(owner[surface.triangles[:, 0]])
                owners[2].append(owner[surface.edges[:, 0]])
            surfaces.append(surface)
        return surfaces, [patches_of(np.concatenate(each)) for each in owners]

    def _lend(self) -> Lease:
        surfaces = [surface for surface in self._surfaces if surface is not None]
        cores = sum(len(s.local) for s in self.standings if s.surface is None)
        points = sum(len(s.points) for s in surfaces) + cores
        edges = sum(len(s.edges) for s in surfaces)
        bodies = len(self.touchers) + len(self.owners)
        self.room = (PAIRS_A_POINT * points, PAIRS_A_POINT * edges)
        of_points, of_faces, of_edges = (len(each) for each in self._patches)
        self.width = max(points, edges)
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
            places = np.concatenate([standing.local for standing in self.standings])
            self.fields.write_locals(self.standing, self._reals(places))

    def _write_patches(self) -> None:
        starts, first = self.lease.starts, self.lease.starts["patches"]
        self._own: list[NDArray[np.int64]] = []
        """Where each body's patches of a kind begin and end."""
        for kind, patches in zip(("points", "triangles", "edges"), self._patches, strict=True):
            self._own.append(ranges_of(patches, len(self.ranges)) + first)
            rows = patches + np.array([starts[kind], starts[kind], starts["bodies"]])
            self.fields.write_patches(first, _ints(rows))
            first += len(patches)

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

    def _write_bodies(self, apart: Sequence[tuple[str, str]]) -> None:
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
        self._may = self._who_may(apart)
        starts = self.lease.starts
        self.fields.write_bodies(
            starts["bodies"], traits, self._reals(numbers), starts["couples"], self._may.ravel()
        )

    def _who_may(self, apart: Sequence[tuple[str, str]]) -> NDArray[np.int32]:
        """Whether two of the bodies and obstacles may touch."""
        names = [toucher.name for toucher in self.touchers]
        meets = [toucher.meets_others for toucher in self.touchers]
        may = np.zeros((len(self.ranges), len(self.ranges)), np.int32)
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
            self._may[np.ix_(rows, rows)],
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
        length[f.THICK] = max(thick)
        length[f.LONGEST] = max(toucher.surface.longest for toucher in self.touchers)
        has_cores = any(s.surface is None for s in self.standings)
        length[f.TOLERANCE] = TOLERANCE * (FINER if has_cores else 1.0) * min(thick)
        length[f.LEAST], length[f.MOST] = (share * edge for share in MARGIN)
        own = [t.surface.edge for t in self.touchers if t.self_contact]
        if own:
            most = max(SELF_REACH * min(own) - max(thick), 0.1 * edge)
            length[f.LEAST : f.MOST + 1] = np.minimum(length[f.LEAST : f.MOST + 1], most)
        return length

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
        if (meet & (self._may[:count, :count] != 0)).any():
            return True
        for standing in self.standings:
            k = count + self.owners.index(standing)
            lo, hi = standing.boxes(times)
            near = ((low[:, None] <= hi) & (lo <= high[:, None])).all(axis=2).any(axis=1)
            if (near & (self._may[:count, k] != 0)).any():
                return True
        return False

    def may_overlap(self, world: Floats, time: float) -> bool:
        """Whether some of what may touch may be nearer at `time` [s] than it keeps (`may_meet`)."""
        thick = max(toucher.thickness for toucher in self.touchers)
        if self.may_meet(world, np.full(len(self.system.parts), thick), [time]):
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

        Args: deep: two of `ranges` and their depth below that distance [m].
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
            others = [t.name for i, t in enumerate(self.touchers) if i != k and self._may[k, i]]
            met = [s.number for i, s in enumerate(self.owners, count) if self._may[k, i]]
            found.append((toucher, others, sorted(set(met))))
        return found

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


def stands(obstacle: Any) -> bool:
    """Whether faces may meet it, not nodes alone."""
    return obstacle.core() is not None or obstacle.corners(1.0) is not None


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
    bodies = [part.body for part in system.parts if part.body.contact]
    meets = len(bodies) > 1 or any(touches_itself(body) for body in bodies)
    if not solid and not meets:
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
    touching = Touching(system, found, [pair.bodies for pair in scene.no_contact], standings)
    if fresh:
        touching.check_apart()
    return touching
