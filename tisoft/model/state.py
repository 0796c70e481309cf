# mypy: ignore-errors
"""The nodes of scenes, as Taichi fields: what moves, what pushes it, what holds it.

World positions are body origin + rest point + displacement: origins in f64 on the host, the others
here in the scene's precision.  A body at 10 km from the world's origin computes with the same
digits as one at 0.  Bodies are ranges of nodes; within a body nodes follow a Morton curve.
"""

from typing import ClassVar

import taichi as ti

from tisoft import runtime
from tisoft.model.placing import placer
from tisoft.obstacles.base import VELOCITY

CHUNK = 1024
"""Nodes whose energies are added up one after the other: sums do not depend on threads."""
RECORD = 11
"""Columns of a record: T [J], Σ m u (3) [kg m], elastic energy, dissipated energy, external work
[J], |u|² + |v|² (finite or not), power, contact's and friction's share of what is dissipated [J];
of a probe: u (3) [m], v (3) [m/s]."""
FRAMES = 64
"""Frames that a launch may make and record."""

A = ti.types.ndarray()
RANGES = 21
"""Columns of `State.ranges`: first and last node, then first and last part of each block."""
INPUTS = 16
"""Column of `State.ranges`: row of `Inputs.scene`, where something acts in time."""
TOUCH = 17
"""Column of `State.ranges`: first point of `Touch`, then one past the last."""
HELD_MEANS = 19
"""Column of `State.ranges`: first row of `Means`, then one past the last."""
ORDERS = (
    FIRST, LAST, PASSES, THREADS, LOADED, DONE, TRIPPED, PROBES, PROBE, RECORDS, CHUNKS, TASK,
    HAND, HELD, TELLS, EASES, SHOVED,
) = tuple(range(17))  # fmt: skip
"""Columns of `State.orders`; TELLS: whether stretches record the elastic energy;
EASES: whether bodies are pushed out of obstacles; SHOVED: the pass after that which last pushed a
node onto an obstacle, where a ledger is kept."""
MOVE, SUM, PUSH = range(3)
"""Tasks of a launch: make substeps; sum up the present state; leave its forces in the copies."""
POWER = 8
"""Column of a record: v·f [W] of elements and gravity, where the task is SUM."""
TOUCHED = 9
"""Columns of a record from here on: contact's and friction's share of what is dissipated."""
NOTED = [5, 6, TOUCHED, TOUCHED + 1]
"""Columns of a record that the account collects: energy dissipated, external work [J], and these
shares."""
TOUCH_SCENE = 14
"""Column of `State.ranges`: the scene's row of contact's fields."""
STEP, GRAVITY, MOST_KINETIC, KICK = 0, 1, 4, 5
"""Columns of `State.settings`."""
HANDS, HAND_NODES = 4, 32
"""Hands on the bodies of a scene, and nodes of each, at the most."""
SLACK = VELOCITY + 6
"""Column of an obstacle's numbers: how deep points that come out may still be in it [m]."""
OBSTACLE_NUMBERS = SLACK + 1
"""Columns of an obstacle's numbers, see `obstacles.base`."""
PRESSURE_NUMBERS = 7


