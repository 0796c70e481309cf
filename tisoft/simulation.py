"""A running scene: frames, state in and out, energies, the stable step."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from tisoft import checkpoint, resume, runtime
from tisoft.body import Body
from tisoft.checks import FieldError
from tisoft.energies import Energies
from tisoft.equilibrium.modes import Mass, Modes, natural_modes
from tisoft.equilibrium.reactions import reactions
from tisoft.equilibrium.statics import Equilibrium, equilibrium
from tisoft.measures.measures import Measures
from tisoft.model.mass import ITERATIONS
from tisoft.motion import Motion
from tisoft.probed import places_of
from tisoft.running import run
from tisoft.scene import Scene
from tisoft.step.account import RUNNING
from tisoft.step.consistent_mass import residual_share
from tisoft.step.loading import external_forces
from tisoft.step.observe import energy_table

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Frame:
    """What an observer sees: the `simulation` at the end of its frame number `index`, from 0."""

    simulation: Simulation
    index: int
    time: float
    """[s]"""
    record: Floats | None = None
    """Of a frame made together with later ones: shape (1 + probes, columns) [SI]."""

    def positions(self, body: Body | None = None) -> Floats:
        """World positions [m], shape (nodes, 3), in the mesh's node order."""
        return self.simulation.positions(body)

    def velocities(self, body: Body | None = None) -> Floats:
        """Velocities [m/s], shape (nodes, 3), in the mesh's node order."""
        return self.simulation.velocities(body)

    def probes(self) -> Floats:
        """World positions of the scene's probes [m], shape (probes, 3)."""
        return self.simulation.probe_positions(self.record)

    def energy(self) -> Energies:
        """Energies [J], as `Simulation.energy`."""
        return self.simulation.energy_of(self.record)


