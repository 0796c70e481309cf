"""A scene in the engine: its system, limits and watchers, and what its present state comes to."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import runtime
from tisoft.equilibrium.damping import damped_body
from tisoft.followed import Kept
from tisoft.gravity import changes, gravity_at, strongest
from tisoft.model import state as columns
from tisoft.model.number_range import check_bound, check_range
from tisoft.model.part import Part
from tisoft.model.system import System
from tisoft.moving import STILL, moves
from tisoft.obstacles import OBSTACLES
from tisoft.obstacles.base import NUMBERS
from tisoft.pushing_out import PushingOut
from tisoft.scene import Scene
from tisoft.stable.guard import Recovery
from tisoft.stable.limit import StepLimit
from tisoft.stable.watch import Watch
from tisoft.step.account import Account
from tisoft.step.grab import Hands
from tisoft.step.loading import Loading, external_forces
from tisoft.step.observe import energy_table
from tisoft.step.pins import Holder
from tisoft.step.schedule import Acting, Schedule, obstacle_signal
from tisoft.step.stepper import Rules, Stepper
from tisoft.touch.touching import touching_of

Floats = NDArray[np.float64]

AGAIN = 32
"""Substeps after which the stable step is looked at again, at the end of a frame."""


class Present:
    """The scene of a Simulation, which has the arguments, and its present state.

    Raises:
        SceneError: a scene that cannot run, with the field that says why.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        precision: str,
        certify: bool,
        threads: int | None,
        ledger: bool,
        interactive: bool = False,
    ) -> None:
        begun = time.perf_counter()
        self.scene = scene
        self.precision = precision
        self.certify = certify
        self.time = 0.0
        self.frame = 0
        self._rate = scene.frame_rate
        self.origin = (0, 0.0)
        """Frame and time [s] from which on frames have the present frame rate."""
        self.substeps = 0
        self.steps: list[float] = []
        self.recoveries: list[Recovery] = []
        self.half_step_lag = 0.0
        """The step [s] by half of which the system's velocities lag behind, or 0."""
        self.since_look = 0
        """Substeps since the limit was looked at."""
        self.next_look = 1
        """Substeps after which it is to be looked at again."""
        self.pushing = PushingOut(self)
        self.remade = False
        """Whether materials have changed since the last substep: the kick that leads from one step
        to another is of forces that both know."""
        self.wall_seconds = 0.0
        self._compiled = runtime.compile_seconds
        with np.errstate(all="ignore"):  # what leaves the range of floats is refused by name
            self.probed = [scene.probed(probe) for probe in scene.probes]
            probes = [(scene.bodies.index(p.body), int(row)) for p in self.probed for row in p.rows]
            bodies = [damped_body(body) for body in scene.bodies]
            self.system = System(bodies, precision, probes)
            check_range(self.system, scene)
            self.limit = StepLimit(self.system, scene.integrator)
            check_bound(self.limit.rest_bound(), self.system)
        self.watch = Watch(self.system, self.limit)
        self._kept = Kept(scene)
        self._kept.settled(scene)
        self._made_of = [body.made_of for body in scene.bodies]
        self._given_gravity = scene.gravity
        self.gravity_now = gravity_at(scene.gravity, 0.0)
        """Of the present state [m/s²], shape (3,): to it gravity energy is told."""
        self._obstacles: tuple[Any, ...] = ()
        self._set_start()
        self.account: Account | None = None
        self.touching = touching_of(scene, self.system)
        self.meets = False
        """Whether surfaces have come near each other: contact is compiled then, and stays."""
        self.loading = Loading(self.system)
        by_means = runtime.on_cpu() and scene.integrator != "explicit-euler"
        self.holder = Holder(self.system, by_means=by_means)
        self.schedule = Schedule(self.system)
        self.is_interactive = interactive
        if interactive:
            self.limit.sharpens = False
            if scene.obstacles or any(body.pins for body in scene.bodies):
                self.schedule.acting = Acting()  # any of them may be moved
        self.hands = Hands(self.system)
        self._threads = threads
        self._compile(ledger)
        self._made_seconds = time.perf_counter() - begun - self.compile_seconds

    def _compile(self, ledger: bool) -> None:
        self._obstacles = tuple(self.scene.obstacles)
        self.pushing.begin()
        self.place_obstacles()
        self.look_for_contact()
        self.account = Account(0.0) if ledger else None
        self.holder.begin(0.0, 0.0)
        self.stepper = self._make_stepper()
        self._set_inputs()
        self.limit.follow()
        self.stepper.compile()
        self.pushing.ease()
        if ledger:
            self.open_account()

    @property
    def compile_seconds(self) -> float:
        """Seconds that compiling kernels has taken since this simulation was begun."""
        return runtime.compile_seconds - self._compiled

    @property
    def setup_seconds(self) -> float:
        """Seconds of numbering, uploading and certifying the step; neither compiling nor stepping
        is in it.
        """
        return self._made_seconds + self.limit.certifying_seconds

    def _make_stepper(self) -> Stepper:
        stepper = Stepper(self.system, self._rules(), threads=self._threads, schedule=self.schedule)
        stepper.loaded = self._is_loaded()
        return stepper

    @property
    def shakes(self) -> bool:
        """Whether gravity changes by itself."""
        return changes(self.scene.gravity)

    def _set_inputs(self) -> None:
        """Take anew what acts in time; makes another stepper where it needs other kernels."""
        acting = None
        pins = [pin for part in self.system.parts for pin in part.body.pins]
        # A scene that was driven once stays so: others' kernels would have to be compiled first.
        timed = self.loading.changes or self.moves_obstacles or self.shakes
        timed = timed or any(pin.moves for pin in pins)
        if self.schedule.acting or timed:
            acting = Acting()
            for part, pin, rows in self.holder.moved:
                acting.add_pin(part, pin, rows)
            self.holder.patches.write(acting.pins)
            if self.loading.changes or self.shakes:
                self.loading.act(acting)
            if self.shakes:
                acting.add_gravity(self.system, self.scene.gravity, lambda: self.gravity_now)
            self._act_obstacles(acting)
        self.loading.write()
        self.schedule.set(acting)
        structure = self.stepper.structure
        known, now = (structure.inputs, structure.means), (self.schedule.fields, self._means)
        if any(a is not b for a, b in zip(known, now, strict=True)):
            self.stepper = self._make_stepper()
            self.stepper.compile()

    def _act_obstacles(self, acting: Acting) -> None:
        for part in self.system.parts:
            for o, obstacle in enumerate(self._obstacles):
                if moves(obstacle):
                    row = self.system.obstacle_row(part, o)
                    signal = acting.signal(obstacle_signal(obstacle, part), NUMBERS + 6)
                    acting.moved.append((row, signal))

    def _rules(self) -> Rules:
        contact = bool(self.scene.obstacles)
        touching = self.touching if self.meets else None
        ledger = self.account is not None
        return Rules(self.scene.integrator, contact, ledger, touching, self._means)

    @property
    def _means(self) -> Any:
        """Fields of patches that are held by means of cells, or None."""
        return self.holder.patches.fields

    def look_for_contact(self) -> None:
        """See whether surfaces may touch before the state is looked at again: until then a body
        travels by half its size at the most (`Motion`), or through a frame.
        """
        if self.touching is None or self.meets:
            return
        time = 1.0 / self.scene.frame_rate
        speed = np.linalg.norm(self.system.motion()[1], axis=1)
        fall = 0.5 * time * time * strongest(self.scene.gravity)
        reach = [p.size + time * float(speed[p.nodes].max()) + fall for p in self.system.parts]
        times = (self.time, self.time + time)
        self.meets = self.touching.meetings.may_meet(self.system.world(), np.array(reach), times)

    def _set_start(self) -> None:
        """Initial velocities: v + ω × (x − centre of mass)."""
        v = np.zeros((self.system.count, 3))
        for part in self.system.parts:
            x = self.system.rest_host[part.nodes]
            middle = part.mass @ x / part.mass.sum()
            v[part.nodes] = part.body.velocity + np.cross(part.body.spin, x - middle)
        if v.any():
            self.system.set_motion(np.zeros_like(v), v)

    def open_account(self) -> None:
        """Begin a ledger with the present state."""
        table = self._table(self.gravity_now)
        self.account = Account(sum(table.values()), touches=self.touching is not None)

    def place_obstacles(self) -> None:
        """Tell the kernels where obstacles are, seen from the bodies' origins."""
        self._obstacles = tuple(self.scene.obstacles)
        if self._obstacles:
            shapes = list(OBSTACLES.values())
            kinds = [shapes.index(type(o)) for o in self._obstacles]
            speeds = self.pushing.table(len(self._obstacles))
            self.system.set_obstacles(self._obstacles, kinds, self.time, speeds)
            self.system.order("orders", columns.EASES, int((speeds < STILL).any()))
        if self.touching is not None:
            self.touching.place_origins()

    @property
    def moves_obstacles(self) -> bool:
        """Whether an obstacle moves by itself."""
        return any(moves(obstacle) for obstacle in self._obstacles)

    def time_of(self, frame: int) -> float:
        """When a frame from now on, or of those just made, ends [s]."""
        first, since = self.origin
        return since + (frame - first) / self.scene.frame_rate

    def shake(self, end: float) -> None:
        """Take the gravity of the end of a stretch [s]: the work of that is external."""
        if self.shakes:
            with self._as_external_work():
                self.gravity_now = gravity_at(self.scene.gravity, end)

    @contextmanager
    def _as_external_work(self) -> Iterator[None]:
        """Book what the block gives to the stored energy as work from outside."""
        before = self._stored() if self.account is not None else 0.0
        yield
        if self.account is not None:
            self.account.external_work += self._stored() - before

    def _is_loaded(self) -> bool:
        return self.loading.acts or self.shakes or bool(self.hands.held)

    def _stored(self) -> float:
        """T + W + G [J] of the present state, under the gravity that was known last."""
        return sum(self._table(self.gravity_now).values())

    def _table(self, gravity: Any) -> dict[str, float]:
        """Kinetic, elastic and gravity energy [J] of the present state under `gravity` [m/s²]."""
        return energy_table(self.system, self.stepper.measure(gravity), gravity)

    # -- the present state ---------------------------------------------------------------------

    def is_driven(self) -> bool:
        """Whether loads, hands, moved pins or obstacles do work on the bodies."""
        loads = any(part.body.loads for part in self.system.parts)
        moved = self.holder.is_moving or self.moves_obstacles or self.pushing.goes_on or self.shakes
        return moved or loads or bool(self.hands.held)

    def remedies(self) -> str:
        """What may help a scene that no step carries: of what it contains."""
        found = ["move pins more slowly"] if self.holder.is_moving else []
        if any(part.body.loads for part in self.system.parts):
            found.append("make loads smaller")
        if self.moves_obstacles:
            found.append("move obstacles more slowly")
        if self.shakes:
            found.append("let gravity change more slowly")
        if self.pushing.goes_on:
            found.append("place bodies clear of obstacles")
        laws = [part.law for part in self.parts if part.law is not None and part.law.is_finite]
        if not all(getattr(law, "stands_compression", False) for law in laws):
            found.append('take model = "neo-hookean", which stands compression')
        return ", ".join([*found, "make the material stiffer", "or mend the element"])

    def acceleration(self) -> Floats:
        """Acceleration of all nodes [m/s²] in the present state, shape (nodes, 3), internal order;
        0 on held axes.
        """
        system = self.system
        force = self.stepper.forces()
        if self.loading.pressure or self.loading.loads:
            force += external_forces(system.parts, self.time, system.world())
        a = force / system.mass[:, None] + self.gravity_now
        drag = np.array([part.body.model.point_damping for part in system.parts])
        a -= drag[system.body][:, None] * system.v
        a[(self.holder.held[:, None] & np.array([1, 2, 4])) != 0] = 0.0
        return self.holder.patches.project(a)

    def whole_velocities(self) -> Floats:
        """Velocities [m/s] of all nodes at the present time, shape (nodes, 3), internal order."""
        v = self.system.v.astype(np.float64)
        if self.half_step_lag:  # the scheme's velocity lives half a step earlier
            v += 0.5 * self.half_step_lag * self.acceleration()
        return v

    def energies(self) -> dict[str, float]:
        """Kinetic, elastic and gravity energy [J]."""
        table = self._table(self.gravity_now)
        if self.half_step_lag:
            squares = (self.whole_velocities() ** 2).sum(axis=1)
            table["kinetic"] = 0.5 * float(self.system.mass @ squares)
        return table

    def present(self) -> tuple[dict[str, float], float]:
        """Energies [J] of the present state, and the power v·f [W] of all conservative forces."""
        if not self.half_step_lag:
            record = self.stepper.measure(self.gravity_now)
            table = energy_table(self.system, record, self.gravity_now)
            return table, float(record[columns.POWER])
        f = self.stepper.forces()
        f += self.system.mass[:, None] * self.gravity_now
        return self.energies(), float(np.einsum("ij,ij->", self.whole_velocities(), f))

    def fallen(self, number: int) -> float:
        """Energy [J] that gravity has given from the rest positions to the end of stretch `number`
        of the last launch.
        """
        record = self.stepper.records(number + 1)[number, 0]
        return -energy_table(self.system, record, self.gravity_now)["gravity"]

    @property
    def parts(self) -> list[Part]:
        """The bodies' shares of the arrays."""
        return self.system.parts