@ti.data_oriented
class State:
    """Fields of nodes; a scene has a range of the rows of each kind.

    Args:
        structure: "f32" or "f64".
        rows: of each kind, see LEAST.
    """

    LEAST: ClassVar = {
        "nodes": 4096,
        "copies": 8192,
        "bodies": 64,
        "chunks": 64,
        "pressures": 8192,
        "obstacles": 4096,
        "probes": 64,
        "hands": 64 * HANDS,
        "records": 16 * FRAMES,
        "scenes": 64,
    }  # fmt: skip

    def __init__(self, structure: str, rows: dict[str, int]) -> None:
        self.precision = structure
        self.serial = runtime.on_cpu()
        """Copies run on the caller's thread: handing them over costs more."""
        self.rows = rows
        self.numpy_real, self.real = runtime.real_type(structure)
        real, wide = self.real, ti.f64 if runtime.has_f64() else ti.f32
        vec3 = ti.types.vector(3, real)
        builder, field = placer(rows)

        # A row a node (and one more a scene, where the last node's copies end):
        self.rest = field(vec3, "nodes")
        """Rest point relative to the body's origin, X − origin [m]."""
        self.displacement = field(vec3, "nodes")
        """u [m]."""
        self.velocity = field(vec3, "nodes")
        """v [m/s]."""
        self.carried = field(ti.types.vector(2, real), "nodes")
        """Impulse of an obstacle per mass in the last pass · velocity of its surface [m²/s²]; the
        same of its friction alone."""
        self.rubbed = field(vec3, "nodes")
        """What its friction did to the velocity [m/s]."""
        self.half = field(vec3, "nodes")
        """v(t + h/2) [m/s] of velocity Verlet."""
        self.saved_displacement = field(vec3, "nodes")
        """u [m] at the start of the frame."""
        self.saved_velocity = field(vec3, "nodes")
        """v [m/s] at the start of the frame."""
        self.inverse_mass = field(real, "nodes")
        """1/m of the lumped mass [1/kg]."""
        self.body = field(ti.i32, "nodes")
        """Row of its body."""
        self.fixed = field(ti.i32, "nodes")
        """Bits 1, 2, 4: the x, y, z components that pins hold."""
        self.drive = field(vec3, "nodes")
        """Velocity of the components that pins hold [m/s]."""
        self.load = field(vec3, "nodes")
        """Force of loads that keep their direction, and of torques [N]."""
        self.pressed = field(vec3, "nodes")
        """Force of pressures [N]."""
        self.pull = field(vec3, "nodes")
        """a of this substep [m/s²], where carried surfaces meet obstacles and a ledger is kept."""
        self.shove = field(vec3, "nodes")
        """Push onto an obstacle's surface in the last pass, by the seconds that forces acted [m/s],
        where a ledger is kept."""
        self.drawn = field(vec3, "nodes")
        """Force of hands [N]; 0 where none holds it."""
        self.pressure_start = field(ti.i32, "nodes")
        """Where its rows of `pressure_ends` begin."""
        self.copy_start = field(ti.i32, "nodes")
        """Where its copies begin."""
        self.work = field(ti.types.vector(2, wide), "nodes")
        """Energy dissipated at it and work done on it since the frame began [J]."""

        self.touched = field(ti.types.vector(2, wide), "nodes")
        """Of what was dissipated at it: by contact and by friction of surfaces [J]."""

        # A row for each part of a mesh that a node lies in, in part order:
        self.force = field(ti.types.vector(4, real), "copies")
        """Force of the part's elements on the node [N], and a 0: LLVM adds four at a time.  All 0
        between substeps.
        """

        # A row for each corner of a loaded face:
        self.pressure_ends = field(ti.types.vector(2, ti.i32), "pressures")
        """The face's two other nodes, seen counter-clockwise from outside."""
        self.pressure_numbers = field(real, "pressures", PRESSURE_NUMBERS)
        """X_j − X_i, X_k − X_i [m] and p c [Pa], see `external`."""

        # A row for each hand, see `grab`:
        self.hand_count = field(ti.i32, "hands")
        """How many nodes it holds."""
        self.hand_node = field(ti.i32, "hands", HAND_NODES)
        self.hand_weight = field(real, "hands", HAND_NODES)
        """Their rows and weights w."""
        self.hand_target = field(vec3, "hands")
        """What Σ w u is drawn to, y − Σ w X [m]."""
        self.hand_numbers = field(real, "hands", 3)
        """k [N/m], c [N s/m] and F [N]."""
        self.hand_force = field(vec3, "hands")
        """Σ f [N] in the last substep."""

        self.drag = field(real, "bodies")
        """Point damping [1/s] of each body."""
        self.obstacle_kind = field(ti.i32, "obstacles")
        """Kind of an obstacle, a row for each body and obstacle."""
        self.obstacle = field(real, "obstacles", OBSTACLE_NUMBERS)
        """Its numbers, seen from the body's origin."""
        self.obstacle_start = field(ti.i32, "bodies")
        """Where the body's rows of `obstacle` begin."""
        self.limit = field(real, "nodes")
        """Longest stable step by the node's tets [s], see `stable.bound`."""
        self.least_limit = field(real, "scenes")
        """The least of a scene's [s]."""
        self.inverted = field(ti.i32, "scenes")
        """Tets of a scene that are inside out."""
        self.probe = field(ti.i32, "probes")
        """Nodes whose path is recorded."""
        self.sums = field(wide, "chunks", RECORD)
        """Sums over CHUNK nodes."""
        self.record = field(wide, "records", RECORD)
        """What the last launch's frames came to: a row a frame, then one for each of its probes."""
        self.orders = field(ti.i32, "scenes", len(ORDERS))
        """What the next launch is to do, and what the last one did; columns above."""
        self.settings = field(wide, "scenes", 6)
        """Step [s], gravity [m/s²], kinetic energy [J] above which a launch stops."""
        self.ranges = field(ti.i32, "scenes", RANGES)
        """What belongs to a scene."""
        self.arrived = field(ti.i32, "scenes")
        """Threads that have come to the barrier."""
        self.tree = builder.finalize()
        self.vector, self.wide = vec3, wide
        self.Now = ti.types.struct(
            scene=ti.i32, number=ti.i32, h=real, kick=real, gravity=vec3, loaded=ti.i32,
            counts=ti.i32, opens=ti.i32, closes=ti.i32,
        )  # fmt: skip
        """Of a pass: its scene, its number in the stretch, step [s], seconds through which
        symplectic Euler's force acts, gravity [m/s²], whether loads act, whether bodies move and a
        ledger counts, whether velocity Verlet opens or closes a substep."""
        self.Moved = ti.types.struct(before=vec3, after=vec3, jump=vec3, way=vec3, push=vec3)
        """How a node moved: velocity before and after its kick, the jump of the velocity in contact
        [m/s], displacement, and push onto a surface [m]."""

    @staticmethod
    def bytes_of(structure: str, rows: dict[str, int]) -> int:
        """Memory that the fields take [bytes]."""
        real = 8 if structure == "f64" else 4
        nodes = rows["nodes"] * (36 * real + 5 * 4 + 32)
        copies = rows["copies"] * 4 * real
        return nodes + copies + rows["pressures"] * (8 + PRESSURE_NUMBERS * real)

    def destroy(self) -> None:
        """Free the memory; the fields are dead."""
        self.tree.destroy()

    @ti.kernel
    def write_nodes(self, first: int, rest: A, inverse_mass: A, body: A, copies: A):
        """Fill new rows of nodes, at rest; `copies` has one entry more than there are nodes."""
        ti.loop_config(serialize=self.serial)
        for k in range(rest.shape[0]):
            i = first + k
            for d in ti.static(range(3)):
                self.rest[i][d] = rest[k, d]
                self.displacement[i][d] = 0.0
                self.velocity[i][d] = 0.0
                self.half[i][d] = 0.0
                self.load[i][d] = 0.0
                self.drive[i][d] = 0.0
                self.pressed[i][d] = 0.0
                self.drawn[i][d] = 0.0
            self.carried[i] = ti.Vector([0.0, 0.0])
            self.inverse_mass[i] = inverse_mass[k]
            self.body[i] = body[k]
            self.fixed[i] = 0
            self.work[i] = ti.Vector([0.0, 0.0])
            self.touched[i] = ti.Vector([0.0, 0.0])
        ti.loop_config(serialize=self.serial)
        for k in range(copies.shape[0]):
            self.copy_start[first + k] = copies[k]
            self.pressure_start[first + k] = 0

    @ti.kernel
    def clear_copies(self, first: int, last: int):
        """Zero the forces of a scene's parts."""
        ti.loop_config(serialize=self.serial)
        for k in range(first, last):
            for d in ti.static(range(4)):
                self.force[k][d] = 0.0

    @ti.kernel
    def write_masses(self, first: int, inverse_mass: A):
        """Write 1/m [1/kg]."""
        ti.loop_config(serialize=self.serial)
        for k in range(inverse_mass.shape[0]):
            self.inverse_mass[first + k] = inverse_mass[k]

    @ti.kernel
    def write_motion(self, first: int, u: A, v: A):
        """Write u and v."""
        ti.loop_config(serialize=self.serial)
        for k in range(u.shape[0]):
            for d in ti.static(range(3)):
                self.displacement[first + k][d] = u[k, d]
                self.velocity[first + k][d] = v[k, d]

    @ti.kernel
    def read_motion(self, first: int, u: A, v: A):
        """Read u and v."""
        ti.loop_config(serialize=self.serial)
        for k in range(u.shape[0]):
            for d in ti.static(range(3)):
                u[k, d] = self.displacement[first + k][d]
                v[k, d] = self.velocity[first + k][d]

    @ti.kernel
    def shift(self, first: int, last: int, way: A):
        """Take `way` [m] off u."""
        ti.loop_config(serialize=self.serial)
        for i in range(first, last):
            for d in ti.static(range(3)):
                self.displacement[i][d] -= way[d]

    @ti.kernel
    def save(self, first: int, last: int):
        """Keep u and v."""
        ti.loop_config(serialize=self.serial)
        for i in range(first, last):
            self.saved_displacement[i] = self.displacement[i]
            self.saved_velocity[i] = self.velocity[i]

    @ti.kernel
    def restore(self, first: int, last: int):
        """Go back to the u and v that were kept."""
        ti.loop_config(serialize=self.serial)
        for i in range(first, last):
            self.displacement[i] = self.saved_displacement[i]
            self.velocity[i] = self.saved_velocity[i]

    @ti.kernel
    def write_fixed(self, first: int, fixed: A, drive: A):
        """Write what pins hold and how they move."""
        ti.loop_config(serialize=self.serial)
        for k in range(fixed.shape[0]):
            self.fixed[first + k] = fixed[k]
            for d in ti.static(range(3)):
                self.drive[first + k][d] = drive[k, d]

    @ti.kernel
    def write_places(self, first: int, nodes: A, axes: A, places: A):
        """Write components of u [m] of some nodes: those whose bits are set in `axes`."""
        ti.loop_config(serialize=self.serial)
        for k in range(nodes.shape[0]):
            for d in ti.static(range(3)):
                if axes[k] & (1 << d):
                    self.displacement[first + nodes[k]][d] = places[k, d]

    @ti.kernel
    def write_loads(self, first: int, load: A):
        """Write the forces of loads."""
        ti.loop_config(serialize=self.serial)
        for k in range(load.shape[0]):
            for d in ti.static(range(3)):
                self.load[first + k][d] = load[k, d]

    @ti.kernel
    def write_pressed(self, first: int, pressed: A):
        """Write the forces of pressures, as the last substep saw them."""
        ti.loop_config(serialize=self.serial)
        for k in range(pressed.shape[0]):
            for d in ti.static(range(3)):
                self.pressed[first + k][d] = pressed[k, d]

    @ti.kernel
    def read_loads(self, first: int, load: A, pressed: A):
        """Read the forces of loads and pressures."""
        ti.loop_config(serialize=self.serial)
        for k in range(load.shape[0]):
            for d in ti.static(range(3)):
                load[k, d] = self.load[first + k][d]
                pressed[k, d] = self.pressed[first + k][d]

    @ti.kernel
    def write_pressures(self, first: int, starts: A, row: int, ends: A,
        numbers: A,
    ):  # fmt: skip
        """Write the loaded faces' corners, from `row` on."""
        ti.loop_config(serialize=self.serial)
        for k in range(starts.shape[0]):
            self.pressure_start[first + k] = starts[k]
        ti.loop_config(serialize=self.serial)
        for k in range(ends.shape[0]):
            self.pressure_ends[row + k] = ti.Vector([ends[k, 0], ends[k, 1]])
            for c in ti.static(range(PRESSURE_NUMBERS)):
                self.pressure_numbers[row + k, c] = numbers[k, c]

    @ti.kernel
    def write_bodies(self, first: int, drag: A, obstacles: A):
        """Write the bodies' point damping and first obstacles."""
        ti.loop_config(serialize=self.serial)
        for k in range(drag.shape[0]):
            self.drag[first + k] = drag[k]
            self.obstacle_start[first + k] = obstacles[k]

    @ti.kernel
    def write_obstacles(self, first: int, kinds: A, numbers: A):
        """Write the obstacles' kinds and numbers."""
        ti.loop_config(serialize=self.serial)
        for k in range(kinds.shape[0]):
            self.obstacle_kind[first + k] = kinds[k]
            for c in ti.static(range(OBSTACLE_NUMBERS)):
                self.obstacle[first + k, c] = numbers[k, c]

    @ti.kernel
    def write_scene(self, scene: int, ranges: A, orders: A, probe: int, probes: A):
        """Write a scene's ranges and probes."""
        ti.loop_config(serialize=self.serial)
        for _ in range(1):
            for k in range(ranges.shape[0]):
                self.ranges[scene, k] = ranges[k]
            for k in range(orders.shape[0]):
                self.orders[scene, k] = orders[k]
            for k in range(probes.shape[0]):
                self.probe[probe + k] = probes[k]

    @ti.kernel
    def write_hand(self, hand: int, nodes: A, weights: A, numbers: A):
        """Write what a hand holds, its target, k, c and F."""
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.hand_count[hand] = nodes.shape[0]
            for k in range(nodes.shape[0]):
                self.hand_node[hand, k] = nodes[k]
                self.hand_weight[hand, k] = weights[k]
            for d in ti.static(range(3)):
                self.hand_target[hand][d] = numbers[d]
                self.hand_numbers[hand, d] = numbers[3 + d]

    @ti.kernel
    def let_go(self, first: int, last: int):
        """Take all hands' forces off the nodes."""
        ti.loop_config(serialize=self.serial)
        for i in range(first, last):
            self.drawn[i] = 0.0 * self.drawn[i]

    @ti.kernel
    def take_forces(self, first: int, out: A):
        """Read the nodes' forces, viscous shares included, and leave the copies at 0."""
        ti.loop_config(serialize=self.serial)
        for k in range(out.shape[0]):
            for q in range(self.copy_start[first + k], self.copy_start[first + k + 1]):
                for d in range(3):
                    out[k, d] += self.force[q][d]
                    self.force[q][d] = 0.0

    @ti.kernel
    def read_record(self, first: int, out: A):
        """Read records."""
        ti.loop_config(serialize=self.serial)
        for k in range(out.shape[0]):
            for c in range(out.shape[1]):
                out[k, c] = self.record[first + k, c]

    @ti.kernel
    def read_limits(self, first: int, out: A):
        """Read the nodes' longest stable steps."""
        ti.loop_config(serialize=self.serial)
        for k in range(out.shape[0]):
            out[k] = self.limit[first + k]