class Simulation(Motion):
    """A scene that runs.

    Args:
        scene: read again between frames: gravity, materials, pins and loads may change.
        arch: "cpu", "cuda", "metal", "vulkan" or "auto".
        precision: "f32" or "f64"; left out, the scene's.
        certify: False takes any step and checks nothing: to show how things fail.
        threads: CPU threads; left out, chosen by the scene's size and the machine's load.
        ledger: keep account of dissipated energy and external work.
        interactive: nothing that a viewer may ask for compiles, or certifies for long, on the way.

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
        interactive: bool = False,
    ) -> None:
        begun = time.perf_counter()
        scene.validate()
        _check_half_step(scene)
        self.arch = runtime.start(arch)
        super().__init__(
            scene,
            precision=precision or scene.precision,
            certify=certify,
            threads=threads,
            ledger=ledger,
            interactive=interactive,
        )
        if interactive:
            self.rehearse()
        self.start_seconds = time.perf_counter() - begun - self.compile_seconds
        """Seconds of making it, without compiling: numbering, uploading, bounds."""

    @property
    def warnings(self) -> list[str]:
        """What the run has told so far that a user should know, a sentence each."""
        self.watch.look(self.time)
        return self.watch.warnings()

    # -- state ---------------------------------------------------------------------------------

    def positions(self, body: Body | None = None) -> Floats:
        """World positions [m], shape (nodes, 3): one body's, or all in the scene's order."""
        return self._outside(self.system.world(), body)

    def velocities(self, body: Body | None = None) -> Floats:
        """Velocities [m/s], shape (nodes, 3): one body's, or all in the scene's order."""
        return self._outside(self.whole_velocities(), body)

    def set_state(self, positions: Any, velocities: Any) -> None:
        """Set all world positions [m] and velocities [m/s], shape (nodes, 3), scene's order.

        Raises SceneError for another shape.
        """
        shape = (self.system.count, 3)
        new = [np.asarray(a, np.float64) for a in (positions, velocities)]
        for name, values in zip(("positions", "velocities"), new, strict=True):
            if values.shape != shape:
                raise FieldError(name, f"has shape {values.shape}, but the scene's is {shape}")
        u = self._inside(new[0]) - self.system.world(np.zeros(shape))
        self.system.set_motion(u, self._inside(new[1]))
        self.limit.moved()
        self.look_for_contact()
        if self.guard is not None:
            self.guard.forget()
        if self.ledger:  # a new state begins a new account
            self.open_account()

    def forces(self, body: Body | None = None) -> Floats:
        """Elastic, viscous and spring forces [N] in the present state, shape (nodes, 3)."""
        return self._outside(self.stepper.forces(), body)

    def reactions(self, body: Body | None = None) -> Floats:
        """Forces of pins on their nodes [N], 0 where nothing is held, shape (nodes, 3)."""
        external = external_forces(self.parts, self.time, self.system.world())
        internal, held = self.stepper.forces(), self.holder.held
        force = reactions(self.system, held, internal, external, self.scene.gravity)
        return self._outside(force, body)

    def energy(self) -> Energies:
        """Energies [J] in the present state; None for what is not measured (see `ledger`)."""
        return self.energy_of(None)

    def energy_of(self, record: Floats | None) -> Energies:
        """The same of the frame with a record."""
        if record is None:
            table = self.energies()
        else:
            table = energy_table(self.system, record[0], self.scene.gravity)
        entries: Any = {**table, "dissipated": None, "external_work": None, "error": None}
        if self.account is not None:
            entries = self.account.entries_at(table, None if record is None else record[0, RUNNING])
        return cast(Energies, entries)

    def probe_positions(self, record: Floats | None = None) -> Floats:
        """World positions of the scene's probes [m], shape (probes, 3), now or in a record."""
        u = self.system.probe_motion()[0] if record is None else record[1:, :3]
        return places_of(self.probed, self.system.probe_origins() + u)

    @property
    def ledger(self) -> bool:
        """Whether dissipated energy and external work are kept account of, from when it is set."""
        return self.account is not None

    @ledger.setter
    def ledger(self, on: bool) -> None:
        if on != self.ledger:
            self.account = None
            if on:
                self.open_account()

    def equilibrium(self, *, external: Any = None) -> Equilibrium:
        """The static equilibrium under gravity, loads and pins of t = duration: see `statics`."""
        return equilibrium(self, external=external)

    def modes(self, n: int = 6, *, about: Any = "rest", mass: Mass | None = None) -> Modes:
        """The n lowest natural frequencies and shapes: see `natural_modes`."""
        return natural_modes(self, n, about=about, mass=mass)

    def stable_step(self) -> float:
        """A step [s] that is certainly stable in the present state."""
        return self.limit.present()

    @cached_property
    def measures(self) -> Measures:
        """Strain, stress and momentum in the present state."""
        return Measures(self)

    def masses(self) -> Floats:
        """Lumped masses [kg], shape (nodes,), in the scene's order."""
        return self._outside(self.system.mass, None)

    def mass_solve(self) -> dict[str, float] | None:
        """Iterations of the last solve with the consistent mass, and its largest |f − M a| over the
        largest |f|; None where all masses are lumped.
        """
        if not self.system.consistent:
            return None
        force = self.stepper.forces()
        force += self.system.mass[:, None] * np.asarray(self.scene.gravity)
        residual = residual_share(self.system.mass_residual(), force)
        return {"iterations": ITERATIONS[self.precision], "residual": residual}

    def _outside(self, values: Floats, body: Body | None) -> Floats:
        """Internal order to the mesh's own."""
        out = np.empty_like(values)
        for part in self.parts:
            out[part.nodes][part.order] = values[part.nodes]
        return out if body is None else out[self.part(body).nodes]

    def _inside(self, values: Floats) -> Floats:
        out = np.empty_like(values)
        for part in self.parts:
            out[part.nodes] = values[part.nodes][part.order]
        return out

    # -- frames --------------------------------------------------------------------------------

    def step(self) -> Frame:
        """Advance one frame.

        Raises:
            Diverged: when no step carries the frame; the state is then the last good one.
        """
        self.make_frame()
        return self.here()

    def here(self) -> Frame:
        """The present state as a Frame."""
        return Frame(self, self.frame, self.time)

    def frames(self, seconds: float | None = None) -> Iterator[Frame]:
        """Frames from now on, the present one first: `seconds` [s] of them, or the scene's."""
        yield self.here()
        for _ in range(self._count(seconds)):
            yield self.step()

    def _count(self, seconds: float | None) -> int:
        duration = self.scene.duration if seconds is None else seconds
        return round(duration * self.scene.frame_rate)

    def run(self, seconds: float | None = None, *, observers: Iterable[Any] = ()) -> None:
        """Run with observers: objects with on_start(sim), on_frame(frame), on_end(sim), each
        optional; a plain callable is on_frame (see `running`).
        """
        run(self, self._count(seconds), list(observers))

    def told(self, index: int, record: Floats) -> Frame:
        """A frame of those just made together: the last is the present one."""
        time = index / self.scene.frame_rate
        return Frame(self, index, time, record if index < self.frame else None)

    # -- checkpoints ---------------------------------------------------------------------------

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a checkpoint, whole or not at all."""
        resume.save(self, path)

    @staticmethod
    def load(path: str | os.PathLike[str], *, arch: str = "cpu") -> Simulation:
        """A simulation from a checkpoint; it goes on with the very bits of the saved one."""
        content, arrays = resume.read(path)
        with checkpoint.damage_told(path):
            simulation = Simulation(
                content["scene"],
                arch=arch,
                precision=content["precision"],
                certify=content["certify"],
            )
            resume.put(simulation, content, arrays)
        return simulation


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
