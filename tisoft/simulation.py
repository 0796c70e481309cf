"""A running scene: frames, state in and out, energies, the stable step."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import resume, runtime
from tisoft.body import Body
from tisoft.checks import FieldError
from tisoft.dynamics import nodes
from tisoft.dynamics.damping import damped_body
from tisoft.dynamics.energy import Energies, Forces
from tisoft.dynamics.flags import Flags
from tisoft.dynamics.guard import Guard, Recovery
from tisoft.dynamics.hold import Holder
from tisoft.dynamics.ledger import Ledger
from tisoft.dynamics.loading import Loading, external_forces
from tisoft.dynamics.modes import Mass, Modes, natural_modes
from tisoft.dynamics.number_range import check_bound, check_range
from tisoft.dynamics.obstacles import obstacle_kinds, obstacle_shapes
from tisoft.dynamics.part import Part
from tisoft.dynamics.reactions import reactions
from tisoft.dynamics.statics import Equilibrium, equilibrium
from tisoft.dynamics.step_limit import StepLimit
from tisoft.dynamics.stepper import Stepper
from tisoft.dynamics.system import System
from tisoft.dynamics.watch import Watch
from tisoft.measures.measures import Measures
from tisoft.models.consistent_mass import ITERATIONS, residual_share
from tisoft.scene import Scene

Floats = NDArray[np.float64]

INTEGRATORS = {
    "symplectic-euler": nodes.SYMPLECTIC_EULER,
    "velocity-verlet": nodes.VELOCITY_VERLET,
    "explicit-euler": nodes.EXPLICIT_EULER,
}


LOOK, LOOK_WORK = 128, 30_000
"""Substeps, or tet-substeps in small scenes, after which the stable step and the guard look at the
bodies again even within a frame."""


MOST_SUBSTEPS = 1e9
"""Substeps that a frame may have: hours of stepping, before which no frame would be seen."""


@dataclass(frozen=True)
class Frame:
    """What an observer sees: the simulation at the end of one frame."""

    simulation: Simulation
    index: int
    time: float
    """[s]"""

    def positions(self, body: Body | None = None) -> Floats:
        """World positions [m], shape (nodes, 3), in the mesh's node order."""
        return self.simulation.positions(body)

    def velocities(self, body: Body | None = None) -> Floats:
        """Velocities [m/s], shape (nodes, 3), in the mesh's node order."""
        return self.simulation.velocities(body)


