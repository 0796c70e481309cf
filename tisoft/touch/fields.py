# mypy: ignore-errors
"""What contact of surfaces needs, as Taichi fields: points, triangles, edges, candidates.

A point is a node on a surface, or a corner of an obstacle.  A pair is a candidate: a point and a
triangle, or two edges.  Its row says what keeps the two apart in the present substep:

    Σ w_k v_k · n ≥ target,    impulses w_k (λ n + λ_t) on its four points
"""

from typing import Any, ClassVar

import taichi as ti

from tisoft import runtime

A = ti.types.ndarray()

(POINT, POINT_END, TRIANGLE, TRIANGLE_END, EDGE, EDGE_END, BODY, BODY_END, PAIR, FACE_ROOM,
 EDGE_ROOM, POINT_PATCH, FACE_PATCH, EDGE_PATCH, PATCH_END, NODE, COUPLE, CANDIDATE, WIDTH, THREAD,
 COUNT, BUILT, BUILDS, FULL, SWEEPS, ROWS, STANDING, CORES, MOVING, ISLANDS,
 WORK, AWAKE, WASTED, ORDERS) = range(34)  # fmt: skip
"""Columns of `Touch.order`: where a scene's rows begin and end; candidates found; threads of the
last search, 0 where it is out of date; searches; whether candidates found no room; sweeps and rows
so far; first point and first core of obstacles, and whether those move; islands now;
what the last search had to do, in tests of two boxes, how many pairs were awake after it, −1 where
not known yet, and what more of them have cost since.  Patches are of points, of triangles, of
edges; each thread has WIDTH rows of `candidate`."""
LEAST, MOST, THICK, THIN, LONGEST, SHRUNK, TOLERANCE, SUNK, LEFT, RATE, LENGTHS = range(11)
"""Columns of `Touch.length` [m]: least and most margin, largest and least thickness, bodies'
longest edge, share of the margins that had room (1), residual that ends the sweeps; most of
`Touch.sunk`, the share of it that is left (1), and how fast that falls [1/s].
"""
(SOLID, SELF, OBSTACLE, ROUND, BARE, ROW, FIRST, LAST, NEAR, OWN_POINTS, _, OWN_EDGES, _,
 TRAITS) = range(14)  # fmt: skip
"""Columns of `Touch.trait`: whether it is an obstacle, the kind of core that it is, whether points
leave its triangles alone, its row of `State.obstacle`; how many bodies are near; where its patches
of points and edges begin, and end."""
BEGIN, END, OWNER, KIN, KIN_END = range(5)
"""Columns of `Touch.patch`: its rows, its body, and its rows of `kin`."""
HALF, FRICTION, DEPTH, SHARE, EASE, GROW, AHEAD, NUMBERS = range(8)
"""Columns of `Touch.number`: half the thickness, or a core's radius [m], Coulomb's coefficient,
depth of push [m], share that it takes of the other's half, most of a penetration that counts, how
far it reaches beyond its points [m]; the most of its points' `ahead` [m]."""
(FACE_START, FACE_STOP, EDGE_START, EDGE_STOP, FACES_NEAR, EDGES_NEAR, FACE_BEGIN, _, EDGE_BEGIN,
 _, SEGMENTS) = range(11)  # fmt: skip
"""Columns of `Touch.segment`: each thread's pairs, how many of them have rows, and where its
patches of triangles and edges begin, and end."""
WORST, STALE, BLOWN, GONE, FOUND, _, _, LOOKED, SWING, FLUNG, MOSTS = range(11)
"""Columns of `Touch.most`: each thread's maxima, whether a body has blown up, what each task of
`find_rows` has found, pairs awake, the velocity to which contact has thrown a point at the most
[m/s], and whether a point is kicked harder than pairs are looked for."""