class Simulation:
    """A scene that runs.

    Args:
        scene: read again between frames: gravity, materials, pins and loads may change.
        arch: "cpu", "cuda", "metal", "vulkan" or "auto".
        precision: "f32" or "f64"; left out, the scene's.
        certify: False takes any step and checks nothing: to show how things fail.
        threads: CPU threads; left out, chosen by the scene's size and the machine's load.
        ledger: keep account of dissipated energy and external work (a seventh slower, a third
            where there is viscosity).

    Raises:
        SceneError: a scene that cannot run, with the field that says why.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        arch: str = "cpu",
        precision: str | None = None,
        certify: bool = True,
        threads: int | None = None,
        ledger: bool = False,
    ) -> None:
        begun = time.perf_counter()
        scene.validate()
        self.scene = scene
        self.arch = runtime.start(arch)
        self.precision = precision or scene.precision
        self.certify = certify
        self.time = 0.0
        self.frame = 0
        self.substeps = 0
        self.steps: list[float] = []
        self.recoveries: list[Recovery] = []
        self.half_step_lag = 0.0
        """The step [s] by half of which the system's velocities lag behind, or 0."""
        self.wall_seconds = 0.0
        _check_half_step(scene)
        with np.errstate(all="ignore"):  # what leaves the range of floats is refused by name
            self.system = System([damped_body(body) for body in scene.bodies], self.precision)
            check_range(self.system, scene)
            self.limit = StepLimit(self.system, INTEGRATORS[scene.integrator])
            check_bound(self.limit.rest_bound(), self.system)
        self.watch = Watch(self.system, self.limit)
        self._models = [body.model for body in scene.bodies]
        self._gravity = tuple(scene.gravity)
        self._set_start()
        self.compile_seconds = 0.0
        self.guard = Guard(self) if certify else None
        self._ledger: Ledger | None = None
        self.ledger = ledger
        self._make_stepper(threads)
        self.start_seconds = time.perf_counter() - begun - self.compile_seconds

    @property
    def warnings(self) -> list[str]:
        """What the run has told so far that a user should know, a sentence each."""
        return self.watch.warnings()

    # -- state ---------------------------------------------------------------------------------

    @property
    def parts(self) -> list[Part]:
        """The bodies' shares of the arrays."""
        return self.system.parts

    def positions(self, body: Body | None = None) -> Floats:
        """World positions [m], shape (nodes, 3): one body's, or all in the scene's order."""
        return self._outside(self.system.world(), body)

    def velocities(self, body: Body | None = None) -> Floats:
        """Velocities [m/s], shape (nodes, 3): one body's, or all in the scene's order."""
        return self._outside(self._velocities(), body)

    def _velocities(self) -> Floats:
        """Velocities [m/s] of all nodes, inside order."""
        v = np.array(runtime.read(self.system.v), np.float64)
        if self.half_step_lag:  # the scheme's velocity lives half a step earlier
            v += 0.5 * self.half_step_lag * self._acceleration()
        return v

    def set_state(self, positions: Any, velocities: Any) -> None:
        """Set all world positions [m] and velocities [m/s], shape (nodes, 3), scene's order."""
        shape = (self.system.count, 3)
        new = [np.asarray(a, np.float64) for a in (positions, velocities)]
        for name, values in zip(("positions", "velocities"), new, strict=True):
            if values.shape != shape:
                raise FieldError(name, f"has shape {values.shape}, but the scene's is {shape}")
        u = self._inside(new[0]) - self.system.world(np.zeros(shape))
        runtime.write(self.system.u, u.astype(self.system.real))
        runtime.write(self.system.v, self._inside(new[1]).astype(self.system.real))
        self.limit.moved()
        if self.guard is not None:
            self.guard.forget()
        if self.ledger:  # a new state begins a new account
            self._ledger = Ledger(self.system, self._energies, self.scene.gravity)

    def forces(self, body: Body | None = None) -> Floats:
        """Elastic, viscous and spring forces [N] in the present state, shape (nodes, 3)."""
        return self._outside(self._forces.internal(), body)

    def reactions(self, body: Body | None = None) -> Floats:
        """Forces of pins on their nodes [N], 0 where nothing is held, shape (nodes, 3)."""
        external = external_forces(self.parts, self.time, self.system.world())
        force = reactions(self.system, self._forces.internal(), external, self.scene.gravity)
        return self._outside(force, body)

    def energy(self) -> dict[str, float | None]:
        """Energies [J] in the present state; None for what is not measured.

        "kinetic", "elastic", "gravity" (zero with every node at rest), "dissipated" (by viscosity,
        damping and contact), "external_work" (of loads and moved pins) and "error" (the imbalance
        of this ledger).
        """
        if self._ledger is not None:
            return self._ledger.entries()
        table = self._energies.table(self.scene.gravity)
        if self.half_step_lag:
            table["kinetic"] = 0.5 * float(self.masses() @ (self.velocities() ** 2).sum(axis=1))
        return {**table, "dissipated": None, "external_work": None, "error": None}

    @property
    def account(self) -> Ledger | None:
        """The ledger's book, where one is kept."""
        return self._ledger

    @property
    def ledger(self) -> bool:
        """Whether dissipated energy and external work are kept account of, from when it is set."""
        return self._ledger is not None

    @ledger.setter
    def ledger(self, on: bool) -> None:
        if on != self.ledger:
            self.system.make_ledger(on)
            gravity = self.scene.gravity
            self._ledger = Ledger(self.system, self._energies, gravity) if on else None

    def equilibrium(self, *, external: Any = None) -> Equilibrium:
        """The static equilibrium under gravity, loads and pins of t = duration: see `statics`."""
        return equilibrium(self, external=external)

    def modes(self, n: int = 6, *, about: Any = "rest", mass: Mass | None = None) -> Modes:
        """The n lowest natural frequencies and shapes: see `natural_modes`."""
        return natural_modes(self, n, about=about, mass=mass)

    @cached_property
    def measures(self) -> Measures:
        """Strain, stress and momentum in the present state."""
        return Measures(self)

    @cached_property
    def _energies(self) -> Energies:
        return Energies(self.system, self._velocities)

    @cached_property
    def _forces(self) -> Forces:
        return Forces(self.system)

    def _outside(self, values: Floats, body: Body | None) -> Floats:
        """Inside order to the mesh's own."""
        out = np.empty_like(values)
        for part in self.parts:
            out[part.nodes][part.order] = values[part.nodes]
        return out if body is None else out[self.part(body).nodes]

    def _inside(self, values: Floats) -> Floats:
        out = np.empty_like(values)
        for part in self.parts:
            out[part.nodes] = values[part.nodes][part.order]
        return out

    def part(self, body: Body) -> Part:
        """A body's share of the arrays; raises SceneError for a body of another scene."""
        for part, own in zip(self.parts, self.scene.bodies, strict=True):
            if body is own or body is part.body:  # the latter has its damping ratio turned
                return part
        raise FieldError("body", "is not in this simulation's scene", getattr(body, "name", body))

    def _set_start(self) -> None:
        """Initial velocities: v + ω × (x − centre of mass)."""
        v = np.zeros((self.system.count, 3))
        for part in self.parts:
            x = self.system.rest_host[part.nodes]
            middle = part.mass @ x / part.mass.sum()
            v[part.nodes] = part.body.velocity + np.cross(part.body.spin, x - middle)
        runtime.write(self.system.v, v.astype(self.system.real))

    # -- stepping ------------------------------------------------------------------------------

    def _make_stepper(self, threads: int | None) -> None:
        begun = time.perf_counter()
        scene, system = self.scene, self.system
        self._kind = runtime.array(obstacle_kinds(scene.obstacles))
        self._shape = runtime.array(self._obstacle_shapes().astype(system.real))
        self.loading = Loading(system)
        self._threads = threads
        self.stepper = self._bind_stepper()
        self.holder = Holder(system)
        self.holder.begin(0.0, 0.0)
        self.limit.follow()
        self.stepper.advance(0, 0.0, (0.0, 0.0, 0.0))
        self.compile_seconds += time.perf_counter() - begun

    def _flags(self) -> Flags:
        return Flags(
            INTEGRATORS[self.scene.integrator],
            bool(self.scene.obstacles),
            self.loading.loads,
            self.loading.pressure,
            self.system.viscous(),
            self.ledger,
        )

    def _bind_stepper(self) -> Stepper:
        obstacles = (self._kind, self._shape)
        return Stepper(self.system, self._flags(), threads=self._threads, obstacles=obstacles)

    def _obstacle_shapes(self) -> Floats:
        origins = [part.center + part.shift for part in self.parts]
        return obstacle_shapes(self.scene.obstacles, origins)

    def _recenter(self) -> None:
        """Move a body's origin after it where it has travelled: u stays small, so exact in f32."""
        moved = False
        u = runtime.read(self.system.u)
        for part in self.parts:
            here = u[part.nodes]
            if np.abs(here[0]).max() < part.size:  # one node tells cheaply
                continue
            way = here.mean(axis=0, dtype=np.float64).astype(u.dtype)
            if np.abs(way).max() < part.size:
                continue
            here -= way
            part.shift = part.shift + way.astype(np.float64)
            moved = True
        if moved:
            runtime.write(self.system.u, u)
            self.place_obstacles()

    def place_obstacles(self) -> None:
        """Tell the kernels where obstacles are, seen from the bodies' origins."""
        if self.scene.obstacles:
            runtime.write(self._shape, self._obstacle_shapes().astype(self.system.real))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a checkpoint, whole or not at all."""
        resume.save(self, path)

    @staticmethod
    def load(path: str | os.PathLike[str], *, arch: str = "cpu") -> Simulation:
        """A simulation from a checkpoint; it goes on with the very bits of the saved one."""
        return resume.load(path, arch=arch)

    def _refresh(self) -> None:
        """Take over what the caller changed since the last frame."""
        models = [body.model for body in self.scene.bodies]
        changed = any(a is not b for a, b in zip(models, self._models, strict=True))
        gravity = tuple(self.scene.gravity)
        if self.guard is not None and (changed or gravity != self._gravity):
            self.guard.forget()  # energies are others than before
        self._gravity = gravity
        if changed:
            for part, body in zip(self.parts, self.scene.bodies, strict=True):
                part.body = damped_body(body)
            self.system.reread_models()
            self._models = models
            table = self.system.material_table().astype(self.system.real)
            runtime.write(self.system.material, table)
            if self.system.tensors:
                self.system.write_tensors()
            self.limit.refresh()
            if self._ledger is None:
                self._energies.reread()
        if self._ledger is not None:
            self._ledger.reread(self.scene.gravity)
        if self.loading.refresh() or self._flags() != self.stepper.flags:
            self.stepper = self._bind_stepper()

    def stable_step(self) -> float:
        """A step [s] that is certainly stable in the present state."""
        return self.limit.bound()

    def substeps_of(self, frame_time: float) -> tuple[int, float]:
        """Number and size [s] of the substeps of the next frame."""
        step = self.scene.step
        if step == "auto":
            step = self.limit.chosen(self.substeps)
        elif self.certify and self.scene.integrator != "explicit-euler":
            self._refuse_long(float(step))
        if not frame_time <= MOST_SUBSTEPS * float(step):
            problem = (
                f"makes frames of {frame_time:.3g} s, which need more than {MOST_SUBSTEPS:.0e} "
                f"substeps of {float(step):.3g} s; give a higher one, or a softer or coarser body"
            )
            raise FieldError("frame_rate", problem, self.scene.frame_rate)
        count = max(1, math.ceil(frame_time / float(step) - 1e-9))
        return count, frame_time / count

    def _refuse_long(self, step: float) -> None:
        limit = self.limit.sharp() if self.frame == 0 else np.inf
        if step > limit:
            problem = (
                f"s is above the stable limit {limit:.6g} s, so the bodies would explode; "
                'give a smaller step, or step = "auto"'
            )
            raise FieldError("step", problem, step)

    def step(self) -> Frame:
        """Advance one frame.

        Raises:
            Diverged: when no step carries the frame; the state is then the last good one.
        """
        self._refresh()
        end = (self.frame + 1) / self.scene.frame_rate
        count, h = self.substeps_of(1.0 / self.scene.frame_rate)
        look = max(LOOK, LOOK_WORK // max(1, self.system.tets))
        while count > look:
            self._stretch(self.time + look * h, look, h)
            count -= look
            if self.scene.step == "auto" and self.limit.chosen(self.substeps) < h:
                count, h = self.substeps_of(end - self.time)
        self._stretch(end, count, h)
        self.frame += 1
        self.watch.look(self.time)
        self._recenter()
        return self.here()

    def _stretch(self, end: float, count: int, step: float) -> None:
        """Advance to `end` [s] in `count` substeps of `step` [s], under the guard's eyes."""
        self.holder.begin(self.time, end)
        self.loading.begin(self.time, end)
        if self.scene.start == "half-step" and not self.half_step_lag:
            back = runtime.read(self.system.v) - 0.5 * step * self._acceleration()
            runtime.write(self.system.v, back.astype(self.system.real))
            self.half_step_lag = step
        if self.steps:
            self.change_step(self.steps[-1], step)
        count, step = self._advance(count, step)
        self.holder.finish(end)
        if self._ledger is not None:
            self._ledger.collect()
        self.substeps += count
        self.steps.append(step)
        self.time = end

    def _advance(self, count: int, step: float) -> tuple[int, float]:
        """Make the substeps of one stretch; returns the number and size [s] that carried it."""
        begun = time.perf_counter()
        if self.guard is None:
            self.substep(count, step)
        elif self.scene.integrator == "explicit-euler":
            self.guard.watch(count, step)
        else:
            count, step = self.guard.carry(count, step)
        self.wall_seconds += time.perf_counter() - begun
        return count, step

    def change_step(self, before: float, after: float) -> None:
        """Bring velocities from one step to another [s].

        Symplectic Euler is the leapfrog method whose velocity lives half a step before its
        position: v(t − h/2).  Without the shift each change would kick the energy by its difference
        of (h/2) v·f, and a step that follows the swings of a body would pump it up.
        """
        plain = self.scene.integrator == "symplectic-euler" and not self.system.consistent
        if plain and abs(after - before) > 1e-9 * before:
            v = runtime.read(self.system.v) + 0.5 * (before - after) * self._acceleration()
            runtime.write(self.system.v, v.astype(self.system.real))

    def substep(self, count: int, step: float) -> None:
        """`count` bare substeps of `step` [s], which nothing watches."""
        self.stepper.advance(count, step, self.scene.gravity)
        self.limit.moved()

    def is_driven(self) -> bool:
        """Whether loads or moved pins do work on the bodies."""
        return self.holder.is_moving or any(part.body.loads for part in self.parts)

    def _acceleration(self) -> Floats:
        """Acceleration of all nodes [m/s²] in the present state, inside order; 0 on held axes."""
        system = self.system
        force = self._forces.internal()
        if self.loading.pressure:  # it follows the surface, so it is that of this very state
            force += external_forces(self.parts, self.time, system.world())
        else:
            force += runtime.read(system.load)
        a = force / system.mass[:, None] + np.asarray(self.scene.gravity)
        drag = np.array([part.body.model.point_damping for part in self.parts])
        a -= drag[runtime.read(system.body)][:, None] * runtime.read(system.v)
        held = runtime.read(system.held)
        a[(held[:, None] & np.array([1, 2, 4])) != 0] = 0.0
        return a

    def mass_solve(self) -> dict[str, float] | None:
        """Iterations of the last solve with the consistent mass, and its largest |f − M a| over the
        largest |f|; None where all masses are lumped.
        """
        system = self.system
        if not system.consistent:
            return None
        force = self._forces.internal() + system.mass[:, None] * np.asarray(self.scene.gravity)
        residual = residual_share(
            runtime.read(system.residual), runtime.read(system.diagonal), force
        )
        return {"iterations": ITERATIONS[self.precision], "residual": residual}

    def masses(self) -> Floats:
        """Lumped masses [kg], shape (nodes,), in the scene's order."""
        return self._outside(self.system.mass, None)

    def here(self) -> Frame:
        """The present state as a Frame."""
        return Frame(self, self.frame, self.time)

    def frames(self, seconds: float | None = None) -> Iterator[Frame]:
        """Frames from now on, the present one first: `seconds` [s] of them, or the scene's."""
        duration = self.scene.duration if seconds is None else seconds
        yield self.here()
        for _ in range(round(duration * self.scene.frame_rate)):
            yield self.step()

    def run(self, seconds: float | None = None, *, observers: Iterable[Any] = ()) -> None:
        """Run with observers: objects with on_start(sim), on_frame(frame), on_end(sim), each
        optional; a plain callable is on_frame.
        """
        watching = list(observers)
        frame_hooks: list[Callable[[Frame], Any]] = [
            getattr(o, "on_frame", o if callable(o) else _nothing) for o in watching
        ]
        for observer in watching:
            getattr(observer, "on_start", _nothing)(self)
        try:
            for frame in self.frames(seconds):
                for hook in frame_hooks:
                    hook(frame)
        finally:
            for observer in watching:
                getattr(observer, "on_end", _nothing)(self)


def _check_half_step(scene: Scene) -> None:
    if scene.start != "half-step":
        return
    if scene.integrator != "symplectic-euler":
        problem = f"shifts the velocities of symplectic-euler, not of {scene.integrator}"
        raise FieldError("start", f'{problem}; use start = "plain"', scene.start)
    for i, body in enumerate(scene.bodies):
        if getattr(body.model, "mass", "lumped") != "lumped":
            problem = f"needs lumped masses, and body[{i}] has consistent ones"
            raise FieldError("start", problem, scene.start)


def _nothing(_: Any) -> None:
    return None