@ti.data_oriented
class Touch:
    """Fields of contact; a scene has a range of the rows of each kind.

    Args:
        structure: "f32" or "f64".
        rows: of each kind, see LEAST.
    """

    LEAST: ClassVar = {
        "points": 2048,
        "nodes": 4096,
        "triangles": 4096,
        "fans": 12288,
        "edges": 1024,
        "pairs": 32768,
        "bodies": 64,
        "couples": 1024,
        "patches": 2048,
        "kins": 4096,
        "candidates": 4096,
        "threads": 64,
        "scenes": 16,
    }  # fmt: skip

    def __init__(self, structure: str, rows: dict[str, int]) -> None:
        self.serial = runtime.on_cpu()
        self.real = real = runtime.real_type(structure)[1]
        self.wide = wide = ti.f64 if runtime.has_f64() else ti.f32
        vec3 = ti.types.vector(3, real)
        builder = ti.FieldsBuilder()

        def field(kind: Any, count: str, *more: int) -> Any:
            made = kind.field() if hasattr(kind, "field") else ti.field(kind)
            axes = [ti.i, ti.ij][len(more)]
            builder.dense(axes, (rows[count], *more)).place(made)
            return made

        self.point = field(ti.i32, "nodes")
        """Row of a node's point, −1 for none."""
        self.acceleration = field(vec3, "nodes")
        """Without contact [m/s²]."""
        self.force = field(vec3, "nodes")
        """Of the elements [N]."""

        self.body = field(ti.i32, "points")
        """Row of its body."""
        self.place = field(vec3, "points")
        """From its body's origin [m]."""
        self.local = field(vec3, "points")
        """Of an obstacle: the same in its own coordinates."""
        self.listed = field(vec3, "points")
        """The same at the last search [m]."""
        self.seen = field(vec3, "points")
        """From the scene's middle at the last search [m]."""
        self.ahead = field(real, "points")
        """Its share of a pair's margin [m]."""
        self.facing = field(vec3, "points")
        """Unit normal, as last seen, of bodies that touch themselves; 0 where there is none."""
        self.allowed = field(real, "points")
        """Way that it may go before the next search [m]."""
        self.gone = field(real, "points")
        """Way that it will have gone since the last search at the substep's end [m]."""
        self.velocity = field(vec3, "points")
        """[m/s]."""
        self.kicked = field(vec3, "points")
        """Before contact [m/s]."""
        self.under = field(vec3, "points")
        """By how much contact has made it slower, in any look at this substep, each axis [m/s]."""
        self.over = field(vec3, "points")
        """The same, faster."""
        self.swung = field(ti.i32, "points")
        """Whether contact has thrown it, in the last look at this substep."""
        self.sent = field(real, "points")
        """Speed up to which its pairs are looked for [m/s]."""
        self.held = field(ti.i32, "points")
        """Bits of axes that do not answer to impulses."""
        self.stop = field(vec3, "points")
        """Normal of the obstacle that stops it first."""
        self.bound = field(real, "points")
        """Velocity along that which it has at least [m/s]; −1e30 for no obstacle."""
        self.surface = field(vec3, "points")
        """Velocity of that obstacle's surface there [m/s]."""
        self.hold = field(real, "points")
        """Its friction."""
        self.stopped = field(ti.i32, "points")
        """Whether it is stopped, in sweeps: 1 where it slides, 2 where it sticks."""
        self.inverse_mass = field(real, "points")
        """[1/kg]; 0 for what is held or an obstacle's."""
        self.weight = field(real, "points")
        """S = Σ |w| over the rows that it is part of."""
        self.met = field(ti.i32, "points")
        """Whether it is part of a row."""
        self.thrust = field(vec3, "points")
        """Impulse of contact on it [N s], in sweeps."""
        self.pushed = field(vec3, "points")
        """Impulse of contact on it [N s], along normals."""
        self.rubbed = field(vec3, "points")
        """Impulse of friction on it [N s]."""
        self.carried = field(ti.types.vector(2, real), "points")
        """Work from outside on it [J], along normals and by friction."""
        self.root = field(ti.i32, "points")
        """Another point of its island, or itself; −1 once its island is solved."""
        self.number_of = field(ti.i32, "points")
        """Of a root: number of its island, −1 where it has none yet."""
        self.slot_start = field(ti.i32, "points")
        """Where its rows of `slot` begin."""
        self.fan_start = field(ti.i32, "points")
        """Where its rows of `fan` begin."""

        self.triangle = field(ti.i32, "triangles", 3)
        """Points, counter-clockwise from outside."""
        self.owned = field(ti.i32, "triangles")
        """See `Surface.owned`."""
        self.across = field(ti.i32, "triangles", 3)
        """See `Surface.across`."""
        self.fan = field(ti.i32, "fans", 2)
        """See `Surface.fan`."""
        self.edge = field(ti.i32, "edges", 2)
        """Ends."""
        self.ball = field(ti.types.vector(4, real), "edges")
        """Around it, as last seen: middle and radius [m]."""
        self.sides = field(ti.i32, "edges", 2)
        """See `Surface.sides`."""

        self.ends = field(ti.i32, "pairs", 4)
        """Its points: a point and a triangle's, or two of each edge."""
        self.item = field(ti.i32, "pairs", 2)
        """Triangle and −1, or two edges."""
        self.distance = field(real, "pairs")
        """At the last search [m]."""
        self.side = field(ti.i32, "pairs")
        """Of a sheet: where the point was last seen, 1 or −1; 0 where not yet."""
        self.behind = field(real, "pairs")
        """How deep it is [m], −1e30 where it does not count; known while bodies are pushed out."""
        self.slot = field(ti.i32, "pairs", 4)
        """4 pair + corner, by point; four to a row; known while bodies are pushed out."""

        # Rows of the present substep, each thread's one after the other.
        self.corner = field(ti.i32, "pairs", 4)
        """Its points."""
        self.share = field(real, "pairs", 4)
        """w."""
        self.normal = vec3.field()
        """n."""
        self.target = ti.field(real)
        """[m/s]."""
        self.mass = ti.field(real)
        """1/P [kg], 0 where its points are held."""
        self.loose = ti.field(real)
        """The same along the surfaces, where no obstacle stops its points."""
        self.impulse = ti.field(real)
        """λ [N s]."""
        self.grip = vec3.field()
        """λ_t [N s]."""
        self.drift = vec3.field()
        """Velocity [m/s] of an obstacle's surface beyond that of its points, turned round."""
        self.rough = ti.field(real)
        """μ."""
        self.outside = ti.field(real)
        """The share of `target` whose work is from outside [m/s]."""
        # What a sweep reads of a row stands side by side.
        builder.dense(ti.i, rows["pairs"]).place(
            self.normal, self.target, self.mass, self.loose, self.impulse, self.grip, self.drift,
            self.rough, self.outside,
        )  # fmt: skip
        self.island = field(ti.i32, "pairs")
        """Of a row: the row of its island."""
        self.island_end = field(ti.i32, "pairs")
        """Where an island's rows of `queue` end; islands stand one after the other."""
        self.queue = field(ti.i32, "pairs")
        """Rows by islands."""

        self.patch = field(ti.i32, "patches", 5)
        self.kin = field(ti.i32, "kins")
        """Patches that it does not touch while neither bends, see `patches`."""
        self.patch_low = field(vec3, "patches")
        """Its box [m]."""
        self.patch_high = field(vec3, "patches")
        self.block_low = field(vec3, "patches")
        """Box of the patches from one on that are left out together [m]."""
        self.block_high = field(vec3, "patches")
        self.patch_speed = field(real, "patches")
        """Of its fastest point [m/s]."""
        self.patch_ahead = field(real, "patches")
        """The most of its points' [m]."""
        self.patch_axis = field(vec3, "patches")
        """Mean of its normals, a unit vector; known of bodies that touch themselves."""
        self.patch_spread = field(real, "patches")
        """How far its normals are from that at the most (chords of the unit ball)."""
        self.patch_work = field(ti.i32, "patches")
        """What the last search had to do for it, in tests of two boxes."""
        self.candidate = field(ti.i32, "candidates")
        """Each thread's points, or edges, near a patch of triangles, or edges."""
        self.group = field(ti.i32, "candidates", 2)
        """In the first row of those of a patch: the row after the last, and the patch."""
        self.reach = field(real, "candidates")
        """In the same row: distance [m] up to which those make pairs."""
        self.trait = field(ti.i32, "bodies", TRAITS)
        self.number = field(real, "bodies", NUMBERS)
        self.spin = field(vec3, "bodies")
        """ω of an obstacle [1/s]."""
        self.origin = field(ti.types.vector(3, wide), "bodies")
        """From the scene's middle [m]."""
        self.low = field(vec3, "bodies")
        """Box of a body's points [m]."""
        self.high = field(vec3, "bodies")
        self.may = field(ti.i32, "couples")
        """Whether two bodies may touch, row by row."""
        self.partner = field(ti.i32, "couples")
        """Bodies near each, from its first row on."""
        self.sunk = field(real, "couples")
        """How deep they were in each other when pushing them out began [m]."""
        self.segment = field(ti.i32, "threads", SEGMENTS)
        self.most = field(real, "threads", MOSTS)
        self.order = field(ti.i32, "scenes", ORDERS)
        self.length = field(wide, "scenes", LENGTHS)
        self.tree = builder.finalize()

    @staticmethod
    def bytes_of(structure: str, rows: dict[str, int]) -> int:
        """Memory that the fields take [bytes]."""
        real = 8 if structure == "f64" else 4
        points = rows["points"] * (52 * real + 36) + rows["nodes"] * (6 * real + 4)
        points += rows["edges"] * (4 * real + 16) + rows["kins"] * 4
        return points + rows["triangles"] * 28 + rows["fans"] * 8 + (
            rows["pairs"] * (21 * real + 72) + rows["patches"] * (18 * real + 24)
        )  # fmt: skip

    def destroy(self) -> None:
        """Free the memory; the fields are dead."""
        self.tree.destroy()

    @ti.kernel
    def write_points(self, first: int, body: A, fan_start: A, node: int, rows: A):
        """Write bodies and fans of points, and the point of each node from row `node` on."""
        ti.loop_config(serialize=self.serial)
        for k in range(body.shape[0]):
            self.body[first + k] = body[k]
            self.fan_start[first + k] = fan_start[k]
            self.inverse_mass[first + k] = 0.0
            self.velocity[first + k] = ti.Vector([0.0, 0.0, 0.0])
            self.met[first + k] = 0
            self.bound[first + k] = -1e30
        ti.loop_config(serialize=self.serial)
        for k in range(fan_start.shape[0] - body.shape[0]):
            self.fan_start[first + body.shape[0] + k] = fan_start[body.shape[0] + k]
        ti.loop_config(serialize=self.serial)
        for k in range(rows.shape[0]):
            self.point[node + k] = rows[k]

    @ti.kernel
    def write_faces(self, first: int, triangles: A, owned: A, across: A, fan_first: int, fan: A):
        """Write triangles and fans."""
        ti.loop_config(serialize=self.serial)
        for k in range(triangles.shape[0]):
            self.owned[first + k] = owned[k]
            for d in ti.static(range(3)):
                self.triangle[first + k, d] = triangles[k, d]
                self.across[first + k, d] = across[k, d]
        ti.loop_config(serialize=self.serial)
        for k in range(fan.shape[0]):
            for d in ti.static(range(2)):
                self.fan[fan_first + k, d] = fan[k, d]

    @ti.kernel
    def write_edges(self, first: int, edges: A, sides: A):
        """Write edges."""
        ti.loop_config(serialize=self.serial)
        for k in range(edges.shape[0]):
            for d in ti.static(range(2)):
                self.edge[first + k, d] = edges[k, d]
                self.sides[first + k, d] = sides[k, d]

    @ti.kernel
    def write_patches(self, first: int, patches: A):
        """Write patches."""
        ti.loop_config(serialize=self.serial)
        for k in range(patches.shape[0]):
            for d in ti.static(range(5)):
                self.patch[first + k, d] = patches[k, d]

    @ti.kernel
    def write_kin(self, first: int, kin: A):
        """Write patches that are kin."""
        ti.loop_config(serialize=self.serial)
        for k in range(kin.shape[0]):
            self.kin[first + k] = kin[k]

    @ti.kernel
    def write_bodies(self, first: int, traits: A, numbers: A, couple: int, may: A):
        """Write bodies, and which of them may touch."""
        ti.loop_config(serialize=self.serial)
        for k in range(traits.shape[0]):
            for d in range(traits.shape[1]):
                self.trait[first + k, d] = traits[k, d]
            for d in range(numbers.shape[1]):
                self.number[first + k, d] = numbers[k, d]
        ti.loop_config(serialize=self.serial)
        for k in range(may.shape[0]):
            self.may[couple + k] = may[k]
            self.sunk[couple + k] = 0.0

    @ti.kernel
    def write_origins(self, first: int, origins: A):
        """Write where bodies' origins are, from the scene's middle [m]."""
        ti.loop_config(serialize=self.serial)
        for k in range(origins.shape[0]):
            for d in ti.static(range(3)):
                self.origin[first + k][d] = origins[k, d]

    @ti.kernel
    def write_scene(self, scene: int, order: A, length: A):
        """Write a scene's columns."""
        ti.loop_config(serialize=self.serial)
        for _ in range(1):
            for k in range(order.shape[0]):
                self.order[scene, k] = order[k]
            for k in range(length.shape[0]):
                self.length[scene, k] = length[k]

    @ti.kernel
    def write_sunk(self, first: int, depths: A):
        """Write how deep couples are in each other [m]."""
        ti.loop_config(serialize=self.serial)
        for k in range(depths.shape[0]):
            self.sunk[first + k] = depths[k]

    @ti.kernel
    def read_sunk(self, first: int, depths: A):
        """The same, told."""
        ti.loop_config(serialize=self.serial)
        for k in range(depths.shape[0]):
            depths[k] = self.sunk[first + k]

    @ti.kernel
    def write_locals(self, first: int, places: A):
        """Write places of obstacles' points in their own coordinates."""
        ti.loop_config(serialize=self.serial)
        for k in range(places.shape[0]):
            for d in ti.static(range(3)):
                self.local[first + k][d] = places[k, d]
            self.held[first + k] = 7

    @ti.kernel
    def write_rows(self, first: int, rows: A):
        """Write where obstacles' numbers are, one body after the other."""
        ti.loop_config(serialize=self.serial)
        for k in range(rows.shape[0]):
            self.trait[first + k, ROW] = rows[k]
